// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "methods/instant_scattering/eye_march.h"
#include "methods/instant_scattering/frame_kernels.h"
#include "methods/instant_scattering/lamp_numbers.h"
#include "transport/lamp_tables.h"
#include "transport/visibility.h"

namespace virga {

/// Light of the lamps at the first vertex of an eye ray, surface and medium both in every sample, by marching. Its bias
/// is that of the steps: it vanishes with them. `Numbers`: RandomNumbers or FixedNumbers.
template <class Rays>
class MarchedLight {
 public:
  static constexpr int kLightSteps = 24;  ///< toward a lamp
  static constexpr int kFogPoints = 3;    ///< times as many on the eye ray by lamps at infinity alone, in fog

  /// `tables`, of each emitter or of none: where there is one it takes the place of the march toward the lamp.
  VIRGA_HD MarchedLight(const SceneView& scene, const Rays& rays, View<LampTable> tables = {})
      : scene_(scene), rays_(rays), tables_(tables) {}

  /// Of an eye ray that has been marched already and is broad.
  template <class Numbers>
  VIRGA_HD void add(const MarchedEye& eye, LayerRadiance& radiance, Numbers& numbers) const {
    lightMedia(eye, MediaLamps::all, radiance, numbers);
    addBesideMedia(eye, radiance, numbers);
  }
  /// Likewise what the media scatter left out.
  template <class Numbers>
  VIRGA_HD void addBesideMedia(const MarchedEye& eye, LayerRadiance& radiance, Numbers& numbers) const {
    addEmission(eye, radiance);
    lightSurface(eye, radiance, numbers);
  }

  enum class MediaLamps {
    all,
    atInfinity,  ///< but for those that isAimedAt()
  };
  /// Light of lamps in the media alone.
  template <class Numbers>
  VIRGA_HD void lightMedia(const MarchedEye& eye, MediaLamps lamps, LayerRadiance& radiance, Numbers& numbers) const {
    const float shift = numbers.shift();
    // The shafts of lamps at infinity end at these points: in fog, where nothing hides that, there are more of them.
    const int points = lamps == MediaLamps::atInfinity ? kFogPoints * numbers.places() : numbers.places();
    for (int group = 0; group < numbers.groups(); ++group)
      eye.visitPoints(points, shift, [&](int k, Vec3 p, Rgb weight, const MediaState& media) {
        const ChosenLamp lamp = numbers.lamp(scene_, group, k, points, p);
        if (!(lamp.chance > 0)) return;
        if (lamps == MediaLamps::atInfinity && isAimedAt(scene_.emitters[lamp.index])) return;
        lightPoint(eye, lamp, p, weight, media, radiance, numbers);
      });
  }
  /// By a chosen lamp, at a point of the media; `weight`: as MarchedEye::visitPoints().
  template <class Numbers>
  VIRGA_HD void lightPoint(const MarchedEye& eye, const ChosenLamp& lamp, Vec3 p, Rgb weight, const MediaState& media,
                           LayerRadiance& radiance, Numbers& numbers) const {
    const LightSample light = sampleLamp(scene_, lamp, p);
    const Rgb found = weight * lampAt(p, -eye.at.ray.d, media, lamp.index, light, numbers);
    radiance.add(Layer::directMedia, found * (1 / lamp.chance));
  }
  /// Light that the media scatter from wi toward wo at a point, over their sigma_t [1/sr].
  VIRGA_HD Rgb scatteringAt(Vec3 p, Vec3 wo, Vec3 wi, const MediaState& media) const {
    if (media.count() == 1) {
      const MediumView& medium = scene_.media[media.medium(0)];
      if (medium.phaseBlends.size == 0) return medium.albedoAt(p) * medium.phase.value(wo, wi);
      return medium.albedoAt(p) * medium.phaseAt(p).value(wo, wi);
    }
    Rgb sigmaT, scattered;
    for (int i = 0; i < media.count(); ++i) {
      const MediumView& medium = scene_.media[media.medium(i)];
      const Rgb here = medium.sigmaTAt(p);
      sigmaT += here;
      scattered += here * medium.albedoAt(p) * medium.phaseAt(p).value(wo, wi);
    }
    for (int c = 0; c < 3; ++c) scattered[c] = sigmaT[c] > 0 ? scattered[c] / sigmaT[c] : 0;
    return scattered;
  }
  /// Of a lamp or the surroundings that are seen directly.
  VIRGA_HD void addEmission(const MarchedEye& eye, LayerRadiance& radiance) const {
    if (eye.hit.found()) {
      const ShapeView& shape = scene_.surfaces[eye.hit.shape];
      if (shape.emitter < 0 || !(dot(eye.point.geometricNormal, -eye.at.ray.d) > 0)) return;
      const EmitterView& emitter = scene_.emitters[shape.emitter];
      const Vec2 uv = lightUv(shape, emitter, eye.point.p, eye.hit.primitive, {eye.hit.u, eye.hit.v});
      radiance.add(Layer::emission, transmittanceOf(eye.depth) * emitter.radianceAt(uv));
    } else if (scene_.environment >= 0) {
      radiance.add(Layer::emission,
                   transmittanceOf(eye.depth) * environmentRadiance(scene_.emitters[scene_.environment], eye.at.ray.d));
    }
  }

  /// Light of lamps on the surface alone.
  template <class Numbers>
  VIRGA_HD void lightSurface(const MarchedEye& eye, LayerRadiance& radiance, Numbers& numbers) const {
    if (!eye.hit.found()) return;
    const Rgb through = transmittanceOf(eye.depth);
    const SurfacePoint& point = eye.point;
    const Vec3 wo = -eye.at.ray.d;
    for (int group = 0; group < numbers.groups(); ++group)
      for (int k = 0; k < numbers.onSurface(group); ++k) {
        const ChosenLamp lamp = numbers.lamp(scene_, group, k, numbers.onSurface(group), point.p);
        if (!(lamp.chance > 0)) return;
        const LightSample light = sampleLamp(scene_, lamp, point.p);
        if (!(light.pdf > 0)) continue;
        const Rgb value = SurfaceScattering(eye.side).scattering(wo, light.wi) * light.radiance;
        if (isBlack(value)) continue;
        const MediaRay leaving = leaveSurface(scene_, point, wo, light.wi, eye.at.media);
        const Rgb seen = lampSeen(leaving, point.p, lamp.index, light, numbers);
        radiance.add(Layer::directSurface, through * value * seen / (light.pdf * lamp.chance));
      }
  }

 private:
  template <class Numbers>
  VIRGA_HD Rgb lampAt(Vec3 p, Vec3 wo, const MediaState& media, int lamp, const LightSample& light,
                      Numbers& numbers) const {
    if (!(light.pdf > 0)) return {};
    const Rgb scattered = scatteringAt(p, wo, light.wi, media);
    if (isBlack(scattered)) return {};
    return scattered * light.radiance * (lampSeen({{p, light.wi}, media, 0}, p, lamp, light, numbers) / light.pdf);
  }
  /// `lamp`: index of the emitter.
  template <class Numbers>
  VIRGA_HD Rgb lampSeen(const MediaRay& r, Vec3 x, int lamp, const LightSample& light, Numbers& numbers) const {
    ConnectingRay ray{r, kInfinity};
    if (!std::isinf(light.distance)) ray = aimAt(scene_, r, x + light.wi * light.distance);
    if (!(ray.tMax > 0)) return Rgb(1.f);
    if (rays_.occluded(ray.at.ray, ray.tMax)) return {};
    if (lamp < tables_.size && tables_[lamp].present()) return transmittanceOf(tables_[lamp].depthTo(x));
    return marchedTransmittance(scene_, rays_, ray.at, ray.tMax, kLightSteps, numbers.shift());
  }

  const SceneView& scene_;
  const Rays& rays_;
  View<LampTable> tables_;
};

}  // namespace virga
