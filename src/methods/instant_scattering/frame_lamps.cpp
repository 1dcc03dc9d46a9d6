// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/frame_lamps.h"

#include <bit>

#include "core/warp.h"
#include "methods/instant_scattering/lamp_places.h"
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

/// Where a sphere has a lamp's points: opposite each other, or four at the corners of a tetrahedron, so that about as
/// much of them is seen from all sides. Passes turn it, and so do lamps, lest few points of many face the same way.
Vec2 placeOnSphere(const FixedNumbers& numbers, int group, int k, int count) {
  const auto g = static_cast<float>(group);
  const Frame turned(uniformSphere(
      {numbers.turned(0.5f + g * 0.7548777f, 0.7320508f), numbers.turned(0.5f + g * 0.5698403f, 0.2360680f)}));
  Vec3 at(0, 0, k % 2 == 0 ? 1.f : -1.f);
  if (count > 2 && k > 0)
    at = sphericalDirection(std::sqrt(8.f) / 3, -1 / 3.f, kTwoPi * (numbers.shift() + static_cast<float>(k) / 3));
  const Vec3 p = turned.toWorld(at);
  const float azimuth = std::atan2(p.y, p.x) / kTwoPi;
  return {clamp((1 - p.z) / 2, 0, 1), azimuth < 0 ? azimuth + 1 : azimuth};
}

/// Point k of a group on a lamp.
ChosenLamp chosenLamp(const SceneView& scene, const FixedNumbers& numbers, int group, int k) {
  const int count = numbers.onSurface(group);
  ChosenLamp lamp = numbers.lamp(scene, group, k, count);
  if (numbers.lamps[group].round && numbers.lamps[group].chosen < 0) lamp.u = placeOnSphere(numbers, group, k, count);
  return lamp;
}

}  // namespace

void FrameLamps::chooseGroups(const SceneView& scene) {
  for (int i = 0; i < scene.emitters.size; ++i)
    if (scene.emitterChoice.probability(i) > 0) groups_.push_back({.lamp = i});
  if (groups_.empty()) return;
  if (groups_.size() > kMostPoints) {
    groups_.assign(kMostPoints / FixedNumbers::kMostPlaces, LampGroup{.points = FixedNumbers::kMostPlaces});
    return;
  }
  const auto each = static_cast<int>(std::bit_floor(kMostPoints / groups_.size()));
  places_ = std::min(each, FixedNumbers::kMostPlaces);
  for (LampGroup& group : groups_) {
    const EmitterView& emitter = scene.emitters[group.lamp];
    if (!emitter.isDelta()) group.points = std::min(each, kMostOfLamp);
    group.round =
        emitter.kind == EmitterView::Kind::area && scene.surfaces[emitter.shape].kind == ShapeView::Kind::sphere;
  }
}

void FrameLamps::choosePlaces(const SceneView& scene, uint32_t pass) {
  for (LampGroup& group : groups_) {
    if (group.lamp == LampGroup::kDrawn) continue;
    const EmitterView& emitter = scene.emitters[group.lamp];
    if (emitter.kind != EmitterView::Kind::area || emitter.isRectangle) continue;
    const ShapeView::Kind shape = scene.surfaces[emitter.shape].kind;
    if (shape != ShapeView::Kind::mesh && shape != ShapeView::Kind::cylinder) continue;
    const LampPlaces own(scene, emitter, group.points, pass);
    group.round = own.facesApart();
    group.chosen = static_cast<int>(chosen_.size());
    chosen_.insert(chosen_.end(), own.places().begin(), own.places().end());
  }
}

FrameLamps::FrameLamps(const Scene& scene, uint32_t pass, const std::stop_token& stop) {
  const SceneView& view = scene.view;
  alone_ = std::all_of(view.emitters.begin(), view.emitters.end(), isAimedAt);
  if (view.hasLamps()) chooseGroups(view);
  choosePlaces(view, pass);
  const FixedNumbers own = numbers(pass);
  std::vector<Vec3> places;
  for (int group = 0; group < own.groups(); ++group)
    for (int k = 0; k < own.onSurface(group); ++k) {
      const LampPoint& point = points_.emplace_back(lampPoint(view, chosenLamp(view, own, group, k)));
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
