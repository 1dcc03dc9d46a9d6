// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/sampler.h"
#include "transport/visibility.h"

namespace virga {

/// Optical depth of the media along a ray by steps of equal length, the first of them shifted by `shift` in [0, 1), so
/// that neighbouring rays do not step in step: visit(t0, t1, optical depth of the step, media) front to back, until it
/// returns false. Homogeneous media are exact.
template <class Visit>
VIRGA_HD bool marchMedia(const SceneView& scene, const MediaState& media, const Ray& ray, float t0, float t1, int steps,
                         float shift, Visit&& visit) {
  float begin = t1, end = t0, thickest = 0;
  bool homogeneous = true;
  for (int i = 0; i < media.count(); ++i) {
    const MediumView& medium = scene.media[media.medium(i)];
    homogeneous &= medium.homogeneous;
    thickest = std::max(thickest, medium.sigmaT);
    ClippedRange in{t0, t1};
    if (!medium.homogeneous && !(medium.density.background > 0))
      in = clipToBox(medium.worldToDensity.point(ray.o), medium.worldToDensity.vector(ray.d), medium.density.supportLo,
                     medium.density.supportHi, t0, t1);
    if (!(in.t0 < in.t1)) continue;
    begin = std::min(begin, in.t0), end = std::max(end, in.t1);
  }
  if (!(begin < end) || !(thickest > 0)) return true;
  // A stretch without end is dark beyond so many mean free paths.
  end = std::min(end, begin + 40 / thickest);
  const float step = (end - begin) / static_cast<float>(steps), first = homogeneous ? 0 : shift;
  for (int n = 0; n <= steps; ++n) {
    const float a = begin + step * std::max(0.f, static_cast<float>(n) - first);
    const float b = std::min(end, begin + step * (static_cast<float>(n + 1) - first));
    if (!(a < b)) continue;
    const Vec3 p = ray.at(0.5f * (a + b));
    Rgb sigmaT;
    for (int i = 0; i < media.count(); ++i) sigmaT += scene.media[media.medium(i)].sigmaTAt(p);
    if (!visit(a, b, sigmaT * (b - a))) return false;
  }
  return true;
}

/// Transmittance along a ray by marching; null boundaries are passed, surfaces are not looked at.
template <class Rays>
VIRGA_HD Rgb marchedTransmittance(const SceneView& scene, const Rays& rays, MediaRay r, float tMax, int steps,
                                  float shift) {
  Rgb depth;
  walkMedia(scene, rays, r, tMax, [&](float t0, float t1) {
    return marchMedia(scene, r.media, r.ray, t0, t1, steps, shift, [&](float, float, Rgb here) {
      depth += here;
      return true;
    });
  });
  return exp(depth * -1);
}

/// Light of the lamps at the first vertex of an eye ray, surface and medium both in every sample, by marching (`fast`).
/// Its bias is that of the steps: it vanishes with them.
template <class Rays>
class MarchedLight {
 public:
  static constexpr int kEyeSteps = 64;    ///< through each stretch of media along the eye ray
  static constexpr int kLightSteps = 24;  ///< toward a lamp
  static constexpr int kPoints = 4;       ///< on the eye ray that are lit

  VIRGA_HD MarchedLight(const SceneView& scene, const Rays& rays) : scene_(scene), rays_(rays) {}

  /// False, and nothing added, where the ray meets a mirror, glass or a narrow bsdf first.
  VIRGA_HD bool add(const CameraRay& camera, LayerRadiance& radiance, Sampler& sampler) const {
    MediaRay r = leaveCamera(scene_, camera.ray);
    const RayHit hit = rays_.nearest(r.ray, camera.tMax);
    Seen seen;
    if (hit.found()) {
      seen.point = surfacePoint(scene_.surfaces[hit.shape], r.ray, hit, scene_.scale);
      seen.side = sideOf(scene_, seen.point, hit, -r.ray.d, seen.textured);
      if (!seen.side.bsdf->broad()) return false;
    }
    march(r, hit.found() ? hit.t : camera.tMax, seen, sampler.random());
    lightMedia(r.ray, seen, radiance, sampler);
    const Rgb through = exp(seen.depth * -1);
    if (hit.found())
      lightSurface(r, hit, through, seen, radiance, sampler);
    else if (scene_.environment >= 0)
      radiance.add(Layer::emission, through * environmentRadiance(scene_.emitters[scene_.environment], r.ray.d));
    return true;
  }

 private:
  /// A step along the eye ray.
  struct Step {
    float t0, t1;
    Rgb before, depth;  ///< optical depth to it, and its own
    int stretch;        ///< which of Seen::media holds there
  };
  struct Seen {
    static constexpr int kMostStretches = 8, kMostSteps = kMostStretches * (kEyeSteps + 1);
    Rgb depth;
    int steps = 0, stretches = 0;
    Step step[kMostSteps];
    MediaState media[kMostStretches];
    SurfacePoint point;
    Side side;
    Bsdf textured;
  };

  VIRGA_HD void march(MediaRay& r, float tMax, Seen& seen, float shift) const {
    walkMedia(scene_, rays_, r, tMax, [&](float t0, float t1) {
      if (r.media.vacuum()) return true;
      const bool kept = seen.stretches < Seen::kMostStretches;
      if (kept) seen.media[seen.stretches] = r.media;
      marchMedia(scene_, r.media, r.ray, t0, t1, kEyeSteps, shift, [&](float a, float b, Rgb here) {
        if (kept && seen.steps < Seen::kMostSteps && !isBlack(here))
          seen.step[seen.steps++] = {a, b, seen.depth, here, seen.stretches};
        seen.depth += here;
        return true;
      });
      seen.stretches += kept ? 1 : 0;
      return true;
    });
  }

  /// Points on the eye ray in equal parts of what is seen of the media.
  VIRGA_HD void lightMedia(const Ray& ray, const Seen& seen, LayerRadiance& radiance, Sampler& sampler) const {
    const float opacity = 1 - std::exp(-mean(seen.depth));
    if (!(opacity > 0) || seen.steps == 0) return;
    const float shift = sampler.random();
    int i = 0;
    for (int k = 0; k < kPoints; ++k) {
      const float depth = -std::log1p(-opacity * (static_cast<float>(k) + shift) / kPoints);
      while (i + 1 < seen.steps && mean(seen.step[i + 1].before) <= depth) ++i;
      const Step& step = seen.step[i];
      const float here = clamp((depth - mean(step.before)) / mean(step.depth), 0, 1);
      // sigma_t tau over the density with which the point was chosen, that of the mean channel
      const Rgb passed = step.before + step.depth * here;
      const Rgb weight = step.depth * exp(passed * -1) * (opacity / (mean(step.depth) * std::exp(-mean(passed))));
      const Vec3 p = ray.at(lerp(step.t0, step.t1, here));
      radiance.add(Layer::directMedia,
                   weight * lampsAt(p, -ray.d, seen.media[step.stretch], sampler) * (1.f / kPoints));
    }
  }
  VIRGA_HD Rgb lampsAt(Vec3 p, Vec3 wo, const MediaState& media, Sampler& sampler) const {
    Rgb sigmaT, scattered;
    const LightSample light = sampleLamp(p, sampler);
    if (!(light.pdf > 0)) return {};
    for (int i = 0; i < media.count(); ++i) {
      const MediumView& medium = scene_.media[media.medium(i)];
      const Rgb here = medium.sigmaTAt(p);
      sigmaT += here;
      scattered += here * medium.albedoAt(p) * medium.phaseAt(p).value(wo, light.wi);
    }
    for (int c = 0; c < 3; ++c) scattered[c] = sigmaT[c] > 0 ? scattered[c] / sigmaT[c] : 0;
    if (isBlack(scattered)) return {};
    return scattered * light.radiance * (lampSeen({{p, light.wi}, media, 0}, p, light, sampler) / light.pdf);
  }

  VIRGA_HD void lightSurface(const MediaRay& r, const RayHit& hit, Rgb through, const Seen& seen,
                             LayerRadiance& radiance, Sampler& sampler) const {
    const SurfacePoint& point = seen.point;
    const ShapeView& shape = scene_.surfaces[hit.shape];
    if (shape.emitter >= 0 && dot(point.geometricNormal, r.ray.d) < 0) {
      const EmitterView& emitter = scene_.emitters[shape.emitter];
      radiance.add(Layer::emission,
                   through * emitter.radianceAt(lightUv(shape, emitter, point.p, hit.primitive, {hit.u, hit.v})));
    }
    const Vec3 wo = -r.ray.d;
    const LightSample light = sampleLamp(point.p, sampler);
    if (!(light.pdf > 0)) return;
    const Rgb value = SurfaceScattering(seen.side).scattering(wo, light.wi) * light.radiance;
    if (isBlack(value)) return;
    const MediaRay leaving = leaveSurface(scene_, point, wo, light.wi, r.media);
    radiance.add(Layer::directSurface, through * value * (lampSeen(leaving, point.p, light, sampler) / light.pdf));
  }

  /// A lamp by power, and a point on it; pdf counts both.
  VIRGA_HD LightSample sampleLamp(Vec3 x, Sampler& sampler) const {
    const int count = scene_.emitters.size;
    if (count == 0 || !(scene_.emitterChoice.cdf[count] > 0)) return {};
    const auto choice = scene_.emitterChoice.sample(sampler.random());
    LightSample light = sampleLight(scene_, scene_.emitters[choice.index], x, sampler.random2D());
    light.pdf *= choice.probability;
    return light;
  }
  VIRGA_HD Rgb lampSeen(const MediaRay& r, Vec3 x, const LightSample& light, Sampler& sampler) const {
    ConnectingRay ray{r, kInfinity};
    if (!std::isinf(light.distance)) ray = aimAt(scene_, r, x + light.wi * light.distance);
    if (!(ray.tMax > 0)) return Rgb(1.f);
    if (rays_.occluded(ray.at.ray, ray.tMax)) return {};
    return marchedTransmittance(scene_, rays_, ray.at, ray.tMax, kLightSteps, sampler.random());
  }

  const SceneView& scene_;
  const Rays& rays_;
};

}  // namespace virga
