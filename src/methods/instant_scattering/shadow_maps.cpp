// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/shadow_maps.h"

#include "core/parallel.h"

namespace virga {
namespace {

/// Disks that are seen at flatter angles than this cosine, and those so near to the plane of a light's own surface,
/// block nothing that matters.
constexpr float kFlat = 0.01f;
/// Holes are closed within squares of 2^kHoleLevels texels.
constexpr int kHoleLevels = 3;
/// So many of the four parts of a square must have a depth for it to have one: else its outline would grow.
constexpr int kLeastParts = 3;

/// One map in the making.
class MapCanvas {
 public:
  MapCanvas(int resolution, const ShadowMaps::Directions& directions)
      : resolution_(resolution), directions_(directions), depths_(directions.x.size(), kInfinity) {}

  const std::vector<float>& depths() const { return depths_; }

  /// `center`: of the disk, as seen from the light.
  void draw(const SurfaceDisk& disk, Vec3 center) {
    const float d = length(center);
    const Seen seen{center, disk.normal, dot(center, disk.normal), square(disk.radius)};
    if (std::fabs(seen.plane) < kFlat * d) return;
    const OctahedralTexel middle = octahedralTexel(center, resolution_);
    const int reach = texelsWithin(center / d, disk.radius / d);
    const int end = resolution_ - 1;
    const int x0 = middle.x - reach, x1 = middle.x + reach, y0 = middle.y - reach, y1 = middle.y + reach;
    const bool overX = x0 < 0 || x1 > end, overY = y0 < 0 || y1 > end;
    if (overX && overY) return drawTexels(seen, 0, end, 0, end);
    drawTexels(seen, x0, x1, y0, y1);
    // What lies beyond a border lies inside, mirrored: wrapOctahedral().
    if (x0 < 0) drawTexels(seen, 0, -1 - x0, end - y1, end - y0);
    if (x1 > end) drawTexels(seen, 2 * end + 1 - x1, end, end - y1, end - y0);
    if (y0 < 0) drawTexels(seen, end - x1, end - x0, 0, -1 - y0);
    if (y1 > end) drawTexels(seen, end - x1, end - x0, 2 * end + 1 - y1, end);
  }

  /// Squares of 2 x 2 texels, of 4 x 4, ... take the farthest depth of their parts, and hand it down to those that have
  /// none.
  void closeHoles() { closeHoles(depths_, resolution_, kHoleLevels); }

 private:
  /// A disk, as the light sees it.
  struct Seen {
    Vec3 center, normal;
    float plane;    ///< dot(center, normal)
    float radius2;  ///< square of its radius
  };

  /// The depth in a direction, if the disk is there, and else the one that was.
  static float depthIn(const Seen& seen, float x, float y, float z, float depth) {
    const float t = seen.plane / (x * seen.normal.x + y * seen.normal.y + z * seen.normal.z);
    const float dx = x * t - seen.center.x, dy = y * t - seen.center.y, dz = z * t - seen.center.z;
    const bool hit = (dx * dx + dy * dy + dz * dz < seen.radius2) & (t > 0) & (t < depth);
    return hit ? t : depth;
  }
  /// Those from x0 to x1 and y0 to y1 that there are, in whole blocks: any texel may be drawn, each is drawn as it
  /// ought to be.
  void drawTexels(const Seen& seen, int x0, int x1, int y0, int y1) {
    constexpr int kBlock = ShadowMaps::Directions::kBlock;
    const float *wx = directions_.x.data(), *wy = directions_.y.data(), *wz = directions_.z.data();
    float* depth = depths_.data();
    for (int y = std::max(y0, 0); y <= std::min(y1, resolution_ - 1); ++y) {
      const int row = y * resolution_, end = row + std::min(x1, resolution_ - 1);
      for (int first = row + std::max(x0, 0); first <= end; first += kBlock)
#pragma omp simd
        for (int i = first; i < first + kBlock; ++i) depth[i] = depthIn(seen, wx[i], wy[i], wz[i], depth[i]);
    }
  }

  /// Half the side of a square that holds all directions within the angle about `middle` whose sine this is.
  int texelsWithin(Vec3 middle, float sine) const {
    const float angle = sine < 1 ? sine * (1 + 0.571f * square(sine)) : kPi;  // more than the arc sine
    // The speed changes by less than this factor within the angle.
    const float speed = std::min(octahedralSpeed(middle) * (1 + 4 * angle), kOctahedralSpeed);
    const float half = 0.5f * static_cast<float>(resolution_);
    return static_cast<int>(std::ceil(std::min(speed * angle, 1.f) * half));
  }
  static void closeHoles(std::vector<float>& fine, int size, int levels) {
    const int half = size / 2;
    if (levels == 0 || half == 0 || size % 2 != 0) return;
    std::vector<float> coarse(static_cast<size_t>(half) * static_cast<size_t>(half), kInfinity);
    const auto part = [&](int x, int y, int i) -> float& {
      return fine[static_cast<size_t>((2 * y + i / 2) * size + 2 * x + i % 2)];
    };
    for (int y = 0; y < half; ++y)
      for (int x = 0; x < half; ++x) {
        int known = 0;
        float farthest = 0;
        for (int i = 0; i < 4; ++i)
          if (const float depth = part(x, y, i); depth < kInfinity) farthest = std::max(farthest, depth), ++known;
        if (known >= kLeastParts) coarse[static_cast<size_t>(y * half + x)] = farthest;
      }
    closeHoles(coarse, half, levels - 1);
    for (int y = 0; y < half; ++y)
      for (int x = 0; x < half; ++x)
        for (int i = 0; i < 4; ++i)
          if (part(x, y, i) == kInfinity) part(x, y, i) = coarse[static_cast<size_t>(y * half + x)];
  }

  int resolution_;
  const ShadowMaps::Directions& directions_;
  std::vector<float> depths_;
};

/// Rounded to the upper half of its bits.
uint16_t upperHalf(float depth) { return static_cast<uint16_t>((std::bit_cast<uint32_t>(depth) + 0x8000u) >> 16); }

/// Could light meet what lies there, as seen from it? Lambertian lights (those whose surface is not kept) shine to one
/// side.
bool mayBlock(const LightVertex& light, Vec3 way) {
  const float d2 = lengthSquared(way);
  if (!(d2 > 0)) return false;
  if (light.kind != VertexKind::surface) return true;
  const float above = dot(way, light.normal) / std::sqrt(d2);
  return (light.surface < 0 ? above : std::fabs(above)) > kFlat;
}

}  // namespace

ShadowMaps::Directions::Directions(int resolution) {
  for (int v = 0; v < resolution; ++v)
    for (int u = 0; u < resolution; ++u) {
      const Vec3 w = octahedralDirection({u, v}, resolution);
      x.push_back(w.x), y.push_back(w.y), z.push_back(w.z);
    }
  for (std::vector<float>* c : {&x, &y, &z}) c->resize(c->size() + kBlock);
}

ShadowMaps::ShadowMaps(const SurfacePoints& points, std::span<const LightVertex> lights,
                       const ShadowMapOptions& options, const std::stop_token& stop)
    : options_(options), directions_(options.resolution) {
  depths_.resize(lights.size() * texels());
  parallelFor(static_cast<int64_t>(lights.size()), 4, [&](int64_t i) {
    if (stop.stop_requested()) return;
    draw(points, lights[static_cast<size_t>(i)], static_cast<size_t>(i));
  });
}

ShadowMaps::ShadowMaps(const RayScene& surfaces, float offset, std::span<const LightVertex> lights,
                       const ShadowMapOptions& options, const std::stop_token& stop)
    : options_(options), directions_(options.resolution) {
  depths_.resize(lights.size() * texels());
  parallelFor(static_cast<int64_t>(lights.size()), 4, [&](int64_t i) {
    if (!stop.stop_requested()) trace(surfaces, offset, lights[static_cast<size_t>(i)], static_cast<size_t>(i));
  });
}

void ShadowMaps::trace(const RayScene& surfaces, float offset, const LightVertex& light, size_t index) {
  // Texels that follow each other in a row look nearly the same way.
  for (size_t first = 0; first < texels(); first += RayPacket::kSize) {
    const size_t count = std::min<size_t>(RayPacket::kSize, texels() - first);
    RayPacket packet;
    for (size_t i = 0; i < count; ++i) {
      const Vec3 w(directions_.x[first + i], directions_.y[first + i], directions_.z[first + i]);
      const Vec3 o =
          light.p + light.normal * std::copysign(offset, dot(w, light.normal));  // the normal is 0 in a medium
      packet.set(static_cast<int>(i), {o, w}, mayBlock(light, w) ? kInfinity : 0);
    }
    const PacketHits hits = surfaces.nearest(packet);
    for (size_t i = 0; i < count; ++i) depths_[index * texels() + first + i] = upperHalf(hits[i].t);
  }
}

void ShadowMaps::draw(const SurfacePoints& points, const LightVertex& light, size_t index) {
  MapCanvas canvas(options_.resolution, directions_);
  Pcg32 random(hash64(options_.seed) + index);
  for (int cell = 0; cell < points.cells(); ++cell) {
    const SurfaceDisk& disk = points.disk(cell, random.nextBits());
    const Vec3 center = disk.p - light.p;
    if (mayBlock(light, center)) canvas.draw(disk, center);
  }
  canvas.closeHoles();
  uint16_t* out = depths_.data() + index * texels();
  std::transform(canvas.depths().begin(), canvas.depths().begin() + static_cast<std::ptrdiff_t>(texels()), out,
                 upperHalf);
}

}  // namespace virga
