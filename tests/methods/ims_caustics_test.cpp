// SPDX-License-Identifier: Apache-2.0
// Light by way of mirrors and glass alone, where the fast modes of instant multiple scattering march toward lamps.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "methods/ims_scenes.h"
#include "methods/instant_scattering/ims_eye_paths.h"
#include "methods/rendering.h"

namespace virga {
namespace {

using namespace virga::testing;

/// Fog in a cube under a sky, with a ball over a floor: lamps at infinity are marched to.
std::string ballUnderSky(const std::string& bsdf) {
  return R"(
    <emitter type="constant"><rgb name="radiance" value="0.5"/></emitter>
    <sensor type="perspective"><float name="fov" value="40"/><transform name="to_world">
      <lookat origin="0, 1, 4" target="0, -0.3, 0" up="0, 1, 0"/></transform>
      <film type="hdrfilm"><integer name="width" value="24"/><integer name="height" value="24"/><rfilter type="box"/></film>
    </sensor>
    <shape type="rectangle"><transform name="to_world"><scale value="3"/><rotate x="1" angle="-90"/>
      <translate y="-1"/></transform><bsdf type="diffuse"/></shape>
    <shape type="sphere"><float name="radius" value="1"/><point name="center" x="0" y="0.01" z="-0.6"/>)" +
         bsdf + R"(</shape>
    <shape type="cube"><bsdf type="null"/><transform name="to_world"><scale x="2.2" y="0.9" z="1.4"/></transform>
      <medium name="interior" type="homogeneous"><float name="sigma_t" value="0.5"/><float name="albedo" value="0.9"/>
      </medium></shape>)";
}

void expectCaustics(const std::string& bsdf) {
  const SceneSnapshot scene = sceneOf(ballUnderSky(bsdf));
  ASSERT_TRUE(marchesLamps(scene->view));
  const RenderSession truth = rendered(scene, {.passes = 256, .seed = 5, .layers = LayerMask::all()});
  for (const char* mode : {"fast", "frame"}) {
    const RenderSession own = rendered(
        scene,
        {.passes = 48, .layers = LayerMask::all(), .method = "ims", .settings = {{"mode", mode}, {"walks", "16"}}});
    for (const Layer layer : {Layer::causticSurface, Layer::causticMedia}) {
      const stats::Moments a = replicateMoments(own.film(), layer), b = replicateMoments(truth.film(), layer);
      const double noise = 4 * std::hypot(a.standardError(), b.standardError());
      EXPECT_NEAR(a.mean(), b.mean(), 0.01 * b.mean() + noise) << mode << kLayerNames[static_cast<size_t>(layer)];
      EXPECT_LT(noise, 0.25 * b.mean()) << "too few samples to tell";
    }
  }
}

TEST(ImsCaustics, OfGlassAreThereWhereLampsAreMarchedTo) { expectCaustics(R"(<bsdf type="dielectric"/>)"); }
TEST(ImsCaustics, OfMirrorsAreThereWhereLampsAreMarchedTo) { expectCaustics(R"(<bsdf type="conductor"/>)"); }

TEST(ImsCaustics, AreLookedForWhereTheyCanBeFoundAlone) {
  EXPECT_TRUE(hasCaustics(sceneOf(ballUnderSky(R"(<bsdf type="dielectric"/>)"))->view));
  EXPECT_FALSE(hasCaustics(sceneOf(ballUnderSky(R"(<bsdf type="diffuse"/>)"))->view));
}

}  // namespace
}  // namespace virga
