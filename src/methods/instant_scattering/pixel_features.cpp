// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/pixel_features.h"

#include "core/parallel.h"
#include "methods/instant_scattering/eye_march.h"

namespace virga {
namespace {

/// Optical depth along a ray, gathered front to back.
struct SeenMedia {
  Rgb depth;
  double weight = 0, moment = 0;

  void add(float t0, float t1, Rgb here) {
    const float before = mean(exp(depth * -1));
    depth += here;
    const float seen = before - mean(exp(depth * -1));
    weight += static_cast<double>(seen);
    moment += static_cast<double>(seen * lerp(t0, t1, meanDistance(mean(here))));
  }

 private:
  /// Mean of t in [0, 1] by exp(-depth t): 1 / depth - 1 / (exp(depth) - 1).
  static float meanDistance(float d) { return d > 0.05f ? 1 / d - 1 / std::expm1(d) : 0.5f - d / 12; }
};

/// A colour by which the surface's light may be divided; of bsdfs other than diffuse ones nothing is known.
Rgb reflectanceOf(const Side& side) {
  if (side.bsdf->kind() != Bsdf::Kind::diffuse) return Rgb(1.f);
  const Rgb r = side.bsdf->value(Vec3(0, 0, 1), Vec3(0, 0, 1)) * kPi;
  return side.wo.z > 0 ? r : Rgb();
}

}  // namespace

PixelFeatures pixelFeatures(const Scene& scene, int x, int y) {
  const SceneView& view = scene.view;
  const EmbreeRays rays{*scene.surfaceRays, *scene.boundaryRays};
  const CameraRay camera = scene.camera.ray(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f);
  MediaRay r = leaveCamera(view, camera.ray);
  const RayHit hit = rays.nearest(r.ray, camera.tMax);
  PixelFeatures f;
  f.regular = true;
  f.depth = hit.found() ? hit.t : kInfinity;
  SeenMedia seen;
  walkMedia(view, rays, r, hit.found() ? hit.t : camera.tMax, [&](float t0, float t1) {
    return marchMedia(view, r.media, r.ray, t0, t1, MarchedEye::kSteps, 0, [&](float a, float b, Rgb depth) {
      seen.add(a, b, depth);
      return true;
    });
  });
  const Rgb transmittance = exp(seen.depth * -1);
  f.opacity = Rgb(1.f) - transmittance;
  f.mediaDepth = seen.weight > 0 ? static_cast<float>(seen.moment / seen.weight) : 0;
  if (!hit.found()) return f;
  const SurfacePoint point = surfacePoint(view.surfaces[hit.shape], r.ray, hit, view.scale);
  Bsdf textured;
  const Side side = sideOf(view, point, hit, -r.ray.d, textured);
  f.regular = !side.bsdf->specular() && !side.bsdf->isThin();
  f.p = point.p;
  f.normal = dot(point.shadingNormal, r.ray.d) > 0 ? -point.shadingNormal : point.shadingNormal;
  f.surface = transmittance * reflectanceOf(side);
  return f;
}

std::vector<PixelFeatures> pictureFeatures(const Scene& scene, const std::stop_token& stop) {
  const int width = scene.camera.width, height = scene.camera.height;
  std::vector<PixelFeatures> features(static_cast<size_t>(width) * static_cast<size_t>(height));
  parallelFor(height, 4, [&](int64_t y) {
    if (stop.stop_requested()) return;
    for (int x = 0; x < width; ++x)
      features[static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x)] =
          pixelFeatures(scene, x, static_cast<int>(y));
  });
  return features;
}

}  // namespace virga
