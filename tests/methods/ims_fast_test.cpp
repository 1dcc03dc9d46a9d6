// SPDX-License-Identifier: Apache-2.0
// The fast mode of instant multiple scattering: what is upsampled, what is computed itself, and how far the picture is
// from the truth.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "methods/ims_checks.h"
#include "methods/ims_scenes.h"
#include "methods/instant_scattering/marched_light.h"
#include "methods/instant_scattering/upsampling.h"
#include "methods/rendering.h"

namespace virga {
namespace {

using namespace virga::testing;

RenderSession fast(const std::string& elements, int passes, int spacing = 4) {
  return rendered(sceneOf(elements), {.passes = passes,
                                      .layers = LayerMask::all(),
                                      .method = "ims",
                                      .settings = {{"mode", "fast"}, {"spacing", std::to_string(spacing)}}});
}

/// Mean of a layer over the picture, by `path`, and by the fast mode.
struct Levels {
  double path, fast, beauty;
};

void expectNear(const std::string& elements, double tolerance, int passes) {
  const RenderSession truth =
      rendered(sceneOf(elements), {.passes = 12 * passes, .seed = 5, .layers = LayerMask::all()});
  const RenderSession own = fast(elements, passes);
  const double beauty = replicateMoments(truth.film()).mean();
  for (int l = 0; l < kLayerCount; ++l) {
    const auto layer = static_cast<Layer>(l);
    const stats::Moments a = replicateMoments(own.film(), layer), b = replicateMoments(truth.film(), layer);
    const double noise = 4 * std::hypot(a.standardError(), b.standardError());
    EXPECT_NEAR(a.mean(), b.mean(), tolerance * b.mean() + 1e-3 * beauty + noise)
        << kLayerNames[static_cast<size_t>(l)];
    EXPECT_LT(noise, 0.03 * beauty) << "too few samples to tell";
  }
}

// The mean of each layer is held to 2 % of it. A filter that forgot opacity or transmittance is 10 % off and more.
TEST(ImsFast, LayersOfAPlumeAreNearTheTruth) { expectNear(plume(48), 0.02, 24); }
TEST(ImsFast, LayersOfFogAreNearTheTruth) { expectNear(fog(48), 0.02, 24); }
TEST(ImsFast, MirrorsAndGlassAreComputedInEachPixel) { expectNear(fog(32, R"(<bsdf type="dielectric"/>)"), 0.02, 24); }

// In a small room, by many lights, of which few are nearer than the radius: what virtual lights in media weigh is seen,
// most finely from media to surfaces, where a tenth too much would be.
TEST(ImsFast, LayersOfSmokeThatVirtualLightsCarry) {
  const SceneSnapshot scene = smokyRoom(virga::testing::plume(), 9);
  const SettingValues settings = {{"mode", "fast"},  {"spacing", "1"}, {"samples", "1"},
                                  {"walks", "1024"}, {"lights", "16"}, {"radius", "0.1"}};
  const Estimates truth = estimates(scene, "path", {}, {.sets = 16, .passes = 8, .seed = 5});
  const Estimates own = estimates(scene, "ims", settings, {.sets = 24, .seed = 6});
  expectSame(own, truth, "fast");
  expectPower(own, truth, {{Layer::mediaToSurface, 0.018}, {Layer::surfaceToMedia, 0.025}, {Layer::mediaToMedia, 0.03}},
              "fast");
}

TEST(ImsFast, IsSaidToBeBiased) {
  RenderSession session(sceneOf(fog(8)), findMethod("ims"), {.settings = {.values = {{"mode", "fast"}}}});
  EXPECT_TRUE(session.step().biased);
}

TEST(ImsFast, APathOfOneSegmentShowsLampsAlone) {
  const RenderSession session = rendered(
      sceneOf(plume(16)),
      {.passes = 1, .layers = LayerMask::all(), .method = "ims", .settings = {{"mode", "fast"}, {"max_depth", "1"}}});
  EXPECT_EQ(pixelMoments(session.film().beauty()).mean(), 0);
}

TEST(ImsFast, AStopBeforeTheFirstPassLeavesNothing) {
  std::stop_source stop;
  stop.request_stop();
  RenderSession session(sceneOf(fog(8)), findMethod("ims"), {.settings = {.values = {{"mode", "fast"}}}});
  EXPECT_FALSE(session.step({}, stop.get_token()).completed);
  EXPECT_EQ(session.film().passes(), 0);
  EXPECT_TRUE(session.step().completed);
}

TEST(ImsFast, ThreadsChangeNothing) {
  const auto picture = [](size_t threads) {
    tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return fast(plume(20), 2).film().beauty();
  };
  EXPECT_EQ(largestDifference(picture(1), picture(4)), 0);
}

// --- the filter ---

/// A floor to the left, near, and to the right, far; fog of even opacity.
std::vector<PixelFeatures> twoFloors(int width, int height) {
  std::vector<PixelFeatures> features;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      PixelFeatures f;
      const bool left = x < width / 2;
      f.regular = true;
      f.depth = left ? 2.f : 9.f;
      f.p = {static_cast<float>(x) * 0.01f, static_cast<float>(y) * 0.01f, -f.depth};
      f.normal = {0, 0, 1};
      f.surface = Rgb(left ? 0.2f : 0.6f, 0.3f, 0);
      f.opacity = Rgb(0.1f + 0.002f * static_cast<float>(x), 0.2f, 0.3f);
      f.mediaDepth = 1;
      features.push_back(f);
    }
  return features;
}

/// The light of all pixels, row by row. lightOf(pixel): of those that are computed.
template <class LightOf>
std::vector<Upsampling::Light> spread(const Upsampling& upsampling, const LightOf& lightOf, int width, int height) {
  std::vector<Upsampling::Light> all(static_cast<size_t>(width * height)), coarse;
  std::vector<int> visits(all.size());
  const auto show = [&](int x, int y, const Upsampling::Light& light) {
    all[static_cast<size_t>(y * width + x)] = light;
    ++visits[static_cast<size_t>(y * width + x)];
  };
  for (const auto& p : upsampling.coarse()) coarse.push_back(lightOf(p));
  for (const auto& p : upsampling.spread(coarse, {}, show)) show(p.x, p.y, lightOf(p));
  EXPECT_EQ(std::count(visits.begin(), visits.end(), 1), width * height) << "each pixel once";
  return all;
}

void expectEvenLightStaysSo(int spacing, Upsampling::Pixel place) {
  const int width = 50, height = 37;
  const auto features = twoFloors(width, height);
  const Upsampling upsampling(features, width, height, spacing, place);
  const auto at = [&](int x, int y) -> const PixelFeatures& { return features[static_cast<size_t>(y * width + x)]; };
  const auto lightOf = [&](const Upsampling::Pixel& p) -> Upsampling::Light {
    const PixelFeatures& f = at(p.x, p.y);
    const float side = p.x < width / 2 ? 1.f : 5.f;
    return {{f.surface * side, f.surface * (2 * side)}, {f.opacity * 3, f.opacity * 4}};
  };
  const auto all = spread(upsampling, lightOf, width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const float side = x < width / 2 ? 1.f : 5.f;
      const Upsampling::Light& found = all[static_cast<size_t>(y * width + x)];
      for (int c = 0; c < 3; ++c) {
        ASSERT_NEAR(found.surface[0][c], at(x, y).surface[c] * side, 1e-4f) << x << " " << y << ": leaks over the edge";
        ASSERT_NEAR(found.surface[1][c], at(x, y).surface[c] * side * 2, 2e-4f);
        ASSERT_NEAR(found.media[0][c], at(x, y).opacity[c] * 3, 1e-4f);
        ASSERT_NEAR(found.media[1][c], at(x, y).opacity[c] * 4, 1e-4f);
      }
    }
}

TEST(Upsampling, LightThatIsEvenBehindItsVeilStaysSo) {
  for (const int spacing : {1, 3, 8, 20})
    for (const int x : {0, 3, 5, -9}) expectEvenLightStaysSo(spacing, {x, 7 - x});
}

TEST(Upsampling, PixelsThatNoNeighbourIsLikeAreComputed) {
  const int width = 40, height = 24;
  auto features = twoFloors(width, height);
  features[static_cast<size_t>(9 * width + 11)].p.z = -5;  // something thin before the floor...
  features[static_cast<size_t>(9 * width + 11)].depth = 5;
  features[static_cast<size_t>(20 * width + 30)].regular = false;  // ...a mirror...
  features[static_cast<size_t>(4 * width + 4)].regular = false;    // ...and one at a coarse pixel
  const Upsampling upsampling(features, width, height, 8, {4, 4});
  ASSERT_EQ(upsampling.coarse().size(), 5u * 3u);
  std::vector<int> computed;
  const auto lightOf = [&](const Upsampling::Pixel& p) -> Upsampling::Light {
    computed.push_back(p.y * width + p.x);
    return {{}, {Rgb(p.x == 30 || p.x == 4 ? 7.f : 0.f), {}}};
  };
  const auto all = spread(upsampling, lightOf, width, height);
  EXPECT_EQ(std::vector<int>(computed.begin() + 15, computed.end()), (std::vector{9 * width + 11, 20 * width + 30}));
  EXPECT_EQ(all[20 * width + 30].media[0].r, 7.f);
  EXPECT_EQ(all[4 * width + 4].media[0].r, 7.f);
}

// One bright pixel among black ones: wherever coarse pixels lie, on average over the passes it counts as one.
TEST(Upsampling, OverPassesNoPixelTellsMoreThanOthers) {
  const int width = 60, height = 50, passes = 4096;
  const std::vector<PixelFeatures> features(static_cast<size_t>(width * height), twoFloors(1, 1)[0]);
  PerspectiveCamera camera;
  camera.cropX = 3, camera.cropY = 5;
  double sum = 0;
  int met = 0;
  for (uint32_t pass = 0; pass < passes; ++pass) {
    const Upsampling upsampling(features, width, height, 8, coarsePlace(camera, 8, pass));
    const auto isBright = [](const Upsampling::Pixel& p) { return p.x == 29 && p.y == 22; };
    const auto coarse = upsampling.coarse();
    if (std::none_of(coarse.begin(), coarse.end(), isBright)) continue;
    const auto lightOf = [&](const Upsampling::Pixel& p) -> Upsampling::Light {
      return {{Rgb(isBright(p) ? 1.f : 0.f), {}}, {}};
    };
    for (const Upsampling::Light& light : spread(upsampling, lightOf, width, height))
      sum += static_cast<double>(light.surface[0].g);
    ++met;
  }
  EXPECT_NEAR(met, passes / 64, 2);
  EXPECT_NEAR(sum / passes, 1, 0.04);
}

TEST(Upsampling, CoarsePixelsAreThoseOfTheFilm) {
  PerspectiveCamera whole, crop;
  crop.cropX = 11, crop.cropY = 5;
  for (uint32_t pass = 0; pass < 20; ++pass) {
    const Upsampling::Pixel a = coarsePlace(whole, 8, pass), b = coarsePlace(crop, 8, pass);
    EXPECT_EQ(a.x, b.x + 11);
    EXPECT_EQ(a.y, b.y + 5);
  }
}

TEST(Upsampling, OnePixelIsAPicture) {
  const auto features = twoFloors(1, 1);
  const Upsampling upsampling(features, 1, 1, 8, {4, 4});
  ASSERT_EQ(upsampling.coarse().size(), 1u);
  const auto lightOf = [](const Upsampling::Pixel&) -> Upsampling::Light {
    return {{Rgb(1.f), Rgb(2.f)}, {Rgb(3.f), Rgb(4.f)}};
  };
  EXPECT_NEAR(spread(upsampling, lightOf, 1, 1)[0].media[1].g, 4, 1e-5f);
}

TEST(PixelFeatures, OfFogBeforeAWall) {
  const SceneSnapshot scene = sceneOf(pinpointSensor("0, 0, 5", "0, 0, 0", "0, 1, 0", 4) + R"(
    <shape type="rectangle"><transform name="to_world"><translate z="-2"/></transform>
      <bsdf type="diffuse"><rgb name="reflectance" value="0.5, 0.25, 0"/></bsdf></shape>
    <shape type="cube"><bsdf type="null"/><medium name="interior" type="homogeneous"><float name="sigma_t" value="0.35"/>
      </medium></shape>)");
  const EyeStart start = middleOf(*scene, 1, 1);
  MarchedEye eye;
  marchEye(scene->view, EmbreeRays{*scene->surfaceRays, *scene->boundaryRays}, start.camera, start.shift, eye);
  const PixelFeatures f = pixelFeatures(eye);
  const float transmittance = std::exp(-0.7f);
  EXPECT_TRUE(f.regular);
  EXPECT_NEAR(f.depth, 7, 0.02f);
  EXPECT_NEAR(f.opacity.r, 1 - transmittance, 1e-4f);
  EXPECT_NEAR(f.surface.r, 0.5f * transmittance, 1e-4f);
  EXPECT_NEAR(f.surface.g, 0.25f * transmittance, 1e-4f);
  EXPECT_EQ(f.surface.b, 0);
  // mean of t exp(-s t) over the two units of fog, from the near face on
  const float s = 0.35f, mean = 1 / s - 2 * transmittance / (1 - transmittance);
  EXPECT_NEAR(f.mediaDepth, 4 + mean, 0.02f);
}

TEST(MarchMedia, HomogeneousMediaAreExactAndEmptyOnesAreNothing) {
  const SceneSnapshot scene = sceneOf(pinpointSensor("0, 0, 5", "0, 0, 0", "0, 1, 0", 4) + R"(
    <shape type="cube"><bsdf type="null"/><medium name="interior" type="homogeneous"><rgb name="sigma_t" value="0.3, 1, 2"/>
      </medium></shape>)");
  const EmbreeRays rays{*scene->surfaceRays, *scene->boundaryRays};
  const MediaRay r{{{0.1f, 0.2f, 5}, {0, 0, -1}}, scene->view.cameraMedia, 0};
  const Rgb through = marchedTransmittance(scene->view, rays, r, kInfinity, 7, 0.4f);
  EXPECT_NEAR(through.r, std::exp(-0.6f), 1e-4f);
  EXPECT_NEAR(through.b, std::exp(-4.f), 1e-4f);
  EXPECT_EQ(marchedTransmittance(scene->view, rays, r, 3.5f, 7, 0.4f).r, 1);
}

// Through fog without end nothing comes, however thin it is in one channel; where it is clear all does. Likewise where
// its density is that around a grid, and steps are taken.
TEST(MarchMedia, StretchesWithoutEndAreDark) {
  const std::string sensor = pinpointSensor("0, 0, 5", "0, 0, 0", "0, 1, 0", 4);
  const SceneSnapshot scene =
      sceneOf(R"(<medium type="homogeneous" id="fog"><rgb name="sigma_t" value="4, 0.004, 0"/></medium>)" +
              std::string(sensor).replace(sensor.find("</sensor>"), 9, R"(<ref name="medium" id="fog"/></sensor>)"));
  const EmbreeRays rays{*scene->surfaceRays, *scene->boundaryRays};
  const MediaRay r{{{0.1f, 0.2f, 5}, {0, 0, -1}}, scene->view.cameraMedia, 0};
  SceneView view = scene->view;
  std::vector<MediumView> media(view.media.begin(), view.media.end());
  view.media = viewOf(media);
  media[0].density = {};
  media[0].density.background = 1;
  for (const bool homogeneous : {true, false}) {
    media[0].homogeneous = homogeneous;
    const Rgb through = marchedTransmittance(view, rays, r, kInfinity, 24, 0.4f);
    EXPECT_EQ(through.r, 0) << homogeneous;
    EXPECT_EQ(through.g, 0) << homogeneous;
    EXPECT_EQ(through.b, 1) << homogeneous;
    EXPECT_NEAR(marchedTransmittance(view, rays, r, 100, 24, 0.4f).g, std::exp(-0.4f), 1e-4f) << homogeneous;
  }
}

// A coarse march of a grid is near the truth for every shift, and 256 steps are nearer.
TEST(MarchMedia, GridsConverge) {
  const SceneSnapshot scene = sceneOf(plume(8));
  const EmbreeRays rays{*scene->surfaceRays, *scene->boundaryRays};
  const MediaRay r{{{-0.05f, -0.3f, 4.5f}, {0, 0, -1}}, scene->view.cameraMedia, 0};
  const auto by = [&](int steps, float shift) { return marchedTransmittance(scene->view, rays, r, 8, steps, shift).g; };
  const float truth = by(20000, 0);
  ASSERT_LT(truth, 0.9f) << "there is smoke on the way";
  for (const float shift : {0.f, 0.3f, 0.7f, 0.99f}) {
    EXPECT_NEAR(std::log(by(24, shift)), std::log(truth), 0.1f * std::fabs(std::log(truth))) << shift;
    EXPECT_NEAR(std::log(by(512, shift)), std::log(truth), 2e-3f * std::fabs(std::log(truth))) << shift;
  }
}

}  // namespace
}  // namespace virga
