// SPDX-License-Identifier: Apache-2.0
// Pictures of rough, thin, textured and round surfaces against pictures of what they must equal.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "image/image_io.h"
#include "image/scratch.h"
#include "methods/rendering.h"

namespace virga {
namespace {

using namespace virga::testing;

constexpr int kSize = 32;

std::string sensor() {
  return fmt::format(R"(<sensor type="perspective"><float name="fov" value="40"/>
    <transform name="to_world"><lookat origin="0.4, 1.2, 5" target="0, -0.1, 0" up="0, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="{0}"/><integer name="height" value="{0}"/><rfilter type="box"/></film>
    </sensor>)",
                     kSize);
}

constexpr const char* kGround =
    R"(<shape type="rectangle"><transform name="to_world"><scale value="4"/><rotate x="1" angle="-90"/>
  <translate y="-1.01"/></transform></shape>)";
constexpr const char* kLamp = R"(<shape type="rectangle"><transform name="to_world"><scale value="0.7"/>
  <rotate x="1" angle="90"/><translate x="-0.8" y="2.5" z="0.5"/></transform><emitter type="area">
  <rgb name="radiance" value="8"/></emitter></shape>)";
constexpr const char* kSky = R"(<emitter type="constant"><rgb name="radiance" value="0.5"/></emitter>)";
constexpr const char* kFog = R"(<medium name="interior" type="homogeneous"><float name="sigma_t" value="1.5"/>
  <rgb name="albedo" value="0.9, 0.7, 0.5"/></medium>)";

std::string ball(const std::string& bsdf, const std::string& parameters, const std::string& inside = "") {
  return fmt::format(R"(<shape type="sphere"><bsdf type="{}">{}</bsdf>{}</shape>)", bsdf, parameters, inside);
}
std::string number(const char* name, double value) {
  return fmt::format(R"(<float name="{}" value="{}"/>)", name, value);
}

Image picture(const std::string& elements, uint64_t seed, int passes) {
  return rendered(sceneOf(sensor() + elements), {.passes = passes, .seed = seed}).film().beauty();
}

/// Of the difference of two pictures: the mean over each quarter in standard errors, largest in size; and the error of
/// the mean over all, relative to the picture.
struct Agreement {
  double worstZ = 0, precision = 0;
};

Agreement agreement(const Image& a, const Image& b) {
  stats::Moments quarters[4], all, level;
  for (int y = 0; y < a.height; ++y)
    for (int x = 0; x < a.width; ++x) {
      const auto d = static_cast<double>(mean(a.at(x, y)) - mean(b.at(x, y)));
      quarters[(2 * x >= a.width ? 1 : 0) + (2 * y >= a.height ? 2 : 0)].add(d);
      all.add(d);
      level.add(static_cast<double>(mean(b.at(x, y))));
    }
  Agreement result{0, all.standardError() / level.mean()};
  for (const stats::Moments& q : quarters)
    result.worstZ = std::max(result.worstZ, std::fabs(q.mean()) / q.standardError());
  return result;
}

void expectSame(const std::string& a, const std::string& b, int passes = 512) {
  Agreement result = agreement(picture(a, 1, passes), picture(b, 2, passes));
  // By chance one pair in a hundred misses by 3 of four quarters: an independent second look tells.
  if (result.worstZ > 3) result = agreement(picture(a, 3, 4 * passes), picture(b, 4, 4 * passes));
  EXPECT_LT(result.worstZ, 3.2);
  EXPECT_LT(result.precision, 0.006) << "too few samples to tell";
}

// The smooth ones are found by chance alone, the rough ones by connection too.
TEST(Surfaces, HardlyRoughMetalIsSmooth) {
  const std::string world = std::string(kGround) + kLamp + kSky;
  const std::string gold = R"(<string name="material" value="Au"/>)";
  for (const char* distribution : {"beckmann", "ggx"})
    expectSame(
        world + ball("conductor", gold),
        world + ball("roughconductor", gold + number("alpha", 1e-3) +
                                           fmt::format(R"(<string name="distribution" value="{}"/>)", distribution)));
}

TEST(Surfaces, HardlyRoughGlassIsSmoothGlassAroundAMediumToo) {
  const std::string world = std::string(kGround) + kLamp + kSky;
  expectSame(world + ball("dielectric", ""), world + ball("roughdielectric", number("alpha", 1e-3)));
  expectSame(world + ball("dielectric", "", kFog), world + ball("roughdielectric", number("alpha", 1e-3), kFog));
}

TEST(Surfaces, RoughGlassIsNotSmoothGlass) {
  const std::string world = std::string(kGround) + kLamp + kSky;
  const Image smooth = picture(world + ball("dielectric", ""), 1, 512);
  EXPECT_GT(agreement(smooth, picture(world + ball("roughdielectric", number("alpha", 0.15)), 2, 512)).worstZ, 3.2)
      << "the tests above cannot fail";
}

// Connections through the glass and directions that find the lamp by chance must agree about the medium behind it: a
// small lamp is found by the first, a sky by the second.
TEST(Surfaces, RoughGlassHasTheSameLightInsideByConnectionAndByChance) {
  const auto lamp = [](double radius) {
    return fmt::format(
        R"(<shape type="sphere"><point name="center" x="-2" y="3" z="2"/><float name="radius" value="{}"/>
      <emitter type="area"><rgb name="radiance" value="{}"/></emitter></shape>)",
        radius, 4 / (radius * radius));
  };
  const std::string glass = ball("roughdielectric", number("alpha", 0.3), kFog);
  expectSame(kGround + glass + lamp(0.5), kGround + glass + lamp(0.05), 1024);
}

TEST(Surfaces, APaneOfIndexOneIsANullBoundary) {
  const std::string same = number("int_ior", 1.5) + number("ext_ior", 1.5);
  const std::string world = std::string(kGround) + kSky;
  expectSame(world + ball("null", "", kFog), world + ball("thindielectric", same, kFog));
}

TEST(Surfaces, APaneThatIsNoneMakesTheFogInsideBrighterOrDarker) {
  const std::string world = std::string(kGround) + kSky;
  EXPECT_GT(agreement(picture(world + ball("null", "", kFog), 1, 512),
                      picture(world + ball("thindielectric", number("int_ior", 2.0), kFog), 2, 512))
                .worstZ,
            3.2)
      << "the test above cannot fail";
}

// --- Textures

std::string bitmap(const char* name, const char* file, const char* more = "") {
  return fmt::format(R"(<texture name="{}" type="bitmap"><string name="filename" value="{}"/>{}</texture>)", name,
                     scratchFile(file).string(), more);
}
void write(const char* file, const Image& image) { writeExr(scratchFile(file), image); }

TEST(Surfaces, ABitmapOfOneColourIsThatColourBitForBit) {
  write("flat.exr", Image(4, 3, Rgb(0.8f, 0.4f, 0.1f)));
  const std::string rgb = R"(value="0.8, 0.4, 0.1"/>)", world = std::string(kGround) + kSky;
  for (const auto& [bsdf, parameter] : {std::pair("diffuse", "reflectance"),
                                        {"phong", "diffuse_reflectance"},
                                        {"roughconductor", "specular_reflectance"},
                                        {"roughdielectric", "specular_transmittance"},
                                        {"conductor", "k"},
                                        {"thindielectric", "specular_reflectance"}}) {
    const std::string other = std::string_view(bsdf) == "phong" ? number("specular_reflectance", 0.1) : "";
    const Image textured = picture(world + ball(bsdf, bitmap(parameter, "flat.exr") + other), 1, 2);
    const Image plain = picture(world + ball(bsdf, fmt::format(R"(<rgb name="{}" )", parameter) + rgb + other), 1, 2);
    EXPECT_EQ(largestDifference(textured, plain), 0) << bsdf;
  }
  const std::string lamp = R"(<shape type="sphere"><emitter type="area">)";
  const Image textured = picture(kGround + lamp + bitmap("radiance", "flat.exr") + "</emitter></shape>", 1, 2);
  const Image plain = picture(kGround + lamp + R"(<rgb name="radiance" )" + rgb + "</emitter></shape>", 1, 2);
  EXPECT_LT(largestDifference(textured, plain), 1e-6f) << "its mean chooses the light, and is rounded";
}

/// 2 x 2 colours on a rectangle that faces the ground and the camera, as one picture or as four rectangles.
const Rgb kColors[] = {Rgb(8, 1, 1), Rgb(1, 6, 1), Rgb(0.5f, 1, 9), Rgb(0.f)};
constexpr const char* kSlanted = R"(<rotate x="1" angle="40"/><translate x="0" y="0.7" z="-0.5"/>)";

std::string mosaic(const std::string& content, const std::string& smaller) {
  return R"(<shape type="rectangle"><transform name="to_world">)" + smaller + kSlanted + "</transform>" + content +
         "</shape>";
}
template <class Content>
std::string fourPieces(const Content& content) {
  std::string all;
  for (int i = 0; i < 4; ++i)
    all += mosaic(content(kColors[i]), fmt::format(R"(<scale value="0.5"/><translate x="{}" y="{}"/>)",
                                                   i % 2 == 0 ? -0.5 : 0.5, i < 2 ? -0.5 : 0.5));
  return all;
}
std::string colored(const char* name, Rgb c) {
  return fmt::format(R"(<rgb name="{}" value="{}, {}, {}"/>)", name, c.r, c.g, c.b);
}
constexpr const char* kNearest = R"(<string name="filter_type" value="nearest"/>)";

// Under a name of its own for each test: they run side by side.
void writeMosaic(const std::string& name, float scale) {
  Image image(2, 2);
  for (size_t i = 0; i < 4; ++i) image.pixels[i] = kColors[i] * scale;
  write(name.c_str(), image);
}

TEST(Surfaces, ATexturedLightIsAMosaicOfPlainOnes) {
  writeMosaic("mosaic-light.exr", 1);
  const auto light = [](const std::string& radiance) { return R"(<emitter type="area">)" + radiance + "</emitter>"; };
  const std::string pieces = fourPieces([&](Rgb c) { return light(colored("radiance", c)); });
  const std::string fog =
      fmt::format(R"(<shape type="cube"><bsdf type="null"/><transform name="to_world"><scale value="0.4"/>
    <translate y="-0.6" z="0.5"/></transform>{}</shape>)",
                  kFog);
  for (const std::string& world : {std::string(kGround), kGround + fog}) {
    expectSame(world + pieces, world + mosaic(light(bitmap("radiance", "mosaic-light.exr", kNearest)), ""));
  }
}

TEST(Surfaces, ATexturedWallIsAMosaicOfPlainOnes) {
  writeMosaic("mosaic-wall.exr", 0.1f);
  const auto wall = [](const std::string& reflectance) {
    return R"(<bsdf type="twosided"><bsdf type="diffuse">)" + reflectance + "</bsdf></bsdf>";
  };
  const std::string pieces = fourPieces([&](Rgb c) { return wall(colored("reflectance", c * 0.1f)); });
  const std::string world = std::string(kGround) + kLamp + kSky;
  expectSame(world + pieces, world + mosaic(wall(bitmap("reflectance", "mosaic-wall.exr", kNearest)), ""));
}

// --- Cylinder

// A tube of 400 flat strips.
std::string tubeFile() { return scratchFile("tube.obj").string(); }
void writeTube(bool closed) {
  FILE* out = std::fopen(tubeFile().c_str(), "w");
  constexpr int kSides = 400;
  for (int i = 0; i < kSides; ++i) {
    const double phi = 2 * 3.14159265358979 * i / kSides;
    for (const int z : {0, 1}) std::fprintf(out, "v %.9f %.9f %d\n", std::cos(phi), std::sin(phi), z);
  }
  for (int i = 0; i < kSides; ++i) {
    const int a = 2 * i + 1, b = 2 * ((i + 1) % kSides) + 1;
    std::fprintf(out, "f %d %d %d %d\n", a, b, b + 1, a + 1);
  }
  if (closed)
    for (const int z : {0, 1}) {
      std::fputs("f", out);
      for (int i = 0; i < kSides; ++i) std::fprintf(out, " %d", 2 * (z == 0 ? kSides - 1 - i : i) + 1 + z);
      std::fputs("\n", out);
    }
  std::fclose(out);
}

constexpr const char* kPose = R"(<transform name="to_world"><scale x="0.6" y="0.6" z="1.5"/><translate z="-0.75"/>
  <rotate x="1" y="0.4" z="0.2" angle="70"/></transform>)";

std::string tube(const std::string& inside) {
  return fmt::format(R"(<shape type="cylinder">{}{}</shape>)", kPose, inside);
}
std::string meshTube(const std::string& inside) {
  return fmt::format(R"(<shape type="obj"><string name="filename" value="{}"/>{}{}</shape>)", tubeFile(), kPose,
                     inside);
}

TEST(Surfaces, ACylinderIsATubeOfStrips) {
  writeTube(false);
  const std::string grey = R"(<bsdf type="twosided"><bsdf type="diffuse"/></bsdf>)",
                    world = std::string(kGround) + kSky;
  expectSame(world + kLamp + tube(grey), world + kLamp + meshTube(grey));
  const std::string light = R"(<emitter type="area"><rgb name="radiance" value="3, 2, 1"/></emitter>)";
  expectSame(kGround + tube(light), kGround + meshTube(light));
  const std::string inward = R"(<boolean name="flip_normals" value="true"/>)" + light;
  expectSame(kGround + tube(inward), kGround + meshTube(inward));
}

// With disks of index one at its ends, a tube bounds a medium as a closed mesh does.
TEST(Surfaces, AClosedCylinderBoundsAMedium) {
  writeTube(true);
  const std::string fog = R"(<medium id="fog" type="homogeneous"><float name="sigma_t" value="1.5"/>
    <rgb name="albedo" value="0.9, 0.7, 0.5"/></medium>)";
  const std::string same = number("int_ior", 1.5) + number("ext_ior", 1.5);
  const std::string pane = "<bsdf type=\"thindielectric\">" + same + "</bsdf><ref name=\"interior\" id=\"fog\"/>";
  const auto lid = [&](const char* place) {
    return fmt::format(
        R"(<shape type="disk"><transform name="to_world">{}<scale x="0.6" y="0.6" z="1.5"/><translate z="-0.75"/>
      <rotate x="1" y="0.4" z="0.2" angle="70"/></transform>{}</shape>)",
        place, pane);
  };
  const std::string world = fog + kGround + kSky;
  expectSame(world + meshTube("<bsdf type=\"null\"/><ref name=\"interior\" id=\"fog\"/>"),
             world + tube(pane) + lid(R"(<translate z="1"/>)") + lid(R"(<rotate x="1" angle="180"/>)"));
}

// A lamp in the middle of a ball of thin glass: its light meets the glass at right angles, and what goes straight on is
// found by connections. It counts as having passed glass, and the glass is no vertex: depth 2 suffices.
TEST(Surfaces, ConnectionsLookThroughThinGlass) {
  constexpr double kEta = 1.5;
  const auto floorUnder = [](const std::string& around, Layer layer) {
    const std::string scene = R"(<integrator type="path"><integer name="max_depth" value="2"/></integrator>)" +
                              pinpointSensor("0, 1, 4", "0, 0, 0", "0, 1, 0", 8) + R"(<shape type="rectangle">
        <transform name="to_world"><rotate x="1" angle="-90"/></transform></shape><emitter type="point">
        <point name="position" x="0" y="2" z="0"/></emitter>)" +
                              around;
    return pixelMoments(rendered(sceneOf(scene), {.passes = 8, .layers = LayerMask::all()}).film().layer(layer)).mean();
  };
  const std::string glass =
      fmt::format(R"(<shape type="sphere"><point name="center" x="0" y="2" z="0"/><float name="radius" value="0.7"/>
    <bsdf type="thindielectric"><float name="int_ior" value="{}"/><float name="ext_ior" value="1"/></bsdf></shape>)",
                  kEta);
  const double bare = floorUnder("", Layer::directSurface), r = std::pow((kEta - 1) / (kEta + 1), 2);
  EXPECT_NEAR(floorUnder(glass, Layer::causticSurface), bare * (1 - 2 * r / (1 + r)), 1e-4 * bare);
  EXPECT_EQ(floorUnder(glass, Layer::directSurface), 0);
}

// Light that passes the glass by chance and light that is connected to through it share: what a pane takes from a lamp
// behind it does not depend on how large the lamp is.
TEST(Surfaces, AWindowTakesTheSameOfLampsOfAnySize) {
  const auto taken = [](double radius) {
    const auto mean = [&](const std::string& window) {
      const std::string scene =
          pinpointSensor("0.5, 2, 4", "0, 0, 0", "0, 1, 0", 24) + R"(<shape type="rectangle">
          <transform name="to_world"><rotate x="1" angle="-90"/></transform></shape>)" +
          fmt::format(R"(<shape type="sphere"><point name="center" x="0" y="20" z="0"/><float name="radius" value="{}"/>
          <emitter type="area"><rgb name="radiance" value="{}"/></emitter></shape>)",
                      radius, 100 / (radius * radius)) +
          window;
      return pixelMoments(rendered(sceneOf(scene), {.passes = 256}).film().beauty());
    };
    const stats::Moments open = mean(""),
                         behind = mean(R"(<shape type="rectangle"><transform name="to_world"><scale value="9"/>
        <rotate x="1" angle="-90"/><translate y="10"/></transform><bsdf type="thindielectric"><float name="int_ior" value="2"/>
        <float name="ext_ior" value="1"/></bsdf></shape>)");
    EXPECT_LT(behind.standardError(), 4e-3 * behind.mean());
    return behind.mean() / open.mean();
  };
  const double r = 1.0 / 9, straight = 1 - 2 * r / (1 + r);
  for (const double radius : {0.01, 1.0, 3.0}) EXPECT_NEAR(taken(radius), straight, 0.012) << radius;
}

}  // namespace
}  // namespace virga
