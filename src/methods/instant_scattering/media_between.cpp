// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/media_between.h"

#include "core/octahedral.h"
#include "core/parallel.h"
#include "methods/instant_scattering/eye_march.h"
#include "transport/virtual_lights.h"

namespace virga {
namespace {

/// Of a node of the table, in the world.
Vec3 nodeDirection(const DepthView& f, int side, int column, int row) {
  const auto place = [side](int n) { return 2 * static_cast<float>(n) / static_cast<float>(side - 1) - 1; };
  const Vec3 stretched = fromOctahedron({place(column), place(row)});
  const float c = 1 - (1 - stretched.z) / f.stretch, sine = std::sqrt(std::max(0.f, 1 - c * c));
  const float off = std::sqrt(square(stretched.x) + square(stretched.y));
  // Against the axis, at the map's corners, any direction of the cone's border will do.
  const float x = off > 0 ? stretched.x * sine / off : sine, y = off > 0 ? stretched.y * sine / off : 0.f;
  return Vec3(f.ux, f.uy, f.uz) * x + Vec3(f.vx, f.vy, f.vz) * y + Vec3(f.wx, f.wy, f.wz) * c;
}

/// Calls visit(t0, t1, ray) for stretches of media along a ray from p, but for where grids hold nothing.
template <class Visit>
void visitStretches(const SceneView& view, const EmbreeRays& rays, MediaRay r, float tMax, const Visit& visit) {
  walkMedia(view, rays, r, tMax, [&](float t0, float t1) {
    for (int i = 0; i < r.media.count(); ++i) {
      const MediumView& medium = view.media[r.media.medium(i)];
      ClippedRange in{t0, t1};
      if (!medium.homogeneous && !(medium.density.background > 0))
        in = clipToBox(medium.worldToDensity.point(r.ray.o), medium.worldToDensity.vector(r.ray.d),
                       medium.density.supportLo, medium.density.supportHi, t0, t1);
      if (in.t0 < in.t1) visit(in.t0, in.t1, r);
    }
    return true;
  });
}

/// Where boundaries say that media may be; everywhere, if there are media outside of them.
Bounds whereMediaMayBe(const Scene& scene) {
  const bool within = scene.view.cameraMedia.vacuum() &&
                      std::none_of(scene.view.surfaces.begin(), scene.view.surfaces.end(),
                                   [](const ShapeView& s) { return s.media.declared(); });
  return within ? scene.boundaryRays->bounds() : scene.view.bounds;
}

/// All of the scene that holds media, as far as rays from a few points tell.
Bounds boundsOfMedia(const Scene& scene) {
  constexpr int kPoints = 3, kDirections = 12;
  const EmbreeRays rays{*scene.surfaceRays, *scene.boundaryRays};
  const int endless = endlessMedium(scene);
  const DepthView around{1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 0, 1};
  Bounds where = whereMediaMayBe(scene);
  if (where.empty()) where = {Vec3(-1), Vec3(1)};
  // Media without end, and no shapes among them: as far as may matter.
  const float most = scene.view.bounds.empty() ? 1e3f : 2 * length(scene.view.bounds.extent());
  const auto place = [](int n) { return (static_cast<float>(n % kPoints) + 0.5f) / kPoints; };
  Bounds media;
  for (int i = 0; i < kPoints * kPoints * kPoints; ++i) {
    const Vec3 p = where.lo + where.extent() * Vec3(place(i), place(i / kPoints), place(i / kPoints / kPoints));
    const MediaState state = mediaAt(scene, p, endless);
    for (int n = 0; n < kDirections * kDirections; ++n) {
      const Vec3 d = nodeDirection(around, kDirections, n % kDirections, n / kDirections);
      visitStretches(scene.view, rays, {{p, d}, state, 0}, most, [&](float t0, float t1, const MediaRay& r) {
        media.extend(r.ray.at(t0)), media.extend(r.ray.at(t1));
      });
    }
  }
  return media;
}

DepthView viewOf(const Bounds& media, Vec3 p) {
  const Vec3 way = media.center() - p;
  const float radius = 0.5f * length(media.extent()), d = length(way);
  if (!(d > 1.001f * radius)) return {1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 0, d + radius};
  const Frame frame(way / d);
  const float height = std::max(1e-7f, square(radius / d) / (1 + std::sqrt(1 - square(radius / d))));  // 1 - cosine
  return {frame.s.x, frame.s.y, frame.s.z, frame.t.x,  frame.t.y,  frame.t.z,
          frame.n.x, frame.n.y, frame.n.z, 2 / height, d - radius, d + radius};
}

/// The way along a ray from a table's point: optical depths of its parts between the radii.
class TableRay {
 public:
  TableRay(const DepthView& view, int radii) : view_(view), depth_(static_cast<size_t>(radii)) {}

  /// Adds what lies, evenly, between two distances.
  void add(float t0, float t1, Rgb depth) {
    const float share = 1 / (t1 - t0);
    const int last = static_cast<int>(depth_.size()) - 1;
    for (int m = std::clamp(static_cast<int>(placeOf(t0)), 0, last - 1); m < last && radius(m) < t1; ++m) {
      const float within = std::min(t1, radius(m + 1)) - std::max(t0, radius(m));
      if (within > 0) depth_[static_cast<size_t>(m) + 1] += depth * (within * share);
    }
  }
  /// Optical depths from the point to each radius, of one channel.
  void write(int channel, float* out) const {
    float sum = 0;
    for (const Rgb& d : depth_) *out++ = sum += d[channel];
  }

 private:
  float intervals() const { return static_cast<float>(depth_.size()) - 1; }
  float radius(int m) const { return view_.first + (view_.last - view_.first) * square(static_cast<float>(m) / intervals()); }
  float placeOf(float t) const {
    return intervals() * std::sqrt(std::max(0.f, t - view_.first) / (view_.last - view_.first));
  }

  const DepthView& view_;
  std::vector<Rgb> depth_;
};

}  // namespace

bool sameMediaEverywhere(const SceneView& view) {
  return view.boundaries.size == 0 && std::none_of(view.surfaces.begin(), view.surfaces.end(),
                                                   [](const ShapeView& s) { return s.media.declared(); });
}

MediaBetween::MediaBetween(const Scene& scene, std::vector<Vec3> points, const Options& options,
                           const std::stop_token& stop)
    : options_(options), channels_(scene.view.chromatic ? 3 : 1), points_(std::move(points)) {
  const SceneView& view = scene.view;
  if (view.media.size == 0) return;
  kind_ = Kind::tables;
  if (sameMediaEverywhere(view)) {
    kind_ = view.cameraMedia.vacuum() ? Kind::nothing : Kind::fog;
    for (int i = 0; i < view.cameraMedia.count(); ++i) {
      const MediumView& medium = view.media[view.cameraMedia.medium(i)];
      if (!medium.homogeneous) kind_ = Kind::tables;
      fog_ += medium.spectrum * medium.sigmaT;
    }
  }
  if (kind_ != Kind::tables) return;
  const Bounds media = boundsOfMedia(scene);
  if (media.empty()) {
    kind_ = Kind::nothing;
    return;
  }
  for (const Vec3 p : points_) views_.push_back(viewOf(media, p));
  depth_.resize(points_.size() * static_cast<size_t>(channels_) * sizeOfTable());
  const auto rows = static_cast<int64_t>(points_.size()) * options_.side;
  parallelFor(rows, 8, [&](int64_t i) {
    if (!stop.stop_requested())
      fillRow(scene, static_cast<size_t>(i / options_.side), static_cast<int>(i % options_.side));
  });
}

void MediaBetween::fillRow(const Scene& scene, size_t i, int row) {
  const SceneView& view = scene.view;
  const EmbreeRays rays{*scene.surfaceRays, *scene.boundaryRays};
  const MediaState media = mediaAt(scene, points_[i], endlessMedium(scene));
  const auto side = static_cast<size_t>(options_.side), radii = static_cast<size_t>(options_.radii);
  float* table = &depth_[i * static_cast<size_t>(channels_) * sizeOfTable() + static_cast<size_t>(row) * side * radii];
  const int steps = options_.radii * 4 / 3;
  for (int column = 0; column < options_.side; ++column, table += radii) {
    MediaRay r{{points_[i], nodeDirection(views_[i], options_.side, column, row)}, media, 0};
    TableRay way(views_[i], options_.radii);
    walkMedia(view, rays, r, views_[i].last, [&](float t0, float t1) {
      return marchMedia(view, r.media, r.ray, t0, t1, steps, 0, [&](float a, float b, Rgb depth) {
        way.add(a, b, depth);
        return true;
      });
    });
    for (int c = 0; c < channels_; ++c) way.write(c, table + static_cast<size_t>(c) * sizeOfTable());
  }
}

void MediaBetween::look(size_t i, const KernelReceivers& to, float* seen[3]) const {
  const Vec3 p = points_[i];
  for (int c = 0; c < 3; ++c) {
    if (c >= channels_) {
      seen[c] = seen[0];
      continue;
    }
    if (kind_ == Kind::fog)
      lookThroughFog({p.x, p.y, p.z}, to, fog_[c], seen[c]);
    else
      std::fill_n(seen[c], to.count, 1.f);
    const size_t table = i * static_cast<size_t>(channels_) + static_cast<size_t>(c);
    if (kind_ == Kind::tables)
      lookThroughTable({p.x, p.y, p.z}, to,
                       {&depth_[table * sizeOfTable()], options_.side, options_.radii, views_[i]}, seen[c]);
  }
}

}  // namespace virga
