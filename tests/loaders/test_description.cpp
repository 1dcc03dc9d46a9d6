// SPDX-License-Identifier: Apache-2.0
#include <limits>

#include "loading.h"

namespace virga {
namespace {

using namespace loading;

const std::string kScene = scene(R"(
<medium type="heterogeneous" id="fog"><volume type="gridvolume" name="sigma_t" id="grid"><string name="filename" value="a.vol"/></volume></medium>
<shape type="cube" id="first"><ref id="fog" name="interior"/><bsdf type="null"/></shape>
<shape type="sphere" id="second"><point name="center" x="0.1" y="2" z="-3e-5"/><ref id="fog" name="interior"/></shape>
<emitter type="constant" id="sky"><rgb name="radiance" value="0.1, 0.2, 0.7"/></emitter>)");

NodePtr childNamed(const NodePtr& node, std::string_view name) { return valueOf<NodePtr>(*node, name); }

TEST(Description, FindNode) {
  const SceneDescription d = parse(kScene);
  EXPECT_EQ(findNode(d, "grid")->type, "gridvolume");
  EXPECT_EQ(findNode(d, d.root->id), d.root);
  EXPECT_EQ(findNode(d, "none"), nullptr);
}

TEST(Description, EditsCopyThePathAndShareTheRest) {
  const SceneDescription before = parse(kScene);
  const SceneDescription after = edited(before, "grid", "filename", std::string("b.vol"));
  EXPECT_EQ(valueOf<std::string>(*findNode(after, "grid"), "filename"), "b.vol");
  EXPECT_EQ(valueOf<std::string>(*findNode(before, "grid"), "filename"), "a.vol") << "the original is as it was";
  const NodePtr fog = findNode(after, "fog");
  EXPECT_NE(fog, findNode(before, "fog"));
  EXPECT_EQ(childNamed(findNode(after, "first"), "interior"), fog) << "still one medium";
  EXPECT_EQ(childNamed(findNode(after, "second"), "interior"), fog);
  EXPECT_EQ(findNode(after, "sky"), findNode(before, "sky")) << "not reached, so shared";
  EXPECT_EQ(std::get<NodePtr>(findNode(after, "first")->properties[1].value),
            std::get<NodePtr>(findNode(before, "first")->properties[1].value));
  EXPECT_EQ(after.searchPaths, before.searchPaths);
}

TEST(Description, EditsAddReplaceAndReachTheRoot) {
  const SceneDescription d = parse(kScene);
  EXPECT_EQ(valueOf<double>(*findNode(edited(d, "fog", "scale", 3.0), "fog"), "scale"), 3);
  EXPECT_EQ(valueOf<bool>(*edited(d, d.root->id, "flag", true).root, "flag"), true);
  const SceneDescription other = edited(d, "sky", "radiance", Rgb(2));
  EXPECT_EQ(findNode(other, "sky")->properties.size(), 1u);
  EXPECT_FALSE(findNode(other, "sky")->properties[0].valuePosition.known()) << "the file says something else";
  const SceneDescription same = edited(d, "sky", "radiance", Rgb(0.1f, 0.2f, 0.7f));
  EXPECT_TRUE(equal(d, same));
}

TEST(Description, EditingNobodyIsAnError) {
  const auto error = errorOf([] { edited(parse(kScene), "fogg", "scale", 1.0); });
  ASSERT_TRUE(error);
  EXPECT_STREQ(error->what(), "error: the scene has no object with the id \"fogg\"; did you mean \"fog\"?");
}

TEST(Description, EqualSeesEveryDifference) {
  const SceneDescription d = parse(kScene);
  EXPECT_TRUE(equal(d, parse(kScene)));
  const auto changed = [&](const std::string& from, const std::string& to) {
    std::string text = kScene;
    text.replace(text.find(from), from.size(), to);
    return parse(text);
  };
  EXPECT_FALSE(equal(d, changed("gridvolume", "vdb")));
  EXPECT_FALSE(equal(d, changed("id=\"grid\"", "id=\"grit\"")));
  EXPECT_FALSE(equal(d, changed("id=\"grid\"", "")));
  EXPECT_FALSE(equal(d, changed("0.7", "0.70001")));
  EXPECT_FALSE(equal(d, changed("name=\"radiance\"", "name=\"r\"")));
  EXPECT_FALSE(equal(d, changed("<bsdf type=\"null\"/>", "")));
  EXPECT_FALSE(equal(d, edited(d, "sky", "radiance", 1.0)));
  EXPECT_TRUE(equal(d, changed("\n", "\n\n"))) << "positions do not count";
}

TEST(Description, SharingIsStructure) {
  const std::string node = "<bsdf type='x'/>";
  const auto shared = std::make_shared<const Node>(Node{.tag = "bsdf", .type = "x", .id = "_bsdf_1"});
  const auto root = [](std::vector<Property> properties) {
    return SceneDescription{
        std::make_shared<const Node>(Node{.tag = "scene", .id = "_scene_1", .properties = std::move(properties)}), {}};
  };
  const SceneDescription once = root({{.name = "", .value = shared}, {.name = "", .value = shared}});
  const SceneDescription twice = parse(scene(node + node));
  EXPECT_FALSE(equal(once, twice));
  EXPECT_FALSE(equal(twice, once));
  const SceneDescription again = parse(toXml(once));
  EXPECT_TRUE(equal(once, again)) << toXml(once);
  EXPECT_EQ(std::get<NodePtr>(again.root->properties[0].value), std::get<NodePtr>(again.root->properties[1].value));
}

TEST(Description, XmlIsWrittenPlainly) {
  SceneDescription d = parse(scene(R"(<shape type="sphere" id="ball"><ref id="fog" name="interior"/></shape>
<medium type="homogeneous" id="fog"><float name="g" value="0.10"/></medium><bsdf type="null"/>)"));
  d.searchPaths.clear();
  EXPECT_EQ(toXml(d), R"(<scene version="3.0.0">
    <shape type="sphere" id="ball">
        <medium type="homogeneous" id="fog" name="interior">
            <float name="g" value="0.1"/>
        </medium>
    </shape>
    <ref id="fog"/>
    <bsdf type="null"/>
</scene>
)");
}

TEST(Description, EveryValueSurvivesTheRoundTrip) {
  SceneDescription d = parse(kScene);
  const float tiny = std::numeric_limits<float>::denorm_min(), big = std::numeric_limits<float>::max();
  const std::vector<Value> values{true,
                                  false,
                                  int64_t{0},
                                  std::numeric_limits<int64_t>::min(),
                                  0.1,
                                  1e-300,
                                  1 / 3.0,
                                  -1e22,
                                  std::numeric_limits<double>::denorm_min(),
                                  std::numeric_limits<double>::max(),
                                  std::string(),
                                  std::string(" <&>\"' \n\t\r $fog $$ &#36; \xc3\xa4 \x01 "),
                                  Vec3(tiny, big, -1 / 3.f),
                                  Rgb(1 / 7.f, 0, 1e-20f),
                                  Matrix4::rotation(1, 2, 3, 77) * Matrix4::translation(1e-9, 3, 1 / 3.0)};
  for (size_t i = 0; i < values.size(); ++i)
    d = edited(d, "sky", std::string("p").append(std::to_string(i)), values[i]);
  const SceneDescription again = parse(toXml(d));
  EXPECT_TRUE(equal(d, again)) << toXml(d);
  for (size_t i = 0; i < values.size(); ++i)
    EXPECT_EQ(findNode(again, "sky")->properties[i + 1].value, values[i]) << "value " << i;
  EXPECT_EQ(toXml(again), toXml(parse(toXml(again))));
}

}  // namespace
}  // namespace virga
