// SPDX-License-Identifier: Apache-2.0
// Rays that leave lights: all of the light's power, from where and whither it goes.
#include "transport/emitted_ray.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "core/random.h"
#include "image/image_io.h"
#include "image/scratch.h"
#include "scene/scenes.h"
#include "stats/stats.h"

namespace virga {
namespace {

constexpr double kPiDouble = 3.14159265358979324;

/// The patch z = -1.5, x and y in [-0.6, 0.6], on whose upper side light is counted; it is in the scene, so that lights
/// at infinity know of it.
constexpr float kPatchZ = -1.5f, kPatchHalf = 0.6f;
constexpr const char* kPatch = R"(<shape type="rectangle"><transform name="to_world"><scale value="0.6"/>
  <translate z="-1.5"/></transform></shape>)";

struct Light {
  std::string name, elements;
  std::array<double, 3> power;  ///< [W]
};

std::string areaLight(const std::string& shape, const std::string& inside, const std::string& radiance) {
  return fmt::format(R"(<shape type="{}">{}<emitter type="area">{}</emitter></shape>)", shape, inside, radiance);
}
std::string placed(const std::string& steps) { return "<transform name=\"to_world\">" + steps + "</transform>"; }

const std::string kColour = R"(<rgb name="radiance" value="2, 3, 4"/>)";
const std::string kBoard = R"(<texture name="radiance" type="checkerboard"><rgb name="color0" value="5, 1, 1"/>
  <rgb name="color1" value="1, 2, 3"/><transform name="to_uv"><scale x="2" y="1"/></transform></texture>)";
std::array<double, 3> ofArea(double area) { return {2 * kPiDouble * area, 3 * kPiDouble * area, 4 * kPiDouble * area}; }

/// Of a disk that hides the scene: irradiance times its area.
std::array<double, 3> throughTheScene(const std::string& elements, std::array<double, 3> irradiance) {
  const SceneSnapshot scene = test::build(elements + kPatch);
  const double radius = 0.5 * static_cast<double>(length(scene->view.bounds.extent())) * 1.001;
  for (double& channel : irradiance) channel *= kPiDouble * radius * radius;
  return irradiance;
}

/// A picture of which the radiance is known in closed form all over the sphere: 2 + cos(angle from +y).
std::string skyFile() {
  const auto path = scratchFile("sky.exr");
  Image image(64, 257);
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x) {
      const float cosine = std::cos(kPi * static_cast<float>(y) / 256);
      image.pixels[static_cast<size_t>(y * image.width + x)] = Rgb(2 + cosine, 1, 2 - cosine);
    }
  writeExr(path, image);
  return path.string();
}

std::vector<Light> lights() {
  const std::string directional = R"(<emitter type="directional"><vector name="direction" x="0.3" y="0.2" z="-1"/>
    <rgb name="irradiance" value="1, 2, 3"/></emitter>)";
  const std::string constant = R"(<emitter type="constant"><rgb name="radiance" value="1, 2, 3"/></emitter>)";
  const std::string sky = fmt::format(R"(<emitter type="envmap"><string name="filename" value="{}"/>
    <transform name="to_world"><rotate x="1" angle="90"/></transform></emitter>)",
                                      skyFile());
  const double beam = 0.3, cutoff = 0.8;  // [rad]
  // Linear in the angle from the beam's edge to the cutoff: by parts, 2 pi (sin c - sin b) / (c - b) less 1.
  const double spot = 2 * kPiDouble * (1 - (std::sin(cutoff) - std::sin(beam)) / (cutoff - beam));
  constexpr double fourPi = 4 * kPiDouble;
  return {
      {"point",
       R"(<emitter type="point"><point name="position" x="0.2" y="0.1" z="0"/><rgb name="intensity" value="1, 2, 3"/></emitter>)",
       {fourPi, 2 * fourPi, 3 * fourPi}},
      {"spot",
       fmt::format(R"(<emitter type="spot"><float name="cutoff_angle" value="{}"/><float name="beam_width" value="{}"/>
      <rgb name="intensity" value="1, 2, 3"/>{}</emitter>)",
                   cutoff * 180 / kPiDouble, beam * 180 / kPiDouble,
                   placed(R"(<lookat origin="0.4, 0.1, 0" target="0, 0, -1.5" up="0, 1, 0"/>)")),
       {spot, 2 * spot, 3 * spot}},
      {"directional", directional, throughTheScene(directional, {1, 2, 3})},
      {"constant", constant, throughTheScene(constant, {fourPi, 2 * fourPi, 3 * fourPi})},
      {"sky", sky, throughTheScene(sky, {2 * fourPi, fourPi, 2 * fourPi})},
      {"rectangle", areaLight("rectangle", placed(R"(<scale x="0.5" y="0.3"/><rotate x="1" angle="150"/>)"), kColour),
       ofArea(0.6)},
      {"textured rectangle",
       areaLight("rectangle", placed(R"(<scale x="0.5" y="0.3"/><rotate x="1" angle="150"/>)"), kBoard),
       {3 * 0.6 * kPiDouble, 1.5 * 0.6 * kPiDouble, 2 * 0.6 * kPiDouble}},
      {"disk", areaLight("disk", placed(R"(<scale value="0.5"/><rotate y="1" angle="160"/>)"), kColour),
       ofArea(0.25 * kPiDouble)},
      {"textured disk",
       areaLight("disk", placed(R"(<scale value="0.5"/><rotate y="1" angle="160"/>)"), kBoard),
       {3 * 0.25 * kPiDouble * kPiDouble, 1.5 * 0.25 * kPiDouble * kPiDouble, 2 * 0.25 * kPiDouble * kPiDouble}},
      {"sphere",
       areaLight("sphere", R"(<float name="radius" value="0.4"/><point name="center" x="0.2" y="0" z="0"/>)", kColour),
       ofArea(0.64 * kPiDouble)},
      {"cylinder",
       areaLight("cylinder", R"(<float name="radius" value="0.2"/><point name="p0" x="-0.5" y="0" z="0"/>
      <point name="p1" x="0.5" y="0" z="0.2"/>)",
                 kColour),
       ofArea(0.4 * kPiDouble * std::hypot(1, 0.2))},
      {"mesh", areaLight("cube", placed(R"(<scale x="0.4" y="0.2" z="0.3"/><rotate x="1" angle="30"/>)"), kColour),
       ofArea(8 * (0.4 * 0.2 + 0.2 * 0.3 + 0.3 * 0.4))}};
}

class Emission {
 public:
  explicit Emission(const Light& light, const EmissionTargets& targets = {})
      : scene_(test::build(light.elements + kPatch)), targets_(targets) {}
  EmittedRay ray(Pcg32& random) const {
    const Vec2 position{random.next(), random.next()}, direction{random.next(), random.next()};
    return sampleEmittedRay(scene_->view, scene_->view.emitters[0], scene_->view.bounds, position, direction, targets_);
  }
  const SceneView& view() const { return scene_->view; }

 private:
  SceneSnapshot scene_;
  EmissionTargets targets_;
};

TEST(EmittedRay, CarriesTheLightsPower) {
  for (const Light& light : lights()) {
    const Emission emission(light);
    stats::Moments flux[3];
    Pcg32 random(1);
    for (int i = 0; i < 100'000; ++i) {
      const EmittedRay r = emission.ray(random);
      ASSERT_NEAR(length(r.ray.d), 1, 1e-5f) << light.name;
      for (int c = 0; c < 3; ++c) flux[c].add(static_cast<double>(r.flux[c]));
    }
    for (int c = 0; c < 3; ++c) {
      const double power = light.power[static_cast<size_t>(c)];
      // The sky is linear between its pixels, and single precision adds up.
      EXPECT_NEAR(flux[c].mean() / power, 1, 4 * flux[c].standardError() / power + 2e-4) << light.name << " " << c;
      EXPECT_LT(flux[c].standardError() / power, 0.005) << light.name << ": too few samples to tell";
    }
  }
}

// --- where the light arrives ---

constexpr int kCells = 4;

/// Light on the cells of the patch, by emitted rays [W]. `shift` is how far the patch is moved for them: a test of the
/// test.
std::vector<stats::Moments> byRays(const Emission& emission, int channel, float shift) {
  std::vector<stats::Moments> cells(kCells * kCells);
  Pcg32 random(2);
  for (int i = 0; i < 300'000; ++i) {
    const EmittedRay r = emission.ray(random);
    const float t = (kPatchZ - r.ray.o.z) / r.ray.d.z;
    const Vec3 p = r.ray.at(t);
    const float x = (p.x + shift + kPatchHalf) / (2 * kPatchHalf), y = (p.y + kPatchHalf) / (2 * kPatchHalf);
    const bool meets = t > 0 && r.ray.d.z < 0 && x >= 0 && x < 1 && y >= 0 && y < 1;
    const int met = meets ? static_cast<int>(x * kCells) + kCells * static_cast<int>(y * kCells) : -1;
    for (int c = 0; c < kCells * kCells; ++c)
      cells[static_cast<size_t>(c)].add(c == met ? static_cast<double>(r.flux[channel]) : 0);
  }
  return cells;
}

/// The same by points on the cells that look for the light.
std::vector<stats::Moments> byConnections(const Emission& emission, int channel) {
  std::vector<stats::Moments> cells(kCells * kCells);
  const double area = 4 * static_cast<double>(kPatchHalf * kPatchHalf) / (kCells * kCells);
  Pcg32 random(3);
  for (int i = 0; i < 10'000 * kCells * kCells; ++i) {
    const int cell = i % (kCells * kCells);
    const float x = (static_cast<float>(cell % kCells) + random.next()) / kCells;
    const float y = (static_cast<float>(cell / kCells) + random.next()) / kCells;
    const Vec3 p((2 * x - 1) * kPatchHalf, (2 * y - 1) * kPatchHalf, kPatchZ);
    const Vec2 u{random.next(), random.next()};
    const LightSample s = sampleLight(emission.view(), emission.view().emitters[0], p, u);
    const bool above = s.pdf > 0 && s.wi.z > 0;
    cells[static_cast<size_t>(cell)].add(above ? area * static_cast<double>(s.radiance[channel] * s.wi.z / s.pdf) : 0);
  }
  return cells;
}

double arrivalP(const Light& light, float shift = 0, const EmissionTargets& targets = {}) {
  const Emission emission(light, targets);
  double p = 1;
  for (const int channel : {0, 2}) {
    const auto rays = byRays(emission, channel, shift), connections = byConnections(emission, channel);
    double statistic = 0, all = 0, variance = 0;
    for (size_t c = 0; c < rays.size(); ++c) {
      const double difference = rays[c].mean() - connections[c].mean();
      const double v = std::pow(rays[c].standardError(), 2) + std::pow(connections[c].standardError(), 2);
      statistic += difference * difference / v, all += difference, variance += v;
    }
    p = std::min({p, stats::chiSquaredTail(statistic, kCells * kCells), stats::zTest(all, 0, std::sqrt(variance))});
  }
  return p;
}

TEST(EmittedRay, ArrivesWhereTheLightIsSeen) {
  for (const Light& light : lights()) EXPECT_GT(arrivalP(light), 1e-4) << light.name;
}

// --- aimed at a part of the scene: the same light, and more of the rays ---

/// The share of the rays that meet a sphere.
double meets(const Light& light, const EmissionTargets& targets, const EmissionTargets::Sphere& sphere) {
  const Emission emission(light, targets);
  Pcg32 random(4);
  const int n = 20'000;
  int met = 0;
  for (int i = 0; i < n; ++i) {
    const EmittedRay r = emission.ray(random);
    const Vec3 way = sphere.center - r.ray.o;
    met += !isBlack(r.flux) && length(way - r.ray.d * dot(way, r.ray.d)) < sphere.radius && dot(way, r.ray.d) > 0;
  }
  return static_cast<double>(met) / n;
}

EmissionTargets at(std::initializer_list<EmissionTargets::Sphere> spheres) {
  EmissionTargets targets;
  for (const EmissionTargets::Sphere& s : spheres) targets.add(s);
  return targets;
}

TEST(EmittedRay, AimedRaysCarryTheSameLight) {
  const EmissionTargets::Sphere sphere{{0.2f, 0, kPatchZ}, 0.3f, 0.6f};  // the patch is in it in part
  for (const Light& light : lights()) {
    EXPECT_GT(arrivalP(light, 0, at({sphere})), 1e-4) << light.name;
    EXPECT_GT(meets(light, at({sphere}), sphere), 1.3 * meets(light, {}, sphere)) << light.name;
  }
}

// Targets that overlap, one beside them, and one around all lamps, at which no lamp among them can aim.
TEST(EmittedRay, RaysAimedAtManyPlacesCarryTheSameLight) {
  const EmissionTargets::Sphere left{{-0.3f, 0.2f, kPatchZ}, 0.25f, 0.2f}, over{{-0.1f, 0, kPatchZ}, 0.3f, 0.2f},
      right{{0.4f, -0.3f, kPatchZ}, 0.15f, 0.2f}, around{{0, 0, 0}, 1.4f, 0.2f};
  const EmissionTargets all = at({left, over, right, around});
  for (const Light& light : lights()) {
    EXPECT_GT(arrivalP(light, 0, all), 1e-4) << light.name;
    for (const EmissionTargets::Sphere& s : {left, right})
      EXPECT_GT(meets(light, all, s), 1.3 * meets(light, {}, s)) << light.name;
  }
}

// What comes evenly from all around, or from everywhere in one direction, does not tell one place from another.
TEST(EmittedRay, ArrivalElsewhereIsNoticed) {
  for (const Light& light : lights()) {
    if (light.name == "directional" || light.name == "constant" || light.name == "sky") continue;
    EXPECT_LT(arrivalP(light, 0.15f), 1e-4) << light.name;
  }
}
TEST(EmittedRay, AnotherBrightnessIsNoticed) {
  for (const Light& light : lights()) {
    const Emission right(light);
    // 5 % more light from every cell of the patch.
    const auto rays = byRays(right, 1, 0), connections = byConnections(right, 1);
    double all = 0, variance = 0;
    for (size_t c = 0; c < rays.size(); ++c) {
      all += 1.05 * rays[c].mean() - connections[c].mean();
      variance += std::pow(rays[c].standardError(), 2) + std::pow(connections[c].standardError(), 2);
    }
    EXPECT_LT(stats::zTest(all, 0, std::sqrt(variance)), 1e-4) << light.name;
  }
}

// --- densities ---

/// Directions against a density about an axis.
double directionP(const Light& light, Vec3 axis, const std::function<double(Vec3)>& density) {
  const Emission emission(light);
  Pcg32 random(4);
  return stats::chiSquared(
      {.axis = axis, .samples = 100'000},
      [&](Vec2 u) {
        return sampleEmittedRay(emission.view(), emission.view().emitters[0], emission.view().bounds,
                                {random.next(), random.next()}, u)
            .ray.d;
      },
      density);
}
const Light& named(const std::vector<Light>& all, const std::string& name) {
  return *std::find_if(all.begin(), all.end(), [&](const Light& l) { return l.name == name; });
}

TEST(EmittedRay, DirectionsFollowTheirDensity) {
  const std::vector<Light> all = lights();
  for (const char* name : {"point", "constant"}) {
    EXPECT_GT(directionP(named(all, name), {0, 0, 1}, [](Vec3) { return 0.25 / kPiDouble; }), 1e-4) << name;
    EXPECT_LT(directionP(named(all, name), {0, 0, 1},
                         [](Vec3 w) { return 0.25 / kPiDouble * (1 + 0.06 * static_cast<double>(w.z)); }),
              1e-4)
        << name << ": the test cannot fail";
  }
  for (const char* name : {"rectangle", "disk"}) {
    const Light& light = named(all, name);
    const Emission emission(light);
    const EmitterView& emitter = emission.view().emitters[0];
    const Vec3 n = uniformPointOnShape(emission.view().surfaces[emitter.shape], emitter, {0.5f, 0.5f}).normal;
    const auto cosine = [&](double power) {
      return [=](Vec3 w) {
        return (power + 1) / (2 * kPiDouble) * std::pow(std::max(0., static_cast<double>(dot(n, w))), power);
      };
    };
    EXPECT_GT(directionP(light, n, cosine(1)), 1e-4) << name;
    EXPECT_LT(directionP(light, n, cosine(1.05)), 1e-4) << name << ": the test cannot fail";
  }
}

TEST(EmittedRay, PositionsAreEvenOverTheLight) {
  const std::vector<Light> all = lights();
  const auto positionP = [&](const char* name, const std::function<Vec2(Vec3)>& square, double tilt) {
    const Emission emission(named(all, name));
    Pcg32 random(5);
    return stats::chiSquaredSquare(
        {.samples = 100'000},
        [&](Vec2 u) -> std::optional<Vec2> {
          return square(sampleEmittedRay(emission.view(), emission.view().emitters[0], emission.view().bounds, u,
                                         {random.next(), random.next()})
                            .ray.o);
        },
        [&](Vec2 u) {
          const auto x = static_cast<double>(u.x);
          return x >= 0 && x < 1 && u.y >= 0 && u.y < 1 ? 1 + tilt * (x - 0.5) : 0.;
        });
  };
  const auto onSphere = [](Vec3 p) {
    const Vec3 n = normalize(p - Vec3(0.2f, 0, 0));
    return Vec2{0.5f + 0.5f * n.x, 0.5f + std::atan2(n.y, n.z) / kTwoPi};
  };
  const auto onRectangle = [](Vec3 p) { return Vec2{0.5f + p.x, 0.5f + p.y / std::cos(kPi / 6) / 0.6f}; };
  const auto onCylinder = [](Vec3 p) {
    const Vec3 axis = normalize(Vec3(1, 0, 0.2f)), up(0, 1, 0), side = cross(axis, up), q = p - Vec3(-0.5f, 0, 0);
    return Vec2{dot(q, axis) / std::hypot(1.f, 0.2f), 0.5f + std::atan2(dot(q, up), dot(q, side)) / kTwoPi};
  };
  for (const double tilt : {0., 0.1}) {
    const double sphere = positionP("sphere", onSphere, tilt), rectangle = positionP("rectangle", onRectangle, tilt),
                 cylinder = positionP("cylinder", onCylinder, tilt);
    for (const double p : {sphere, rectangle, cylinder})
      EXPECT_TRUE(tilt == 0 ? p > 1e-4 : p < 1e-4) << tilt << ": " << sphere << " " << rectangle << " " << cylinder;
  }
}

// A ray that starts on its light must not meet it.
TEST(EmittedRay, LeavesItsLightBehind) {
  for (const Light& light : lights()) {
    const SceneSnapshot scene = test::build(light.elements);
    if (scene->view.emitters[0].kind != EmitterView::Kind::area) continue;
    Pcg32 random(6);
    int met = 0;
    for (int i = 0; i < 20'000; ++i) {
      const Vec2 position{random.next(), random.next()}, direction{random.next(), random.next()};
      const EmittedRay r =
          sampleEmittedRay(scene->view, scene->view.emitters[0], scene->view.bounds, position, direction);
      if (r.ray.d.x == 0 || isBlack(r.flux)) continue;
      const RayHit hit = scene->surfaceRays->nearest(r.ray, 0, kInfinity);
      met += hit.found();
    }
    EXPECT_EQ(met, 0) << light.name;
  }
}

// Few of a sun's rays meet a small target by themselves, and those weigh a million times as much: none that was aimed
// at its rim may be taken for one of them.
TEST(EmittedRay, AimedAtTheRimOfASmallTarget) {
  const SceneSnapshot scene = test::build(R"(<emitter type="directional">
    <vector name="direction" x="0.3" y="0.2" z="-1"/><rgb name="irradiance" value="2"/></emitter>)" +
                                          std::string(kPatch));
  const Bounds reach{Vec3(-1000), Vec3(1000)};
  EmissionTargets targets;
  targets.add({Vec3(700, -300, 400), 1, 0.5f});
  Pcg32 random(1);
  double flux = 0;
  constexpr int kRays = 2'000'000;
  for (int i = 0; i < kRays; ++i) {
    const Vec2 position{random.next(), random.next()};
    const EmittedRay r = sampleEmittedRay(scene->view, scene->view.emitters[0], reach, position, {}, targets);
    const Vec3 way = targets.spheres[0].center - r.ray.o;
    if (length(cross(way, r.ray.d)) < 1.001f) flux += static_cast<double>(r.flux.g);
  }
  EXPECT_NEAR(flux / kRays / (2 * kPiDouble), 1, 0.01);
}

}  // namespace
}  // namespace virga
