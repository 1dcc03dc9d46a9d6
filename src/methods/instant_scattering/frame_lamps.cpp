// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/frame_lamps.h"

#include <bit>
#include <optional>

#include "core/distribution.h"
#include "core/warp.h"
#include "methods/instant_scattering/lamp_places.h"
#include "methods/instant_scattering/light_visibility.h"

namespace virga {
namespace {

/// Points of an area: penumbrae are steps already. Of the sky, and of a textured lamp where packets do not know it.
constexpr int kMostOfLamp = 4, kMostOfSky = 16;

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
  point.medium = emitter.medium;
  return point;
}

/// Where a sphere has a lamp's points: opposite each other, or four at the corners of a tetrahedron, so that about as
/// much of them is seen from all sides. Passes turn it, and so do lamps, lest few points of many face the same way.
Vec2 placeOnSphere(const FixedNumbers& numbers, int group, int k, int count) {
  const auto g = static_cast<float>(group);
  const Frame turned(uniformSphere(
      {numbers.turned(0.5f + g * 0.7548777f, 0.7320508f), numbers.turned(0.5f + g * 0.5698403f, 0.3166248f)}));
  Vec3 at(0, 0, k % 2 == 0 ? 1.f : -1.f);
  if (count > 2 && k > 0)
    at = sphericalDirection(std::sqrt(8.f) / 3, -1 / 3.f, kTwoPi * (numbers.shift() + static_cast<float>(k) / 3));
  const Vec3 p = turned.toWorld(at);
  const float azimuth = std::atan2(p.y, p.x) / kTwoPi;
  return {clamp((1 - p.z) / 2, 0, 1), azimuth < 0 ? azimuth + 1 : azimuth};
}

/// Where on a lamp its texture is bright: a grid over the square of sampleLightPoint().
class TexturedPlaces {
 public:
  TexturedPlaces(const SceneView& scene, const EmitterView& lamp) {
    std::vector<float> weights(kSide * kSide), rows;
    double sum = 0;
    for (size_t n = 0; n < weights.size(); ++n) sum += double{weights[n] = radianceIn(scene, lamp, n)};
    // No place is left out: what a cell's samples do not see counts little, and passes see it.
    for (float& weight : weights) weight += kEven * static_cast<float>(sum) / static_cast<float>(weights.size());
    for (size_t row = 0; row < kSide; ++row)
      rows.push_back(static_cast<float>(columns_.emplace_back(std::span(&weights[row * kSide], kSide)).total()));
    rows_ = Discrete(rows);
  }

  /// Moves a place of an even set to where it is bright. Returns the density there over the square.
  float move(Vec2& place) const {
    if (!(rows_.total() > 0)) return 1;
    const auto row = rows_.view().sample(place.y);
    const auto column = columns_[static_cast<size_t>(row.index)].view().sample(place.x);
    place = {(static_cast<float>(column.index) + column.remapped) / kSide,
             (static_cast<float>(row.index) + row.remapped) / kSide};
    return row.probability * column.probability * kSide * kSide;
  }

 private:
  static constexpr size_t kSide = 64, kLooks = 3;  ///< in either direction; the latter in each cell
  static constexpr float kEven = 0.02f;

  /// Mean of a cell.
  static float radianceIn(const SceneView& scene, const EmitterView& lamp, size_t cell) {
    constexpr auto kAll = static_cast<float>(kSide * kLooks);
    float sum = 0;
    for (size_t n = 0; n < kLooks * kLooks; ++n) {
      const Vec2 at(static_cast<float>(cell % kSide * kLooks + n % kLooks) + 0.5f,
                    static_cast<float>(cell / kSide * kLooks + n / kLooks) + 0.5f);
      sum += mean(lamp.radianceAt(sampleLightPoint(scene, lamp, {at.x / kAll, at.y / kAll}).uv));
    }
    return sum / static_cast<float>(kLooks * kLooks);
  }

  std::vector<Discrete> columns_;  ///< of each row
  Discrete rows_;
};

/// All points of a group, on one lamp or more.
std::vector<LampPoint> pointsOf(const SceneView& scene, const FixedNumbers& numbers, int group) {
  const LampGroup& own = numbers.lamps[group];
  std::optional<TexturedPlaces> textured;
  if (own.lamp != LampGroup::kDrawn && scene.emitters[own.lamp].texture.present())
    textured.emplace(scene, scene.emitters[own.lamp]);
  std::vector<LampPoint> points;
  for (int k = 0; k < own.points; ++k) {
    ChosenLamp lamp = numbers.lamp(scene, group, k, own.points);
    if (textured)
      lamp.chance *= textured->move(lamp.u);
    else if (own.round && own.chosen < 0)
      lamp.u = placeOnSphere(numbers, group, k, own.points);
    points.push_back(lampPoint(scene, lamp));
  }
  return points;
}

}  // namespace

void FrameLamps::chooseGroups(const SceneView& scene) {
  for (int i = 0; i < scene.emitters.size; ++i)
    if (scene.emitterChoice.probability(i) > 0) groups_.push_back({.lamp = i});
  if (groups_.empty()) return;
  if (groups_.size() > kMostPoints) {
    constexpr int kEach = FixedNumbers::kMostPlaces;
    groups_.assign(kMostPoints / kEach, LampGroup{.points = kEach, .onSurface = kEach});
    return;
  }
  const auto each = static_cast<int>(std::bit_floor(kMostPoints / groups_.size()));
  places_ = std::min(each, FixedNumbers::kMostPlaces);
  for (LampGroup& group : groups_) {
    const EmitterView& emitter = scene.emitters[group.lamp];
    if (!emitter.isDelta()) group.points = group.onSurface = std::min(each, kMostOfLamp);
    if (isSky(emitter) || emitter.texture.present()) group.onSurface = std::min(each, kMostOfSky);
    if (!isAimedAt(emitter)) group.points = 0;
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
    for (const LampPoint& point : pointsOf(view, own, group)) {
      points_.push_back(point);
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
