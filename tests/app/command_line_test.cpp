// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <signal.h>

#include <chrono>
#include <cstring>
#include <nlohmann/json.hpp>

#include "app/program.h"
#include "image/image_io.h"
#include "loaders/mitsuba_xml.h"
#include "scene/builder.h"
#include "scene/scene_parts.h"
#include "volume/volume_io.h"

namespace virga::app {
namespace {

using Names = std::vector<std::string>;

// Homogeneous fog in a box, a lamp beside it, a ground.
constexpr const char* kFog = R"(<scene version="3.0.0">
  <default name="albedo" value="0.9"/>
  <integrator type="volpath"><integer name="max_depth" value="20"/></integrator>
  <sensor type="perspective">
    <float name="fov" value="40"/>
    <transform name="to_world"><lookat origin="0, 0.5, 5" target="0, 0, 0" up="0, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="24"/><integer name="height" value="16"/><rfilter type="box"/></film>
    <sampler type="independent"><integer name="sample_count" value="3"/></sampler>
  </sensor>
  <emitter type="point"><point name="position" x="-2" y="3" z="1"/><rgb name="intensity" value="30, 28, 25"/></emitter>
  <shape type="rectangle">
    <transform name="to_world"><scale x="9" y="9"/><rotate x="1" angle="-90"/><translate y="-1"/></transform>
    <bsdf type="diffuse"><rgb name="reflectance" value="0.5, 0.5, 0.5"/></bsdf>
  </shape>
  <shape type="cube">
    <bsdf type="null"/>
    <medium name="interior" type="homogeneous">
      <float name="sigma_t" value="1.5"/><float name="albedo" value="$albedo"/>
    </medium>
  </shape>
</scene>
)";

class CommandLine : public ::testing::Test {
 protected:
  void SetUp() override { scratch_.write("fog.xml", kFog); }

  Ended run(const Names& arguments) const { return virga(scratch_, arguments); }
  Image picture(const std::string& name) const { return readImage(scratch_.path(name)); }
  nlohmann::json json(const std::string& name) const { return nlohmann::json::parse(scratch_.read(name)); }

  Scratch scratch_;
};

bool identical(const Image& a, const Image& b) {
  return a.width == b.width && a.height == b.height &&
         std::memcmp(a.pixels.data(), b.pixels.data(), a.pixels.size() * sizeof(Rgb)) == 0;
}

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

int lines(const std::string& text, const std::string& part) {
  int count = 0;
  for (size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++count;
  return count;
}

// ---- usage ----------------------------------------------------------------------------------------------------------

TEST_F(CommandLine, HelpIsNoErrorAndNeedsNoScene) {
  for (const Names& line : {Names{"--help"}, Names{"render", "--help"}, Names{"make", "-h"}, Names{"--version"}}) {
    const Ended r = run(line);
    EXPECT_EQ(r.exitCode, 0) << line[0];
    EXPECT_FALSE(r.out.empty());
    EXPECT_TRUE(r.err.empty()) << r.err;
  }
  EXPECT_EQ(run({}).exitCode, 2);
}

TEST_F(CommandLine, WrongUsageIsExitCode2WithOneMessage) {
  const std::vector<std::pair<Names, std::string>> cases = {
      {{"rendr", "fog.xml"}, "did you mean \"render\"?"},
      {{"render", "fog.xml", "--sed", "3"}, "did you mean \"--seed\"?"},
      {{"--verson"}, "did you mean \"--version\"?"},
      {{"render"}, "SCENE"},
      {{"render", "fog.xml", "--spp", "many"}, "--spp"},
      {{"render", "fog.xml", "--spp", "0"}, "--spp 0"},
      {{"render", "fog.xml", "--spp", "-1"}, "--spp"},
      {{"render", "fog.xml", "--audit", "0"}, "--audit 0"},
      {{"render", "fog.xml", "--spp", "2", "--passes", "2"}, "--passes"},
      {{"render", "fog.xml", "--time", "nan"}, "--time nan"},
      {{"render", "fog.xml", "--error", "inf"}, "--error inf"},
      {{"render", "fog.xml", "--size", "640"}, "--size 640"},
      {{"render", "fog.xml", "--size", "64x"}, "--size 64x"},
      {{"render", "fog.xml", "--size", "999999x999999"}, "--size"},
      {{"render", "fog.xml", "--seed", "18446744073709551616"}, "--seed"},
      {{"render", "fog.xml", "--threads", "0"}, "--threads"},
      {{"render", "fog.xml", "-D", "albedo"}, "-D albedo"},
      {{"render", "fog.xml", "--set", "max_depth=3"}, "--set max_depth=3"},
      {{"render", "fog.xml", "-o", "out.jpg"}, "out.jpg"},
      {{"render", "fog.xml", "-o", "out.exr", "-o", "./out.exr"}, "twice"},
      {{"render", "fog.xml", "surplus.xml"}, "surplus.xml"},
      {{"compare", "a.exr"}, "REFERENCE"},
      {{"make", "smoke"}, "--output"},
      {{"make", "smoke", "-o", "smoke.txt"}, "smoke.txt"},
      {{"make", "smoke", "-o", "smoke.vol", "--resolution", "1"}, "--resolution"},
  };
  for (const auto& [line, message] : cases) {
    const Ended r = run(line);
    EXPECT_EQ(r.exitCode, 2) << r.err;
    EXPECT_TRUE(contains(r.err, message)) << r.err;
    EXPECT_TRUE(r.err.starts_with("error: ")) << r.err;
    EXPECT_EQ(lines(r.err, "error: "), 1) << r.err;
    EXPECT_TRUE(r.out.empty()) << r.out;
  }
  EXPECT_EQ(scratch_.files(), Names{"fog.xml"});
}

TEST_F(CommandLine, BadInputIsExitCode1WithOneMessage) {
  scratch_.write("broken.xml", "<scene version=\"3.0.0\"><shape type=\"sphre\"/></scene>");
  scratch_.write("empty.xml", "");
  scratch_.write("empty.vol", "");
  scratch_.write("noise.vdb", std::string(1000, 'x'));
  scratch_.write("noise.exr", std::string(1000, 'x'));
  const std::vector<std::pair<Names, std::string>> cases = {
      {{"render", "nowhere.xml", "-o", "o.exr"}, "nowhere.xml"},
      {{"render", "nowhere.vol", "-o", "o.exr"}, "nowhere.vol"},
      {{"render", "broken.xml", "-o", "o.exr"}, "did you mean \"sphere\"?"},
      {{"render", "empty.xml", "-o", "o.exr"}, "empty.xml"},
      {{"render", "empty.vol", "-o", "o.exr"}, "empty.vol"},
      {{"render", "noise.vdb", "-o", "o.exr"}, "noise.vdb"},
      {{"render", ".", "-o", "o.exr"}, "."},
      {{"render", "fog.xml", "-o", "o.exr", "-m", "pth"}, "did you mean \"path\"?"},
      {{"render", "fog.xml", "-o", "o.exr", "--set", "path.max_dept=3"}, "did you mean \"max_depth\"?"},
      {{"render", "fog.xml", "-o", "o.exr", "--set", "path.max_depth=three"}, "three"},
      {{"render", "fog.xml", "-o", "o.exr", "--set", "beams.max_depth=3"}, "beams"},
      {{"render", "fog.xml", "-o", "o.exr", "-D", "albdo=0.5"}, "albdo"},
      {{"render", "fog.xml", "-o", "o.exr", "-D", "albedo=1.5"}, "albedo"},
      {{"render", "fog.xml", "-o", "no/such/folder/o.exr"}, "no/such/folder"},
      {{"render", "fog.xml", "-o", "o.exr", "--stats", "no/such/folder/s.json"}, "no/such/folder"},
      {{"compare", "fog.xml", "noise.exr"}, "fog.xml"},
      {{"compare", "noise.exr", "noise.exr"}, "noise.exr"},
      {{"info", "noise.exr"}, "noise.exr"},
      {{"info", "noise.vdb"}, "noise.vdb"},
      {{"info", "broken.xml"}, "broken.xml"},
      {{"make", "clod", "-o", "s.vol"}, "did you mean \"cloud\"?"},
      {{"make", "smoke", "-o", "no/such/folder/s.vol"}, "no/such/folder"},
      {{"methods", "pth"}, "did you mean \"path\"?"},
  };
  const Names before = scratch_.files();
  for (const auto& [line, message] : cases) {
    const Ended r = run(line);
    EXPECT_EQ(r.exitCode, 1) << line[0] << " " << line[1] << "\n" << r.err;
    EXPECT_TRUE(contains(r.err, message)) << r.err;
    EXPECT_EQ(lines(r.err, "error: "), 1) << r.err;
    EXPECT_TRUE(r.out.empty()) << r.out;
    EXPECT_EQ(scratch_.files(), before) << line[0] << " " << line[1];
  }
}

// ---- render ---------------------------------------------------------------------------------------------------------

TEST_F(CommandLine, RendersWithTheScenesOwnSettings) {
  const Ended r = run({"render", "fog.xml"});
  EXPECT_EQ(r.exitCode, 0) << r.err;
  EXPECT_TRUE(r.out.empty());
  const LayeredImage image = readLayeredImage(scratch_.path("fog.exr"));
  EXPECT_EQ(image.beauty.width, 24);
  EXPECT_EQ(image.beauty.height, 16);
  EXPECT_TRUE(image.layers.empty());
  EXPECT_FALSE(image.variance);
  EXPECT_EQ(std::get<int64_t>(image.metadata.at("virga.passes")), 3);
  EXPECT_EQ(std::get<std::string>(image.metadata.at("virga.method")), "path");
  EXPECT_EQ(std::get<std::string>(image.metadata.at("virga.bias")), "unbiased");
  EXPECT_EQ(std::get<std::string>(image.metadata.at("virga.scene")), "fog.xml");
  for (const char* name : {"virga.version", "virga.scene_hash", "virga.seed", "virga.seconds", "virga.path.rr_depth"})
    EXPECT_TRUE(image.metadata.contains(name)) << name;
  EXPECT_EQ(std::get<std::string>(image.metadata.at("virga.path.max_depth")), "20") << "the scene's";
  float brightest = 0;
  for (const Rgb& p : image.beauty.pixels) brightest = std::max(brightest, p.r);
  EXPECT_GT(brightest, 0);
}

TEST_F(CommandLine, WritesLayersThatSumUpToTheBeautyAndVariances) {
  ASSERT_EQ(run({"render", "fog.xml", "--layers", "--spp", "8", "-o", "f.exr", "-o", "f.png", "-q"}).exitCode, 0);
  const LayeredImage image = readLayeredImage(scratch_.path("f.exr"));
  ASSERT_EQ(image.layers.size(), 9u);
  EXPECT_EQ(image.layerVariances.size(), 9u);
  EXPECT_TRUE(image.variance);
  for (size_t i = 0; i < image.beauty.pixels.size(); ++i) {
    Rgb sum;
    for (const auto& [name, layer] : image.layers) sum += layer.pixels[i];
    EXPECT_NEAR(sum.g, image.beauty.pixels[i].g, 1e-6f + 1e-5f * sum.g);
  }
  EXPECT_EQ(picture("f.png").width, 24);
}

// A lamp whose light overflows close to it.
TEST_F(CommandLine, SamplesThatAreNoNumbersAreReported) {
  scratch_.write("glare.xml", R"(<scene version="3.0.0"><sensor type="perspective"><float name="fov" value="40"/>
    <transform name="to_world"><lookat origin="0, 0, 5" target="0, 0, 0" up="0, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="8"/></film></sensor>
    <shape type="rectangle"/><emitter type="point"><point name="position" x="0" y="0" z="0.05"/>
    <rgb name="intensity" value="3e38"/></emitter></scene>)");
  const Ended r = run({"render", "glare.xml", "--spp", "2", "--stats", "s.json"});
  EXPECT_EQ(r.exitCode, 0) << r.err;
  const int64_t count = json("s.json")["non_finite_samples"];
  EXPECT_GT(count, 0);
  EXPECT_TRUE(contains(r.err, std::to_string(count) + " samples were NaN or infinite")) << r.err;
}

TEST_F(CommandLine, QuietPrintsNothing) {
  const Ended r = run({"render", "fog.xml", "--spp", "1", "--quiet"});
  EXPECT_EQ(r.exitCode, 0);
  EXPECT_EQ(r.out + r.err, "");
}

TEST_F(CommandLine, ThePictureDependsOnTheSeedAloneNotOnTheThreads) {
  const auto render = [&](const std::string& seed, const std::string& threads, const std::string& out) {
    ASSERT_EQ(run({"render", "fog.xml", "--spp", "9", "--seed", seed, "--threads", threads, "-o", out}).exitCode, 0);
  };
  render("5", "1", "one.exr");
  render("5", "2", "two.exr");
  render("5", "7", "seven.exr");
  render("6", "1", "other.exr");
  EXPECT_TRUE(identical(picture("one.exr"), picture("two.exr")));
  EXPECT_TRUE(identical(picture("one.exr"), picture("seven.exr")));
  EXPECT_FALSE(identical(picture("one.exr"), picture("other.exr")));
}

TEST_F(CommandLine, StatsAreJsonThatSaysWhatWasDone) {
  ASSERT_EQ(run({"render", "fog.xml", "--size", "20x10", "--passes", "8", "--seed", "7", "--threads", "1", "-o",
                 "s.exr", "--stats", "s.json", "--set", "path.max_depth=4"})
                .exitCode,
            0);
  const nlohmann::json stats = json("s.json");
  EXPECT_EQ(stats["passes"], 8);
  EXPECT_EQ(stats["stopped_by"], "passes");
  EXPECT_EQ(stats["threads"], 1);
  EXPECT_EQ(stats["scene"]["width"], 20);
  EXPECT_EQ(stats["scene"]["height"], 10);
  EXPECT_EQ(stats["method"]["name"], "path");
  EXPECT_EQ(stats["method"]["settings"]["max_depth"], "4");
  EXPECT_EQ(stats["method"]["settings"]["rr_depth"], "5") << "the scene is silent: the default that is in force";
  EXPECT_EQ(stats["method"]["seed"], 7);
  EXPECT_EQ(stats["non_finite_samples"], 0);
  EXPECT_GT(stats["estimated_relmse"].get<double>(), 0);
  EXPECT_GT(stats["peak_resident_bytes"].get<double>(), 1e6);
  EXPECT_GT(stats["samples_per_second"].get<double>(), 0);
  for (const char* part : {"load", "build", "prepare", "render", "write", "total", "render_cpu", "total_cpu"})
    EXPECT_GE(stats["seconds"][part].get<double>(), 0) << part;
  EXPECT_EQ(stats["outputs"], nlohmann::json({"s.exr"}));
}

TEST_F(CommandLine, TimeAndErrorStopByThemselves) {
  ASSERT_EQ(run({"render", "fog.xml", "--time", "0.5", "-o", "t.exr", "--stats", "t.json"}).exitCode, 0);
  EXPECT_EQ(json("t.json")["stopped_by"], "time");
  EXPECT_NEAR(json("t.json")["seconds"]["render"].get<double>(), 0.5, 0.4);
  ASSERT_EQ(run({"render", "fog.xml", "--error", "0.05", "-o", "e.exr", "--stats", "e.json"}).exitCode, 0);
  EXPECT_EQ(json("e.json")["stopped_by"], "error");
  EXPECT_GE(json("e.json")["passes"], 16);
  EXPECT_LE(json("e.json")["estimated_relmse"].get<double>(), 0.05);
}

// ---- files ----------------------------------------------------------------------------------------------------------

TEST_F(CommandLine, AnAuditTellsHowWrongAPictureIs) {
  const Ended r = run({"render", "fog.xml", "--spp", "64", "--set", "path.max_depth=2", "--audit", "0.5", "--stats",
                       "stats.json", "-o", "a.exr"});
  ASSERT_EQ(r.exitCode, 0) << r.err;
  EXPECT_TRUE(contains(r.err, "audit: bias")) << r.err;
  EXPECT_TRUE(contains(r.err, "audit: relMSE")) << r.err;
  const nlohmann::json audit = json("stats.json")["audit"];
  EXPECT_LT(audit["bias"]["high"], 0) << "paths of two segments lack multiple scattering";
  EXPECT_GE(audit["samples"], 4);
  EXPECT_GT(json("stats.json")["seconds"]["audit"], 0);
  const LayeredImage made = readLayeredImage(scratch_.path("a.exr"));
  for (const char* name : {"bias", "bias_low", "bias_high", "relmse", "relmse_low", "relmse_high"})
    EXPECT_TRUE(made.metadata.contains(std::string("virga.audit.") + name)) << name;
  EXPECT_EQ(run({"render", "fog.xml", "-o", "b.exr", "--stats", "stats.json"}).exitCode, 0);
  EXPECT_TRUE(json("stats.json")["audit"].is_null());
}

TEST_F(CommandLine, AnAuditJudgesTheErrorThatWasAskedFor) {
  const auto verdict = [&](const Names& more) {
    Names all = {"render", "fog.xml", "--audit", "0.3", "--stats", "stats.json", "-o", "a.exr"};
    all.insert(all.end(), more.begin(), more.end());
    const Ended r = run(all);
    EXPECT_EQ(r.exitCode, 0) << r.err;
    EXPECT_TRUE(contains(r.err, "says the audit")) << r.err;
    return json("stats.json")["audit"]["error"]["verdict"].get<std::string>();
  };
  EXPECT_EQ(verdict({"--error", "1000"}), "reached");
  EXPECT_EQ(verdict({"--error", "1e-3", "--passes", "1"}), "not reached");
}

// The noise of clamped virtual lights falls below what was asked for; their bias does not.
TEST_F(CommandLine, AnAuditJudgesABiasedMethod) {
  const Names clamped = {"render",  "fog.xml",      "-m",      "ims",  "--set", "ims.compensation=none",
                         "--set",   "ims.radius=2", "--error", "0.02", "-o",    "a.exr",
                         "--stats", "stats.json"};
  const Ended alone = run(clamped);
  EXPECT_EQ(alone.exitCode, 0) << alone.err;
  EXPECT_TRUE(contains(alone.err, "add --audit SEC")) << alone.err;
  Names audited = clamped;
  audited.insert(audited.end(), {"--audit", "1.5"});
  const Ended r = run(audited);
  ASSERT_EQ(r.exitCode, 0) << r.err;
  const nlohmann::json audit = json("stats.json")["audit"];
  EXPECT_LT(audit["bias"]["high"], 0) << "clamping takes light";
  EXPECT_EQ(audit["error"]["verdict"], "not reached") << r.err;
}

TEST_F(CommandLine, DotsShowWhereVirtualLightsStand) {
  const Ended r = run({"render", "fog.xml", "-m", "ims", "--set", "ims.walks=1024", "--passes", "1", "-o", "a.png",
                       "--dots", "dots.png"});
  ASSERT_EQ(r.exitCode, 0) << r.err;
  const Image plain = picture("a.png"), dots = picture("dots.png");
  int green = 0, red = 0;
  for (size_t i = 0; i < dots.pixels.size(); ++i) {
    if (dots.pixels[i] == plain.pixels[i]) continue;
    green += dots.pixels[i] == Rgb(0, 1, 0);
    red += dots.pixels[i] == Rgb(1, 0, 0);
  }
  EXPECT_GT(green, 0) << "on the ground";
  EXPECT_GT(red, 0) << "in the fog";
  EXPECT_TRUE(contains(run({"render", "fog.xml", "-o", "b.png", "--dots", "none.png"}).err, "nothing to draw"));
  EXPECT_EQ(run({"render", "fog.xml", "-o", "b.png", "--dots", "dots.exr"}).exitCode, 2);
  EXPECT_EQ(run({"render", "fog.xml", "-o", "b.png", "--dots", "b.png"}).exitCode, 2);
}

TEST_F(CommandLine, AnInterruptEndsTheAuditAndKeepsThePicture) {
  Program program(scratch_, {"render", "fog.xml", "--audit", "1000", "-o", "a.exr"});
  ASSERT_TRUE(program.waitForStderr("auditing"));
  program.signal(SIGINT);
  const Ended r = program.wait();
  EXPECT_EQ(r.exitCode, 0) << r.err;
  EXPECT_EQ(picture("a.exr").width, 24);
}

TEST_F(CommandLine, AnOutputStaysAsItWasWhenTheRenderFails) {
  scratch_.write("old.exr", "precious");
  scratch_.write("old.json", "precious");
  EXPECT_EQ(run({"render", "fog.xml", "-D", "albedo=7", "-o", "old.exr", "--stats", "old.json"}).exitCode, 1);
  EXPECT_EQ(run({"render", "fog.xml", "-o", "old.exr", "-o", "no/folder.png"}).exitCode, 1);
  EXPECT_EQ(scratch_.read("old.exr"), "precious");
  EXPECT_EQ(scratch_.read("old.json"), "precious");
  EXPECT_EQ(run({"render", "fog.xml", "-o", "old.exr", "--spp", "1"}).exitCode, 0);
  EXPECT_EQ(picture("old.exr").width, 24);
  EXPECT_EQ(scratch_.files(), (Names{"fog.xml", "old.exr", "old.json"}));
}

// ---- Ctrl-C ---------------------------------------------------------------------------------------------------------

TEST_F(CommandLine, AnInterruptWritesThePassesThatThereAre) {
  for (const int signal : {SIGINT, SIGTERM}) {
    Program program(scratch_, {"render", "fog.xml", "--time", "1000", "-o", "i.exr", "--stats", "i.json"});
    ASSERT_TRUE(program.waitForStderr("passes, "));
    program.signal(signal);
    const Ended r = program.wait();
    EXPECT_EQ(r.exitCode, 0) << r.err;
    EXPECT_EQ(json("i.json")["stopped_by"], "interrupted");
    EXPECT_GT(json("i.json")["passes"], 1);
    EXPECT_EQ(picture("i.exr").width, 24);
  }
}

TEST_F(CommandLine, AnInterruptInTheFirstPassWaitsForIt) {
  Program program(scratch_,
                  {"render", "fog.xml", "--size", "1000x1000", "--spp", "1000", "-o", "f.exr", "--stats", "f.json"});
  ASSERT_TRUE(program.waitForStderr("rendering"));
  program.signal(SIGINT);
  const Ended r = program.wait();
  EXPECT_EQ(r.exitCode, 0) << r.err;
  EXPECT_EQ(json("f.json")["stopped_by"], "interrupted");
  EXPECT_EQ(json("f.json")["passes"], 1);
  EXPECT_EQ(picture("f.exr").width, 1000);
}

TEST_F(CommandLine, ASecondInterruptLeavesNothing) {
  Program program(scratch_, {"render", "fog.xml", "--size", "6000x6000", "-o", "f.exr"});
  ASSERT_TRUE(program.waitForStderr("rendering"));
  program.signal(SIGINT);
  ASSERT_TRUE(program.waitForStderr("once more"));
  program.signal(SIGINT);
  EXPECT_EQ(program.wait().exitCode, 130);
  EXPECT_EQ(scratch_.files(), Names{"fog.xml"});
}

// ---- the other commands ---------------------------------------------------------------------------------------------

TEST_F(CommandLine, ComparesPictures) {
  ASSERT_EQ(run({"render", "fog.xml", "--spp", "16", "--seed", "1", "--layers", "-o", "a.exr"}).exitCode, 0);
  ASSERT_EQ(run({"render", "fog.xml", "--spp", "16", "--seed", "2", "--layers", "-o", "b.exr"}).exitCode, 0);
  ASSERT_EQ(run({"render", "fog.xml", "--spp", "1", "--size", "8x8", "-o", "small.exr"}).exitCode, 0);

  const auto same = nlohmann::json::parse(run({"compare", "a.exr", "a.exr", "--json"}).out);
  EXPECT_EQ(same["mse"], 0);
  EXPECT_TRUE(same["psnr"].is_null());
  const auto other = nlohmann::json::parse(run({"compare", "a.exr", "b.exr", "--json", "--diff", "d.png"}).out);
  EXPECT_GT(other["relmse"].get<double>(), 0);
  EXPECT_GT(other["t_test"]["tests"].get<int>(), 0);
  EXPECT_EQ(picture("d.png").width, 24);
  const auto layer =
      nlohmann::json::parse(run({"compare", "a.exr", "b.exr", "--json", "--layer", "media_to_media"}).out);
  EXPECT_LT(layer["mse"].get<double>(), other["mse"].get<double>());
  EXPECT_TRUE(contains(run({"compare", "a.exr", "b.exr"}).out, "relMSE"));

  EXPECT_TRUE(contains(run({"compare", "a.exr", "b.exr", "--layer", "media_to_medai"}).err,
                       "did you mean \"media_to_media\"?"));
  EXPECT_EQ(run({"compare", "a.exr", "small.exr"}).exitCode, 1);
  EXPECT_EQ(run({"compare", "a.exr", "b.exr", "--diff", "d.exr"}).exitCode, 2);
}

TEST_F(CommandLine, TellsWhatIsInAFile) {
  ASSERT_EQ(run({"make", "smoke", "-o", "smoke.vdb", "--resolution", "16"}).exitCode, 0);
  ASSERT_EQ(run({"render", "fog.xml", "--spp", "2", "--layers", "-o", "fog.exr"}).exitCode, 0);
  const std::vector<std::pair<Names, Names>> cases = {
      {{"info", "fog.xml"}, {"24 x 16 pixels", "media: 1", "sigma_t=1.5", "emitters: 1", "2 triangles"}},
      {{"info", "fog.xml", "-D", "albedo=0.25"}, {"albedo=0.25"}},
      {{"info", "smoke.vdb"}, {"density", "fog volume", "float", "active", "bounds", "memory"}},
      {{"info", "fog.exr"}, {"24 x 16 pixels", "direct_media", "virga.passes = 2"}},
      {{"methods"}, {"path", "unbiased"}},
      {{"methods", "path"}, {"max_depth", "direct_surface"}},
  };
  for (const auto& [line, parts] : cases) {
    const Ended r = run(line);
    EXPECT_EQ(r.exitCode, 0) << r.err;
    for (const std::string& part : parts) EXPECT_TRUE(contains(r.out, part)) << part << " is not in\n" << r.out;
  }
}

TEST_F(CommandLine, MakesVolumesThatRenderAloneAndInAReadyScene) {
  for (const std::string extension : {".vol", ".nvdb", ".vdb"}) {
    const std::string volume = "smoke" + extension;
    ASSERT_EQ(run({"make", "smoke", "-o", volume, "--resolution", "16", "--scene", "smoke.xml"}).exitCode, 0);
    for (const std::string& scene : {volume, std::string("smoke.xml")}) {
      const Ended r = run({"render", scene, "--size", "16x16", "--spp", "8", "-o", scene + ".exr", "-q"});
      ASSERT_EQ(r.exitCode, 0) << r.err;
    }
    EXPECT_TRUE(identical(picture(volume + ".exr"), picture("smoke.xml.exr"))) << extension;
  }
  // The volume is named relative to the scene: the folder can be moved.
  EXPECT_FALSE(contains(scratch_.read("smoke.xml"), scratch_.path("").string()));
}

TEST_F(CommandLine, MakesSequences) {
  ASSERT_EQ(run({"make", "smoke", "-o", "puff.xml", "--frames", "3", "--resolution", "16", "--seed", "4"}).exitCode, 0);
  EXPECT_EQ(scratch_.files(), (Names{"fog.xml", "puff.0001.vol", "puff.0002.vol", "puff.0003.vol", "puff.xml"}));
  EXPECT_NE(scratch_.read("puff.0001.vol"), scratch_.read("puff.0003.vol"));
  ASSERT_EQ(run({"render", "puff.xml", "--size", "8x8", "--spp", "8", "-o", "1.exr"}).exitCode, 0);
  ASSERT_EQ(run({"render", "puff.xml", "--size", "8x8", "--spp", "8", "-D", "frame=0003", "-o", "3.exr"}).exitCode, 0);
  EXPECT_FALSE(identical(picture("1.exr"), picture("3.exr")));
}

TEST_F(CommandLine, FramesOfASequenceFitItsScene) {
  ASSERT_EQ(run({"make", "cloud", "-o", "c.vdb", "--frames", "24", "--resolution", "24", "--scene", "c.xml"}).exitCode,
            0);
  // Each frame's active voxels lie in the scene's one box: its half edges are those of the union of all frames.
  Bounds all;
  for (const std::string frame : {"0001", "0012", "0024"})
    all.extend(listGrids(scratch_.path("c." + frame + ".vdb")).at(0).worldBounds);
  const SceneSnapshot scene = buildScene(loadMitsubaXml(scratch_.path("c.xml")));
  const auto& boundary = scene->parts->boundaryShapes.at(0)->bounds;
  const float slack = 1e-5f;
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_LE(boundary.lo[axis], all.lo[axis] + slack);
    EXPECT_GE(boundary.hi[axis], all.hi[axis] - slack);
  }
}

TEST_F(CommandLine, MakesTheSameVolumeAgain) {
  for (const std::string end : {".vol", ".vdb", ".nvdb"}) {
    ASSERT_EQ(run({"make", "cloud", "-o", "a" + end, "--resolution", "20", "--seed", "3"}).exitCode, 0);
    ASSERT_EQ(run({"make", "cloud", "-o", "b" + end, "--resolution", "20", "--seed", "3"}).exitCode, 0);
    ASSERT_EQ(run({"make", "cloud", "-o", "c" + end, "--resolution", "20", "--seed", "4"}).exitCode, 0);
    EXPECT_EQ(scratch_.read("a" + end), scratch_.read("b" + end)) << end;
    EXPECT_NE(scratch_.read("a" + end), scratch_.read("c" + end)) << end;
  }
}

TEST_F(CommandLine, MakeOverwritesNoVolumeThatItWasNotTold) {
  scratch_.write("x.vol", "somebody's");
  const Ended refused = run({"make", "fog", "-o", "x.xml", "--resolution", "8"});
  EXPECT_EQ(refused.exitCode, 1);
  EXPECT_TRUE(contains(refused.err, "x.vol")) << refused.err;
  EXPECT_EQ(scratch_.read("x.vol"), "somebody's");
  ASSERT_EQ(run({"make", "fog", "-o", "x.vol", "--scene", "x.xml", "--resolution", "8"}).exitCode, 0);
  EXPECT_EQ(run({"make", "fog", "-o", "x.xml", "--resolution", "8"}).exitCode, 0) << "once made, it may be made again";
}

}  // namespace
}  // namespace virga::app
