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
  MapCanvas(int resolution, const std::vector<Vec3>& directions)
      : resolution_(resolution), directions_(directions), depths_(directions.size(), kInfinity) {}

  const std::vector<float>& depths() const { return depths_; }

  /// `center`: of the disk, as seen from the light.
  void draw(const SurfaceDisk& disk, Vec3 center) {
    const float d2 = lengthSquared(center), d = std::sqrt(d2);
    const float plane = dot(center, disk.normal), r2 = disk.radius * disk.radius;
    const OctahedralTexel middle = octahedralTexel(center, resolution_);
    if (std::fabs(plane) < kFlat * d) return;
    const int reach = texelsWithin(disk.radius / d);
    for (int y = -reach; y <= reach; ++y)
      for (int x = -reach; x <= reach; ++x) {
        const OctahedralTexel texel = wrapOctahedral({middle.x + x, middle.y + y}, resolution_);
        const Vec3 w = directions_[static_cast<size_t>(texel.index(resolution_))];
        const float t = plane / dot(w, disk.normal);
        if (t > 0 && lengthSquared(w * t - center) < r2) lower(texel, t);
      }
  }

  /// Squares of 2 x 2 texels, of 4 x 4, ... take the farthest depth of their parts, and hand it down to those that have
  /// none.
  void closeHoles() { closeHoles(depths_, resolution_, kHoleLevels); }

 private:
  /// Half the side of a square that holds all directions within the angle whose sine this is.
  int texelsWithin(float sine) const {
    const float angle = sine < 1 ? std::asin(sine) : kPi;
    const float half = 0.5f * static_cast<float>(resolution_);
    return static_cast<int>(std::ceil(std::min(kOctahedralSpeed * angle, 1.f) * half));
  }
  void lower(OctahedralTexel texel, float t) {
    float& depth = depths_[static_cast<size_t>(texel.index(resolution_))];
    depth = std::min(depth, t);
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
  const std::vector<Vec3>& directions_;
  std::vector<float> depths_;
};

/// Rounded to the upper half of its bits.
uint16_t upperHalf(float depth) { return static_cast<uint16_t>((std::bit_cast<uint32_t>(depth) + 0x8000u) >> 16); }

/// Could light meet a disk that lies there, as seen from it? Lambertian lights (those whose surface is not kept) shine
/// to one side.
bool mayBlock(const LightVertex& light, Vec3 center) {
  const float d2 = lengthSquared(center);
  if (!(d2 > 0)) return false;
  if (light.kind != VertexKind::surface) return true;
  const float above = dot(center, light.normal) / std::sqrt(d2);
  return (light.surface < 0 ? above : std::fabs(above)) > kFlat;
}

}  // namespace

ShadowMaps::ShadowMaps(const SurfacePoints& points, std::span<const LightVertex> lights,
                       const ShadowMapOptions& options, const std::stop_token& stop)
    : options_(options) {
  const int resolution = options.resolution;
  directions_.reserve(texels());
  for (int y = 0; y < resolution; ++y)
    for (int x = 0; x < resolution; ++x) directions_.push_back(octahedralDirection({x, y}, resolution));
  depths_.resize(lights.size() * texels());
  parallelFor(static_cast<int64_t>(lights.size()), 4, [&](int64_t i) {
    if (stop.stop_requested()) return;
    draw(points, lights[static_cast<size_t>(i)], static_cast<size_t>(i));
  });
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
  for (const float depth : canvas.depths()) *out++ = upperHalf(depth);
}

}  // namespace virga
