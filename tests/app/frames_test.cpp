// SPDX-License-Identifier: Apache-2.0
// `render --frames`: each picture is that of its frame alone, whatever came before.
#include "app/frames.h"

#include <gtest/gtest.h>
#include <signal.h>

#include <cstring>
#include <nlohmann/json.hpp>

#include "app/program.h"
#include "image/image_io.h"
#include "volume/procedural.h"
#include "volume/volume_io.h"

namespace virga::app {
namespace {

using Names = std::vector<std::string>;

TEST(Frames, ReadsRanges) {
  const auto isRange = [](std::string_view text, int first, int last) {
    const auto range = frameRange(text);
    return range && range->first == first && range->last == last;
  };
  EXPECT_TRUE(isRange("1..24", 1, 24));
  EXPECT_TRUE(isRange("0..0", 0, 0));
  EXPECT_TRUE(isRange("0007..0012", 7, 12));
  EXPECT_TRUE(isRange("7", 7, 7));
  for (const char* wrong : {"", "..", "1..", "..3", "3..1", "1-3", "1..2..3", "-1..2", "1.5..2", "1..1000000", " 1..2"})
    EXPECT_FALSE(frameRange(wrong)) << wrong;
}

TEST(Frames, NumbersFiles) {
  EXPECT_EQ(frameText(7), "0007");
  EXPECT_EQ(fileOfFrame("out.exr", 7), "out.0007.exr");
  EXPECT_EQ(fileOfFrame("a.b/out.x.exr", 12345), "a.b/out.x.12345.exr");
  EXPECT_EQ(fileOfFrame("out_##.png", 7), "out_07.png");
  EXPECT_EQ(fileOfFrame("#/a.######.exr", 123), "#/a.000123.exr");
  EXPECT_EQ(fileOfFrame("##", 1), "01");
  EXPECT_EQ(fileOfFrame("", 1), "");
}

// Everything moves but the ground: a sequence of smoke and its box, a ball, a lamp, the camera.
constexpr const char* kMoving = R"(<scene version="3.0.0">
  <default name="frame" value="0001"/>
  <sensor type="perspective"><float name="fov" value="40"/>
    <animation name="to_world">
      <transform time="1"><lookat origin="0, 0.5, 5" target="0, 0, 0" up="0, 1, 0"/></transform>
      <transform time="3"><lookat origin="1, 0.5, 5" target="0, 0, 0" up="0, 1, 0"/></transform></animation>
    <film type="hdrfilm"><integer name="width" value="24"/><integer name="height" value="16"/></film></sensor>
  <emitter type="point"><rgb name="intensity" value="30"/>
    <animation name="to_world"><transform time="2"><translate x="-2" y="3" z="1"/></transform>
      <transform time="4"><translate x="-1" y="3" z="2"/></transform></animation></emitter>
  <shape type="rectangle"><transform name="to_world"><scale value="9"/><rotate x="1" angle="-90"/><translate y="-1"/>
    </transform></shape>
  <shape type="sphere"><float name="radius" value="0.4"/>
    <animation name="to_world"><transform time="1"><translate x="-1"/></transform>
      <transform time="3"><rotate z="1" angle="90"/><translate x="1"/></transform></animation></shape>
  <shape type="cube"><bsdf type="null"/>
    <animation name="to_world"><transform time="1"/><transform time="3"><translate y="0.5"/></transform></animation>
    <medium name="interior" type="heterogeneous"><float name="albedo" value="0.9"/><float name="scale" value="6"/>
      <volume name="sigma_t" type="gridvolume"><string name="filename" value="smoke.$frame.vol"/>
        <animation name="to_world">
          <transform time="1"><translate value="-0.5"/><scale value="2"/></transform>
          <transform time="3"><translate value="-0.5"/><scale value="2"/><translate y="0.5"/></transform>
        </animation></volume></medium></shape></scene>)";

class Sequence : public ::testing::Test {
 protected:
  void SetUp() override {
    scratch_.write("moving.xml", kMoving);
    for (int frame = 1; frame <= 3; ++frame)
      writeVol(scratch_.path("smoke." + frameText(frame) + ".vol"),
               makeProcedural(ProceduralKind::smoke, {.resolution = 12, .frame = static_cast<float>(8 * frame)}));
  }
  Ended run(const Names& arguments) const { return virga(scratch_, arguments); }
  Image picture(const std::string& name) const { return readImage(scratch_.path(name)); }
  bool exists(const std::string& name) const { return std::filesystem::exists(scratch_.path(name)); }

  Scratch scratch_;
};

bool identical(const Image& a, const Image& b) {
  return a.width == b.width && a.height == b.height &&
         std::memcmp(a.pixels.data(), b.pixels.data(), a.pixels.size() * sizeof(Rgb)) == 0;
}

TEST_F(Sequence, EachFrameIsThePictureOfThatFrameAlone) {
  for (const std::string method : {"path", "ims"}) {
    Names line{"render", "moving.xml", "-m", method, "--passes", "4"};
    if (method == "ims") line.insert(line.end(), {"--set", "ims.walks=64"});
    const auto with = [&](Names more) {
      more.insert(more.begin(), line.begin(), line.end());
      return run(more);
    };
    const Ended all = with({"--frames", "1..3", "-o", method + ".exr", "--stats", "s.json"});
    ASSERT_EQ(all.exitCode, 0) << all.err;
    for (const std::string frame : {"0001", "0002", "0003"}) {
      ASSERT_EQ(with({"-D", "frame=" + frame, "-o", "alone.exr"}).exitCode, 0);
      EXPECT_TRUE(identical(picture(method + "." + frame + ".exr"), picture("alone.exr"))) << method << " " << frame;
    }
    EXPECT_FALSE(identical(picture(method + ".0001.exr"), picture(method + ".0002.exr")));
    const auto stats = nlohmann::json::parse(scratch_.read("s.0002.json"));
    EXPECT_EQ(stats["frame"], 2);
    EXPECT_EQ(stats["passes"], 4);
  }
}

TEST_F(Sequence, AFrameWithoutAChangeIsRenderedLikeAnyOther) {
  scratch_.write("still.xml", [] {
    std::string text = kMoving;
    for (size_t at; (at = text.find("time=\"3\"")) != std::string::npos;) text.replace(at, 8, "time=\"1.5\"");
    text.replace(text.find("time=\"2\""), 8, "time=\"1\"");
    text.replace(text.find("time=\"4\""), 8, "time=\"1.2\"");
    text.replace(text.find("smoke.$frame.vol"), 16, "smoke.0001.vol");
    return text;
  }());
  ASSERT_EQ(
      run({"render", "still.xml", "--frames", "2..3", "--spp", "3", "-o", "s_#.exr", "--stats", "s_#.json"}).exitCode,
      0);
  EXPECT_TRUE(identical(picture("s_2.exr"), picture("s_3.exr")));
  EXPECT_EQ(nlohmann::json::parse(scratch_.read("s_3.json"))["passes"], 3);
}

// The lamp must stand: kept walks are those of lamps that do.
TEST_F(Sequence, WalksAreKeptFromFrameToFrame) {
  std::string still = kMoving;
  for (size_t at; (at = still.find("<animation name=\"to_world\">")) != std::string::npos;) {
    const size_t first = still.find("<transform time=", at), inner = still.find('>', first) + 1;
    const bool empty = still[inner - 2] == '/';
    const size_t last = empty ? inner : still.find("</transform>", inner), end = still.find("</animation>", last) + 12;
    still.replace(at, end - at,
                  "<transform name=\"to_world\">" + (empty ? "" : still.substr(inner, last - inner)) + "</transform>");
  }
  scratch_.write("still.xml", still);
  const auto film = [&](const char* name, const std::string& retrace, const std::string& mode,
                        const char* frames = "1..3") {
    const Ended r =
        run({"render", "still.xml", "--frames", frames, "-m", "ims", "--set", "ims.walks=400", "--passes", "8", "--set",
             "ims.retrace=" + retrace, "--set", "ims.mode=" + mode, "-o", std::string(name) + ".exr"});
    EXPECT_EQ(r.exitCode, 0) << r.err;
  };
  const auto meanOf = [](const Image& image) {
    double sum = 0;
    for (const Rgb& pixel : image.pixels) sum += static_cast<double>(pixel.g);
    return sum / static_cast<double>(image.pixels.size());
  };
  for (const std::string mode : {"exact", "frame"}) {
    film("kept", "0.25", mode), film("fresh", "1", mode);
    for (int frame = 1; frame <= 3; ++frame) {
      const Image kept = picture(fileOfFrame("kept.exr", frame)), fresh = picture(fileOfFrame("fresh.exr", frame));
      EXPECT_NEAR(meanOf(kept) / meanOf(fresh), 1, 0.1) << mode << " " << frame;
      EXPECT_NE(kept.pixels, fresh.pixels) << "other walks";
    }
    // A sequence that goes on where another was interrupted begins with walks of its own.
    film("resumed", "0.25", mode, "2..3");
    for (int frame = 2; frame <= 3; ++frame) {
      const Image kept = picture(fileOfFrame("kept.exr", frame)), resumed = picture(fileOfFrame("resumed.exr", frame));
      EXPECT_NEAR(meanOf(resumed) / meanOf(kept), 1, 0.1) << mode << " " << frame;
    }
  }
}

TEST_F(Sequence, AnErrorNamesItsFrameAndLeavesTheFramesBefore) {
  const Ended r = run({"render", "moving.xml", "--frames", "3..5", "--spp", "1", "-o", "e.exr"});
  EXPECT_EQ(r.exitCode, 1);
  EXPECT_NE(r.err.find("smoke.0004.vol"), std::string::npos) << r.err;
  EXPECT_NE(r.err.find("in frame 0004 of --frames 3..5"), std::string::npos) << r.err;
  EXPECT_EQ(picture("e.0003.exr").width, 24);
  EXPECT_FALSE(exists("e.0004.exr"));
}

TEST_F(Sequence, WrongUseIsRefusedBeforeAnythingIsRendered) {
  EXPECT_EQ(run({"render", "moving.xml", "--frames", "3..1"}).exitCode, 2);
  EXPECT_EQ(run({"render", "moving.xml", "--frames", "1..2", "-D", "frame=1"}).exitCode, 2);
  EXPECT_EQ(run({"render", "smoke.0001.vol", "--frames", "1..2"}).exitCode, 2);
  EXPECT_EQ(run({"render", "moving.xml", "--frames", "1..2", "-o", "no/folder.exr"}).exitCode, 1);
  scratch_.write("still.xml", R"(<scene version="3.0.0"><sensor type="perspective"/></scene>)");
  const Ended still = run({"render", "still.xml", "--frames", "1..2"});
  EXPECT_EQ(still.exitCode, 1);
  EXPECT_NE(
      still.err.find("still.xml:1:2: error: all frames would be the same picture: nothing in this scene uses $frame"),
      std::string::npos)
      << still.err;
  EXPECT_EQ(still.err.find("-D"), std::string::npos) << "what nobody wrote: " << still.err;
  EXPECT_EQ(scratch_.files(), (Names{"moving.xml", "smoke.0001.vol", "smoke.0002.vol", "smoke.0003.vol", "still.xml"}));
}

TEST_F(Sequence, AnInterruptLeavesWholeFrames) {
  scratch_.write("long.xml", [] {
    std::string text = kMoving;
    return text.replace(text.find("smoke.$frame.vol"), 16, "smoke.0001.vol");
  }());
  Program program(scratch_, {"render", "long.xml", "--frames", "1..900000", "--spp", "64", "-o", "i.exr"});
  ASSERT_TRUE(program.waitForStderr("wrote i.0002.exr"));
  program.signal(SIGINT);
  const Ended r = program.wait();
  EXPECT_EQ(r.exitCode, 0) << r.err;
  EXPECT_NE(r.err.find("interrupted: frames 1 to "), std::string::npos) << r.err;
  for (const std::string& file : scratch_.files()) {
    if (!file.ends_with(".exr")) continue;
    EXPECT_EQ(picture(file).width, 24) << file;
  }
}

}  // namespace
}  // namespace virga::app
