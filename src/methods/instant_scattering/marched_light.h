// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/sampler.h"
#include "methods/instant_scattering/eye_march.h"
#include "methods/instant_scattering/frame_kernels.h"
#include "transport/lamp_tables.h"
#include "transport/visibility.h"

namespace virga {

/// What MarchedLight asks for, drawn anew in each sample (`fast`).
struct RandomNumbers {
  static constexpr int kPoints = 4;        ///< on the eye ray that are lit
  static constexpr int kSurfaceLamps = 1;  ///< points on lamps that light the surface

  Sampler& sampler;

  VIRGA_HD float shift() { return sampler.random(); }
  struct Lamp {
    float choice;
    Vec2 u;
  };
  /// The k-th of `count` points on lamps.
  VIRGA_HD Lamp lamp(int, int) {
    const float choice = sampler.random();
    return {choice, sampler.random2D()};
  }
};

/// The same in every pixel (`frame`): points of an even set, turned by a number of the pass. Nothing shimmers; what an
/// even set gets wrong changes slowly from pixel to pixel.
struct FixedNumbers {
  static constexpr int kPoints = 8;
  static constexpr int kSurfaceLamps = 4;

  uint32_t pass;

  VIRGA_HD float shift() const { return turned(0.5f, 0.6180340f); }
  /// In the pixel.
  VIRGA_HD Vec2 place() const { return {turned(0.5f, 0.7548777f), turned(0.5f, 0.5698403f)}; }
  /// Van der Corput's sequence chooses the lamp, the additive one of the plastic number the place on it; of four points
  /// a set whose mean is the middle, so that no side of the lamp is preferred.
  VIRGA_HD RandomNumbers::Lamp lamp(int k, int count) const {
    const auto n = static_cast<float>(k);
    const float choice =
        count == 1 ? 0.5f : toUnitFloat(reverseBits(static_cast<uint32_t>(k))) + 0.5f / static_cast<float>(count);
    Vec2 place(0.5f + n * 0.7548777f, 0.5f + n * 0.5698403f);
    if (count == 4) place = {kFour[k % 4].x, kFour[k % 4].y};
    return {turned(choice, 0.4142136f), {turned(place.x, 0.7320508f), turned(place.y, 0.2360680f)}};
  }

  /// A number of pass 0 in that of this pass, which moves `by` so much from one to the next.
  VIRGA_HD float turned(float x, float by) const {
    const float y = x + by * static_cast<float>(pass % 4096u);
    return std::fmin(y - std::floor(y), 0x1.fffffep-1f);
  }

 private:
  static constexpr struct {
    float x, y;
  } kFour[4] = {{0.375f, 0.125f}, {0.875f, 0.875f}, {0.125f, 0.625f}, {0.625f, 0.375f}};
};

/// Fog is lit by points of these lamps, and by angle as seen from them: LampPackets.
VIRGA_HD inline bool isAimedAt(const EmitterView& e) {
  return e.kind == EmitterView::Kind::point || e.kind == EmitterView::Kind::area;
}

struct LampChoice {
  int index;
  float probability;  ///< 0: there is none
};
/// By power.
VIRGA_HD inline LampChoice chooseLamp(const SceneView& scene, float u) {
  if (!scene.hasLamps()) return {0, 0};
  const auto choice = scene.emitterChoice.sample(u);
  return {choice.index, choice.probability};
}

/// Light of the lamps at the first vertex of an eye ray, surface and medium both in every sample, by marching. Its bias
/// is that of the steps: it vanishes with them. `Numbers`: RandomNumbers or FixedNumbers.
template <class Rays>
class MarchedLight {
 public:
  static constexpr int kLightSteps = 24;  ///< toward a lamp
  static constexpr int kFogPoints = 24;   ///< on the eye ray that are lit by lamps at infinity alone, in fog

  /// `tables`, of each emitter or of none: where there is one it takes the place of the march toward the lamp.
  VIRGA_HD MarchedLight(const SceneView& scene, const Rays& rays, View<LampTable> tables = {})
      : scene_(scene), rays_(rays), tables_(tables) {}

  /// Of an eye ray that has been marched already and is broad.
  template <class Numbers>
  VIRGA_HD void add(const MarchedEye& eye, LayerRadiance& radiance, Numbers& numbers) const {
    lightMedia(eye, MediaLamps::all, radiance, numbers);
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
    const int points = lamps == MediaLamps::atInfinity ? kFogPoints : Numbers::kPoints;
    const float share = 1 / static_cast<float>(points);
    eye.visitPoints(points, shift, [&](int k, Vec3 p, Rgb weight, const MediaState& media) {
      const auto drawn = numbers.lamp(k, points);
      const LampChoice lamp = chooseLamp(scene_, drawn.choice);
      if (!(lamp.probability > 0)) return;
      const EmitterView& emitter = scene_.emitters[lamp.index];
      if (lamps == MediaLamps::atInfinity && isAimedAt(emitter)) return;
      const LightSample light = sampleLight(scene_, emitter, p, drawn.u);
      const Rgb found = weight * lampAt(p, -eye.at.ray.d, media, lamp.index, light, numbers);
      radiance.add(Layer::directMedia, found * (share / lamp.probability));
    });
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
    const bool allAlike = scene_.emitters.size == 1 && scene_.emitters[0].isDelta();
    const int count = allAlike ? 1 : Numbers::kSurfaceLamps;
    for (int k = 0; k < count; ++k) {
      const auto drawn = numbers.lamp(k, count);
      const LampChoice lamp = chooseLamp(scene_, drawn.choice);
      if (!(lamp.probability > 0)) return;
      const LightSample light = sampleLight(scene_, scene_.emitters[lamp.index], point.p, drawn.u);
      if (!(light.pdf > 0)) continue;
      const Rgb value = SurfaceScattering(eye.side).scattering(wo, light.wi) * light.radiance;
      if (isBlack(value)) continue;
      const MediaRay leaving = leaveSurface(scene_, point, wo, light.wi, eye.at.media);
      const Rgb seen = lampSeen(leaving, point.p, lamp.index, light, numbers);
      radiance.add(Layer::directSurface,
                   through * value * seen / (light.pdf * lamp.probability * static_cast<float>(count)));
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
