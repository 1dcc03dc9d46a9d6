// SPDX-License-Identifier: Apache-2.0
#include "volume/procedural.h"

#include <fmt/format.h>

#include <array>
#include <cmath>

#include "core/error.h"
#include "core/parallel.h"
#include "volume/noise.h"
#include "volume/plume.h"

namespace virga {
namespace {

// A cumulus: puffs heaped over a flat base, each surface roughened by smaller puffs.
class Cumulus {
 public:
  Cumulus(uint32_t seed, float frame) : seed_(seed), time_(frame / 24) {
    for (int n = 0; n < kPuffs; ++n) puffs_[static_cast<size_t>(n)] = puff(n);
  }

  float density(Vec3 p) const {
    const Vec3 at = p - Vec3(0.06f * std::sin(0.35f * time_), 0, 0.03f * std::sin(0.23f * time_));
    const float depth = envelope(at);
    if (depth < -kRoughness) return 0;
    const float inside = depth + roughness(at);
    const float wisps = 0.75f + 0.25f * fractalNoise(at * 5.f + Vec3(0, -0.3f * time_, 0), seed_ + 61, 3);
    return clamp(smoothstep(0, 0.05f, inside) * wisps * base(at), 0, 1);
  }

 private:
  static constexpr int kPuffs = 26;
  static constexpr float kBase = -0.42f;
  static constexpr float kRoughness = 0.21f;

  struct Puff {
    Vec3 center;
    float radius;
  };

  // Wide and low first, then towers; each breathes at its own pace.
  Puff puff(int n) const {
    const Vec3 u = toUnit3(latticeHash(n, 0, 0, seed_ + 41)), w = toUnit3(latticeHash(n, 1, 0, seed_ + 43));
    const float rank = static_cast<float>(n) / kPuffs, angle = kTwoPi * u.x;
    const float reach = (0.58f - 0.40f * rank) * std::sqrt(u.y);
    const float breath = 1 + 0.07f * std::sin(0.8f * time_ * (0.5f + w.x) + kTwoPi * w.y);
    const float radius = (0.17f + 0.13f * u.z) * breath;
    const float lift = 0.10f + 0.80f * rank * (0.55f + 0.45f * w.z);
    return {{reach * std::cos(angle), kBase + lift, 0.75f * reach * std::sin(angle)}, radius};
  }

  // Depth below the surface of the heap of puffs, blended where they meet.
  float envelope(Vec3 p) const {
    float depth = -1;
    for (const Puff& puff : puffs_) {
      const float d = puff.radius - distance(p, puff.center);
      const float blend = clamp(0.5f + (d - depth) / 0.12f, 0, 1);
      depth = lerp(depth, d, blend) + 0.03f * blend * (1 - blend);
    }
    return depth;
  }

  // Cells around strewn points look like heads of cauliflower; the pattern rises slowly.
  float roughness(Vec3 p) const {
    float sum = 0, size = 0.16f, frequency = 3.6f;
    for (int n = 0; n < 3; ++n, size *= 0.45f, frequency *= 2.1f) {
      const Vec3 at = p * frequency + Vec3(0.05f, -0.22f, 0.03f) * (time_ * (1 + static_cast<float>(n)));
      sum += size * (0.55f - cellNoise(at, seed_ + 71 + static_cast<uint32_t>(n)));
    }
    return clamp(sum, -kRoughness, kRoughness);
  }

  float base(Vec3 p) const {
    const float level = kBase + 0.03f * fractalNoise(Vec3(p.x, 0.2f * time_, p.z) * 3.f, seed_ + 83, 2);
    return smoothstep(level - 0.02f, level + 0.05f, p.y);
  }

  uint32_t seed_;
  float time_;  // [s]
  std::array<Puff, kPuffs> puffs_;
};

// Banks of fog whose upper edge undulates; they drift with a light wind.
float fogDensity(Vec3 p, uint32_t seed, float frame) {
  const float time = frame / 24, height = p.y + 1;
  const Vec3 at = p - Vec3(0.10f, 0, 0.04f) * time;
  const float level = 0.42f + 0.30f * fractalNoise(Vec3(at.x * 1.3f, 0.10f * time, at.z * 1.3f), seed, 3);
  const float banks = fractalNoise(Vec3(at.x * 2.2f, at.y * 3.5f + 0.05f * time, at.z * 2.2f), seed + 17, 5);
  const float fall = std::exp(-1.6f * height / std::max(0.12f, level));
  return clamp(fall * (0.85f + 0.9f * banks) * (1 - smoothstep(1.2f, 1.9f, height)), 0, 1);
}

// Twice as dense at the floor as at the ceiling, with lazy swirls.
float dustDensity(Vec3 p, uint32_t seed, float frame) {
  const float time = frame / 24, height = 0.5f * (p.y + 1);
  const Vec3 drift = Vec3(0.03f, -0.02f, 0.02f) * time;
  const Vec3 bend{gradientNoise(p * 1.4f + drift, seed + 3), gradientNoise(p * 1.4f + drift, seed + 5),
                  gradientNoise(p * 1.4f + drift, seed + 9)};
  const float swirl = fractalNoise((p + drift) * 2.6f + bend * 0.9f, seed + 29, 5);
  return clamp(lerp(0.50f, 0.22f, std::sqrt(height)) * (1 + 0.8f * swirl), 0, 1);
}

// Calls density(p) for each voxel, p in [-1, 1]^3.
template <class Density>
DenseVolume fill(int n, const Density& density) {
  DenseVolume volume;
  volume.nx = volume.ny = volume.nz = n;
  volume.values.resize(static_cast<size_t>(n) * static_cast<size_t>(n) * static_cast<size_t>(n));
  const double step = 2.0 / n;
  volume.indexToWorld =
      Matrix4::translation(0.5 * step - 1, 0.5 * step - 1, 0.5 * step - 1) * Matrix4::scaling(step, step, step);
  const auto place = [&](int i) { return static_cast<float>((i + 0.5) * step - 1); };
  parallelFor(int64_t{n} * n, 16, [&](int64_t row) {
    const int j = static_cast<int>(row % n), k = static_cast<int>(row / n);
    float* out = volume.values.data() + row * n;
    for (int i = 0; i < n; ++i) out[i] = density(Vec3(place(i), place(j), place(k)));
  });
  return volume;
}

void require(const ProceduralSettings& settings) {
  if (settings.resolution < 2 || settings.resolution > 2048)
    throw Error(fmt::format("resolution {} of a procedural volume is not from 2 to 2048", settings.resolution));
  if (!std::isfinite(settings.frame) || std::fabs(settings.frame) > 1e5f)
    throw Error(fmt::format("frame {} of a procedural volume is not within 100000", settings.frame));
}

}  // namespace

DenseVolume makeProcedural(ProceduralKind kind, const ProceduralSettings& settings) {
  require(settings);
  const int n = settings.resolution;
  const uint32_t seed = settings.seed * 7919u;
  const float frame = settings.frame;
  switch (kind) {
    case ProceduralKind::smoke: {
      const Plume plume(seed);
      return fill(n, [&](Vec3 p) { return plume.density(p, frame); });
    }
    case ProceduralKind::cloud: {
      const Cumulus cloud(seed, frame);
      return fill(n, [&](Vec3 p) { return cloud.density(p); });
    }
    case ProceduralKind::fog:
      return fill(n, [&](Vec3 p) { return fogDensity(p, seed, frame); });
    case ProceduralKind::dust:
      return fill(n, [&](Vec3 p) { return dustDensity(p, seed, frame); });
  }
  throw Error("unknown kind of procedural volume");
}

const std::vector<std::string>& proceduralNames() {
  static const std::vector<std::string> names{"smoke", "cloud", "fog", "dust"};
  return names;
}

ProceduralKind proceduralKind(std::string_view name) {
  const std::vector<std::string>& names = proceduralNames();
  for (size_t i = 0; i < names.size(); ++i)
    if (names[i] == name) return static_cast<ProceduralKind>(i);
  throw Error(fmt::format("unknown kind of volume \"{}\"", name),
              {{}, didYouMean(name, names), {"available: " + joined(names)}});
}

}  // namespace virga
