// SPDX-License-Identifier: Apache-2.0
// Cameras and lamps exactly on the boundaries of media: pictures are those from a hair to either side.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "image/scratch.h"
#include "methods/rendering.h"
#include "transport/tabled_lamps.h"
#include "volume/volume_io.h"

namespace virga {
namespace {

using namespace virga::testing;

constexpr int kPixels = 16;  // along each edge
constexpr double kHair = 1e-4;

/// Of a medium, at z = 1.
enum class End {
  face,      ///< of a cube full of a homogeneous medium
  gridFace,  ///< of a cube and the grid in it at once
  grid       ///< of a grid in a larger cube
};

class Boundaries : public ::testing::TestWithParam<End> {
 protected:
  Boundaries() {
    DenseVolume volume;
    volume.nx = volume.ny = volume.nz = 8;
    for (int i = 0; i < 512; ++i) volume.values.push_back(0.4f + 0.2f * static_cast<float>(i * 7 % 5));
    volume.indexToWorld = Matrix4::translation(-0.875, -0.875, -0.875) * Matrix4::scaling(0.25, 0.25, 0.25);
    writeVol(file_, volume);
  }

  std::string medium(End end, double scale = 1) const {
    const std::string albedo = R"(<float name="albedo" value="0.9"/>)";
    if (end == End::face)
      return fmt::format(R"(<shape type="cube"><bsdf type="null"/><medium name="interior" type="homogeneous">
        <float name="sigma_t" value="{}"/>{}</medium></shape>)",
                         scale, albedo);
    return fmt::format(R"(<shape type="cube"><transform name="to_world"><scale value="{}"/></transform>
      <bsdf type="null"/><medium name="interior" type="heterogeneous"><volume name="sigma_t" type="gridvolume">
      <string name="filename" value="{}"/><boolean name="use_grid_bbox" value="true"/></volume>{}
      <float name="scale" value="{}"/></medium></shape>)",
                       end == End::grid ? 1.5 : 1., file_.string(), albedo, scale);
  }
  const std::filesystem::path file_ = scratchFile("grid.vol");
};

std::string camera(const std::string& origin, const std::string& target, double nearClip, double fieldOfView) {
  return fmt::format(R"(<sensor type="perspective"><float name="fov" value="{}"/>
    <float name="near_clip" value="{}"/><transform name="to_world"><lookat origin="{}" target="{}" up="0, 1, 0"/>
    </transform><film type="hdrfilm"><integer name="width" value="{}"/><integer name="height" value="{}"/></film>
    </sensor>)",
                     fieldOfView, nearClip, origin, target, kPixels, kPixels);
}
std::string lampAt(const std::string& place) {
  return "<emitter type=\"point\"><point name=\"position\" " + place +
         R"(/><rgb name="intensity" value="8"/></emitter>)";
}
/// A wall before that end of the medium, and a lamp between them.
const std::string kWallAndLamp = lampAt(R"(x="0.8" y="1.2" z="2")") + R"(<shape type="rectangle">
  <transform name="to_world"><scale value="4"/><rotate y="1" angle="180"/><translate z="3"/></transform></shape>)";
const std::string kFloor = R"(<shape type="rectangle">
  <transform name="to_world"><scale value="4"/><rotate x="1" angle="-90"/><translate y="-1.2"/></transform></shape>)";

Film film(const std::string& elements, uint64_t seed, const std::string& lampTable) {
  const Run run{.passes = 240, .seed = seed, .layers = LayerMask::all(), .settings = {{"lamp_table", lampTable}}};
  const RenderSession session = rendered(sceneOf(elements), run);
  EXPECT_EQ(session.film().nonFiniteSamples(), 0u);
  return session.film();
}

bool hasTable(const std::string& elements) {
  const SceneSnapshot scene = sceneOf(elements);
  const TabledLamps lamps(*scene, tabledLampSide(*scene, kPixels * kPixels), {});
  return lamps.view().size > 0 && lamps.view()[0].present();
}

/// The three are the same, and a medium `denser` is not.
void expectSame(const stats::Moments& at, const stats::Moments& inside, const stats::Moments& outside,
                const stats::Moments& denser) {
  EXPECT_GT(stats::welchTest(at, inside), 1e-4) << at.mean() << " and inside " << inside.mean();
  EXPECT_GT(stats::welchTest(at, outside), 1e-4) << at.mean() << " and outside " << outside.mean();
  EXPECT_LT(stats::welchTest(at, denser), 1e-4) << "the test cannot fail";
}

// Without a near clip: paths begin exactly on the boundary.
TEST_P(Boundaries, ACameraOnOneIsJustBesideIt) {
  const auto tables = GetParam() == End::face ? std::vector<std::string>{"0"} : std::vector<std::string>{"32", "0"};
  for (const Vec3 direction : {Vec3(0, 0, -1), Vec3(0, 0, 1), Vec3(1, 0.2f, 0)}) {  // in, out and along
    SCOPED_TRACE(fmt::format("toward {}, {}, {}", direction.x, direction.y, direction.z));
    std::vector<stats::Moments> on;
    for (const std::string& table : tables) {
      const auto from = [&](double off, double scale, uint64_t seed) {
        const double z = 1 + off;
        const std::string scene =
            camera(fmt::format("0.2, 0.1, {}", z),
                   fmt::format("{}, {}, {}", 0.2f + direction.x, 0.1f + direction.y, z + double{direction.z}), 0, 70) +
            kWallAndLamp + medium(GetParam(), scale);
        EXPECT_EQ(hasTable(scene), GetParam() != End::face);
        return replicateMoments(film(scene, seed, table));
      };
      on.push_back(from(0, 1, 1));
      expectSame(on.back(), from(-kHair, 1, 2), from(kHair, 1, 3), from(0, 1.5, 4));
    }
    EXPECT_GT(stats::welchTest(on.front(), on.back()), 1e-4) << "with tables and without";
  }
}

// Tables are for grids.
class BoundariesOfGrids : public Boundaries {};

// The lamp itself is not in the picture: near it pixels vary without bound.
TEST_P(BoundariesOfGrids, ALampOnOneIsJustBesideItAndItsTableKnows) {
  for (const char* place : {R"(x="-0.8" y="0.3" z="{0}")", R"(x="-{0}" y="0.3" z="{0}")"}) {  // on a face, on an edge
    SCOPED_TRACE(place);
    const auto lit = [&](double off, double scale, const std::string& table, uint64_t seed) {
      const std::string scene = camera("0.6, 0.6, 4", "0.5, -0.6, 0", 0.01, 18) + kFloor + medium(GetParam(), scale) +
                                lampAt(fmt::format(fmt::runtime(place), 1 + off));
      EXPECT_TRUE(scale > 1 || hasTable(scene)) << off;
      return film(scene, seed, table);
    };
    const Film own = lit(0, 1, "32", 1), byRays = lit(0, 1, "0", 2);
    for (const Layer layer : {Layer::directSurface, Layer::directMedia, Layer::mediaToSurface, Layer::surfaceToMedia,
                              Layer::mediaToMedia}) {
      const stats::Moments a = replicateMoments(own, layer), b = replicateMoments(byRays, layer);
      EXPECT_GT(b.mean(), 0);
      EXPECT_GT(stats::welchTest(a, b), 1e-4) << kLayerNames[static_cast<size_t>(layer)];
    }
    const auto direct = [](const Film& f) { return replicateMoments(f, Layer::directMedia); };
    const stats::Moments inside = direct(lit(-kHair, 1, "32", 3)), outside = direct(lit(kHair, 1, "32", 4)),
                         denser = direct(lit(0, 1.4, "32", 5));
    expectSame(direct(own), inside, outside, denser);
    expectSame(direct(byRays), inside, outside, denser);
  }
}

INSTANTIATE_TEST_SUITE_P(All, Boundaries, ::testing::Values(End::face, End::gridFace, End::grid));
INSTANTIATE_TEST_SUITE_P(All, BoundariesOfGrids, ::testing::Values(End::gridFace, End::grid));

}  // namespace
}  // namespace virga
