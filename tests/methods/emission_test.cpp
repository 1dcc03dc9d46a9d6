// SPDX-License-Identifier: Apache-2.0
// Media that emit light, against integrals.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "image/scratch.h"
#include "methods/rendering.h"
#include "volume/volume_io.h"

namespace virga {
namespace {

using namespace virga::testing;

std::string box(const std::string& parameters, const std::string& type = "homogeneous") {
  return fmt::format(R"(<shape type="cube"><bsdf type="null"/><medium name="interior" type="{}">{}</medium></shape>)",
                     type, parameters);
}

std::array<stats::Moments, 3> channels(const Image& image) {
  std::array<stats::Moments, 3> m;
  for (const Rgb& p : image.pixels)
    for (size_t c = 0; c < 3; ++c) m[c].add(static_cast<double>(p[static_cast<int>(c)]));
  return m;
}

void expectRadiance(const std::string& elements, const std::array<double, 3>& truth, Layer layer, int passes = 64) {
  const RenderSession session = rendered(sceneOf(elements), {.passes = passes, .layers = LayerMask::all()});
  const auto beauty = channels(session.film().beauty()), own = channels(session.film().layer(layer));
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(own[c].mean(), truth[c], std::max(4 * own[c].standardError(), 1e-5 * truth[c])) << c;
    EXPECT_LT(own[c].standardError(), 0.01 * truth[c]) << "too few samples to tell";
    EXPECT_NEAR(beauty[c].mean(), own[c].mean(), 1e-6 + 1e-5 * truth[c]) << "light in another layer";
  }
}

// Along 2 units of an absorber of sigma that emits j a unit: j (1 - exp(-2 sigma)) / sigma.
TEST(Emission, OfAnAbsorbingSlab) {
  const auto seen = [](double j, double sigma) { return sigma > 0 ? j * (1 - std::exp(-2 * sigma)) / sigma : 2 * j; };
  const std::string camera = pinpointSensor("0, 0, 5", "0, 0, 0", "0, 1, 0", 16);
  for (const std::array<double, 3>& s : {std::array<double, 3>{0, 0, 0}, {0.7, 0.7, 0.7}, {0.1, 1, 4}, {0, 2, 0}})
    expectRadiance(camera + box(fmt::format(R"(<rgb name="sigma_t" value="{}, {}, {}"/><float name="albedo" value="0"/>
                     <rgb name="emission" value="1, 0.5, 2"/>)",
                                            s[0], s[1], s[2])),
                   {seen(1, s[0]), seen(0.5, s[1]), seen(2, s[2])}, Layer::emission, 256);
}

TEST(Emission, OfTheMediumAroundTheCamera) {
  const std::string camera = pinpointSensor("0, 0, 0", "0, 0, -1", "0, 1, 0", 16,
                                            R"(<float name="near_clip" value="0.001"/><ref id="glow"/>)");
  const std::string glow =
      R"(<medium type="homogeneous" id="glow"><float name="sigma_t" value="1"/><float name="albedo" value="0"/>
      <rgb name="emission" value="3"/></medium>)";
  const double truth = 3 * (1 - std::exp(-0.999));
  expectRadiance(glow + camera + R"(<shape type="cube"><bsdf type="null"/><ref name="interior" id="glow"/></shape>)",
                 {truth, truth, truth}, Layer::emission, 256);
}

/// A field that rises linearly along x between the outermost voxel centres, from 0 at -1 to 2 at +1.
std::string rampFile(const std::string& format) {
  DenseVolume volume;
  constexpr int kN = 16;
  volume.nx = volume.ny = volume.nz = kN;
  for (int i = 0; i < kN * kN * kN; ++i) volume.values.push_back(2 * (static_cast<float>(i % kN) + 0.5f) / kN);
  volume.indexToWorld = Matrix4::translation(-1, -1, -1) * Matrix4::scaling(2.0 / kN, 2.0 / kN, 2.0 / kN) *
                        Matrix4::translation(0.5, 0.5, 0.5);
  const std::filesystem::path path = scratchFile("ramp." + format);
  if (format == "vol") writeVol(path, volume);
  if (format == "vdb") writeVdb(path, volume);
  return path.string();
}

TEST(Emission, OfAGrid) {
  const std::string camera = pinpointSensor("5, 0, 0", "0, 0, 0", "0, 1, 0", 16);
  const std::string placed =
      R"(<transform name="to_world"><scale value="2"/><translate value="-1, -1, -1"/></transform>)";
  for (const std::string format : {"vol", "vdb"}) {
    const std::string volume =
        fmt::format(R"(<volume name="emission" type="{}"><string name="filename" value="{}"/>{}</volume>)",
                    format == "vol" ? "gridvolume" : "vdb", rampFile(format), format == "vol" ? placed : "");
    // From x = 1 inwards the ramp is 1 + x, damped by exp(-(1 - x) sigma); but for half a voxel at each end, where it
    // is flat (.vol).
    const double sigma = 0.8;
    const auto damped = [&](double x) {
      const double value = format == "vol" ? std::clamp(1 + x, 0.0625, 1.9375) : 1 + x;
      return value * std::exp(-(1 - x) * sigma);
    };
    const bool whole = format == "vol";  // a VDB falls to its background beyond the outermost centres: a smaller cube
    const double edge = whole ? 1 : 0.9375;
    const double truth = stats::integrateInterval(
        [&](double x) { return damped(x) * std::exp(whole ? 0 : (1 - edge) * sigma); }, -edge, edge);
    const std::string cube = fmt::format(
        R"(<shape type="cube"><transform name="to_world"><scale value="{}"/></transform><bsdf type="null"/>
        <medium name="interior" type="heterogeneous"><float name="sigma_t" value="{}"/><float name="albedo" value="0"/>{}
        <rgb name="emission_scale" value="1, 2, 3"/></medium></shape>)",
        edge, sigma, volume);
    expectRadiance(camera + cube, {truth, 2 * truth, 3 * truth}, Layer::emission, 256);
  }
}

// Kirchhoff: in a closed cavity at one temperature the emission of absorbers makes up for what they take.
TEST(Emission, FurnaceWithAbsorption) {
  const std::string scene = R"(<sensor type="perspective"><float name="fov" value="50"/>
    <transform name="to_world"><lookat origin="0.3, 1, 5" target="0, 0, 0" up="0, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="32"/><integer name="height" value="32"/></film></sensor>
    <emitter type="constant"><rgb name="radiance" value="1"/></emitter>)";
  const auto cavity = [&](const char* emission) {
    return rendered(sceneOf(scene + box(fmt::format(R"(<rgb name="sigma_t" value="1, 2, 5"/>
             <rgb name="albedo" value="0.7, 0.5, 0.9"/><rgb name="emission" value="{}"/>
             <phase type="hg"><float name="g" value="0.5"/></phase>)",
                                                    emission))),
                    {.passes = 128})
        .film()
        .beauty();
  };
  const auto right = channels(cavity("0.3, 1, 0.5")), wrong = channels(cavity("0.33, 1.1, 0.55"));
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(right[c].mean(), 1, 4 * right[c].standardError()) << c;
    EXPECT_GT(wrong[c].mean(), 1 + 4 * wrong[c].standardError()) << "the test cannot fail";
  }
}

// A transparent ball of radius 1 that glows by 1 a unit, its centre 2 above a white floor: the radiance of the floor
// below it is the integral of chords, 2 sqrt(1 - 4 sin^2), over directions, by the cosine, over pi.
TEST(Emission, LightsSurfaces) {
  const std::string scene =
      pinpointSensor("0, 2, 8", "0, 0, 0", "0, 1, 0", 32) +
      R"(<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/></transform><bsdf type="diffuse">
        <rgb name="reflectance" value="1"/></bsdf></shape>
      <shape type="sphere"><point name="center" x="0" y="2" z="0"/><bsdf type="null"/><medium name="interior" type="homogeneous">
        <float name="sigma_t" value="0"/><rgb name="emission" value="1, 2, 3"/></medium></shape>)";
  const double truth = stats::integrateInterval(
      [](double theta) {
        const double s = std::sin(theta);
        return 2 * std::sqrt(std::max(0.0, 1 - 4 * s * s)) * 2 * std::cos(theta) * s;
      },
      0, std::asin(0.5));
  expectRadiance(scene, {truth, 2 * truth, 3 * truth}, Layer::directSurface, 512);
}

}  // namespace
}  // namespace virga
