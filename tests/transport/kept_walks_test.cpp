// SPDX-License-Identifier: Apache-2.0
// Walks that are kept while the media change carry, in expectation, what walks carry that are traced in the changed
// scene.
#include "transport/kept_walks.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <functional>

#include "image/scratch.h"
#include "scene/scenes.h"
#include "stats/stats.h"
#include "transport/defence.h"
#include "volume/volume_io.h"

namespace virga {
namespace {

/// Number of a voxel's centre in [0, 1]^3 to a density.
using Density = std::function<float(Vec3)>;

class KeptWalksTest : public ::testing::Test {
 protected:
  /// A room with a lamp, smoke in its middle and, in a corner that overlaps it, coloured fog.
  SceneSnapshot room(const Density& density, const std::string& fog = "0.3, 0.6, 1.2", double albedo = 0.8) {
    const std::string name = write(density, 10);
    return test::build(
        fmt::format(R"(<shape type="cube"><boolean name="flip_normals" value="true"/><transform name="to_world">
      <scale value="2"/></transform><bsdf type="diffuse"><rgb name="reflectance" value="0.6, 0.5, 0.3"/></bsdf></shape>
    <shape type="sphere"><float name="radius" value="0.2"/><point name="center" x="-1.5" y="1.2" z="0"/>
      <emitter type="area"><rgb name="radiance" value="5, 4, 3"/></emitter></shape>
    <shape type="cube"><bsdf type="null"/><medium name="interior" type="heterogeneous">
      <float name="scale" value="3"/><float name="albedo" value="{}"/>
      <phase type="hg"><float name="g" value="0.4"/></phase>
      <volume name="sigma_t" type="gridvolume"><string name="filename" value="{}"/><transform name="to_world">
        <translate value="-0.5"/><scale value="2"/></transform></volume></medium></shape>
    <shape type="sphere"><bsdf type="null"/><float name="radius" value="0.8"/><point name="center" x="1" y="0" z="0"/>
      <medium name="interior" type="homogeneous"><rgb name="sigma_t" value="{}"/><float name="albedo" value="0.9"/>
      </medium></shape>)",
                    albedo, name, fog),
        folder_.path().string());
  }

  /// Smoke of 64^3 voxels above a small floor, in a cube or declared by the sensor.
  SceneSnapshot smokeAlone(const Density& density, bool inCube) {
    const std::string medium =
        fmt::format(R"(<medium type="heterogeneous" id="smoke"><volume name="sigma_t" type="gridvolume">
      <string name="filename" value="{}"/><transform name="to_world"><translate value="-0.5"/><scale value="16"/>
      </transform></volume></medium><shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/>
      <translate y="-2"/></transform></shape>)",
                    write(density, 64));
    const std::string cube = R"(<shape type="cube"><transform name="to_world"><scale value="8"/></transform>
      <bsdf type="null"/><ref id="smoke" name="interior"/></shape><sensor type="perspective"/>)";
    const std::string sensor = R"(<sensor type="perspective"><ref id="smoke" name="medium"/></sensor>)";
    return buildScene(test::describe(medium + (inCube ? cube : sensor), folder_.path().string()));
  }

 private:
  std::string write(const Density& density, int size) {
    DenseVolume volume{size, size, size, {}, {}};
    for (int z = 0; z < size; ++z)
      for (int y = 0; y < size; ++y)
        for (int x = 0; x < size; ++x)
          volume.values.push_back(
              density((Vec3(static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)) + Vec3(0.5f)) /
                      static_cast<float>(size)));
    const std::string name = fmt::format("smoke{}.vol", ++files_);
    writeVol(folder_.path() / name, volume);
    return name;
  }

  ScratchFolder folder_;
  int files_ = 0;
};

/// What a set of walks carries: sums of weights, by kind, half of the room, depth and channel.
constexpr size_t kBins = 2 * 2 * 3 * 3;
using Carried = std::array<double, kBins>;

Carried carriedBy(const VirtualLights& lights) {
  Carried sums{};
  for (const LightVertex& v : lights.lights)
    for (int c = 0; c < 3; ++c) {
      const int bin =
          (((v.kind == VertexKind::surface ? 1 : 0) * 2 + (v.p.x > 0 ? 1 : 0)) * 3 + std::min(v.depth, 3) - 1);
      // Of a vertex on a wall the weight is irradiance over the cosine: the cosine makes it flux.
      const float cosine = generalCosine(v.normal, v.wi);
      sums[static_cast<size_t>(3 * bin + c)] += static_cast<double>(v.weight[c] * cosine) / lights.walks();
    }
  return sums;
}

using Moments = std::array<stats::Moments, kBins>;
constexpr WalkOptions kWalks{.walks = 64, .maxDepth = 6};

template <class Make>
Moments momentsOf(int sets, uint64_t seed, const Make& make) {
  Moments moments;
  for (int s = 0; s < sets; ++s) {
    const Carried c = carriedBy(make(SampleId{seed * 100000 + static_cast<uint64_t>(s), 0, 0, 0}));
    for (size_t i = 0; i < kBins; ++i) moments[i].add(c[i]);
  }
  return moments;
}

struct Verdict {
  double p = 1;          ///< of the worst bin, times their number
  double precision = 0;  ///< of all that is carried
};
Verdict compared(const Moments& a, const Moments& b) {
  Verdict v;
  double level = 0, variance = 0;
  for (size_t i = 0; i < kBins; ++i) {
    v.p = std::min(v.p, static_cast<double>(kBins) * stats::welchTest(a[i], b[i]));
    level += b[i].mean();
    variance += std::pow(a[i].standardError(), 2);
  }
  v.precision = std::sqrt(variance) / level;
  return v;
}

constexpr int kSets = 600;
constexpr double kDisagree = 1e-4;

float left(Vec3 p) { return p.x < 0.5f ? 0.6f : 0.f; }
float moved(Vec3 p) { return p.x > 0.3f && p.x < 0.8f ? 0.6f : 0.f; }
float stripes(Vec3 p) { return 0.6f + 0.5f * std::sin(17 * p.x) * std::sin(13 * p.y); }
float none(Vec3) { return 0; }

TEST_F(KeptWalksTest, CarryWhatFreshOnesCarryWhateverTheMediaBecome) {
  struct Case {
    const char* what;
    SceneSnapshot before, after;
    double precision;
    int later = 1;      ///< frames after the change
    float retrace = 0;  ///< in each
  };
  const Case cases[] = {
      {"the same", room(stripes), room(stripes), 0.02},
      {"in place", room(stripes), room([](Vec3 p) { return 1.5f - stripes(p); }), 0.03},
      {"into empty space", room(left), room(moved), 0.04},
      {"the same, half of them traced anew", room(left), room(moved), 0.04, 2, 0.25f},
      {"out of nothing", room(none), room(stripes), 0.03},
      {"vanishing", room(stripes), room(none), 0.02},
      {"another colour, another albedo", room(stripes, "0.6, 0.6, 1.2", 0.1), room(stripes, "1.2, 0.5, 0", 0.9), 0.03},
  };
  uint64_t seed = 0;
  for (const Case& c : cases) {
    const Moments fresh =
        momentsOf(kSets, ++seed, [&](const SampleId& id) { return traceVirtualLights(*c.after, kWalks, id); });
    const Moments kept = momentsOf(kSets, ++seed, [&](const SampleId& id) {
      KeptWalks walks;
      walks.lights(*c.before, kWalks, id, 0, 0);
      for (int frame = 1; frame < c.later; ++frame) walks.lights(*c.after, kWalks, id, frame, c.retrace);
      return walks.lights(*c.after, kWalks, id, c.later, c.retrace);
    });
    const Moments stale =
        momentsOf(kSets, ++seed, [&](const SampleId& id) { return KeptWalks().lights(*c.before, kWalks, id, 0, 0); });
    const Verdict verdict = compared(kept, fresh), control = compared(stale, fresh);
    fmt::print("{:32} p {:.2g}, precision {:.2f} %; as before: p {:.2g}\n", c.what, std::min(1.0, verdict.p),
               100 * verdict.precision, control.p);
    EXPECT_GT(verdict.p, kDisagree) << c.what;
    EXPECT_LT(verdict.precision, c.precision) << c.what << ": too few samples to tell";
    if (c.before == cases[0].before) continue;
    EXPECT_LT(control.p, kDisagree) << c.what << ": the test cannot fail";
  }
}

TEST_F(KeptWalksTest, AimedOnesCarryTheSame) {
  const SceneSnapshot before = room(left), after = room(stripes);
  WalkOptions aimed = kWalks;
  aimed.aimed = 0.5f;
  const Moments fresh =
      momentsOf(kSets, 31, [&](const SampleId& id) { return traceVirtualLights(*after, kWalks, id); });
  const Moments kept = momentsOf(kSets, 32, [&](const SampleId& id) {
    KeptWalks walks;
    walks.lights(*before, aimed, id, 0, 0);
    return walks.lights(*after, aimed, id, 1, 0);
  });
  const Verdict verdict = compared(kept, fresh);
  EXPECT_GT(verdict.p, kDisagree);
  EXPECT_LT(verdict.precision, 0.04);
}

TEST_F(KeptWalksTest, KnowHowMuchTheMediaChange) {
  const SceneSnapshot before = room(stripes);
  const auto changeTo = [&](const SceneSnapshot& next) { return changeOfMedia(*before, *next); };
  EXPECT_EQ(changeTo(before), 0);
  EXPECT_NEAR(changeTo(room([](Vec3 p) { return 1.01f * stripes(p); })), 0.01f, 1e-4f);
  EXPECT_NEAR(changeTo(room(stripes, "0.3, 0.6, 1.3")), 0.1f / 2.1f, 1e-4f);
  EXPECT_NEAR(changeTo(room(none)), 1, 1e-4f);
  EXPECT_EQ(changeOfMedia(*room(none), *before), 1);
  EXPECT_EQ(changeTo(room(stripes, "0.3, 0.6, 1.2", 0.5)), 0) << "an albedo is no extinction";
}

// A small ball in a large grid, as the sensor's medium and in a cube; it moves by its own width.
TEST_F(KeptWalksTest, KnowHowMuchSmallMediaChange) {
  const auto ball = [](float x) { return [x](Vec3 p) { return length(p - Vec3(x, 0.5f, 0.5f)) < 0.03f ? 1.f : 0.f; }; };
  const auto moved = [&](float by, bool inCube) {
    return changeOfMedia(*smokeAlone(ball(0.25f), inCube), *smokeAlone(ball(0.25f + by), inCube));
  };
  for (const bool inCube : {false, true}) {
    EXPECT_EQ(moved(0, inCube), 0);
    EXPECT_GT(moved(1 / 16.f, inCube), 0.9f);
    EXPECT_NEAR(moved(1 / 64.f, inCube), 0.75f, 0.25f);
  }
}

bool same(const VirtualLights& a, const VirtualLights& b) {
  return a.firstOf == b.firstOf && std::equal(a.lights.begin(), a.lights.end(), b.lights.begin(), b.lights.end(),
                                              [](const LightVertex& x, const LightVertex& y) {
                                                return x.kind == y.kind && x.p == y.p && x.wi == y.wi &&
                                                       x.weight == y.weight && x.medium == y.medium &&
                                                       x.depth == y.depth && x.normal == y.normal;
                                              });
}

const SampleId kId{5, 1, 0, 3};

TEST_F(KeptWalksTest, AreTracedAnewInTurn) {
  const SceneSnapshot before = room(left), after = room(moved);
  const VirtualLights fresh = KeptWalks().lights(*after, kWalks, kId, 0, 0);
  KeptWalks all, quarters, none;
  for (KeptWalks* walks : {&all, &quarters, &none}) walks->lights(*before, kWalks, kId, 0, 0);
  EXPECT_TRUE(same(all.lights(*after, kWalks, kId, 1, 1), fresh));
  for (int frame = 1; frame <= 4; ++frame) {
    const VirtualLights lights = quarters.lights(*after, kWalks, kId, frame, 0.25f);
    EXPECT_EQ(same(lights, fresh), frame == 4);
    EXPECT_TRUE(same(lights, quarters.lights(*after, kWalks, kId, frame, 0.25f))) << "once more in the same frame";
    EXPECT_FALSE(same(none.lights(*after, kWalks, kId, frame, 0), fresh));
  }
}

TEST_F(KeptWalksTest, StandStillInAStandingScene) {
  const SceneSnapshot scene = room(stripes);
  KeptWalks walks;
  const VirtualLights first = walks.lights(*scene, kWalks, kId, 0, 0.3f);
  for (int frame = 1; frame < 5; ++frame) EXPECT_TRUE(same(walks.lights(*scene, kWalks, kId, frame, 0.3f), first));
}

TEST_F(KeptWalksTest, DoNotDependOnTheNumberOfThreads) {
  const SceneSnapshot before = room(stripes), after = room(moved);
  const auto with = [&](size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    KeptWalks walks;
    walks.lights(*before, kWalks, kId, 0, 0);
    return walks.lights(*after, kWalks, kId, 1, 0.3f);
  };
  EXPECT_TRUE(same(with(1), with(4)));
}

TEST_F(KeptWalksTest, AStopLeavesNoHalfWalksBehind) {
  const SceneSnapshot scene = room(stripes);
  std::stop_source stop;
  stop.request_stop();
  KeptWalks walks;
  EXPECT_TRUE(walks.lights(*scene, kWalks, kId, 0, 0, stop.get_token()).lights.empty());
  EXPECT_TRUE(same(walks.lights(*scene, kWalks, kId, 0, 0), KeptWalks().lights(*scene, kWalks, kId, 0, 0)));
}

TEST_F(KeptWalksTest, AreForgottenWhereMoreThanMediaChanges) {
  const SceneSnapshot before = room(left), after = room(moved);
  const VirtualLights fresh = KeptWalks().lights(*after, kWalks, kId, 0, 0);
  const auto isKept = [&](const ChangeSet& changes) {
    WalkStore store;
    store.lights(*before, kWalks, kId, 0, 0);
    store.edit(*before, *after, changes);
    return !same(store.lights(*after, kWalks, kId, 0, 0), fresh);
  };
  const std::string id = "_volume_1";
  EXPECT_TRUE(isKept({{{id, Aspect::mediumGrid}}}));
  EXPECT_TRUE(isKept({{{id, Aspect::mediumGrid}, {"camera", Aspect::camera}, {id, Aspect::mediumPose}}}));
  EXPECT_TRUE(isKept(differences(before->description, after->description)));
  for (const Aspect aspect : {Aspect::shapePose, Aspect::shapeTopology, Aspect::emitterIntensity, Aspect::emitterPose,
                              Aspect::emitterSet, Aspect::material, Aspect::setting})
    EXPECT_FALSE(isKept({{{id, Aspect::mediumGrid}, {"_shape_1", aspect}}})) << static_cast<int>(aspect);
  EXPECT_FALSE(isKept({{{"_phase_1", Aspect::mediumParameters}}}));
  EXPECT_FALSE(isKept({{{"nobody", Aspect::mediumGrid}}}));
}

TEST_F(KeptWalksTest, AreForgottenWhereAMediumNamesAnotherPhaseFunction) {
  const auto fog = [](const std::string& phase, double sigmaT) {
    const std::string medium = R"(<shape type="sphere"><bsdf type="null"/><medium name="interior" type="homogeneous">
      <float name="sigma_t" value="{}"/><ref name="phase" id="{}"/></medium></shape>)";
    return test::build(R"(<phase type="isotropic" id="even"/><phase type="hg" id="forward"><float name="g" value="0.9"/>
      </phase><emitter type="point"/>)" +
                       fmt::format(fmt::runtime(medium), sigmaT, phase) + fmt::format(fmt::runtime(medium), 1, "even") +
                       fmt::format(fmt::runtime(medium), 1, "forward"));
  };
  const auto isKept = [](const SceneSnapshot& before, const SceneSnapshot& after) {
    return WalkStore().edit(*before, *after, differences(before->description, after->description));
  };
  EXPECT_TRUE(isKept(fog("even", 2), fog("even", 3)));
  EXPECT_FALSE(isKept(fog("even", 2), fog("forward", 2)));
}

}  // namespace
}  // namespace virga
