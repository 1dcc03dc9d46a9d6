// SPDX-License-Identifier: Apache-2.0
// Extinction that differs between the channels: each channel alone is a grey picture, and the three together must not
// be noisier in colour than they have to be.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "image/scratch.h"
#include "methods/rendering.h"

namespace virga {
namespace {

using namespace virga::testing;

constexpr const char* kCamera = R"(<sensor type="perspective"><float name="fov" value="40"/>
  <transform name="to_world"><lookat origin="0.4, 0.8, 5" target="0, -0.1, 0" up="0, 1, 0"/></transform>
  <film type="hdrfilm"><integer name="width" value="24"/><integer name="height" value="24"/><rfilter type="box"/></film></sensor>)";
constexpr const char* kLamp =
    R"(<shape type="sphere"><point name="center" x="-2" y="3" z="1"/><float name="radius" value="0.4"/>
  <emitter type="area"><rgb name="radiance" value="30, 40, 50"/></emitter></shape>)";
constexpr const char* kPoint =
    R"(<emitter type="point"><point name="position" x="0.2" y="0.3" z="-1.4"/><rgb name="intensity" value="9"/></emitter>)";
constexpr const char* kGround = R"(<shape type="rectangle"><transform name="to_world"><scale value="4"/>
  <rotate x="1" angle="-90"/><translate y="-1"/></transform></shape>)";

using Coefficients = std::array<double, 3>;

// Three numbers, or one of them for all channels.
std::string colour(const Coefficients& c, int channel) {
  if (channel >= 0) return fmt::format("{}", c[static_cast<size_t>(channel)]);
  return fmt::format("{}, {}, {}", c[0], c[1], c[2]);
}

std::string box(const std::string& medium, const std::string& transform = "") {
  return fmt::format(R"(<shape type="cube"><transform name="to_world">{}</transform><bsdf type="null"/>{}</shape>)",
                     transform, medium);
}

std::string homogeneous(const Coefficients& sigmaT, int channel) {
  return fmt::format(R"(<medium name="interior" type="homogeneous"><rgb name="sigma_t" value="{}"/>
    <rgb name="albedo" value="{}"/><phase type="hg"><float name="g" value="0.3"/></phase></medium>)",
                     colour(sigmaT, channel), colour({0.95, 0.8, 0.99}, channel));
}

// Three channels of 4^3 voxels, or one of them, in a file.
std::string grid(int channel) {
  const std::filesystem::path path = scratchFile(fmt::format("colours{}.vol", channel));
  std::ofstream out(path, std::ios::binary);
  const auto put = [&](auto value) { out.write(reinterpret_cast<const char*>(&value), sizeof value); };
  out.write("VOL\3", 4);
  for (const int32_t n : {1, 4, 4, 4, channel < 0 ? 3 : 1}) put(n);
  for (const float x : {0.f, 0.f, 0.f, 1.f, 1.f, 1.f}) put(x);
  for (int i = 0; i < 64; ++i)
    for (int c = 0; c < 3; ++c) {
      const uint32_t bits = hash32(static_cast<uint32_t>(3 * i + c));
      const float value = c == 2 && i % 3 == 0 ? 0 : toUnitFloat(bits) * (c == 0 ? 4.f : 1.f);
      if (channel < 0 || channel == c) put(value);
    }
  return path.string();
}

std::string heterogeneous(const std::string& file, const Coefficients& scale, int channel) {
  return fmt::format(R"(<medium name="interior" type="heterogeneous"><volume name="sigma_t" type="gridvolume">
    <string name="filename" value="{}"/><transform name="to_world"><scale value="2"/><translate value="-1, -1, -1"/></transform>
    </volume><rgb name="scale" value="{}"/><rgb name="albedo" value="{}"/></medium>)",
                     file, colour(scale, channel), colour({0.9, 0.99, 0.9}, channel));
}

using Elements = std::function<std::string(int channel)>;

Image picture(const std::string& elements, uint64_t seed, int passes) {
  return rendered(sceneOf(elements), {.passes = passes, .seed = seed}).film().beauty();
}

// Each channel against its own grey picture, over quarters. Returns the largest deviation in standard errors.
double worstDeviation(const Elements& elements, int passes, uint64_t seed, double* precision) {
  const Image together = picture(elements(-1), seed, passes);
  double worst = 0;
  *precision = 0;
  for (int c = 0; c < 3; ++c) {
    const Image alone = picture(elements(c), seed + 10 + static_cast<uint64_t>(c), passes);
    stats::Moments quarters[4], all;
    double level = 0;
    for (int y = 0; y < alone.height; ++y)
      for (int x = 0; x < alone.width; ++x) {
        const auto d = static_cast<double>(together.at(x, y)[c] - alone.at(x, y)[c]);
        quarters[(2 * x >= alone.width ? 1 : 0) + (2 * y >= alone.height ? 2 : 0)].add(d);
        all.add(d);
        level += static_cast<double>(alone.at(x, y)[c]) / (alone.width * alone.height);
      }
    for (const stats::Moments& q : quarters) worst = std::max(worst, std::fabs(q.mean()) / q.standardError());
    *precision = std::max(*precision, all.standardError() / level);
  }
  return worst;
}

void expectChannelsAlone(const Elements& elements, int passes = 512) {
  double precision = 0;
  double worst = worstDeviation(elements, passes, 1, &precision);
  // Of twelve quarters one deviates by three by chance in thirty such tests: an independent second look tells.
  if (worst > 3) worst = worstDeviation(elements, 4 * passes, 100, &precision);
  EXPECT_LT(worst, 3.6);
  EXPECT_LT(precision, 0.012) << "too few samples to tell";
}

TEST(Spectral, ChannelsOfHomogeneousMediaAreGreyPictures) {
  expectChannelsAlone([](int c) { return std::string(kCamera) + kLamp + kGround + box(homogeneous({0.2, 2, 8}, c)); });
}
TEST(Spectral, ChannelsAHundredfoldApart) {
  expectChannelsAlone([](int c) { return std::string(kCamera) + kLamp + kGround + box(homogeneous({0.1, 1, 10}, c)); });
}
TEST(Spectral, AChannelWithoutExtinction) {
  expectChannelsAlone([](int c) { return std::string(kCamera) + kLamp + kGround + box(homogeneous({0, 3, 1}, c)); });
}
// Without end: the sky is seen, and lights the ground, in the one channel that it is clear in.
TEST(Spectral, FogWithoutEndThatIsClearInOneChannel) {
  const std::string camera(kCamera), open = camera.substr(0, camera.rfind("</sensor>"));
  const auto fog = [](int c) {
    return fmt::format(
        R"(<medium type="homogeneous"><rgb name="sigma_t" value="{}"/><rgb name="albedo" value="{}"/></medium>)",
        colour({0, 0.3, 0.1}, c), colour({0.9, 0.5, 0.4}, c));
  };
  const std::string sky = R"(<emitter type="constant"><rgb name="radiance" value="0.5, 0.7, 1"/></emitter>)";
  expectChannelsAlone([&](int c) { return open + fog(c) + "</sensor>" + sky + kLamp + kGround; });
}
TEST(Spectral, EquiangularSampling) {
  expectChannelsAlone(
      [](int c) {
        return std::string(kCamera) + kPoint + kGround + box(homogeneous({0.3, 1, 3}, c));
      },
      1024);
}
TEST(Spectral, ColouredScaleOfAGrid) {
  const std::string file = grid(1);
  expectChannelsAlone([&](int c) {
    return std::string(kCamera) + kLamp + kGround + box(heterogeneous(file, {6, 1, 3}, c));
  });
}
TEST(Spectral, GridsOfColours) {
  const std::string files[] = {grid(-1), grid(0), grid(1), grid(2)};
  expectChannelsAlone([&](int c) {
    return std::string(kCamera) + kLamp + kGround +
           box(heterogeneous(files[static_cast<size_t>(c + 1)], {1.5, 2, 3}, c));
  });
}
TEST(Spectral, MediaThatOverlap) {
  const std::string file = grid(1);
  expectChannelsAlone([&](int c) {
    return std::string(kCamera) + kLamp + kGround + box(heterogeneous(file, {6, 1, 3}, c)) +
           box(homogeneous({0.5, 0.1, 2}, c), "<scale value=\"0.8\"/><translate x=\"0.5\"/>");
  });
}
// All flights are spectral where some medium has colour, if only a speck far away.
TEST(Spectral, GreyMediaAreTheSameBesideColour) {
  const std::string speck = box(homogeneous({1, 2, 4}, -1), R"(<scale value="0.01"/><translate x="40"/>)");
  const auto means = [&](const char* sigmaT, const std::string& besides, uint64_t seed) {
    const std::string grey =
        fmt::format(R"(<medium name="interior" type="homogeneous"><float name="sigma_t" value="{}"/>
      <rgb name="albedo" value="0.95, 0.8, 0.9"/></medium>)",
                    sigmaT);
    const SceneSnapshot scene = sceneOf(std::string(kCamera) + kLamp + kGround + box(grey) + besides);
    EXPECT_EQ(scene->view.chromatic, !besides.empty());
    return replicateMoments(rendered(scene, {.passes = 512, .seed = seed}).film());
  };
  const stats::Moments alone = means("1.5", "", 1);
  EXPECT_GT(stats::welchTest(means("1.5", speck, 2), alone), 1e-3);
  EXPECT_LT(stats::welchTest(means("1.8", speck, 2), alone), 1e-3) << "denser media must be seen";
}

TEST(Spectral, TheTestNoticesFivePercent) {
  double precision = 0;
  const auto wrong = [](int c) {
    return std::string(kCamera) + kLamp + kGround +
           box(c == 1 ? homogeneous({0.2, 2.1, 8}, c) : homogeneous({0.2, 2, 8}, c));
  };
  EXPECT_GT(worstDeviation(wrong, 1024, 7, &precision), 3.6);
}

// Were the channel of each flight picked without weighing it against the others, r - g would be noisier than r itself.
TEST(Spectral, NearlyGreyMediaHaveNearlyNoColourNoise) {
  const auto noise = [](const Coefficients& sigmaT) {
    const RenderSession session =
        rendered(sceneOf(std::string(kCamera) + kLamp + kGround +
                         box(fmt::format(R"(<medium name="interior" type="homogeneous"><rgb name="sigma_t" value="{}"/>
                  <float name="albedo" value="0.9"/></medium>)",
                                         colour(sigmaT, -1)))),
                 {.passes = 8});
    // Between replicates of one pass each: the scene's own colours drop out.
    double chroma = 0, total = 0;
    const Image mean = session.film().beauty();
    for (int r = 0; r < Film::kReplicates; ++r) {
      const Image one = session.film().replicateBeauty(r);
      for (size_t i = 0; i < one.pixels.size(); ++i) {
        const Rgb lamp(30, 40, 50), d = (one.pixels[i] - mean.pixels[i]) / lamp;
        chroma += static_cast<double>(square(d.r - d.g));
        total += static_cast<double>(square(d.r));
      }
    }
    return chroma / total;
  };
  EXPECT_LT(noise({2, 2.002, 2}), 1e-4);
  EXPECT_GT(noise({0.2, 2, 20}), 1e-2) << "the test cannot fail";
}

TEST(Spectral, FurnaceIsWhiteInEveryChannel) {
  const std::string elements =
      std::string(kCamera) + R"(<emitter type="constant"><rgb name="radiance" value="1"/></emitter>)" +
      box(R"(<medium name="interior" type="homogeneous"><rgb name="sigma_t" value="0.2, 2, 20"/>
                                 <float name="albedo" value="1"/></medium>)");
  const Image image = picture(elements, 3, 256);
  for (int c = 0; c < 3; ++c) {
    stats::Moments m;
    for (const Rgb& p : image.pixels) m.add(static_cast<double>(p[c]));
    EXPECT_NEAR(m.mean(), 1, 4 * m.standardError()) << c;
    EXPECT_LT(m.standardError(), 6e-3) << c;
  }
}

}  // namespace
}  // namespace virga
