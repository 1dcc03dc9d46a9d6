// SPDX-License-Identifier: Apache-2.0
#include "loading.h"

namespace virga {
namespace {

using namespace loading;

NodePtr childAt(const NodePtr& node, size_t i) { return std::get<NodePtr>(node->properties.at(i).value); }

std::string textAt(const SourcePosition& position) {
  return position.file->text.substr(position.offset, position.length);
}

TEST(MitsubaXml, NodesKeepOrderNamesAndPlaces) {
  const SceneDescription d = parse(scene(R"(
<!-- a comment -->
<medium type="homogeneous" id="fog"><float name="scale" value="2.5"/></medium>
<shape type="cube"><medium type="homogeneous" name="interior"/></shape>)"));
  ASSERT_EQ(d.root->properties.size(), 2u);
  EXPECT_EQ(d.root->tag, "scene");
  const NodePtr fog = childAt(d.root, 0), cube = childAt(d.root, 1);
  EXPECT_EQ(fog->tag + " " + fog->type + " " + fog->id, "medium homogeneous fog");
  EXPECT_EQ(fog->position.line(), 4);
  EXPECT_EQ(fog->position.column(), 2);
  EXPECT_EQ(textAt(fog->typePosition), "homogeneous");
  EXPECT_EQ(textAt(fog->properties[0].position), "scale");
  EXPECT_EQ(textAt(fog->properties[0].valuePosition), "2.5");
  EXPECT_EQ(cube->properties[0].name, "interior");
  EXPECT_EQ(d.root->properties[0].name, "");
}

TEST(MitsubaXml, GeneratedIdsCountEachTagInOrder) {
  const SceneDescription d =
      parse(scene("<shape type='cube'/><shape type='disk' id='a'/><shape type='cube'/><bsdf type='null'/><shape "
                  "type='x' id='_shape_1'/>"));
  EXPECT_EQ(d.root->id, "_scene_1");
  EXPECT_EQ(childAt(d.root, 0)->id, "_shape_1_") << "a given id comes first";
  EXPECT_EQ(childAt(d.root, 1)->id, "a");
  EXPECT_EQ(childAt(d.root, 2)->id, "_shape_3");
  EXPECT_EQ(childAt(d.root, 3)->id, "_bsdf_1");
}

TEST(MitsubaXml, ReferencesShareTheNode) {
  const SceneDescription d = parse(scene(R"(
<shape type="cube"><ref id="fog" name="interior"/></shape>
<medium type="homogeneous" id="fog"/>
<alias id="fog" as="mist"/>
<shape type="sphere"><ref id="mist" name="exterior"/></shape>)"));
  const NodePtr fog = childAt(d.root, 1);
  EXPECT_EQ(childAt(childAt(d.root, 0), 0), fog) << "before its definition";
  EXPECT_EQ(childAt(childAt(d.root, 2), 0), fog) << "through an alias";
  EXPECT_EQ(childAt(d.root, 0)->properties[0].name, "interior");
  EXPECT_EQ(findNode(d, "fog"), fog);
  EXPECT_EQ(findNode(d, "mist"), nullptr);
}

TEST(MitsubaXml, ReferenceErrors) {
  expectError(scene("<bsdf type='diffuse' id='white'/><shape type='cube'><ref id='[[whit]]'/></shape>"),
              "no object has the id \"whit\"");
  expectError(scene("<bsdf type='diffuse' id='white'/><shape type='cube'><ref id='[[whit]]'/></shape>"),
              "did you mean \"white\"?");
  expectError(scene("<shape type='cube'><ref id='[[white]]'/></shape>"), "no object of this scene has an id");
  expectError(scene("<shape type='cube' id='a'/>\n<shape type='cube' id='[[a]]'/>"), "the id \"a\" is taken");
  expectError(scene("<shape type='cube' id='a'/>\n<shape type='cube' id='[[a]]'/>"), "first given at scene.xml:2:24");
  expectError(scene("<shape type='cube' id='[[]]'/>"), "an id must not be empty");
  expectError(scene("<alias id='[[nobody]]' as='b'/>"), "no object has the id \"nobody\"");
  expectError(scene("<bsdf type='x' id='a'/><alias id='a' as='[[a]]'/>"), "the id \"a\" is taken");
  expectError(scene("<alias id='b' as='a'/><alias id='[[a]]' as='b'/>"), "go round in a circle");
}

TEST(MitsubaXml, NothingContainsItself) {
  expectError(scene("<bsdf type='twosided' id='a'><ref id='[[a]]'/></bsdf>"), "the object \"a\" contains itself");
  expectError(scene("<bsdf type='x' id='a'><ref id='b'/></bsdf><bsdf type='x' id='b'><ref id='[[a]]'/></bsdf>"),
              "it begins at scene.xml:2:2");
}

TEST(MitsubaXml, VariablesTakeTheLongestName) {
  const std::string text = scene(R"(<default name="sp" value="1"/><default name="spp" value="64"/>
<default name="double" value="2$spp"/><string name="x" value="a$spp.$sp-$double&#36;spp"/>)");
  EXPECT_EQ(valueOf<std::string>(*parse(text).root, "x"), "a64.1-264$spp");
}

TEST(MitsubaXml, TheCommandLineWinsThenTheFirstDefault) {
  const std::string text = scene(R"(<default name="n" value="1"/><default name="n" value="2"/>
<integer name="x" value="$n"/>)");
  EXPECT_EQ(valueOf<int64_t>(*parse(text).root, "x"), 1);
  EXPECT_EQ(valueOf<int64_t>(*parse(text, {.defines = {{"n", "5"}}}).root, "x"), 5);
  EXPECT_EQ(valueOf<int64_t>(*parse(scene("<integer name='x' value='$n'/>"), {.defines = {{"n", "6"}}}).root, "x"), 6);
}

TEST(MitsubaXml, VariableErrors) {
  const std::string text = scene("<default name='spp' value='many'/>\n<integer name='x' value='[[$spp]]'/>");
  expectError(text, "\"many\" is not an integer");
  expectError(text, "note: $spp is \"many\", the default of scene.xml:2");
  expectError(text, "note: $spp is \"lots\", given on the command line", {.defines = {{"spp", "lots"}}});
  expectError(scene("<default name='spp' value='1'/><integer name='x' value='1[[$ssp]]'/>"),
              "unknown variable \"$ssp\"");
  expectError(scene("<default name='spp' value='1'/><integer name='x' value='[[$ssp]]'/>"), "did you mean \"spp\"?");
  expectError(scene("<integer name='x' value='[[$spp]]'/><default name='spp' value='1'/>"),
              "no variable is defined up to here");
  expectError(scene("<string name='x' value='100 [[$]]'/>"), "a plain dollar is &#36;");
}

TEST(MitsubaXml, DefinesThatChangeNothingAreErrors) {
  const std::string text = scene(
      "<default name='spp' value='1'/><default name='res' value='1'/>"
      "<integer name='x' value='$spp'/>");
  const auto error = errorOf([&] { parse(text, {.defines = {{"ssp", "4"}}}); });
  ASSERT_TRUE(error);
  EXPECT_EQ(error->message(), "-D ssp=4 changes nothing: the scene never uses $ssp");
  EXPECT_EQ(error->details().hint, "did you mean \"spp\"?");
  EXPECT_EQ(error->details().notes, std::vector<std::string>{"the scene's variables: spp, res"});
  EXPECT_TRUE(errorOf([&] { parse(text, {.defines = {{"res", "4"}}}); })) << "declared but never used";
  EXPECT_FALSE(errorOf([&] { parse(text, {.defines = {{"spp", "4"}}}); }));
  expectError("<[[scene]] version='3.0.0'><default name='frame' value='1'/></scene>",
              "nothing in this scene uses $frame", {.frame = "0001"});
}

TEST(MitsubaXml, OldScenesAreModernised) {
  const SceneDescription d = parse(R"(<scene version="0.6.0"><default name="maxDepth" value="3"/>
<sensor type="perspective"><string name="fovAxis" value="x"/><integer name="maxDepth" value="$maxDepth"/>
<transform name="toWorld"><lookAt origin="0,0,0" target="0,0,1" up="0,1,0"/></transform></sensor>
<bsdf type="diffuse"><rgb name="diffuseReflectance" value="1"/></bsdf>
<bsdf type="plastic"><rgb name="diffuseReflectance" value="1"/><float name="intIOR" value="1.5"/>
<integer name="kNN" value="1"/></bsdf></scene>)");
  const NodePtr sensor = childAt(d.root, 0), plastic = childAt(d.root, 2);
  EXPECT_EQ(sensor->properties[0].name, "fov_axis");
  EXPECT_EQ(valueOf<int64_t>(*sensor, "max_depth"), 3);
  EXPECT_EQ(valueOf<Matrix4>(*sensor, "to_world"), Matrix4());
  EXPECT_EQ(childAt(d.root, 1)->properties[0].name, "reflectance");
  EXPECT_EQ(plastic->properties[0].name, "diffuse_reflectance");
  EXPECT_EQ(plastic->properties[1].name, "int_ior");
  EXPECT_EQ(plastic->properties[2].name, "k_nn");
}

TEST(MitsubaXml, NewScenesAreNot) {
  EXPECT_EQ(valueOf<double>(*parse("<scene version='2.1.0'><float name='toWorld' value='1'/></scene>").root, "toWorld"),
            1);
  expectError(scene("<transform name='x'><[[lookAt]] origin='0,0,0' target='0,0,1'/></transform>"),
              "did you mean \"lookat\"?");
}

TEST(MitsubaXml, Versions) {
  expectError("<[[scene]]></scene>", "<scene> needs the attribute \"version\"");
  expectError("<scene version='[[three]]'/>", "\"three\" is not a version");
  expectError("<scene version='[[3.0.0.0]]'/>", "is not a version");
  expectError("<scene version='[[3.]]'/>", "is not a version");
  expectError("<scene version='[[4.0.0]]'/>", "scenes of version 4.0.0 are not known");
  EXPECT_FALSE(errorOf([] { parse("<scene version='3'/>"); }));
}

TEST(MitsubaXml, ElementErrors) {
  expectError("<[[shape]] type='cube'/>", "the root element is <shape>");
  expectError(scene("<[[shap]] type='cube'/>"), "unknown element <shap>");
  expectError(scene("<[[shap]] type='cube'/>"), "did you mean \"shape\"?");
  expectError(scene("<[[shap]] type='cube'/>"), "available: integrator, sensor,");
  expectError(scene("<[[shape]]/>"), "<shape> needs the attribute \"type\"");
  expectError(scene("<shape type='[[]]'/>"), "the type of a shape must not be empty");
  expectError(scene("<shape type='cube' [[tpye]]='x'/>"), "did you mean \"type\"?");
  expectError(scene("<shape type='cube' [[type]]='disk'/>"), "attribute \"type\" is given twice");
  expectError(scene("<[[float]] value='1'/>"), "<float> needs the attribute \"name\"");
  expectError(scene("<float name='[[]]' value='1'/>"), "a name must not be empty");
  expectError(scene("<[[float]] name='x'/>"), "<float> needs the attribute \"value\"");
  expectError(scene("<float name='x' value='1'/>\n<integer name='[[x]]' value='1'/>"), "\"x\" is given twice");
  expectError(scene("<float name='x' value='1'/>\n<integer name='[[x]]' value='1'/>"), "first given at scene.xml:2:14");
  expectError(scene("<float name='x' value='1'><[[shape]] type='cube'/></float>"), "<float> holds a value");
  expectError(scene("<[[scene]] version='3.0.0'/>"), "a <scene> cannot stand inside");
  expectError(scene("<shape type='cube'><[[path]] value='.'/></shape>"), "<path> belongs directly into the scene");
  expectError(scene("<path value='[[no such folder]]'/>"), "there is no folder");
}

TEST(MitsubaXml, MalformedXml) {
  expectError("<scene version='3.0.0'>\n<shape type='cube'><bsdf type='>'/></[[scene]]>",
              "</scene> closes nothing: <shape> of line 2 is open");
  expectError("<scene version='3.0.0'><!-- <a> --><?b <c>?>\n<shape type='cube'> [[ ]]",
              "the file ends inside <shape> of line 2");
  expectError("<scene version='3.0.0'></[[]]>", "</> closes nothing: <scene> of line 1 is open");
  expectError("<scene version='3.0.0'/></[[scene]]>", "</scene> closes nothing");
  expectError("<scene version='3.0.0'><!-- comment </scene[[>]]", "a comment is not closed");
  expectError(scene("<shape type='cube'/>[[hello]] <shape type='cube'/>"), "text between the elements");
  expectError("<scene version='3.0.0'/><[[scene]] version='3.0.0'/>", "a second root element");
  expectError("[[j]]ust words", "this is not XML");
  expectError("[[<]]!-- nothing -->", "there is no element in this file");
  for (const char* text : {"", " \n\t"})
    EXPECT_STREQ(errorOf([&] { parse(text); })->what(), "error: cannot read \"scene.xml\": the file is empty");
  EXPECT_STREQ(errorOf([&] { parse(std::string("<scene\0version", 14)); })->what(),
               "error: cannot read \"scene.xml\": this is a binary file, not XML");
}

TEST(MitsubaXml, TheFullMessage) {
  const auto error = errorOf([] { parse(scene("  <float name=\"g\" value=\"0.5f\"/>")); });
  ASSERT_TRUE(error);
  EXPECT_STREQ(error->what(),
               "scene.xml:2:26: error: \"0.5f\" is not a number\n"
               "    2 |   <float name=\"g\" value=\"0.5f\"/>\n"
               "      |                          ^~~~");
}

TEST(MitsubaXml, PlacesSurviveMarksEntitiesAndLineEnds) {
  const auto error = errorOf([] {
    parse(
        "\xEF\xBB\xBF<scene\r\n version = '3.0.0' >\r\n<string name='a' value='&amp;\n'/>"
        "<float name='x'\r\n\t value = '1e'/></scene>");
  });
  ASSERT_TRUE(error);
  EXPECT_EQ(error->details().position.line(), 5);
  EXPECT_EQ(error->details().position.column(), 12);
}

std::string nested(int depth) {
  std::string open, close;
  for (int i = 0; i < depth; ++i) open += "<bsdf type='x'>", close += "</bsdf>";
  return scene(open + close);
}

TEST(MitsubaXml, DeepNestingIsAnErrorNotACrash) {
  EXPECT_FALSE(errorOf([] { parse(nested(150)); }));
  for (int depth : {250, 100'000}) {
    const auto error = errorOf([&] { parse(nested(depth)); });
    ASSERT_TRUE(error);
    EXPECT_EQ(error->message(), "more than 200 elements inside each other");
  }
}

TEST(MitsubaXml, DeepChainsOfReferencesAreAnErrorNotACrash) {
  for (const bool backwards : {false, true}) {
    std::string body;
    const int n = 50'000;
    for (int k = 0; k < n; ++k) {
      const int i = backwards ? n - k : k;
      const std::string inner = i == 0 ? "" : "<ref id='b" + std::to_string(i - 1) + "'/>";
      body += "<bsdf type='x' id='b" + std::to_string(i) + "'>" + inner + "</bsdf>";
    }
    const auto error = errorOf([&] { parse(scene(backwards ? body + "<bsdf type='x' id='b0'/>" : body)); });
    ASSERT_TRUE(error);
    EXPECT_EQ(error->message(), "more than 200 objects inside each other");
  }
}

TEST(MitsubaXml, SharedDiamondsStayCheap) {
  std::string body = "<bsdf type='x' id='b0'/>";
  for (int i = 1; i < 150; ++i) {
    const std::string ref = "<ref id='b" + std::to_string(i - 1) + "'/>";
    body += "<bsdf type='x' id='b" + std::to_string(i) + "'>" + ref + ref + "</bsdf>";
  }
  const SceneDescription d = parse(scene(body));  // 2^149 paths lead to b0
  const SceneDescription changed = edited(d, "b0", "y", 1.0);
  EXPECT_FALSE(equal(d, changed));
  EXPECT_TRUE(equal(d, parse(toXml(d))));
}

TEST(MitsubaXml, Lenience) {
  std::vector<std::string> warnings;
  const LoadOptions lenient{.defines = {}, .lenient = true, .warnings = &warnings};
  const SceneDescription d = parse(scene("<mode type='final'><any/></mode><shape type='cube' colour='red'/>"), lenient);
  EXPECT_EQ(d.root->properties.size(), 1u);
  ASSERT_EQ(warnings.size(), 2u);
  EXPECT_TRUE(warnings[0].starts_with("scene.xml:2:2: warning: unknown element <mode>\n")) << warnings[0];
  EXPECT_NE(warnings[1].find("warning: <shape> has no attribute \"colour\""), std::string::npos) << warnings[1];
  expectError(scene("<float name='x' value='[[1x]]'/>"), "is not a number", lenient);
}

TEST(Files, MissingFoldersAndUnreadable) {
  const TemporaryFolder folder;
  const auto message = [](const std::filesystem::path& file) {
    const auto error = errorOf([&] { loadMitsubaXml(file); });
    return error ? error->message() : "loads";
  };
  const std::string here = folder.path().string();
  EXPECT_EQ(message(folder.path() / "none.xml"), "cannot read \"" + here + "/none.xml\": no such file");
  EXPECT_EQ(message(folder.path()), "cannot read \"" + here + "\": this is a folder, not a file");
  EXPECT_EQ(message("/dev/zero"), "cannot read \"/dev/zero\": this is not a regular file");
  if (geteuid() == 0) {
    std::cerr << "NOTE: running as root, so the unreadable file is not tested\n";
    return;
  }
  const auto closed = folder.write("closed.xml", scene(""));
  std::filesystem::permissions(closed, std::filesystem::perms::none);
  EXPECT_EQ(message(closed), "cannot read \"" + closed.string() + "\": Permission denied");
}

TEST(Includes, AreFoundBesideTheIncludingFileAndShareVariables) {
  const TemporaryFolder folder;
  folder.write("parts/inner.xml",
               "<bsdf version='0.6.0' type='diffuse' id='b'><float name='someValue' value='$n'/></bsdf>");
  folder.write("parts/outer.xml",
               "<scene version='3.0.0'><default name='n' value='4'/><include filename='inner.xml'/></scene>");
  const auto file =
      folder.write("scene.xml", scene("<include filename='parts/outer.xml'/><shape type='cube'><ref id='b'/></shape>"));
  const SceneDescription d = loadMitsubaXml(file);
  ASSERT_EQ(d.root->properties.size(), 2u);
  EXPECT_EQ(valueOf<double>(*childAt(d.root, 0), "some_value"), 4) << "the lone root has a version of its own";
  EXPECT_EQ(childAt(childAt(d.root, 1), 0), childAt(d.root, 0));
  EXPECT_EQ(childAt(d.root, 0)->position.file->name, (folder.path() / "parts/inner.xml").string());
  EXPECT_EQ(d.searchPaths, (std::vector<std::filesystem::path>{folder.path(), folder.path() / "parts"}));
}

TEST(Includes, ComeFromSearchPathsTheLatestFirst) {
  const TemporaryFolder folder;
  folder.write("a/part.xml", scene("<string name='x' value='a'/>"));
  folder.write("b/part.xml", scene("<string name='x' value='b'/>"));
  const auto file =
      folder.write("scene.xml", scene("<path value='a'/><path value='b'/><include filename='part.xml'/>"));
  const SceneDescription d = loadMitsubaXml(file);
  EXPECT_EQ(valueOf<std::string>(*d.root, "x"), "b");
  EXPECT_EQ(d.searchPaths,
            (std::vector<std::filesystem::path>{folder.path() / "b", folder.path() / "a", folder.path()}));
  EXPECT_EQ(parse(toXml(d)).searchPaths.front(), d.searchPaths.front());
}

TEST(Includes, TheSceneFolderIsAbsoluteHoweverItIsNamed) {
  const TemporaryFolder folder;
  folder.write("scene.xml", scene("<path value='./'/>"));
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(folder.path());
  for (const char* name : {"scene.xml", "./scene.xml"})
    EXPECT_EQ(loadMitsubaXml(name).searchPaths, std::vector<std::filesystem::path>{folder.path()}) << name;
  EXPECT_EQ(parseMitsubaXml(scene(""), "text", "").searchPaths, std::vector<std::filesystem::path>{folder.path()});
  std::filesystem::current_path(before);
}

TEST(Includes, Errors) {
  const TemporaryFolder folder;
  const auto message = [&](const std::string& body) {
    const auto error = errorOf([&] { loadMitsubaXml(folder.write("scene.xml", scene(body))); });
    return error ? std::string(error->what()) : "loads";
  };
  const auto expectIn = [&](const std::string& body, const std::string& part) {
    EXPECT_NE(message(body).find(part), std::string::npos) << message(body);
  };
  folder.write("a.xml", scene("<include filename='b.xml'/>"));
  folder.write("b.xml", scene("\n<include filename='./a.xml'/>"));
  folder.write("bad.xml", scene("<float name='x' value='?'/>"));
  folder.write("empty.xml", "");
  folder.write("twice.xml", scene("<bsdf type='x' id='b'/>"));
  expectIn("<include filename='a.xml'/>", "b.xml:3:20: error: the file \"./a.xml\" includes itself");
  expectIn("<include filename='a.xml'/>", "note: a.xml includes b.xml includes a.xml");
  expectIn("<include filename='scene.xml'/>", "scene.xml:2:20: error: the file \"scene.xml\" includes itself");
  expectIn("<include filename='none.xml'/>", "scene.xml:2:20: error: there is no file \"none.xml\"");
  expectIn("<include filename='none.xml'/>", "note: looked in " + folder.path().string());
  expectIn("<include filename='.'/>", "scene.xml:2:20: error: cannot read");
  expectIn("<include filename='bad.xml'/>", "bad.xml:2:24: error: \"?\" is not a number");
  expectIn("<include filename='empty.xml'/>", "empty.xml\": the file is empty");
  expectIn("<include filename='twice.xml'/><include filename='twice.xml'/>", "the id \"b\" is taken");
}

TEST(Includes, CannotMultiplyWithoutEnd) {
  const TemporaryFolder folder;
  for (int i = 0; i < 40; ++i) {
    const std::string next = "<include filename='" + std::to_string(i + 1) + ".xml'/>";
    folder.write(std::to_string(i) + ".xml", scene(next + next));  // 2^40 in all
  }
  folder.write("40.xml", scene(""));
  const auto error = errorOf([&] { loadMitsubaXml(folder.path() / "0.xml"); });
  ASSERT_TRUE(error);
  EXPECT_EQ(error->message(), "more than 1000 included files");
}

// Every prefix and many mutations of a scene must load or be refused: no crash, no hang, no foreign exception.
TEST(MitsubaXml, BrokenTextIsRefusedCleanly) {
  const std::string good = scene(R"(<default name="a" value="1"/><!-- c --><path value="."/>
<bsdf type="diffuse" id="w"><rgb name="reflectance" value="#ffffff"/></bsdf><alias id="w" as="v"/>
<shape type="cube"><ref id="v"/><transform name="to_world"><scale value="$a"/><lookat origin="0,0,0" target="0,0,1" up="0,1,0"/>
<matrix value="1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"/></transform><point name="p" x="1" y="2" z="3"/></shape>)");
  size_t refused = 0;
  const auto attempt = [&](const std::string& text) { refused += errorOf([&] { parse(text); }) ? 1 : 0; };
  for (size_t n = 0; n < good.size(); ++n) attempt(good.substr(0, n));
  EXPECT_GE(refused + 1, good.size());  // only the text without its last line end loads
  uint32_t state = 1;
  for (int i = 0; i < 20'000; ++i) {
    std::string text = good;
    for (int k = 0; k < 3; ++k) {
      state = state * 1664525u + 1013904223u;
      const size_t at = (state >> 8) % text.size();
      constexpr std::string_view kBytes = "<>\"'/=& $#;\\-!?[]0x\xff\n";
      state = state * 1664525u + 1013904223u;
      text[at] = kBytes[(state >> 8) % kBytes.size()];
    }
    attempt(text);
  }
}

}  // namespace
}  // namespace virga
