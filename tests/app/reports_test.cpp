// SPDX-License-Identifier: Apache-2.0
// What the program says about odd inputs, and what it refuses to write over.
#include <gtest/gtest.h>
#include <signal.h>

#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>

#include "app/program.h"
#include "image/image_io.h"
#include "loaders/mitsuba_xml.h"
#include "volume/volume_io.h"

namespace virga::app {
namespace {

namespace fs = std::filesystem;
using Names = std::vector<std::string>;

// A ball of fog before a lit wall; the camera, the lamp and the depth may be changed.
constexpr const char* kBall = R"(<scene version="3.0.0">
  <default name="far" value="100"/>
  <default name="depth" value="-1"/>
  <integrator type="volpath"><integer name="max_depth" value="$depth"/></integrator>
  <sensor type="perspective">
    <float name="fov" value="40"/><float name="far_clip" value="$far"/>
    <transform name="to_world"><lookat origin="0, 0, 5" target="0, 0, 0" up="0, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="8"/><rfilter type="box"/></film>
  </sensor>
  <emitter type="point"><point name="position" x="0" y="2" z="4"/><rgb name="intensity" value="30"/></emitter>
  <include filename="wall.xml"/>
</scene>
)";
constexpr const char* kWall = R"(<scene>
  <shape type="obj"><string name="filename" value="wall.obj"/></shape>
</scene>)";
constexpr const char* kWallObj = "v -3 -3 0\nv 3 -3 0\nv 3 3 0\nv -3 3 0\nf 1 2 3 4\n";

class Reports : public ::testing::Test {
 protected:
  void SetUp() override {
    scratch_.write("ball.xml", kBall);
    scratch_.write("wall.xml", kWall);
    scratch_.write("wall.obj", kWallObj);
  }
  Ended run(const Names& arguments) const { return virga(scratch_, arguments); }

  Scratch scratch_;
};

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

// ---- inputs stay ----------------------------------------------------------------------------------------------------

TEST_F(Reports, NoOutputDestroysAnInput) {
  writeExr(scratch_.path("sky.exr"), Image(4, 2));
  std::string withSky = kBall;
  withSky.insert(withSky.find("<include"),
                 "<emitter type=\"envmap\"><string name=\"filename\" value=\"sky.exr\"/></emitter>\n");
  scratch_.write("sky.xml", withSky);  // without -o, its picture would be sky.exr
  fs::create_symlink("wall.xml", scratch_.path("soft.json"));
  fs::create_hard_link(scratch_.path("wall.obj"), scratch_.path("hard.json"));
  const std::vector<Names> lines = {
      {"render", "ball.xml", "--stats", "./ball.xml"},
      {"render", "ball.xml", "--stats", scratch_.path("wall.xml").string()},
      {"render", "ball.xml", "--stats", "wall.obj"},
      {"render", "ball.xml", "--stats", "soft.json"},
      {"render", "ball.xml", "--stats", "hard.json"},
      {"render", "sky.xml", "-o", "sky.exr"},
      {"render", "sky.xml"},
      {"compare", "sky.png", "sky.png", "--diff", "./sky.png"},
  };
  writePng(scratch_.path("sky.png"), Image(4, 2));
  const Names files = {"ball.xml", "sky.xml", "wall.xml", "wall.obj", "sky.exr", "sky.png"};
  std::vector<std::string> before;
  for (const std::string& file : files) before.push_back(scratch_.read(file));
  const Names there = scratch_.files();
  for (const Names& line : lines) {
    const Ended r = run(line);
    EXPECT_EQ(r.exitCode, 2) << line.back();
    EXPECT_TRUE(contains(r.err, "is read as an input")) << r.err;
  }
  for (size_t i = 0; i < files.size(); ++i) EXPECT_EQ(scratch_.read(files[i]), before[i]) << files[i];
  EXPECT_EQ(scratch_.files(), there) << "nothing was begun";
  EXPECT_EQ(run({"render", "ball.xml", "--spp", "1", "--stats", "new.json"}).exitCode, 0);
}

TEST_F(Reports, AnOutputNamedTwiceIsFoundBehindLinks) {
  fs::create_directory(scratch_.path("folder"));
  fs::create_directory_symlink("folder", scratch_.path("alias"));
  const Ended r = run({"render", "ball.xml", "-o", "folder/a.exr", "-o", "alias/a.exr"});
  EXPECT_EQ(r.exitCode, 2);
  EXPECT_TRUE(contains(r.err, "twice")) << r.err;
}

// ---- pictures that show nothing -------------------------------------------------------------------------------------

TEST_F(Reports, BlackPicturesAreWarnedOf) {
  const auto warned = [&](const std::string& define) {
    const Ended r = run({"render", "ball.xml", "--spp", "2", "-D", define, "--stats", "s.json"});
    EXPECT_EQ(r.exitCode, 0) << r.err;
    const auto warnings = nlohmann::json::parse(scratch_.read("s.json"))["warnings"];
    EXPECT_EQ(contains(r.err, "warning: every pixel is black"), !warnings.empty()) << r.err;
    return !warnings.empty();
  };
  EXPECT_TRUE(warned("far=1"));
  EXPECT_TRUE(warned("depth=0")) << "no segment reaches anything";
  EXPECT_TRUE(warned("depth=1")) << "no lamp is in sight";
  EXPECT_FALSE(warned("depth=2"));
}

TEST_F(Reports, AMaxDepthOfZeroIsBlackEvenWhereALampIsInSight) {
  scratch_.write(
      "lamp.xml",
      "<scene version=\"3.0.0\"><integrator type=\"path\"><integer name=\"max_depth\" value=\"0\"/></integrator>"
      "<sensor type=\"perspective\"><float name=\"fov\" value=\"40\"/><film type=\"hdrfilm\"><integer name=\"width\" "
      "value=\"4\"/><integer name=\"height\" value=\"4\"/></film></sensor><emitter type=\"constant\"/></scene>");
  const auto brightness = [&](const Names& more) {
    Names line{"render", "lamp.xml", "--spp", "1", "-o", "lamp.exr"};
    line.insert(line.end(), more.begin(), more.end());
    EXPECT_EQ(run(line).exitCode, 0);
    return readImage(scratch_.path("lamp.exr")).pixels[5].g;
  };
  EXPECT_EQ(brightness({}), 0);
  EXPECT_EQ(brightness({"--set", "path.max_depth=1"}), 1);
}

TEST_F(Reports, ComparingSaysWhatWasLeftOut) {
  Image half(4, 2), none(4, 2);
  half.pixels[3] = Rgb(std::numeric_limits<float>::quiet_NaN());
  for (Rgb& p : none.pixels) p = Rgb(std::numeric_limits<float>::quiet_NaN());
  writeExr(scratch_.path("half.exr"), half);
  writeExr(scratch_.path("none.exr"), none);
  const Ended some = run({"compare", "half.exr", "half.exr"});
  EXPECT_EQ(some.exitCode, 0);
  EXPECT_TRUE(some.out.starts_with("only 7 of 8 pixels compared: 1 of the image and 1 of the reference are"))
      << some.out;
  const Ended nothing = run({"compare", "none.exr", "half.exr"});
  EXPECT_EQ(nothing.exitCode, 1);
  EXPECT_TRUE(contains(nothing.err, "no pixel that is finite in both")) << nothing.err;
  EXPECT_TRUE(contains(run({"info", "half.exr"}).out, "mean 0 0 0\n1 pixels are NaN or infinite"));
  EXPECT_TRUE(contains(run({"info", "none.exr"}).out, "no finite pixel"));
}

// ---- names of files -------------------------------------------------------------------------------------------------

TEST_F(Reports, ExtensionsMayShoutOrBeMissing) {
  for (const std::string end : {".vdb", ".nvdb", ".vol"})
    ASSERT_EQ(run({"make", "smoke", "-o", "s" + end, "--resolution", "12"}).exitCode, 0);
  fs::copy_file(scratch_.path("s.vdb"), scratch_.path("S.VDB"));
  fs::copy_file(scratch_.path("s.vol"), scratch_.path("S.VOL"));
  fs::copy_file(scratch_.path("s.nvdb"), scratch_.path("bare"));
  fs::copy_file(scratch_.path("ball.xml"), scratch_.path("scene"));
  for (const std::string name : {"S.VDB", "S.VOL", "bare"}) {
    EXPECT_TRUE(contains(run({"info", name}).out, "1 grid")) << name;
    const Ended r = run({"render", name, "--spp", "1", "--size", "4x4", "-o", "T.EXR", "-o", "T.PNG"});
    EXPECT_EQ(r.exitCode, 0) << r.err;
    EXPECT_EQ(readImage(scratch_.path("T.EXR")).width, 4);
  }
  EXPECT_TRUE(contains(run({"info", "scene"}).out, "8 x 8 pixels"));
  EXPECT_EQ(run({"make", "smoke", "-o", "M.VOL", "--resolution", "8"}).exitCode, 0);
}

TEST_F(Reports, InfoTellsMeshesAndNothingThatIsNotThere) {
  const Ended mesh = run({"info", "wall.obj"});
  EXPECT_TRUE(contains(mesh.out, "4 vertices, 2 triangles")) << mesh.out << mesh.err;
  EXPECT_TRUE(contains(mesh.out, "(-3, -3, 0) to (3, 3, 0)")) << mesh.out;
  DenseVolume volume{2, 2, 2, std::vector<float>(8, 1.f), Matrix4(), "density"};
  volume.values[3] = std::numeric_limits<float>::quiet_NaN();
  writeVol(scratch_.path("nan.vol"), volume);
  std::string bytes = scratch_.read("nan.vol");
  const float nan = std::numeric_limits<float>::quiet_NaN();
  bytes.replace(4 + 5 * 4 + 3 * 4, sizeof(nan), reinterpret_cast<const char*>(&nan), sizeof(nan));
  scratch_.write("nan.vol", bytes);
  const Ended grid = run({"info", "nan.vol"});
  EXPECT_EQ(grid.exitCode, 0) << grid.err;
  EXPECT_TRUE(contains(grid.out, "bounds  none")) << grid.out;
  EXPECT_TRUE(contains(grid.out, "values  none that can be told")) << grid.out;
}

TEST_F(Reports, FogAndDustAreThinInTheirScenes) {
  for (const auto& [kind, thickness] : {std::pair("smoke", 10.0), {"fog", 1.5}, {"dust", 1.0}}) {
    const std::string name = kind;
    ASSERT_EQ(run({"make", name, "-o", name + ".xml", "--resolution", "24"}).exitCode, 0);
    const auto grid = loadVolume(scratch_.path(name + ".vol"));
    double sum = 0, count = 0;
    for (int i = 0; i < 24 * 24 * 24; ++i) {
      sum += static_cast<double>(grid->view().dense.values[i]);
      count += grid->view().dense.values[i] != 0 ? 1 : 0;
    }
    const NodePtr medium = findNode(loadMitsubaXml(scratch_.path(name + ".xml")), "medium");
    double scale = 0;
    for (const Property& p : medium->properties)
      if (p.name == "scale") scale = std::get<double>(p.value);
    EXPECT_NEAR(scale * sum / count * 2, thickness, 1e-3 * thickness) << name;
  }
}

// ---- words ----------------------------------------------------------------------------------------------------------

TEST_F(Reports, VariablesAreToldAsTheyAre) {
  scratch_.write("free.xml",
                 "<scene version=\"3.0.0\"><sensor type=\"perspective\"><float name=\"fov\" value=\"$a\"/>"
                 "</sensor></scene>");
  const Ended r = run({"info", "free.xml", "-D", "a=40", "-D", "b=1"});
  EXPECT_EQ(r.exitCode, 1);
  EXPECT_TRUE(contains(r.err, "the scene's variables: a")) << r.err;
  scratch_.write("unused.xml",
                 "<scene version=\"3.0.0\"><default name=\"spare\" value=\"1\"/><sensor type=\"perspective\"/>"
                 "<emitter type=\"constant\"/></scene>");
  const Ended unused = run({"info", "unused.xml"});
  EXPECT_EQ(unused.exitCode, 0);
  EXPECT_TRUE(contains(unused.out, "unused.xml:1:")) << unused.out;
  EXPECT_TRUE(contains(unused.out, "warning: the default of $spare is never used")) << unused.out;
  EXPECT_FALSE(contains(run({"info", "ball.xml"}).out, "warning")) << "all of its defaults are used";
}

TEST_F(Reports, AnInterruptedRenderSaysHowFarItCame) {
  Program program(scratch_, {"render", "ball.xml", "--spp", "1000000000", "-o", "i.exr"});
  ASSERT_TRUE(program.waitForStderr("passes, "));
  program.signal(SIGINT);
  const Ended r = program.wait();
  EXPECT_TRUE(contains(r.err, " of 1000000000 passes\n")) << r.err;
}

TEST_F(Reports, StatsCountBytesInWholeNumbers) {
  ASSERT_EQ(run({"render", "ball.xml", "--spp", "1", "-o", "b.exr", "--stats", "b.json"}).exitCode, 0);
  const auto stats = nlohmann::json::parse(scratch_.read("b.json"));
  EXPECT_TRUE(stats["peak_resident_bytes"].is_number_integer());
  EXPECT_TRUE(stats["resident_bytes"].is_number_integer());
  EXPECT_GT(stats["resident_bytes"], 1e6);
}

}  // namespace
}  // namespace virga::app
