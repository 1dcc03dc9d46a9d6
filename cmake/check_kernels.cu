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
