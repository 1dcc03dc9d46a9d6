// SPDX-License-Identifier: Apache-2.0
// What frames of instant multiple scattering are made of: kernels, packets of eye rays, lights.
#include <gtest/gtest.h>

#include <regex>

#include "methods/ims_scenes.h"
#include "methods/instant_scattering/frame_lights.h"
#include "methods/instant_scattering/lamp_packets.h"
#include "methods/instant_scattering/light_spacing.h"
#include "methods/instant_scattering/pixel_features.h"
#include "methods/rendering.h"
#include "volume/grid.h"
#include "volume/lookup_along.h"
#include "volume/procedural.h"

namespace virga {
namespace {

using namespace virga::testing;

// In a medium with an optical depth of `depth` along the ball's radius, light within the ball is that of its middle.
TEST(FrameKernels, ASpreadLightKeepsItsEnergy) {
  const float bound = 4, radius = 0.5f;  // 1 / sqrt(bound)
  for (const float depth : {0.f, 0.5f, 2.f, 6.f}) {
    const float core = coreFor(depth);
    double spread = 0, point = 0, plain = 0;
    const int n = 100000;
    for (int i = 0; i < n; ++i) {
      const float u = (static_cast<float>(i) + 0.5f) / n, d2 = square(radius * u);
      const double through = std::exp(-static_cast<double>(depth * u));
      spread += static_cast<double>(kernels::spreadFalloff(d2, bound, core) * d2) * through;
      plain += static_cast<double>(kernels::spreadFalloff(d2, bound, NearField::kPlainCore) * d2) * through;
      point += through;  // 1 / d^2
    }
    EXPECT_NEAR(spread / point, 1, 1e-3) << depth;
    if (depth >= 2) {
      EXPECT_LT(plain / point, 0.8) << depth;
    }
    EXPECT_NEAR(kernels::spreadFalloff(0.2499f, bound, core), kernels::spreadFalloff(0.2501f, bound, core), 0.01f);
  }
  EXPECT_NEAR(coreFor(0), NearField::kPlainCore, 7e-3f);
}

/// A table of what lies all around in a medium that ends at a distance, at optical depth 1 a unit times sigmaT.
struct TableAround {
  std::vector<float> depth;
  DepthTable table;

  TableAround(float sigmaT, float end) {
    constexpr int kSide = 12, kRadii = 64;
    table = {nullptr, kSide, kRadii, {1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 0, 4}};
    for (int node = 0; node < kSide * kSide; ++node)
      for (int m = 0; m < kRadii; ++m)
        depth.push_back(sigmaT * std::min(end, 4 * square(static_cast<float>(m) / (kRadii - 1))));
    table.depth = depth.data();
  }
};

/// Of an isotropic light there, at most 1 wide.
LightBall ballAround(float sigmaT, float end) {
  const TableAround around(sigmaT, end);
  return ballWithin({&around.table, 1}, {0, 0, 0, 0, 0, 1, 1, 1, 1, 0}, 1, 0.4f, coreFor(6));
}

// In a medium without end it is the core that is known; where the medium ends, what lies beyond counts for nothing.
TEST(FrameLights, BallsKeepTheirLightInTheMedium) {
  for (const float sigmaT : {0.1f, 2.f, 5.f}) {
    const LightBall ball = ballAround(sigmaT, 4);
    EXPECT_EQ(ball.radius, 1);
    EXPECT_NEAR(ball.core.r / coreFor(sigmaT), 1, 0.05) << sigmaT;
  }
  for (const float end : {0.8f, 0.5f}) {
    const float sigmaT = 2;
    const LightBall ball = ballAround(sigmaT, end);
    double spread = 0, point = 0, even = 0;
    const int n = 10000;
    for (int i = 0; i < n; ++i) {
      const float d = end * (static_cast<float>(i) + 0.5f) / n, through = std::exp(-sigmaT * d);
      const float bound = 1 / square(ball.radius);
      point += static_cast<double>(through);
      spread += static_cast<double>(through * d * d * kernels::spreadFalloff(d * d, bound, ball.core.r));
      even += static_cast<double>(through * d * d * kernels::spreadFalloff(d * d, 1, coreFor(sigmaT)));
    }
    EXPECT_NEAR(spread / point, 1, 0.06) << end;
    EXPECT_LT(even / point, end > 0.6f ? 0.98 : 0.9) << end << ": as if the medium had no end";
  }
  // The densest of three channels says how large the ball is; each has its own core.
  const TableAround thin(1, 4), middle(2, 4), dense(5, 4);
  const LightBall ball = ballWithin(std::vector{thin.table, middle.table, dense.table}, {}, 1, 0.4f, coreFor(6));
  EXPECT_EQ(ball.radius, 1);
  EXPECT_FLOAT_EQ(ball.core.r, ballAround(1, 4).core.r);
  EXPECT_FLOAT_EQ(ball.core.b, ballAround(5, 4).core.r);
  EXPECT_GT(ball.core.b, 1.5f * ball.core.r);
  EXPECT_LT(ballAround(2, 0.2f).radius, 0.9f) << "wider than the smoke";
  EXPECT_LT(ballAround(20, 4).radius, 0.9f) << "too deep";
}

TEST(FrameLights, NeighboursAreThoseOfAllPairs) {
  const auto number = [](int i, double step) { return static_cast<float>(std::fmod(i * step, 1)); };
  std::vector<PlacedLight> lights;
  for (int i = 0; i < 500; ++i) {
    const float x = number(i, 0.8191725134), spread = i % 3 ? 1.f : 20.f;
    lights.push_back({Vec3(x, number(i, 0.6710436067), number(i, 0.5497004779)) * spread, 1 + number(i, 0.618034)});
  }
  for (int i = 0; i < 20; ++i) lights.push_back({Vec3(3, 3, 3), 1});  // in one place
  const float times = 9;
  const std::vector<float> radii = radiiOfNeighbours(lights, times, 40, 3);
  for (size_t i = 0; i < lights.size(); ++i) {
    std::vector<std::pair<float, float>> all;
    for (const PlacedLight& l : lights) all.emplace_back(lengthSquared(l.p - lights[i].p), l.weight);
    std::sort(all.begin(), all.end());
    float sum = 0, d2 = 0;
    for (const auto& [distance2, weight] : all) {
      sum += weight, d2 = distance2;
      if (sum >= times * lights[i].weight) break;
    }
    EXPECT_NEAR(radii[i], std::sqrt(d2), 1e-5f) << i;
  }
  EXPECT_EQ(radii.back(), 0);
  EXPECT_TRUE(radiiOfNeighbours({}, times, 40, 3).empty());
  const std::vector<PlacedLight> two{{Vec3(0, 0, 0), 1}, {Vec3(0, 2, 0), 1}};
  EXPECT_FLOAT_EQ(radiiOfNeighbours(two, 8, 16, 2)[0], 4) << "as if there were more, as dense";
}

TEST(FrameKernels, LampsLightFogAsFarAsTheIntegralSays) {
  LampPoint lamp;
  lamp.known = true, lamp.px = 0.3f, lamp.py = 0.5f, lamp.pz = -2;
  lamp.all = 1;
  FogRays fog{};  // the others are not there
  fog.dz[3] = -1, fog.t0[3] = 0.5f, fog.t1[3] = 4;
  fog.sigmaT[0][3] = 0.4f, fog.sigmaT[1][3] = 0.8f, fog.anisotropy[3] = 0.3f;
  double truth = 0;
  const int n = 200000;
  for (int i = 0; i < n; ++i) {
    const double t = 0.5 + 3.5 * (i + 0.5) / n, z = -2 + t, d2 = 0.34 + z * z, c = (t - 2) / std::sqrt(d2);
    const double phase = (1 - 0.09) / (4 * 3.14159265358979 * std::pow(1.09 + 0.6 * c, 1.5));
    truth += 0.4 * std::exp(-0.4 * (t - 0.5)) * phase / d2 * 3.5 / n;
  }
  KernelPlaces at;
  RayPacket rays;
  float value[3][RayPacket::kSize];
  constexpr int kShifts = 256;
  double sum = 0;
  for (int shift = 0; shift < kShifts; ++shift) {
    lightFog(lamp, fog, (static_cast<float>(shift) + 0.5f) / kShifts, 5, at, value, rays);
    sum += static_cast<double>(value[0][3]) / kShifts;
    EXPECT_EQ(value[2][3], 0);
    EXPECT_EQ(value[0][0], 0);
    EXPECT_GT(rays.tMax[3], 0);
    EXPECT_EQ(rays.tMax[0], 0);
  }
  EXPECT_NEAR(sum, truth, 2e-3 * truth);
}

// Four places find the light of dense fog, whether the lamp is within it, before it or behind it. (Lamps that lie more
// than ten mean free paths deep are hardly seen at all.)
TEST(FrameKernels, FourPlacesAreEnoughInDenseFog) {
  constexpr int kPlaces = 4;
  for (const bool within : {false, true})
    for (const float sigmaT : {0.3f, 1.f, 1.9f, 3.f, 10.f, within ? 0.5f : 100.f}) {
      FogRays fog{};
      for (int i = 0; i < RayPacket::kSize; ++i) {
        fog.dz[i] = 1, fog.t0[i] = 3, fog.t1[i] = 5;
        for (auto& channel : fog.sigmaT) channel[i] = sigmaT;
      }
      LampPoint lamp;
      lamp.known = true, lamp.all = 1, lamp.medium = within ? 0 : -1;
      for (const float z : within ? std::vector<float>{4} : std::vector<float>{0, 8}) {
        lamp.pz = z;
        for (int i = 0; i < RayPacket::kSize; ++i) fog.ox[i] = 0.02f + 0.05f * static_cast<float>(i);
        double found[RayPacket::kSize] = {};
        const auto leftBy = [&](double d) { return within ? std::exp(-double{sigmaT} * d) : 1; };
        for (int n = 0; n < kPlaces; ++n) {
          KernelPlaces at;
          RayPacket rays;
          float value[3][RayPacket::kSize];
          lightFog(lamp, fog, (static_cast<float>(n) + 0.5f) / kPlaces, 5, at, value, rays);
          for (int i = 0; i < RayPacket::kSize; ++i) {
            const auto x = double{at.px[i]}, y = double{at.pz[i]} - double{z};
            found[i] += double{value[1][i]} * leftBy(std::sqrt(x * x + y * y)) / kPlaces;
          }
        }
        for (int i = 0; i < RayPacket::kSize; ++i) {
          double truth = 0;
          constexpr int kSteps = 20000;
          for (int k = 0; k < kSteps; ++k) {
            const double t = 2 * (k + 0.5) / kSteps, x = double{fog.ox[i]}, y = 3 + t - double{z}, d2 = x * x + y * y;
            truth += double{sigmaT} * std::exp(-double{sigmaT} * t) * leftBy(std::sqrt(d2)) / (4 * 3.14159265 * d2) *
                     2 / kSteps;
          }
          EXPECT_NEAR(found[i] / truth, 1, 0.07) << within << ' ' << sigmaT << ' ' << z << ' ' << i;
        }
      }
    }
}

TEST(FrameKernels, DensitiesAlongARayAreTheGrids) {
  DenseVolume volume = makeProcedural(ProceduralKind::smoke, {.resolution = 32});
  const auto grid = Grid::dense(volume.nx, volume.ny, volume.nz, std::move(volume.values), {});
  const GridView view = grid->view();
  const Vec3 o(3, 28, 1), d(0.31f, -0.4f, 0.47f);
  float out[60];
  lookupAlong(view, o, d, 60, out);
  for (int n = 0; n < 60; ++n) EXPECT_NEAR(out[n], view.lookup(o + d * static_cast<float>(n)), 1e-4f) << n;
}

TEST(FrameKernels, TheirExponentialIsExact) {
  for (const float x : {0.f, 1e-6f, 0.3f, 0.35f, 1.f, 7.7f, 40.f, 80.f})
    EXPECT_NEAR(kernels::falling(x) / std::exp(-x), 1, 2e-6) << x;
  EXPECT_LT(kernels::falling(1e30f), 1e-37f);
}

// Rays side by side find what marchEye() finds for each, in smoke whose channels differ and beside it.
TEST(EyePacket, MarchesAsEachRayByItself) {
  const SceneSnapshot scene = sceneOf(plume(8));
  SceneView view = scene->view;
  std::vector<MediumView> media(view.media.begin(), view.media.end());
  media.at(0).spectrum = {1, 0.5f, 0.2f};
  view.media = {media.data(), view.media.size};
  const EmbreeRays rays{*scene->surfaceRays, *scene->boundaryRays};
  constexpr int kPoints = 4;
  const auto shiftOf = [](size_t i) { return 0.06f * static_cast<float>(i); };
  EyePacket packet;
  packet.clear();
  std::vector<MarchedEye> eyes(EyePacket::kSize);
  for (size_t i = 0; i < eyes.size(); ++i) {
    const float u = static_cast<float>(i % 4), v = static_cast<float>(i / 4);
    const CameraRay camera{{{i == 7 ? 3 : 0.3f * u - 0.6f, 0.4f * v - 0.7f, 5}, normalize(Vec3(0.05f, 0.02f, -1))}, 9};
    MarchedEye beside;
    walkEye(view, rays, camera, rays.nearest(camera.ray, camera.tMax), beside, [&](float t0, float t1) {
      return packet.add(view, i, camera.ray, beside.at.media, t0, t1, 100, shiftOf(i));
    });
    marchEye(view, rays, camera, shiftOf(i), eyes[i], 100);
    EXPECT_EQ(packet.has(i), i != 7);
  }
  packet.march();
  int dense = 0;
  std::vector<EyePoints> points(kPoints);
  for (int k = 0; k < kPoints; ++k) {
    alignas(64) float place[EyePacket::kSize];
    for (size_t i = 0; i < eyes.size(); ++i) place[i] = (static_cast<float>(k) + shiftOf(i)) / kPoints;
    placePoints(packet.eyes(), packet.depths(), place, points[static_cast<size_t>(k)]);
  }
  for (size_t i = 0; i < eyes.size(); ++i) {
    for (int c = 0; packet.has(i) && c < 3; ++c)
      EXPECT_NEAR(packet.depth(i)[c], eyes[i].depth[c], 1e-4f * eyes[i].depth[c] + 1e-6f);
    if (!(eyes[i].opacity() > 0.01f)) continue;
    ++dense;
    EXPECT_NEAR(packet.meanPlace(i), pixelFeatures(eyes[i]).mediaDepth, 1e-3f);
    eyes[i].visitPoints(kPoints, shiftOf(i), [&](int k, Vec3 p, Rgb weight, const MediaState&) {
      const EyePoints& at = points[static_cast<size_t>(k)];
      EXPECT_LT(length(Vec3(at.px[i], at.py[i], at.pz[i]) - p), 2e-3f);
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(at.weight[c][i], weight[c], 1e-3f * weight[c]);
    });
  }
  EXPECT_GT(dense, 3) << "the test looks past the smoke";
}

/// What all lights bring to receivers of a kind, at once or step by step.
std::vector<float> gathered(const FrameLights& lights, EndKind kind, bool atOnce) {
  std::vector<float> p[3], axis[3], g(64, 0.4f), sum[3], seen[3];
  for (int i = 0; i < 64; ++i)
    for (int c = 0; c < 3; ++c) {
      p[c].push_back(-0.9f + 0.6f * static_cast<float>((i >> 2 * c) % 4));
      axis[c].push_back(c == i % 3 ? 1.f : 0.f), sum[c].push_back(0), seen[c].push_back(0);
    }
  const KernelReceivers to{
      64,       p[0].data(),   p[1].data(),   p[2].data(),  axis[0].data(), axis[1].data(), axis[2].data(),
      g.data(), sum[0].data(), sum[1].data(), sum[2].data()};
  const NearField near{NearField::Kind::spread, 50};
  for (size_t l = 0; l < lights.lights().size(); ++l) {
    const FrameLights::Light& light = lights.lights()[l];
    float* out[3] = {seen[0].data(), seen[1].data(), seen[2].data()};
    if (atOnce) {
      EXPECT_TRUE(lights.gatherAtOnce(l, to, kind, near));
    } else {
      lights.lookFrom(l, to, kind, out);
      gatherLight(light.kernel, light.kind, to, kind, out, near);
    }
  }
  return sum[1];
}

TEST(FrameLights, AllAtOnceIsStepByStep) {
  const std::string room = fog(8);  // its fog ends at a cube, which comes last
  const std::string inFog =
      R"(<medium type="homogeneous" id="all"><float name="sigma_t" value="0.4"/><float name="albedo" value="0.9"/></medium>)" +
      std::regex_replace(room.substr(0, room.find(R"(<shape type="cube">)")), std::regex("</sensor>"),
                         R"(<ref name="medium" id="all"/></sensor>)");
  for (const std::string& elements : {plume(8), inFog}) {
    const SceneSnapshot scene = sceneOf(elements);
    FrameLights::Kept kept;
    FrameLights::Options few;
    few.most = 100;
    const FrameLights lights(*scene, traceVirtualLights(*scene, {.walks = 1000}, {3, 0, 0, 0}), few, kept, {});
    for (const EndKind kind : {EndKind::lambertian, EndKind::isotropic, EndKind::henyeyGreenstein}) {
      const std::vector<float> one = gathered(lights, kind, true), other = gathered(lights, kind, false);
      double error = 0, sum = 0;
      for (size_t i = 0; i < one.size(); ++i)
        error += static_cast<double>(std::fabs(one[i] - other[i])), sum += static_cast<double>(other[i]);
      EXPECT_GT(sum, 0);
      EXPECT_LT(error, 2e-3 * sum);
    }
  }
}

// Tables of optical depths are near those that marching finds, from lights in the plume and on the floor.
TEST(FrameLights, TablesKnowTheMedia) {
  const SceneSnapshot scene = sceneOf(plume(8));
  FrameLights::Kept kept;
  FrameLights::Options few;
  few.most = 200, few.shadows = FrameLights::ShadowMapping::none;
  const FrameLights lights(*scene, traceVirtualLights(*scene, {.walks = 4000}, {3, 0, 0, 0}), few, kept, {});
  ASSERT_GT(lights.lights().size(), 100u);
  const EmbreeRays rays{*scene->surfaceRays, *scene->boundaryRays};
  std::vector<float> x, y, z, none(64, 0.f), seen(64);
  for (int i = 0; i < 64; ++i)
    x.push_back(-0.9f + 0.6f * static_cast<float>(i % 4)), y.push_back(-0.9f + 0.6f * static_cast<float>(i / 4 % 4)),
        z.push_back(-0.8f + 0.6f * static_cast<float>(i / 16));
  const KernelReceivers to{64,          x.data(),    y.data(),    z.data(),    none.data(), none.data(),
                           none.data(), none.data(), none.data(), none.data(), none.data()};
  double error = 0, sum = 0;
  for (size_t l = 0; l < lights.lights().size(); ++l) {
    float* out[3] = {seen.data(), seen.data(), seen.data()};
    lights.lookFrom(l, to, EndKind::isotropic, out);
    const Vec3 from = lights.lights()[l].vertex->p + lights.lights()[l].vertex->normal * 1e-3f;
    const MediaState media = mediaAt(*scene, from);
    for (size_t i = 0; i < 64; ++i) {
      const Vec3 way = Vec3(x[i], y[i], z[i]) - from;
      const float d = length(way);
      const float truth = marchedTransmittance(scene->view, rays, {{from, way / d}, media, 0}, d, 128, 0).g;
      error += static_cast<double>(std::fabs(seen[i] - truth));
      sum += static_cast<double>(truth);
    }
  }
  EXPECT_LT(error, 0.06 * sum);
}

}  // namespace
}  // namespace virga
