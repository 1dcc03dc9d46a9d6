// SPDX-License-Identifier: Apache-2.0
// Walks from the lights: flux is conserved where it has to be. A surface that reflects next to nothing counts the
// light that meets it.
#include "transport/light_walk.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>

#include "image/scratch.h"
#include "scene/scenes.h"
#include "stats/stats.h"
#include "transport/virtual_lights.h"

namespace virga {
namespace {

using test::build;

constexpr double kPiDouble = 3.14159265358979324;
constexpr double kFlux = 4 * kPiDouble;  ///< [W] of the point light

std::string pointLight(const std::string& at = "0, 0, 0") {
  return fmt::format(R"(<emitter type="point"><point name="position" value="{}"/><rgb name="intensity" value="1"/>
    </emitter>)",
                     at);
}
std::string ballOf(double radius, const std::string& medium) {
  return fmt::format(R"(<shape type="sphere"><float name="radius" value="{}"/><bsdf type="null"/>
    <medium name="interior" type="homogeneous">{}</medium></shape>)",
                     radius, medium);
}

/// Reflectance of surfaces that count light and hardly disturb it.
constexpr double kCounter = 1e-4;
std::string diffuse(double r, double g, double b) {
  return fmt::format(R"(<bsdf type="diffuse"><rgb name="reflectance" value="{}, {}, {}"/></bsdf>)", r, g, b);
}
const std::string kCounting = diffuse(kCounter, kCounter, kCounter);

/// Sums over one walk, channel by channel.
using Triple = std::array<double, 3>;
struct WalkSums {
  std::map<int, Triple> medium;                ///< weights of vertices in media, by depth
  std::map<int, Triple> surface;               ///< of those on surfaces: flux that Lambertian reflection goes out with
  std::map<std::pair<int, int>, Triple> side;  ///< likewise; sign of z of the surface's normal, then depth
};

WalkSums sumsOf(const VirtualLights& lights, int walk) {
  WalkSums sums;
  const auto w = static_cast<size_t>(walk);
  for (size_t i = lights.firstOf[w]; i < lights.firstOf[w + 1]; ++i) {
    const LightVertex& v = lights.lights[i];
    const bool surface = v.kind == VertexKind::surface;
    if (v.surface >= 0) continue;  // not Lambertian: counters are
    for (int c = 0; c < 3; ++c) {
      const double weight = static_cast<double>(v.weight[c]) * (surface ? kPiDouble : 1);
      (surface ? sums.surface : sums.medium)[v.depth][static_cast<size_t>(c)] += weight;
      if (surface) sums.side[{v.normal.z > 0 ? 1 : -1, v.depth}][static_cast<size_t>(c)] += weight;
    }
  }
  return sums;
}

/// Mean of `value(sums of a walk)` over many walks.
template <class Value>
stats::Moments meanOf(const VirtualLights& lights, const Value& value) {
  stats::Moments m;
  for (int w = 0; w < lights.walks(); ++w) m.add(value(sumsOf(lights, w)));
  return m;
}

VirtualLights walksOf(const std::string& elements, int walks, int maxDepth = -1) {
  const SceneSnapshot scene = build(elements);
  return traceVirtualLights(*scene, {.walks = walks, .maxDepth = maxDepth}, {1, 0, 0, 0});
}

double valueAt(const std::map<int, Triple>& map, int depth, int channel) {
  const auto found = map.find(depth);
  return found == map.end() ? 0 : found->second[static_cast<size_t>(channel)];
}

/// `m` is `expected`, to that precision; one comparison in 30,000 fails by chance.
void expectMean(const stats::Moments& m, double expected, double precision, const std::string& what) {
  EXPECT_NEAR(m.mean(), expected, 4 * m.standardError() + 1e-5 * expected) << what;
  EXPECT_LT(m.standardError(), precision * expected) << what << ": too few walks to tell";
}

// --- media ---

// In a medium without end all of the flux meets it, time and again; each time its albedo is left.
TEST(LightWalk, EndlessMediumLeavesThePowersOfItsAlbedo) {
  const Triple albedo = {0.9, 0.5, 0.7};
  for (const char* phase :
       {R"(<phase type="isotropic"/>)", R"(<phase type="hg"><float name="g" value="0.8"/></phase>)"}) {
    const VirtualLights lights = walksOf(
        pointLight() +
            ballOf(1e4, std::string(R"(<float name="sigma_t" value="1"/><rgb name="albedo" value="0.9, 0.5, 0.7"/>)") +
                            phase),
        20'000);
    for (int depth = 1; depth <= 6; ++depth)
      for (int c = 0; c < 3; ++c)
        expectMean(meanOf(lights, [&](const WalkSums& s) { return valueAt(s.medium, depth, c); }),
                   kFlux * std::pow(albedo[static_cast<size_t>(c)], depth), 0.02,
                   fmt::format("depth {} channel {}", depth, c));
  }
}

/// Distances between neighbouring vertices of walks, from depth `first` on.
std::vector<double> flights(const VirtualLights& lights) {
  std::vector<double> result;
  for (size_t w = 0; w + 1 < lights.firstOf.size(); ++w)
    for (size_t i = lights.firstOf[w]; i + 1 < lights.firstOf[w + 1]; ++i)
      result.push_back(static_cast<double>(distance(lights.lights[i].p, lights.lights[i + 1].p)));
  return result;
}

TEST(LightWalk, FreePathsAreExponential) {
  const VirtualLights lights = walksOf(
      pointLight() + ballOf(1e4, R"(<float name="sigma_t" value="0.7"/><float name="albedo" value="0.8"/>)"), 20'000);
  const auto p = [&](double sigmaT) {
    return stats::kolmogorovSmirnov(flights(lights), [=](double t) { return -std::expm1(-sigmaT * t); });
  };
  EXPECT_GT(p(0.7), 1e-4);
  EXPECT_LT(p(0.72), 1e-4) << "the test cannot fail";
}

TEST(LightWalk, ChannelsOfAChromaticMediumAreEachRight) {
  const Triple albedo = {0.9, 0.6, 0.8};
  const VirtualLights lights =
      walksOf(pointLight() +
                  ballOf(1e4, R"(<rgb name="sigma_t" value="0.1, 0.4, 1"/><rgb name="albedo" value="0.9, 0.6, 0.8"/>)"),
              40'000);
  for (int depth = 1; depth <= 3; ++depth)
    for (int c = 0; c < 3; ++c)
      expectMean(meanOf(lights, [&](const WalkSums& s) { return valueAt(s.medium, depth, c); }),
                 kFlux * std::pow(albedo[static_cast<size_t>(c)], depth), 0.03,
                 fmt::format("depth {} channel {}", depth, c));
}

// Straight through a ball of fog: what is left of it.
TEST(LightWalk, ChannelsPassAChromaticMediumByBeersLaw) {
  const Triple sigmaT = {0.1, 0.4, 1};
  const VirtualLights lights = walksOf(
      pointLight() + ballOf(1, R"(<rgb name="sigma_t" value="0.1, 0.4, 1"/><float name="albedo" value="0.5"/>)") +
          R"(<shape type="sphere"><float name="radius" value="5"/><boolean name="flip_normals" value="true"/>)" +
          kCounting + "</shape>",
      40'000);
  for (int c = 0; c < 3; ++c) {
    const auto passed = meanOf(lights, [&](const WalkSums& s) { return valueAt(s.surface, 1, c) / kCounter; });
    const double expected = kFlux * std::exp(-sigmaT[static_cast<size_t>(c)]);
    expectMean(passed, expected, 0.02, fmt::format("channel {}", c));
    EXPECT_GT(std::fabs(passed.mean() - 1.1 * expected), 4 * passed.standardError()) << "the test cannot fail";
  }
}

// Van de Hulst's slab of albedo 0.9, g 0.75, optical thickness 2: reflectance 0.09739, transmittance 0.66096.
TEST(LightWalk, SlabReflectsAndTransmitsAsPublished) {
  const auto counter = [](double z, double turn) {
    return fmt::format(R"(<shape type="rectangle"><transform name="to_world"><scale value="5000"/>
      <rotate x="1" angle="{}"/><translate z="{}"/></transform>{}</shape>)",
                       turn, z, kCounting);
  };
  const VirtualLights lights = walksOf(
      R"(<emitter type="spot"><float name="cutoff_angle" value="0.1"/><float name="beam_width" value="0.05"/><rgb name="intensity" value="1e6"/>
      <transform name="to_world"><lookat origin="0, 0, 1.5" target="0, 0, 0" up="0, 1, 0"/></transform></emitter>
      <shape type="cube"><transform name="to_world"><scale x="500" y="500" z="1"/></transform><bsdf type="null"/>
      <medium name="interior" type="homogeneous"><float name="sigma_t" value="1"/><float name="albedo" value="0.9"/>
      <phase type="hg"><float name="g" value="0.75"/></phase></medium></shape>)" +
          counter(2, 180) + counter(-2, 0),
      60'000);
  // The spot's rays are weighed by where they go; each walk by its own start.
  double emitted = 0;
  stats::Moments reflected, transmitted, absorbed, all;
  for (int w = 0; w < lights.walks(); ++w) {
    const WalkSums s = sumsOf(lights, w);
    double up = 0, down = 0, lost = 0;
    for (const auto& [key, flux] : s.side) (key.first < 0 ? up : down) += flux[0] / kCounter;
    for (const auto& [depth, weight] : s.medium) lost += weight[0] * (1 / 0.9 - 1);
    reflected.add(up), transmitted.add(down), absorbed.add(lost), all.add(up + down + lost);
  }
  const double b = 0.05 * kPiDouble / 180, c = 0.1 * kPiDouble / 180;
  emitted = 1e6 * 2 * kPiDouble * (1 - (std::sin(c) - std::sin(b)) / (c - b));
  expectMean(reflected, 0.09739 * emitted, 0.015, "reflected");
  expectMean(transmitted, 0.66096 * emitted, 0.01, "transmitted");
  expectMean(absorbed, (1 - 0.09739 - 0.66096) * emitted, 0.01, "absorbed");
  expectMean(all, emitted, 0.01, "all of it");
}

// --- surfaces ---

std::string room(const std::string& bsdf) {
  return R"(<shape type="cube"><boolean name="flip_normals" value="true"/>)" + bsdf + "</shape>";
}

TEST(LightWalk, AClosedRoomLeavesThePowersOfItsReflectance) {
  const Triple rho = {0.9, 0.5, 1};
  const std::string rooms[] = {
      room(diffuse(0.9, 0.5, 1)),
      R"(<shape type="sphere"><float name="radius" value="2"/><boolean name="flip_normals" value="true"/>)" +
          diffuse(0.9, 0.5, 1) + "</shape>"};
  for (const std::string& walls : rooms) {
    const VirtualLights lights = walksOf(pointLight("0.3, 0.2, -0.1") + walls, 20'000, 6);
    for (int depth = 1; depth <= 6; ++depth)
      for (int c = 0; c < 3; ++c)
        expectMean(meanOf(lights, [&](const WalkSums& s) { return valueAt(s.surface, depth, c); }),
                   kFlux * std::pow(rho[static_cast<size_t>(c)], depth), 0.02,
                   fmt::format("depth {} channel {}", depth, c));
  }
}

// Fog and walls share the flux between them.
TEST(LightWalk, FogInAClosedRoom) {
  const VirtualLights lights = walksOf(
      pointLight("0.3, 0.2, -0.1") + room(diffuse(0.8, 0.8, 0.8)) +
          R"(<shape type="cube"><bsdf type="null"/><medium name="interior" type="homogeneous"><float name="sigma_t" value="0.7"/>
        <float name="albedo" value="0.8"/></medium></shape>)",
      20'000);
  for (int depth = 1; depth <= 5; ++depth)
    expectMean(
        meanOf(lights, [&](const WalkSums& s) { return valueAt(s.medium, depth, 0) + valueAt(s.surface, depth, 0); }),
        kFlux * std::pow(0.8, depth), 0.02, fmt::format("depth {}", depth));
}

std::string inCountingSphere(const std::string& elements) {
  return elements +
         R"(<shape type="sphere"><float name="radius" value="6"/><boolean name="flip_normals" value="true"/>)" +
         kCounting + "</shape>";
}
stats::Moments counted(const std::string& elements, int walks = 20'000) {
  return meanOf(walksOf(inCountingSphere(elements), walks), [](const WalkSums& s) {
    double sum = 0;
    for (const auto& [depth, flux] : s.surface) sum += flux[0] / kCounter;
    return sum;
  });
}

// Refraction scales radiance, not flux.
TEST(LightWalk, GlassKeepsTheFlux) {
  const std::string ball = R"(<shape type="sphere"><bsdf type="dielectric"/></shape>)";
  const std::string lamp = R"(<shape type="sphere"><float name="radius" value="0.3"/>)" + diffuse(0, 0, 0) +
                           R"(<emitter type="area"><rgb name="radiance" value="1"/></emitter></shape>)";
  expectMean(counted(pointLight("0.3, 0.2, 0.1") + ball), kFlux, 0.01, "from within");
  expectMean(counted(pointLight("2, 0.2, 0.1") + ball), kFlux, 0.01, "from outside");
  // Light that the glass mirrors back to the lamp ends there.
  const stats::Moments fromLamp = counted(lamp + ball);
  EXPECT_LT(fromLamp.mean(), kPiDouble * kFlux * 0.09);
  EXPECT_GT(fromLamp.mean(), 0.9 * kPiDouble * kFlux * 0.09);
}
TEST(LightWalk, PanesKeepTheFlux) {
  const std::string pane = R"(<shape type="rectangle"><transform name="to_world"><scale value="3"/><translate z="{}"/>
    </transform><bsdf type="thindielectric"/></shape>)";
  expectMean(counted(pointLight() + fmt::format(fmt::runtime(pane), 0.5) + fmt::format(fmt::runtime(pane), -1)), kFlux,
             0.01, "between panes");
}
TEST(LightWalk, MirrorsTakeTheirShare) {
  expectMean(
      counted(
          pointLight("0, 0, 1") +
          R"(<shape type="rectangle"><transform name="to_world"><scale value="1e4"/></transform><bsdf type="conductor">
      <string name="material" value="none"/><rgb name="specular_reflectance" value="0.6"/></bsdf></shape>)"),
      // Seen from the light, the counting sphere ends where the mirror is sqrt(37) away.
      kFlux * (0.5 * (1 + 1 / std::sqrt(37.)) + 0.6 * 0.5 * (1 - 1 / std::sqrt(37.))), 0.01, "mirrored light");
}

// What bounces between facets is lost.
TEST(LightWalk, RoughMetalNeverGains) {
  for (const char* alpha : {"0.1", "0.5"}) {
    const stats::Moments m = counted(
        pointLight("1.5, 0.2, 0.1") +
        fmt::format(
            R"(<shape type="sphere"><bsdf type="roughconductor"><float name="alpha" value="{}"/><string name="material" value="none"/></bsdf></shape>)",
            alpha));
    EXPECT_LT(m.mean(), kFlux + 4 * m.standardError()) << alpha;
    EXPECT_GT(m.mean(), 0.93 * kFlux) << alpha;
  }
}

// A flat plate that scatters as if it were tilted by an angle t. Lit along its true normal it has radiance in
// proportion to cos(t), on directions above both planes, and sends it out by the true cosine: cos(t) (1 + cos(t)) / 2
// of the flux. (Veach 1997, 5.3. A walk without his correction would carry (1 + cos(t)) / 2.)
TEST(LightWalk, ShadingNormalsScatterAsTheyDoTowardTheEye) {
  const auto path = scratchFile("plate.obj");
  const double tilt = 40 * kPiDouble / 180, cutoff = 3 * kPiDouble / 180, beam = 2.9 * kPiDouble / 180;
  std::ofstream(path) << fmt::format(
      "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvn {} 0 {}\nf 1//1 2//1 3//1\nf 1//1 3//1 4//1\n", std::sin(tilt),
      std::cos(tilt));
  const stats::Moments m = counted(
      R"(<emitter type="spot"><float name="cutoff_angle" value="3"/><float name="beam_width" value="2.9"/><rgb name="intensity" value="1"/>
      <transform name="to_world"><lookat origin="0, 0, 3" target="0, 0, 0" up="0, 1, 0"/></transform></emitter>)" +
          fmt::format(R"(<shape type="obj"><string name="filename" value="{}"/>{}</shape>)", path.string(),
                      diffuse(1, 1, 1)),
      60'000);
  const double flux = 2 * kPiDouble * (1 - (std::sin(cutoff) - std::sin(beam)) / (cutoff - beam));
  expectMean(m, flux * std::cos(tilt) * (1 + std::cos(tilt)) / 2, 0.01, "tilted");
}

// --- depth ---

TEST(LightWalk, DepthCountsWhatMirrorsButNotWhatPasses) {
  // Straight down through a pane to a mirror, up through the pane, to the ceiling.
  const std::string level =
      R"(<shape type="rectangle"><transform name="to_world"><scale value="30"/><rotate x="1" angle="{}"/>
    <translate z="{}"/></transform>{}</shape>)";
  const VirtualLights lights = walksOf(
      R"(<emitter type="spot"><float name="cutoff_angle" value="1"/><float name="beam_width" value="0.5"/><rgb name="intensity" value="1"/>
      <transform name="to_world"><lookat origin="0, 0, 1" target="0.2, 0, 0" up="0, 1, 0"/></transform></emitter>)" +
          fmt::format(fmt::runtime(level), 180, 2, diffuse(0.5, 0.5, 0.5)) +
          fmt::format(fmt::runtime(level), 0, 0.5, R"(<bsdf type="thindielectric"/>)") +
          fmt::format(fmt::runtime(level), 0, -1,
                      R"(<bsdf type="conductor"><string name="material" value="none"/></bsdf>)"),
      2000, 2);
  EXPECT_GT(lights.lights.size(), 1000u);
  for (const LightVertex& v : lights.lights) {
    EXPECT_EQ(v.depth, 2) << "the mirror, or the pane as one, and the ceiling";
    EXPECT_NEAR(v.p.z, 2, 1e-4f);
  }
}

}  // namespace
}  // namespace virga
