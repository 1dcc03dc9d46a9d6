// SPDX-License-Identifier: Apache-2.0
#include "volume/plume.h"

#include "core/parallel.h"
#include "volume/noise.h"

namespace virga {
namespace {

constexpr float kSourceY = -0.93f;
constexpr float kSourceRadius = 0.085f;
constexpr float kSpread = 0.21f;         // dR/dy
constexpr float kReach = 2.1f;           // |q| beyond which the air is clear
constexpr float kTimePerFrame = 0.035f;  // [R / speed]
constexpr float kFirstFront = 6.9f;      // zeta of the plume's head at frame 0
constexpr float kMemory = 3.4f;          // life of an eddy [R / speed]
constexpr int kSteps = 8;

}  // namespace

CurlTile::CurlTile(uint32_t seed) : velocity_(static_cast<size_t>(kSamples) * kSamples * kSamples) {
  std::vector<Vec3> potential(velocity_.size());
  const auto index = [](int i, int j, int k) {
    constexpr int kMask = kSamples - 1;
    return static_cast<size_t>(((k & kMask) * kSamples + (j & kMask)) * kSamples + (i & kMask));
  };
  constexpr float kStepSize = static_cast<float>(kPeriod) / kSamples;
  parallelFor(kSamples, 1, [&](int64_t plane) {
    const int k = static_cast<int>(plane);
    for (int j = 0; j < kSamples; ++j)
      for (int i = 0; i < kSamples; ++i) {
        const Vec3 p = Vec3(static_cast<float>(i), static_cast<float>(j), static_cast<float>(k)) * kStepSize;
        potential[index(i, j, k)] = {gradientNoise(p, seed + 101, kPeriod), gradientNoise(p, seed + 211, kPeriod),
                                     gradientNoise(p, seed + 307, kPeriod)};
      }
  });
  parallelFor(kSamples, 1, [&](int64_t plane) {
    const int k = static_cast<int>(plane);
    for (int j = 0; j < kSamples; ++j)
      for (int i = 0; i < kSamples; ++i) {
        const Vec3 dx = potential[index(i + 1, j, k)] - potential[index(i - 1, j, k)];
        const Vec3 dy = potential[index(i, j + 1, k)] - potential[index(i, j - 1, k)];
        const Vec3 dz = potential[index(i, j, k + 1)] - potential[index(i, j, k - 1)];
        velocity_[index(i, j, k)] = Vec3(dy.z - dz.y, dz.x - dx.z, dx.y - dy.x) / (2 * kStepSize);
      }
  });
}

Vec3 CurlTile::lookup(Vec3 p) const {
  constexpr float kScale = static_cast<float>(kSamples) / kPeriod;
  constexpr int kMask = kSamples - 1;
  p = p * kScale;
  const Vec3 base{std::floor(p.x), std::floor(p.y), std::floor(p.z)}, f = p - base;
  const int i = static_cast<int>(base.x) & kMask, j = static_cast<int>(base.y) & kMask,
            k = static_cast<int>(base.z) & kMask;
  const int i1 = (i + 1) & kMask, j1 = (j + 1) & kMask, k1 = (k + 1) & kMask;
  const auto at = [&](int x, int y, int z) {
    return velocity_[static_cast<size_t>((z * kSamples + y) * kSamples + x)];
  };
  const auto mix = [](Vec3 a, Vec3 b, float t) { return a + (b - a) * t; };
  return mix(mix(mix(at(i, j, k), at(i1, j, k), f.x), mix(at(i, j1, k), at(i1, j1, k), f.x), f.y),
             mix(mix(at(i, j, k1), at(i1, j, k1), f.x), mix(at(i, j1, k1), at(i1, j1, k1), f.x), f.y), f.z);
}

// Rise with a jet's profile, so that the edge lags and rolls up, and three sizes of eddies that are carried along at
// different speeds, so that their pattern changes.
Vec3 Plume::velocity(const Parcel& parcel) const {
  const Vec3 p = parcel.at;
  const float r2 = p.x * p.x + p.z * p.z, t = parcel.time;
  const float rise = 0.25f + 0.75f / square(1 + 0.45f * r2);
  const float strength = smoothstep(-0.5f, 2.5f, p.y) / (1 + 0.3f * r2);
  const Vec3 large = eddies_.lookup(p * 0.45f + Vec3(0.07f * t, -0.25f * t, 0.3f));
  const Vec3 medium = eddies_.lookup(p * 1.1f + Vec3(2.7f, -0.66f * t, 0.05f * t));
  const Vec3 small = eddies_.lookup(p * 2.5f + Vec3(-0.06f * t, -1.6f * t, 5.1f));
  return Vec3(0, rise, 0) + (large * 0.20f + medium * 0.34f + small * 0.20f) * strength;
}

Plume::Parcel Plume::tracedBack(Parcel parcel) const {
  constexpr float kStep = kMemory / kSteps;
  for (int n = 0; n < kSteps && parcel.at.y > -0.5f; ++n) {
    parcel.at -= velocity(parcel) * kStep;
    parcel.time -= kStep;
  }
  return parcel;
}

// The column before the eddies: puffs and threads that rise with it, and a wider head.
float Plume::column(const Parcel& parcel) const {
  const Vec3 p = parcel.at;
  const float front = kFirstFront + parcel.time, below = front - p.y;
  if (below < 0) return 0;
  const Vec3 carried(p.x, p.y - parcel.time, p.z);
  const float puff = gradientNoise(Vec3(0.4f, 0.8f * carried.y, 0.7f), seed_ + 7);
  const float head = 0.45f * std::exp(-square((below - 0.9f) / 0.8f));
  const float edge = 0.95f + 0.3f * puff + head;
  const float r = std::sqrt(p.x * p.x + p.z * p.z);
  const float inside = 1 - smoothstep(0.5f * edge, 1.1f * edge, r);
  if (inside <= 0) return 0;
  const float threads = fractalNoise(carried * 1.5f, seed_ + 11, 4);
  return inside * clamp(0.75f + 1.1f * threads, 0.03f, 1.3f) * smoothstep(0, 0.5f, below);
}

float Plume::density(Vec3 p, float frame) const {
  const float height = p.y - kSourceY, radius = kSourceRadius + kSpread * height;
  if (height < 0) return 0;
  const Vec3 start{p.x / radius, std::log(radius / kSourceRadius) / kSpread, p.z / radius};
  const float q = std::sqrt(start.x * start.x + start.z * start.z);
  if (q > kReach) return 0;
  const float smoke = column(tracedBack({start, kTimePerFrame * frame})) * (1 - smoothstep(0.75f * kReach, kReach, q));
  const float diluted = std::pow(kSourceRadius / radius, 0.25f);
  const float ends = smoothstep(0, 0.04f, height) * (1 - smoothstep(0.82f, 0.98f, p.y));
  return clamp(1.6f * smoke * diluted * ends, 0, 1);
}

}  // namespace virga
