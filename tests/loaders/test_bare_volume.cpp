// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "loaders/bare_volume.h"
#include "loading.h"

namespace virga {
namespace {

using namespace loading;

BareVolume smoke(const Bounds& bounds, const char* file = "smoke.vdb") {
  return {.file = file, .grid = "density", .worldBounds = bounds, .maximumDensity = 4, .meanDensity = 0.5f};
}

// The largest |x| or |y| of the box's corners on the film, whose edge is at 1.
double frameFill(const SceneDescription& d, const Bounds& box) {
  const NodePtr camera = findNode(d, "camera");
  const Matrix4 toCamera = valueOf<Matrix4>(*camera, "to_world").inverse();
  const double slope = std::tan(valueOf<double>(*camera, "fov") / 2 * 3.14159265358979 / 180);
  double fill = 0;
  for (int i = 0; i < 8; ++i) {
    const Vec3 c = box.corner(i);
    const auto row = [&](int r) {
      return toCamera(r, 0) * c.x + toCamera(r, 1) * c.y + toCamera(r, 2) * c.z + toCamera(r, 3);
    };
    EXPECT_GT(row(2), valueOf<double>(*camera, "near_clip"));
    EXPECT_LT(row(2), valueOf<double>(*camera, "far_clip"));
    fill = std::max(fill, std::max(std::fabs(row(0)), std::fabs(row(1))) / (row(2) * slope));
  }
  return fill;
}

TEST(BareVolume, FillsTheFrameWhateverItsShape) {
  const std::vector<Bounds> boxes{{Vec3(-1), Vec3(1)},
                                  {Vec3(100, 200, 300), Vec3(101, 240, 302)},
                                  {Vec3(-1e-3f), Vec3(1e-3f, 2e-3f, 3e-3f)},
                                  {Vec3(0), Vec3(5e4f, 1e3f, 5e4f)},
                                  {Vec3(0), Vec3(0, 1, 1)}};
  for (const Bounds& box : boxes) {
    const double fill = frameFill(describeBareVolume(smoke(box)), box);
    EXPECT_LE(fill, 0.93);
    EXPECT_GE(fill, 0.9);
  }
}

TEST(BareVolume, OpticalThicknessIsAboutTen) {
  const SceneDescription d = describeBareVolume(smoke({Vec3(0), Vec3(1, 2, 6)}));
  EXPECT_NEAR(valueOf<double>(*findNode(d, "medium"), "scale") * 0.5 * 3, 10, 1e-5);
  BareVolume unknownMean = smoke({Vec3(0), Vec3(2)});
  unknownMean.meanDensity = 0;
  EXPECT_NEAR(valueOf<double>(*findNode(describeBareVolume(unknownMean), "medium"), "scale") * 4 * 2, 10, 1e-5);
}

TEST(BareVolume, TheMediumLivesInANullCube) {
  const Bounds box{Vec3(1, 2, 3), Vec3(3, 6, 9)};
  const SceneDescription d = describeBareVolume(smoke(box));
  EXPECT_EQ(valueOf<Matrix4>(*findNode(d, "box"), "to_world"),
            (Matrix4{{1, 0, 0, 2, 0, 2, 0, 4, 0, 0, 3, 6, 0, 0, 0, 1}}));
  EXPECT_EQ(valueOf<NodePtr>(*findNode(d, "box"), "interior"), findNode(d, "medium"));
  EXPECT_EQ(findNode(d, "density")->type, "vdb");
  EXPECT_EQ(valueOf<std::string>(*findNode(d, "density"), "grid"), "density");
  EXPECT_TRUE(std::filesystem::path(valueOf<std::string>(*findNode(d, "density"), "filename")).is_absolute());
}

TEST(BareVolume, AVolFileSpansItsUnitCube) {
  const SceneDescription d = describeBareVolume(smoke({Vec3(1, 2, 3), Vec3(3, 6, 9)}, "smoke.vol"));
  EXPECT_EQ(findNode(d, "density")->type, "gridvolume");
  EXPECT_EQ(valueOf<Matrix4>(*findNode(d, "density"), "to_world"),
            (Matrix4{{2, 0, 0, 1, 0, 4, 0, 2, 0, 0, 6, 3, 0, 0, 0, 1}}));
}

TEST(BareVolume, RoundTripsAsXml) {
  const SceneDescription d = describeBareVolume(smoke({Vec3(-1), Vec3(1)}));
  std::vector<std::string> warnings;
  EXPECT_TRUE(equal(d, parse(toXml(d), {.defines = {}, .lenient = true, .warnings = &warnings}))) << toXml(d);
}

TEST(BareVolume, NothingToSee) {
  const auto message = [](BareVolume volume) { return errorOf([&] { describeBareVolume(volume); })->message(); };
  BareVolume volume = smoke({Vec3(0), Vec3(1)});
  volume.maximumDensity = 0;
  EXPECT_EQ(message(volume), "nothing to see in \"smoke.vdb\": all its values are 0");
  volume.maximumDensity = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(message(volume), "nothing to see in \"smoke.vdb\": all its values are 0");
  volume.maximumDensity = kInfinity;
  EXPECT_EQ(message(volume), "nothing to see in \"smoke.vdb\": its values are not finite");
  EXPECT_EQ(message(smoke({})), "nothing to see in \"smoke.vdb\": it has no extent");
  EXPECT_EQ(message(smoke({Vec3(1), Vec3(1)})), "nothing to see in \"smoke.vdb\": it has no extent");
  EXPECT_EQ(message(smoke({Vec3(0), Vec3(kInfinity)})), "nothing to see in \"smoke.vdb\": it has no extent");
}

}  // namespace
}  // namespace virga
