// SPDX-License-Identifier: Apache-2.0
// Compiled with -ffast-math (CMakeLists.txt): without it no loop with an exponential becomes vector code.
#include "methods/instant_scattering/frame_kernels.h"

namespace virga {
namespace {

template <EndKind light, EndKind receiver>
void gatherBy(const KernelLight& l, const KernelReceivers& to, const float* const seen[3], const NearField& near) {
  if (near.kind == NearField::Kind::clamped)
    kernels::gather<light, receiver, NearField::Kind::clamped>(l, to, seen[0], seen[1], seen[2], near.bound);
  else
    kernels::gather<light, receiver, NearField::Kind::spread>(l, to, seen[0], seen[1], seen[2], near.bound);
}

template <EndKind light>
void gatherFrom(const KernelLight& l, const KernelReceivers& to, EndKind kind, const float* const seen[3],
                const NearField& near) {
  switch (kind) {
    case EndKind::lambertian:
      return gatherBy<light, EndKind::lambertian>(l, to, seen, near);
    case EndKind::isotropic:
      return gatherBy<light, EndKind::isotropic>(l, to, seen, near);
    case EndKind::henyeyGreenstein:
      return gatherBy<light, EndKind::henyeyGreenstein>(l, to, seen, near);
  }
}

}  // namespace

void gatherLight(const KernelLight& light, EndKind from, const KernelReceivers& to, EndKind kind,
                 const float* const seen[3], const NearField& near) {
  switch (from) {
    case EndKind::lambertian:
      return gatherFrom<EndKind::lambertian>(light, to, kind, seen, near);
    case EndKind::isotropic:
      return gatherFrom<EndKind::isotropic>(light, to, kind, seen, near);
    case EndKind::henyeyGreenstein:
      return gatherFrom<EndKind::henyeyGreenstein>(light, to, kind, seen, near);
  }
}

void lookThroughFog(const KernelPoint& from, const KernelReceivers& to, float sigmaT, float* seen) {
  kernels::seenThroughFog(from, to, sigmaT, seen);
}

void lightFog(const FogLamps& lamps, const FogRay& ray, float shift, float* t, float* r, float* g, float* b) {
  kernels::lightFog(lamps, ray, shift, t, r, g, b);
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

}  // namespace virga
