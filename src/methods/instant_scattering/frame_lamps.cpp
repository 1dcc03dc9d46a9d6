// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/frame_lamps.h"

#include <bit>

#include "methods/instant_scattering/light_visibility.h"

namespace virga {
namespace {

/// Points of an area on surfaces: penumbrae are steps already.
constexpr int kMostOfLamp = 4;

/// Of a lamp's tables: of the smoke's own shadows a voxel or two, as it is seen from a lamp outside. Those of many
/// points are an eighth as large: together they take 150 MB at most, where media are coloured.
constexpr MediaBetween::Options kTables{.side = 128, .radii = 96}, kSmallTables{.side = 64, .radii = 48};
constexpr size_t kMostLargeTables = 8;

LampPoint lampPoint(const SceneView& scene, const ChosenLamp& lamp) {
  LampPoint point;
  if (!(lamp.chance > 0)) return point;
  const EmitterView& emitter = scene.emitters[lamp.index];
  if (!isAimedAt(emitter)) return point;
  const LightPoint on = sampleLightPoint(scene, emitter, lamp.u);
  if (!(on.areaPdf > 0)) return point;
  const Rgb sent = (on.pointLike ? emitter.value : emitter.radianceAt(on.uv)) / (on.areaPdf * lamp.chance);
  point.known = true;
  point.px = on.p.x, point.py = on.p.y, point.pz = on.p.z;
  point.nx = on.normal.x, point.ny = on.normal.y, point.nz = on.normal.z;
  point.all = on.pointLike ? 1.f : 0.f;
  point.r = sent.r, point.g = sent.g, point.b = sent.b;
  point.area = on.pointLike ? 0.f : 1 / on.areaPdf;
  return point;
}

}  // namespace

void FrameLamps::chooseGroups(const SceneView& scene) {
  for (int i = 0; i < scene.emitters.size; ++i)
    if (scene.emitterChoice.probability(i) > 0) groups_.push_back({i, 1});
  if (groups_.empty()) return;
  if (groups_.size() > kMostPoints) {
    groups_.assign(kMostPoints / FixedNumbers::kMostPlaces, {LampGroup::kDrawn, FixedNumbers::kMostPlaces});
    return;
  }
  const auto each = static_cast<int>(std::bit_floor(kMostPoints / groups_.size()));
  places_ = std::min(each, FixedNumbers::kMostPlaces);
  for (LampGroup& group : groups_)
    if (!scene.emitters[group.lamp].isDelta()) group.points = std::min(each, kMostOfLamp);
}

FrameLamps::FrameLamps(const Scene& scene, uint32_t pass, const std::stop_token& stop) {
  const SceneView& view = scene.view;
  alone_ = std::all_of(view.emitters.begin(), view.emitters.end(), isAimedAt);
  if (view.hasLamps()) chooseGroups(view);
  const FixedNumbers own = numbers(pass);
  std::vector<Vec3> places;
  for (int group = 0; group < own.groups(); ++group)
    for (int k = 0; k < own.onSurface(group); ++k) {
      const LampPoint& point = points_.emplace_back(lampPoint(view, own.lamp(view, group, k, own.onSurface(group))));
      places.push_back(Vec3(point.px, point.py, point.pz) + Vec3(point.nx, point.ny, point.nz) * mapOffset(view));
    }
  if (std::none_of(points_.begin(), points_.end(), [](const LampPoint& point) { return point.known; })) places.clear();
  const bool homogeneous =
      std::all_of(view.media.begin(), view.media.end(), [](const MediumView& medium) { return medium.homogeneous; });
  marches_ = homogeneous && !sameMediaEverywhere(view);
  const MediaBetween::Options& tables = places.size() > kMostLargeTables ? kSmallTables : kTables;
  if (!marches_) between_ = MediaBetween(scene, std::move(places), tables, stop);
}

}  // namespace virga
