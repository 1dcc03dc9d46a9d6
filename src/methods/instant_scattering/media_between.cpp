// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/media_between.h"

#include "core/octahedral.h"
#include "core/parallel.h"
#include "methods/instant_scattering/eye_packet.h"
#include "transport/media_bounds.h"
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

DepthView viewOf(const Bounds& media, Vec3 p) {
  const Vec3 way = media.center() - p;
  const float radius = 0.5f * length(media.extent()), d = length(way);
  if (!(d > 1.001f * radius)) return {1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 0, d + radius};
  const Frame frame(way / d);
  const float height = std::max(1e-7f, square(radius / d) / (1 + std::sqrt(1 - square(radius / d))));  // 1 - cosine
  return {frame.s.x, frame.s.y, frame.s.z, frame.t.x,  frame.t.y,  frame.t.z,
          frame.n.x, frame.n.y, frame.n.z, 2 / height, d - radius, d + radius};
}

/// Distances of a table's nodes.
std::vector<float> radiiOf(const DepthView& view, int count) {
  std::vector<float> radii;
  for (int m = 0; m < count; ++m)
    radii.push_back(view.first +
                    (view.last - view.first) * square(static_cast<float>(m) / static_cast<float>(count - 1)));
  return radii;
}

/// Optical depth along a ray as it was marched: linear between these distances.
struct MarchedDepth {
  struct Mark {
    float t;
    Rgb depth;
  };
  std::vector<Mark> marks;

  void clear() { marks.assign(1, {0, {}}); }
  void add(float t0, float t1, Rgb depth) {
    if (t0 > marks.back().t) marks.push_back({t0, marks.back().depth});
    marks.push_back({t1, marks.back().depth + depth});
  }
  /// At each radius, of one channel.
  void write(const std::vector<float>& radii, int channel, float* out) const {
    size_t next = 0;
    for (const float r : radii) {
      while (next < marks.size() && marks[next].t <= r) ++next;
      const Mark& a = marks[std::max<size_t>(next, 1) - 1];
      const Mark& b = marks[std::min(next, marks.size() - 1)];
      *out++ = b.t > a.t ? lerp(a.depth[channel], b.depth[channel], (r - a.t) / (b.t - a.t)) : a.depth[channel];
    }
  }
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
  boxes_ = boxesOfMedia(scene, mostParts());
  if (boxes_.empty()) {
    kind_ = Kind::nothing;
    return;
  }
  VIRGA_ASSERT(sizeOfTable() < DepthTable::kMostSize);
  for (const Vec3 p : points_)
    for (const Bounds& box : boxes_) views_.push_back(viewOf(box, p));
  depth_.resize(views_.size() * static_cast<size_t>(channels_) * sizeOfTable());
  const int packets = (options_.side * options_.side + EyePacket::kSize - 1) / EyePacket::kSize;
  parallelFor(static_cast<int64_t>(points_.size()), 1, [&](int64_t n) {
    const auto i = static_cast<size_t>(n);
    const MediaState at = mediaAt(scene, points_[i], endlessMedium(scene));
    parallelFor(packets, 8, [&](int64_t packet) {
      for (size_t part = 0; part < parts() && !stop.stop_requested(); ++part)
        fill(scene, i, part, at, static_cast<size_t>(packet) * EyePacket::kSize);
    });
  });
}

size_t MediaBetween::mostParts() const {
  constexpr size_t kMostBytes = 256 << 20;
  const size_t one = std::max<size_t>(1, points_.size()) * static_cast<size_t>(channels_) * sizeOfTable();
  return std::clamp(kMostBytes / (one * sizeof(float)), size_t{1}, static_cast<size_t>(options_.parts));
}

template <class Visit>
void MediaBetween::walkPart(const Scene& scene, size_t part, MediaRay& r, float tMax, const Visit& visit) const {
  const EmbreeRays rays{*scene.surfaceRays, *scene.boundaryRays};
  ClippedRange within{0, tMax};
  if (parts() > 1) within = clipToBox(r.ray.o, r.ray.d, boxes_[part].lo, boxes_[part].hi, 0, tMax);
  if (!(within.t0 < within.t1)) return;
  walkMedia(scene.view, rays, r, within.t1, [&](float t0, float t1) {
    const float from = std::max(t0, within.t0);
    return !(from < t1) || visit(from, t1);
  });
}

void MediaBetween::fill(const Scene& scene, size_t i, size_t part, const MediaState& media, size_t first) {
  const SceneView& view = scene.view;
  const DepthView& lookAt = views_[i * parts() + part];
  const auto side = static_cast<size_t>(options_.side), radii = static_cast<size_t>(options_.radii);
  const size_t count = std::min<size_t>(EyePacket::kSize, side * side - first);
  const int steps = options_.radii * 4 / 3;
  const std::vector<float> distances = radiiOf(lookAt, options_.radii);
  float* const table = &depth_[(i * parts() + part) * static_cast<size_t>(channels_) * sizeOfTable() + first * radii];
  EyePacket packet;
  packet.clear();
  const auto rayOf = [&](size_t n) {
    const auto column = static_cast<int>((first + n) % side), row = static_cast<int>((first + n) / side);
    return MediaRay{{points_[i], nodeDirection(lookAt, options_.side, column, row)}, media, 0};
  };
  for (size_t n = 0; n < count; ++n) {
    MediaRay r = rayOf(n);
    bool alone = false;  // its media are not for the packet
    walkPart(scene, part, r, lookAt.last, [&](float t0, float t1) {
      alone = !r.media.vacuum() && (packet.has(n) || !packet.add(view, n, r.ray, r.media, t0, t1, steps, 0));
      return !alone;
    });
    if (!alone) continue;
    packet.remove(n);
    fillNode(scene, part, rayOf(n), distances, table + n * radii);
  }
  packet.march();
  for (size_t n = 0; n < count; ++n)
    for (size_t c = 0; packet.has(n) && c < static_cast<size_t>(channels_); ++c) {
      float* const out = table + c * sizeOfTable() + n * radii;
      packet.depthsAt(n, distances, out);
      for (size_t m = 0; channels_ > 1 && m < radii; ++m) out[m] *= packet.medium().spectrum[static_cast<int>(c)];
    }
}

void MediaBetween::fillNode(const Scene& scene, size_t part, MediaRay r, const std::vector<float>& distances,
                            float* out) const {
  const int steps = options_.radii * 4 / 3;
  MarchedDepth way;
  way.clear();
  walkPart(scene, part, r, distances.back(), [&](float t0, float t1) {
    return marchMedia(scene.view, r.media, r.ray, t0, t1, steps, 0, [&](float a, float b, Rgb depth) {
      way.add(a, b, depth);
      return true;
    });
  });
  for (int c = 0; c < channels_; ++c) way.write(distances, c, out + static_cast<size_t>(c) * sizeOfTable());
}

size_t MediaBetween::partAround(size_t i) const {
  const auto holds = [p = points_[i]](const Bounds& b) { return max(min(p, b.hi), b.lo) == p; };
  return static_cast<size_t>(std::find_if(boxes_.begin(), boxes_.end(), holds) - boxes_.begin());
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
    for (size_t part = 0; kind_ == Kind::tables && part < parts(); ++part)
      lookThroughTable({p.x, p.y, p.z}, to, table(i, part, c), seen[c]);
  }
}

}  // namespace virga
