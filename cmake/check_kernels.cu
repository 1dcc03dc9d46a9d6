// SPDX-License-Identifier: Apache-2.0
// Never run, only compiled: device code of what kernels are made of. kernel_headers.h is written by the build; it includes every
// header that marks functions for the device.
#include "kernel_headers.h"

namespace virga {
namespace {

/// Stands in for a device's ray queries; its answers depend on the arguments, so that nothing is optimised away.
struct StubRays {
  RayHit hit;
  CrossingList list;

  __host__ __device__ RayHit nearest(const Ray& ray, float tMax) const { return ray.d.x < tMax ? hit : RayHit(); }
  __host__ __device__ bool occluded(const Ray& ray, float tMax) const { return hit.t < tMax * ray.d.x; }
  __host__ __device__ uint32_t occluded(const RayPacket& rays) const { return occluded(rays.ray(0), rays.tMax[0]); }
  __host__ __device__ void crossings(const Ray& ray, float tMin, float tMax, CrossingList& out) const {
    for (int i = 0; i < list.count; ++i)
      if (list.items[i].t > tMin * ray.d.y && list.items[i].t < tMax) out.insert(list.items[i]);
  }
};

}  // namespace

__global__ void tracePaths(SceneView scene, StubRays rays, PathOptions options, PerspectiveCamera camera, PixelFilter filter,
                           Rgb* out) {
  const auto pixel = static_cast<uint32_t>(threadIdx.x);
  Sampler sampler(SampleId{1, 2, pixel, 3});
  const Vec2 offset = filter.sample(sampler.next2D());
  const PathTracer<StubRays> tracer(scene, rays, options);
  out[pixel] = tracer.trace(camera.ray(offset.x, offset.y), sampler).sum();
}

/// A group of pixels each.
__global__ void sharePaths(SceneView scene, StubRays rays, PathOptions options, const CameraRay* cameras, Sampler* samplers,
                           LayerRadiance* out) {
  const uint32_t first = threadIdx.x * SharedPaths<StubRays>::kMost;
  const PathTracer<StubRays> tracer(scene, rays, options);
  const SharedPaths<StubRays> shared(scene, rays, tracer);
  shared.trace(cameras + first, samplers + first, SharedPaths<StubRays>::kMost, out + first);
}

__global__ void marchEyes(SceneView scene, StubRays rays, View<LampTable> tables, PerspectiveCamera camera, Rgb* out) {
  Sampler sampler(SampleId{1, 2, threadIdx.x, 3});
  MarchedEye eye;
  marchEye(scene, rays, camera.ray(0.5f, 0.5f), 0.f, eye);
  RandomNumbers numbers{sampler};
  LayerRadiance radiance;
  MarchedLight<StubRays>(scene, rays, tables).add(eye, radiance, numbers);
  out[threadIdx.x] = radiance.sum();
}

__global__ void walkFromLights(SceneView scene, StubRays rays, MediaRay start, Rgb* out) {
  Sampler sampler(SampleId{1, 2, threadIdx.x, 3});
  LightWalker<StubRays>(scene, rays, 8).walk(start, Rgb(1.f), sampler, [&](const LightVertex& v, const SurfaceScattering*) {
    out[threadIdx.x] += v.weight;
  });
}

__global__ void gatherOnEyePaths(SceneView scene, StubRays rays, VirtualLightsView lights, LightVisibilityView visibility,
                                 ImsOptions options, View<LampTable> tables, PerspectiveCamera camera, Rgb* out) {
  Sampler sampler(SampleId{1, 2, threadIdx.x, 3});
  const ImsEyePaths<StubRays> paths(scene, rays, lights, visibility, options, tables);
  const CameraRay ray = camera.ray(0.5f, 0.5f);
  out[threadIdx.x] = paths.trace(ray, sampler).sum() + paths.traceGlow(ray, sampler).sum();
}

/// What `fast` knows of a pixel.
__global__ void seeAndLight(SceneView scene, StubRays rays, VirtualLightsView lights, LightVisibilityView visibility,
                            ImsOptions options, View<LampTable> tables, PerspectiveCamera camera, PixelFeatures* seen,
                            Rgb* out) {
  Sampler sampler(SampleId{1, 2, threadIdx.x, 3});
  const ImsEyePaths<StubRays> paths(scene, rays, lights, visibility, options, tables);
  MarchedEye eye;
  marchEye(scene, rays, camera.ray(0.5f, 0.5f), 0.5f, eye, options.eyeSteps);
  seen[threadIdx.x] = pixelFeatures(eye);
  RandomNumbers numbers{sampler};
  LayerRadiance radiance;
  paths.marched().add(eye, radiance, numbers);
  out[threadIdx.x] = radiance.sum();
}

/// Receivers of a frame from `i` on.
__device__ KernelReceivers receiversFrom(const KernelReceivers& all, int i) {
  return {1,           all.px + i, all.py + i, all.pz + i, all.ax + i, all.ay + i, all.az + i, all.anisotropy + i,
          all.r + i, all.g + i,  all.b + i};
}

template <EndKind light, EndKind receiver, class Near>
__device__ void gatherOne(const KernelLight& l, const KernelReceivers& to, const DepthTable& table,
                          const KernelShadowMap& map, float sigmaT, const Near& near) {
  float seen[3];
  kernels::seenThroughFog({l.px, l.py, l.pz}, to, sigmaT, &seen[0]);
  kernels::seenThroughTable({l.px, l.py, l.pz}, to, table, &seen[0]);
  kernels::seenThroughMap<receiver>(l, to, map, &seen[0]);
  kernels::gather<light, receiver>(l, to, kernels::SeenInArrays{seen, seen, seen}, near);
  using kernels::FogBetween, kernels::TableBetween;
  kernels::gather<light, receiver>(l, to, kernels::SeenThrough<receiver, FogBetween>{{sigmaT}, map}, near);
  kernels::gather<light, receiver>(l, to, kernels::SeenThrough<receiver, TableBetween>{{table}, map}, near);
}

/// A receiver each: all lights.
__global__ void gatherInFrame(View<KernelLight> lights, KernelReceivers receivers, View<DepthTable> tables,
                              View<KernelShadowMap> maps, NearField near) {
  const KernelReceivers to = receiversFrom(receivers, static_cast<int>(threadIdx.x));
  constexpr auto kLambertian = EndKind::lambertian, kIsotropic = EndKind::isotropic, kHg = EndKind::henyeyGreenstein;
  const kernels::Clamped clamped{near.bound};
  const kernels::Spread spread{near.bound, near.core.r};
  const kernels::SpreadByChannel byChannel{near.bound, near.core};
  for (int i = 0; i < lights.size; ++i) {
    gatherOne<kLambertian, kLambertian>(lights[i], to, tables[i], maps[i], near.bound, clamped);
    gatherOne<kLambertian, kHg>(lights[i], to, tables[i], maps[i], near.bound, spread);
    gatherOne<kHg, kIsotropic>(lights[i], to, tables[i], maps[i], near.bound, byChannel);
  }
}

/// A packet of pixels each: their lamps.
__global__ void lightPackets(LampPoint lamp, KernelSurfaces* surfaces, FogRays* fog, KernelPlaces* places,
                             RayPacket* rays, float (*value)[3][RayPacket::kSize]) {
  const auto n = threadIdx.x;
  const KernelSurfaces& s = surfaces[n];
  float* first = value[n][0];
  kernels::lampOnSurfaces(lamp, s, first);
  kernels::aimAtLamp(lamp, s, s.epsilon, s.gx, s.gy, s.gz, first, kHitError, 1, rays[n]);
  kernels::lampInFog(lamp, fog[n], 0.5f, places[n], value[n]);
  kernels::lampInMedia(lamp, places[n], first);
}

/// A packet of pixels each: their eye rays through a grid.
__global__ void marchPackets(KernelGrid grid, KernelEyes* eyes, KernelDepths* depths, EyePoints* points, LampPoint lamp,
                             const float* places, float* out) {
  const auto n = threadIdx.x;
  kernels::march(grid, eyes[n], depths[n]);
  kernels::pointsAt(eyes[n], depths[n], places, points[n]);
  kernels::depthsAlong(eyes[n], depths[n], 0, places, 1, out + 32 * n);
  kernels::lampAtPoints(lamp, eyes[n], points[n], 0.6f, out + 32 * n + 1);
}

/// A block of pixels each, between the same coarse ones.
__global__ void spreadOverBlocks(const UpsamplingBlock* blocks, const UpsamplingTap* taps, UpsamplingWeights* weights,
                                 UpsampledLight* light) {
  const auto n = threadIdx.x;
  const UpsamplingTap* own[UpsamplingBlock::kTaps];
  for (int i = 0; i < UpsamplingBlock::kTaps; ++i) own[i] = taps + i;
  kernels::weighTaps(blocks[n], own, weights[n]);
  kernels::spreadLight(blocks[n], own, weights[n], light[n]);
}

__global__ void lookUp(GridView grid, RgbGridView colors, PhaseFunction phase, const Vec3* at, float* out) {
  const Vec3 p = at[threadIdx.x];
  const PhaseSample s = phase.sample(p, {p.x, p.y});
  out[threadIdx.x] = grid.lookup(p) + mean(colors.lookup(p)) + phase.value(p, s.wi) + phase.pdf(p, s.wi);
}

__global__ void scatter(Bsdf bsdf, const Vec3* at, Rgb* out) {
  const Vec3 p = at[threadIdx.x];
  const BsdfSample s = bsdf.sample(p, {p.x, p.y}, p.z);
  out[threadIdx.x] = bsdf.value(p, s.wi) * bsdf.pdf(p, s.wi) + s.weight;
}

}  // namespace virga
