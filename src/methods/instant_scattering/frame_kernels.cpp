// SPDX-License-Identifier: Apache-2.0
// Compiled with -ffast-math (CMakeLists.txt): without it no loop with an exponential becomes vector code.
#include "methods/instant_scattering/eye_kernels.h"
#include "scene/shape.h"

namespace virga {
namespace {

template <EndKind kind>
struct Kind {
  static constexpr EndKind value = kind;
};

/// body(Kind) for the kind.
template <class Body>
void withKind(EndKind kind, const Body& body) {
  switch (kind) {
    case EndKind::lambertian:
      return body(Kind<EndKind::lambertian>());
    case EndKind::isotropic:
      return body(Kind<EndKind::isotropic>());
    case EndKind::henyeyGreenstein:
      return body(Kind<EndKind::henyeyGreenstein>());
  }
}

template <EndKind kind, class Between>
auto seenBy(Kind<kind>, const Between& between, const KernelShadowMap& map) {
  return kernels::SeenThrough<kind, Between>{between, map};
}

/// body() with what kernels take for lights in grey media.
template <class Body>
void withGrey(const NearField& near, const Body& body) {
  if (near.kind == NearField::Kind::clamped)
    body(kernels::Clamped{near.bound});
  else
    body(kernels::Spread{near.bound, near.core.r});
}

/// kernels::gather; seenBy(Kind of the receivers) says what is between.
template <class Near, class SeenBy>
void gather(const KernelLight& light, EndKind from, const KernelReceivers& to, EndKind kind, const Near& near,
            const SeenBy& seenBy) {
  withKind(from, [&](auto f) {
    withKind(kind, [&](auto k) { kernels::gather<f.value, k.value>(light, to, seenBy(k), near); });
  });
}

}  // namespace

void gatherLight(const KernelLight& light, EndKind from, const KernelReceivers& to, EndKind kind,
                 const float* const seen[3], const NearField& near) {
  const auto seenBy = [&](auto) { return kernels::SeenInArrays{seen[0], seen[1], seen[2]}; };
  if (near.kind == NearField::Kind::spread && !near.grey())
    gather(light, from, to, kind, kernels::SpreadByChannel{near.bound, near.core}, seenBy);
  else
    withGrey(near, [&](const auto& grey) { gather(light, from, to, kind, grey, seenBy); });
}

void gatherThrough(const KernelLight& light, EndKind from, const KernelReceivers& to, EndKind kind,
                   const DepthTable* table, float sigmaT, const KernelShadowMap& map, const NearField& near) {
  withGrey(near, [&](const auto& grey) {
    if (table)
      gather(light, from, to, kind, grey, [&](auto k) { return seenBy(k, kernels::TableBetween{*table}, map); });
    else
      gather(light, from, to, kind, grey, [&](auto k) { return seenBy(k, kernels::FogBetween{sigmaT}, map); });
  });
}

void lookThroughFog(const KernelPoint& from, const KernelReceivers& to, float sigmaT, float* seen) {
  kernels::seenThroughFog(from, to, sigmaT, seen);
}

void lookThroughMap(const KernelLight& light, const KernelReceivers& to, EndKind kind, const KernelShadowMap& map,
                    float* seen) {
  if (kind == EndKind::lambertian)
    kernels::seenThroughMap<EndKind::lambertian>(light, to, map, seen);
  else
    kernels::seenThroughMap<EndKind::isotropic>(light, to, map, seen);
}

void lookThroughTable(const KernelPoint& from, const KernelReceivers& to, const DepthTable& table, float* seen) {
  kernels::seenThroughTable(from, to, table, seen);
}

namespace {

constexpr KernelSurfaces kNone{};  // places in media have no normals, and rays start at them

void aimFromMedia(const LampPoint& lamp, const KernelPlaces& from, const float* value, float scale, RayPacket& rays) {
  kernels::aimAtLamp(lamp, from, kNone.epsilon, kNone.gx, kNone.gy, kNone.gz, value, kHitError, scale, rays);
}

}  // namespace

void lightSurfaces(const LampPoint& lamp, const KernelSurfaces& surfaces, float scale, float* value, RayPacket& rays) {
  kernels::lampOnSurfaces(lamp, surfaces, value);
  kernels::aimAtLamp(lamp, surfaces, surfaces.epsilon, surfaces.gx, surfaces.gy, surfaces.gz, value, kHitError, scale,
                     rays);
}

void lightMedia(const LampPoint& lamp, const KernelPlaces& places, float scale, float* value, RayPacket& rays) {
  kernels::lampInMedia(lamp, places, value);
  aimFromMedia(lamp, places, value, scale, rays);
}

void lightFog(const LampPoint& lamp, const FogRays& fog, float place, float scale, KernelPlaces& at,
              float (*value)[RayPacket::kSize], RayPacket& rays) {
  kernels::lampInFog(lamp, fog, place, at, value);
  bool dense = false;
  for (int i = 0; i < RayPacket::kSize; ++i) dense |= kernels::isDense(lamp, fog, i);
  if (dense) {
    kernels::FogProfile profile;
    kernels::profileFog(lamp, fog, profile);
    kernels::lampInDenseFog(lamp, fog, profile, place, at, value);
  }
  alignas(64) float most[RayPacket::kSize];
  for (int i = 0; i < RayPacket::kSize; ++i) most[i] = std::fmax(value[0][i], std::fmax(value[1][i], value[2][i]));
  aimFromMedia(lamp, at, most, scale, rays);
}

void marchEyes(const KernelGrid& grid, KernelEyes& eyes, KernelDepths& depths) { kernels::march(grid, eyes, depths); }

void placePoints(const KernelEyes& eyes, const KernelDepths& depths, const float* place, EyePoints& at) {
  kernels::pointsAt(eyes, depths, place, at);
}

void lookUpDepths(const KernelEyes& eyes, const KernelDepths& depths, int lane, const float* places, int count,
                  float* out) {
  kernels::depthsAlong(eyes, depths, lane, places, count, out);
}

void lightEyes(const LampPoint& lamp, const KernelEyes& eyes, const EyePoints& at, float anisotropy, float scale,
               float* value, RayPacket& rays) {
  kernels::lampAtPoints(lamp, eyes, at, anisotropy, value);
  for (int i = 0; i < RayPacket::kSize; ++i)
    value[i] = at.weight[0][i] + at.weight[1][i] + at.weight[2][i] > 0 ? value[i] : 0.f;
  aimFromMedia(lamp, at, value, scale, rays);
}

}  // namespace virga
