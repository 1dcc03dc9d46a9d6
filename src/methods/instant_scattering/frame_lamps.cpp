// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/frame_lamps.h"

#include "methods/instant_scattering/light_visibility.h"

namespace virga {
namespace {

/// Of a lamp's tables: of the smoke's own shadows a voxel or two, as it is seen from a lamp outside.
constexpr MediaBetween::Options kTables{.side = 128, .radii = 96};

LampPoint lampPoint(const SceneView& scene, const RandomNumbers::Lamp& drawn) {
  const LampChoice lamp = chooseLamp(scene, drawn.choice);
  LampPoint point;
  if (!(lamp.probability > 0)) return point;
  const EmitterView& emitter = scene.emitters[lamp.index];
  if (!isAimedAt(emitter)) return point;
  const LightPoint on = sampleLightPoint(scene, emitter, drawn.u);
  if (!(on.areaPdf > 0)) return point;
  const Rgb sent = (on.pointLike ? emitter.value : emitter.radianceAt(on.uv)) /
                   (on.areaPdf * lamp.probability * static_cast<float>(LampPoints::kCount));
  point.known = true;
  point.px = on.p.x, point.py = on.p.y, point.pz = on.p.z;
  point.nx = on.normal.x, point.ny = on.normal.y, point.nz = on.normal.z;
  point.all = on.pointLike ? 1.f : 0.f;
  point.r = sent.r, point.g = sent.g, point.b = sent.b;
  point.area = on.pointLike ? 0.f : 1 / on.areaPdf;
  return point;
}

}  // namespace

FrameLamps::FrameLamps(const Scene& scene, const FixedNumbers& numbers, const std::stop_token& stop) {
  const SceneView& view = scene.view;
  points_.alone = std::all_of(view.emitters.begin(), view.emitters.end(), isAimedAt);
  std::vector<Vec3> places;
  for (int k = 0; k < LampPoints::kCount; ++k) {
    const LampPoint point = points_.point[k] = lampPoint(view, numbers.lamp(k, LampPoints::kCount));
    places.push_back(Vec3(point.px, point.py, point.pz) + Vec3(point.nx, point.ny, point.nz) * mapOffset(view));
  }
  allAlike_ = view.emitters.size == 1 && view.emitters[0].isDelta();
  if (allAlike_) places.resize(1);
  const bool homogeneous =
      std::all_of(view.media.begin(), view.media.end(), [](const MediumView& medium) { return medium.homogeneous; });
  marches_ = homogeneous && !sameMediaEverywhere(view);
  if (!marches_) between_ = MediaBetween(scene, std::move(places), kTables, stop);
}

}  // namespace virga
