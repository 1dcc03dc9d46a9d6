// SPDX-License-Identifier: Apache-2.0
// Two descriptions of the same world give the same picture.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "image/scratch.h"
#include "methods/rendering.h"
#include "volume/volume_io.h"

namespace virga {
namespace {

using namespace virga::testing;

constexpr int kSize = 32;

/// Of the difference of two pictures: mean over each quarter, in standard errors, largest in size; and the error of the
/// mean over all, relative to the picture: what the test can tell.
struct Agreement {
  double worstZ, precision;
};

Agreement agreement(const Image& a, const Image& b) {
  stats::Moments quarters[4], all;
  double level = 0;
  for (int y = 0; y < a.height; ++y)
    for (int x = 0; x < a.width; ++x) {
      const auto d = static_cast<double>(mean(a.at(x, y)) - mean(b.at(x, y)));
      quarters[(2 * x >= a.width ? 1 : 0) + (2 * y >= a.height ? 2 : 0)].add(d);
      all.add(d);
      level += static_cast<double>(mean(b.at(x, y))) / (a.width * a.height);
    }
  double worst = 0;
  for (const stats::Moments& q : quarters) worst = std::max(worst, std::fabs(q.mean()) / q.standardError());
  return {worst, all.standardError() / level};
}

Image picture(const std::string& elements, uint64_t seed, int passes = 512) {
  return rendered(sceneOf(elements), {.passes = passes, .seed = seed}).film().beauty();
}

void expectAllSame(const std::string& a, const std::vector<std::string>& others, int passes = 512) {
  const Image first = picture(a, 1, passes);
  for (const std::string& b : others) {
    Agreement result = agreement(first, picture(b, 2, passes));
    // By chance one pair in a hundred misses by 3 of four quarters: an independent second look tells.
    if (result.worstZ > 3) result = agreement(picture(a, 3, 4 * passes), picture(b, 4, 4 * passes));
    EXPECT_LT(result.worstZ, 3.2);
    EXPECT_LT(result.precision, 0.006) << "too few samples to tell";
  }
}
void expectSame(const std::string& a, const std::string& b, int passes = 512) { expectAllSame(a, {b}, passes); }

std::string sensor(const std::string& extra = "", double scale = 1, const std::string& rotation = "") {
  return fmt::format(R"(<sensor type="perspective"><float name="fov" value="40"/>
    <transform name="to_world"><lookat origin="0.4, 0.8, 5" target="0, -0.1, 0" up="0, 1, 0"/>{}<scale value="{}"/></transform>
    <film type="hdrfilm"><integer name="width" value="{}"/><integer name="height" value="{}"/><rfilter type="box"/></film>{}</sensor>)",
                     rotation, scale, kSize, kSize, extra);
}

constexpr const char* kLamp =
    R"(<emitter type="point"><point name="position" x="-2" y="3" z="2"/><rgb name="intensity" value="40"/></emitter>)";
constexpr const char* kGround =
    R"(<shape type="rectangle"><transform name="to_world"><scale value="4"/><rotate x="1" angle="-90"/>
  <translate y="-1"/></transform></shape>)";
constexpr const char* kPhase =
    R"(<float name="albedo" value="0.9"/><phase type="hg"><float name="g" value="0.4"/></phase>)";

std::string homogeneous(double sigmaT, const std::string& attributes = "name=\"interior\"") {
  return fmt::format(R"(<medium {} type="homogeneous"><float name="sigma_t" value="{}"/>{}</medium>)", attributes,
                     sigmaT, kPhase);
}

std::string box(const std::string& medium, const std::string& transform = "", const std::string& bsdf = "null") {
  return fmt::format(R"(<shape type="cube"><transform name="to_world">{}</transform><bsdf type="{}"/>{}</shape>)",
                     transform, bsdf, medium);
}

/// A medium of density 1 on a constant grid that covers [-1, 1]^3.
std::string gridMedium(const std::string& format) {
  DenseVolume volume;
  volume.nx = volume.ny = volume.nz = 20;
  volume.values.assign(20 * 20 * 20, 1.f);
  volume.indexToWorld =
      Matrix4::translation(-1, -1, -1) * Matrix4::scaling(0.1, 0.1, 0.1) * Matrix4::translation(0.5, 0.5, 0.5);
  const std::filesystem::path path = scratchFile("constant." + format);
  if (format == "vol") writeVol(path, volume);
  if (format == "vdb") writeVdb(path, volume);
  if (format == "nvdb") writeNvdb(path, volume);
  const std::string plugin = format == "vol" ? R"(<volume name="sigma_t" type="gridvolume"><transform name="to_world">
    <scale value="2"/><translate value="-1, -1, -1"/></transform>)"
                                             : R"(<volume name="sigma_t" type="vdb">)";
  return fmt::format(R"(<medium name="interior" type="heterogeneous">{}<string name="filename" value="{}"/></volume>
    <float name="scale" value="2"/>{}</medium>)",
                     plugin, path.string(), kPhase);
}

// A VDB falls to its background beyond the outermost voxel centres: its picture is of a cube that is smaller by half a
// voxel.
const std::string kInnerCube = "<scale value=\"0.95\"/>";

TEST(Equivalence, HomogeneousIsAConstantVol) {
  expectSame(sensor() + kLamp + kGround + box(homogeneous(2)), sensor() + kLamp + kGround + box(gridMedium("vol")));
}
TEST(Equivalence, HomogeneousIsAConstantVdb) {
  expectSame(sensor() + kLamp + kGround + box(homogeneous(2), kInnerCube),
             sensor() + kLamp + kGround + box(gridMedium("vdb"), kInnerCube));
}
TEST(Equivalence, HomogeneousIsAConstantNanoVdb) {
  expectSame(sensor() + kLamp + kGround + box(homogeneous(2), kInnerCube),
             sensor() + kLamp + kGround + box(gridMedium("nvdb"), kInnerCube));
}
TEST(Equivalence, ADifferenceOfFivePercentIsNoticed) {
  const std::string world = sensor() + kLamp + kGround;
  EXPECT_GT(agreement(picture(world + box(homogeneous(2)), 1), picture(world + box(homogeneous(2.1)), 2)).worstZ, 3.2);
}

// The camera stands in the fog, between it and its near plane; the same fog begins at the near plane.
TEST(Equivalence, CameraInsideIsCameraOutsideWithTheBoundaryMoved) {
  const std::string near = R"(<float name="near_clip" value="1"/>)";
  const std::string around = box(homogeneous(0.3), R"(<scale value="9"/>)");
  const std::string fog = homogeneous(0.3, "id=\"fog\"");
  const std::string lamp =
      R"(<shape type="sphere"><point name="center" x="-1" y="2" z="0"/><float name="radius" value="0.3"/>
    <emitter type="area"><rgb name="radiance" value="60"/></emitter></shape>)";
  expectSame(sensor(near) + lamp + kGround + around,
             fog + sensor(near + R"(<ref name="medium" id="fog"/>)") + lamp + kGround +
                 box(R"(<ref name="interior" id="fog"/>)", R"(<scale value="9"/>)"),
             768);
}

TEST(Equivalence, NestedIsFlattened) {
  // An inner box that replaces, of the same medium, is no box at all.
  const std::string fog = homogeneous(1.5, "id=\"fog\"");
  const std::string outer = box(R"(<ref name="interior" id="fog"/>)");
  const std::string inner =
      box(R"(<ref name="interior" id="fog"/><ref name="exterior" id="fog"/>)", R"(<scale value="0.5"/>)");
  expectSame(fog + sensor() + kLamp + kGround + outer, fog + sensor() + kLamp + kGround + outer + inner);
}

TEST(Equivalence, OverlappingVolumesAdd) {
  expectSame(sensor() + kLamp + kGround + box(homogeneous(2)),
             sensor() + kLamp + kGround + box(homogeneous(0.5)) + box(homogeneous(1.5)));
}

TEST(Equivalence, TouchingBoxesAreOneBox) {
  const std::string half = homogeneous(2);
  expectSame(sensor() + kLamp + kGround + box(half), sensor() + kLamp + kGround +
                                                         box(half, R"(<scale x="0.5"/><translate x="-0.5"/>)") +
                                                         box(half, R"(<scale x="0.5"/><translate x="0.5"/>)"));
}

// The boxes above stand exactly on the ground; here the ground is half a unit higher in one picture and the box is cut
// in the other.
TEST(Equivalence, AMediumBelowTheGroundIsNotSeen) {
  const std::string ground =
      R"(<shape type="rectangle"><transform name="to_world"><scale value="4"/><rotate x="1" angle="-90"/>
    <translate y="-0.5"/></transform></shape>)";
  expectSame(sensor() + kLamp + ground + box(homogeneous(2)),
             sensor() + kLamp + ground + box(homogeneous(2), R"(<scale y="0.75"/><translate y="0.25"/>)"));
}

TEST(Equivalence, AMeshBoundaryIsACubeHoweverItIsWound) {
  const std::filesystem::path path = scratchFile("cube.obj");
  FILE* file = std::fopen(path.c_str(), "w");
  for (int i = 0; i < 8; ++i) std::fprintf(file, "v %d %d %d\n", i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1);
  std::fputs("f 1 5 7 3\nf 2 4 8 6\nf 1 2 6 5\nf 3 7 8 4\nf 1 3 4 2\nf 5 6 8 7\n", file);
  std::fclose(file);
  const std::string world = sensor() + kLamp + kGround;
  const auto mesh = [&](const std::string& transform) {
    return fmt::format(R"(<shape type="obj"><string name="filename" value="{}"/><bsdf type="null"/>
      <transform name="to_world">{}</transform>{}</shape>)",
                       path.string(), transform, homogeneous(2));
  };
  expectAllSame(world + box(homogeneous(2)), {world + mesh(""), world + mesh(R"(<scale x="-1"/>)")});
}

TEST(Equivalence, GlassOfIndexOneIsANullBoundary) {
  // The point light reaches nothing through the glass by connection: an environment is met by chance and serves both.
  const std::string sky = R"(<emitter type="constant"/>)";
  const std::string glass = R"(<shape type="sphere"><bsdf type="dielectric"><float name="int_ior" value="1.5"/>
    <float name="ext_ior" value="1.5"/></bsdf>)" +
                            homogeneous(2) + "</shape>";
  const std::string null = R"(<shape type="sphere"><bsdf type="null"/>)" + homogeneous(2) + "</shape>";
  expectSame(sensor() + sky + kGround + null, sensor() + sky + kGround + glass);
}

TEST(Equivalence, RotatingTheWorldChangesNothing) {
  const std::string turn = R"(<rotate x="0.3" y="0.8" z="-0.5" angle="77"/>)";
  const auto world = [&](const std::string& rotation) {
    return sensor("", 1, rotation) +
           R"(<emitter type="spot"><transform name="to_world"><lookat origin="-2, 3, 2" target="0, 0, 0" up="0, 1, 0"/>)" +
           rotation +
           R"(</transform><rgb name="intensity" value="60"/></emitter><shape type="rectangle"><transform name="to_world">
           <scale value="4"/><rotate x="1" angle="-90"/><translate y="-1"/>)" +
           rotation + "</transform></shape>" + box(homogeneous(2), rotation);
  };
  expectSame(world(""), world(turn));
}

TEST(Equivalence, ScalingTheWorldChangesNothing) {
  // By s, with coefficients by 1/s and the point light's intensity by s^2.
  const auto world = [&](double s) {
    const std::string scale = fmt::format(R"(<scale value="{}"/>)", s);
    const std::string clip =
        fmt::format(R"(<float name="near_clip" value="{}"/><float name="far_clip" value="{}"/>)", 0.01 * s, 1e4 * s);
    return sensor(clip, s) +
           fmt::format(R"(<emitter type="point"><point name="position" x="{}" y="{}" z="{}"/>
      <rgb name="intensity" value="{}"/></emitter>)",
                       -2 * s, 3 * s, 2 * s, 40 * s * s) +
           R"(<shape type="rectangle"><transform name="to_world"><scale value="4"/><rotate x="1" angle="-90"/><translate y="-1"/>)" +
           scale + "</transform></shape>" + box(homogeneous(2 / s), scale);
  };
  expectAllSame(world(1), {world(1000), world(0.001)});
}

/// Uneven smoke on a grid over a ground, a lamp that has a table and a panel; turned, and larger by s.
std::string smokyWorld(const std::string& turn, double s) {
  const std::filesystem::path file = scratchFile("uneven.vol");
  DenseVolume volume;
  volume.nx = volume.ny = volume.nz = 6;
  for (int i = 0; i < 6 * 6 * 6; ++i) volume.values.push_back(static_cast<float>(i * 7 % 11) / 5);
  writeVol(file, volume);
  const std::string moved = turn + fmt::format(R"(<scale value="{}"/>)", s);
  const auto shape = [&](const std::string& type, const std::string& place, const std::string& inside) {
    return fmt::format(R"(<shape type="{}"><transform name="to_world">{}{}</transform>{}</shape>)", type, place, moved,
                       inside);
  };
  const std::string medium = fmt::format(R"(<bsdf type="null"/><medium name="interior" type="heterogeneous">
      <volume name="sigma_t" type="gridvolume"><string name="filename" value="{}"/>
      <transform name="to_world"><scale value="2"/><translate value="-1, -1, -1"/>{}</transform></volume>
      <float name="scale" value="{}"/>{}</medium>)",
                                         file.string(), moved, 2 / s, kPhase);
  const std::string lamp = fmt::format(R"(<emitter type="spot"><transform name="to_world">
      <lookat origin="-2, 3, 2" target="0, 0, 0" up="0, 1, 0"/>{}</transform><rgb name="intensity" value="{}"/></emitter>)",
                                       moved, 60 * s * s);
  const std::string clip =
      fmt::format(R"(<float name="near_clip" value="{}"/><float name="far_clip" value="{}"/>)", 0.01 * s, 1e4 * s);
  return sensor(clip, s, turn) + lamp +
         shape("rectangle", R"(<scale value="4"/><rotate x="1" angle="-90"/><translate y="-1"/>)", "") +
         shape("rectangle", R"(<scale value="0.7"/><rotate y="1" angle="-90"/><translate x="3"/>)",
               R"(<emitter type="area"><rgb name="radiance" value="6"/></emitter>)") +
         shape("cube", "", medium);
}

TEST(Equivalence, NorDoTheyWithSmokeOnAGridATableAndAPanel) {
  const std::string turn = R"(<rotate x="0.3" y="0.8" z="-0.5" angle="77"/>)";
  expectAllSame(smokyWorld("", 1), {smokyWorld(turn, 1), smokyWorld("", 1000), smokyWorld(turn, 0.001)});
}

TEST(Equivalence, EquiangularSamplingChangesNothing) {
  const std::string fog =
      homogeneous(0.5, "id=\"fog\"") + sensor(R"(<ref name="medium" id="fog"/>)") + kGround +
      R"(<shape type="rectangle"><transform name="to_world"><scale value="0.5"/><rotate x="1" angle="90"/>
                          <translate y="1.5"/></transform><emitter type="area"><rgb name="radiance" value="20"/></emitter></shape>
                          <shape type="sphere"><point name="center" x="1" y="0" z="0"/><float name="radius" value="0.2"/>
                          <emitter type="area"><rgb name="radiance" value="20"/></emitter></shape>)";
  const SceneSnapshot scene = sceneOf(fog);
  const auto with = [&](const char* equiangular, uint64_t seed) {
    return rendered(
        scene,
        {.passes = 384, .seed = seed, .layers = LayerMask::all(), .settings = {{"equiangular_depth", equiangular}}});
  };
  const RenderSession by = with("8", 1), without = with("0", 2);
  // In the picture as a whole lamps seen through the fog would hide what these layers tell.
  for (const Layer layer : {Layer::directMedia, Layer::mediaToMedia}) {
    const Agreement result = agreement(by.film().layer(layer), without.film().layer(layer));
    EXPECT_LT(result.worstZ, 3.5) << kLayerNames[static_cast<size_t>(layer)];
    EXPECT_LT(result.precision, 0.012) << kLayerNames[static_cast<size_t>(layer)];
  }
}

}  // namespace
}  // namespace virga
