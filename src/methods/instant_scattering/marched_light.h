// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/sampler.h"
#include "methods/instant_scattering/eye_march.h"
#include "methods/instant_scattering/frame_kernels.h"
#include "methods/instant_scattering/lamp_tables.h"

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
  /// Van der Corput's sequence chooses the lamp, the additive one of the plastic number the place on it.
  VIRGA_HD RandomNumbers::Lamp lamp(int k, int count) const {
    const auto n = static_cast<float>(k);
    const float choice =
        count == 1 ? 0.5f : toUnitFloat(reverseBits(static_cast<uint32_t>(k))) + 0.5f / static_cast<float>(count);
    return {turned(choice, 0.4142136f),
            {turned(0.5f + n * 0.7548777f, 0.7320508f), turned(0.5f + n * 0.5698403f, 0.2360680f)}};
  }

 private:
  VIRGA_HD float turned(float x, float by) const {
    const float y = x + by * static_cast<float>(pass % 4096u);
    return std::fmin(y - std::floor(y), 0x1.fffffep-1f);
  }
};

/// Fog is lit by points of these lamps, and by angle as seen from them: FogLamps.
VIRGA_HD inline bool isAimedAt(const EmitterView& e) {
  return e.kind == EmitterView::Kind::point || e.kind == EmitterView::Kind::area;
}

struct LampChoice {
  int index;
  float probability;  ///< 0: there is none
};
/// By power.
VIRGA_HD inline LampChoice chooseLamp(const SceneView& scene, float u) {
  const int count = scene.emitters.size;
  if (count == 0 || !(scene.emitterChoice.cdf[count] > 0)) return {0, 0};
  const auto choice = scene.emitterChoice.sample(u);
  return {choice.index, choice.probability};
}

/// Light of the lamps at the first vertex of an eye ray, surface and medium both in every sample, by marching. Its bias
/// is that of the steps: it vanishes with them. `Numbers`: RandomNumbers or FixedNumbers.
template <class Rays>
class MarchedLight {
 public:
  static constexpr int kLightSteps = 24;  ///< toward a lamp
  static constexpr int kFogPoints = 24;   ///< on the eye ray that are lit by lamps at infinity, with FogLamps

  /// `lamps`: points in fog are lit by these, wherever they are known; null: by none. `tables`, of each emitter or of
  /// none: where there is one it takes the place of the march toward the lamp.
  VIRGA_HD MarchedLight(const SceneView& scene, const Rays& rays, const FogLamps* lamps = nullptr,
                        View<LampTable> tables = {})
      : scene_(scene), rays_(rays), lamps_(lamps), tables_(tables) {}

  /// Of an eye ray that has been marched already and is broad.
  template <class Numbers>
  VIRGA_HD void add(const MarchedEye& eye, LayerRadiance& radiance, Numbers& numbers) const {
    lightMedia(eye, radiance, numbers);
    const Rgb through = transmittanceOf(eye.depth);
    if (eye.hit.found())
      lightSurface(eye, through, radiance, numbers);
    else if (scene_.environment >= 0)
      radiance.add(Layer::emission, through * environmentRadiance(scene_.emitters[scene_.environment], eye.at.ray.d));
  }

 private:
  template <class Numbers>
  VIRGA_HD void lightMedia(const MarchedEye& eye, LayerRadiance& radiance, Numbers& numbers) const {
    const float shift = numbers.shift();
    const bool inFog = lamps_ && isFog(eye);
    // The shafts of lamps at infinity end at these points: in fog, where nothing hides that, there are more of them.
    const int points = inFog ? kFogPoints : Numbers::kPoints;
    const float share = 1 / static_cast<float>(points);
    if (inFog) lightFogOf(eye, shift, radiance, numbers);
    if (inFog && lamps_->alone) return;
    eye.visitPoints(points, shift, [&](int k, Vec3 p, Rgb weight, const MediaState& media) {
      const auto drawn = numbers.lamp(k, points);
      const LampChoice lamp = chooseLamp(scene_, drawn.choice);
      if (!(lamp.probability > 0)) return;
      const EmitterView& emitter = scene_.emitters[lamp.index];
      if (inFog && isAimedAt(emitter)) return;
      const LightSample light = sampleLight(scene_, emitter, p, drawn.u);
      const Rgb found = weight * lampAt(p, -eye.at.ray.d, media, lamp.index, light, numbers);
      radiance.add(Layer::directMedia, found * (share / lamp.probability));
    });
  }
  /// sigma_t tau was the weight; here it is the light that the media scatter toward wo over their sigma_t.
  template <class Numbers>
  VIRGA_HD Rgb lampAt(Vec3 p, Vec3 wo, const MediaState& media, int lamp, const LightSample& light,
                      Numbers& numbers) const {
    if (!(light.pdf > 0)) return {};
    Rgb sigmaT, scattered;
    for (int i = 0; i < media.count(); ++i) {
      const MediumView& medium = scene_.media[media.medium(i)];
      const Rgb here = medium.sigmaTAt(p);
      sigmaT += here;
      scattered += here * medium.albedoAt(p) * medium.phaseAt(p).value(wo, light.wi);
    }
    for (int c = 0; c < 3; ++c) scattered[c] = sigmaT[c] > 0 ? scattered[c] / sigmaT[c] : 0;
    if (isBlack(scattered)) return {};
    return scattered * light.radiance * (lampSeen({{p, light.wi}, media, 0}, p, lamp, light, numbers) / light.pdf);
  }

  /// The ray passes a single stretch of a single homogeneous medium whose phase function is plain.
  VIRGA_HD bool isFog(const MarchedEye& eye) const {
    if (eye.stretches != 1 || eye.steps != 1 || eye.media[0].count() != 1) return false;
    const MediumView& medium = scene_.media[eye.media[0].medium(0)];
    return medium.homogeneous && !medium.albedoGrid.values && medium.phaseBlends.size == 0 &&
           (medium.phase.get<Isotropic>() || medium.phase.get<HenyeyGreenstein>());
  }
  template <class Numbers>
  VIRGA_HD void lightFogOf(const MarchedEye& eye, float shift, LayerRadiance& radiance, Numbers& numbers) const {
    const MediumView& medium = scene_.media[eye.media[0].medium(0)];
    const Ray& ray = eye.at.ray;
    const Rgb sigmaT = medium.spectrum * medium.sigmaT;
    const auto* hg = medium.phase.get<HenyeyGreenstein>();
    const FogRay fog{ray.o.x,        ray.o.y,        ray.o.z,
                     ray.d.x,        ray.d.y,        ray.d.z,
                     eye.step[0].t0, eye.step[0].t1, {sigmaT.r, sigmaT.g, sigmaT.b},
                     hg ? hg->g : 0};
    float t[FogLamps::kCount], r[FogLamps::kCount], g[FogLamps::kCount], b[FogLamps::kCount];
    lightFog(*lamps_, fog, shift, t, r, g, b);
    for (int k = 0; k < FogLamps::kCount; ++k) {
      const Rgb found(r[k], g[k], b[k]);
      if (!lamps_->known[k] || isBlack(found)) continue;
      const Vec3 p = ray.at(t[k]), way = Vec3(lamps_->px[k], lamps_->py[k], lamps_->pz[k]) - p;
      LightSample light;
      light.distance = length(way);
      if (!(light.distance > 0)) continue;
      light.wi = way / light.distance;
      radiance.add(Layer::directMedia,
                   found * medium.albedo * lampSeen({{p, light.wi}, eye.media[0], 0}, p, kNoTable, light, numbers));
    }
  }

  template <class Numbers>
  VIRGA_HD void lightSurface(const MarchedEye& eye, Rgb through, LayerRadiance& radiance, Numbers& numbers) const {
    const SurfacePoint& point = eye.point;
    const ShapeView& shape = scene_.surfaces[eye.hit.shape];
    const Vec3 wo = -eye.at.ray.d;
    if (shape.emitter >= 0 && dot(point.geometricNormal, wo) > 0) {
      const EmitterView& emitter = scene_.emitters[shape.emitter];
      const Vec2 uv = lightUv(shape, emitter, point.p, eye.hit.primitive, {eye.hit.u, eye.hit.v});
      radiance.add(Layer::emission, through * emitter.radianceAt(uv));
    }
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

  static constexpr int kNoTable = -1;
  /// `lamp`: index of the emitter, or kNoTable.
  template <class Numbers>
  VIRGA_HD Rgb lampSeen(const MediaRay& r, Vec3 x, int lamp, const LightSample& light, Numbers& numbers) const {
    ConnectingRay ray{r, kInfinity};
    if (!std::isinf(light.distance)) ray = aimAt(scene_, r, x + light.wi * light.distance);
    if (!(ray.tMax > 0)) return Rgb(1.f);
    if (rays_.occluded(ray.at.ray, ray.tMax)) return {};
    if (lamp < tables_.size && lamp >= 0 && tables_[lamp].present()) return transmittanceOf(tables_[lamp].depthTo(x));
    return marchedTransmittance(scene_, rays_, ray.at, ray.tMax, kLightSteps, numbers.shift());
  }

  const SceneView& scene_;
  const Rays& rays_;
  const FogLamps* lamps_;
  View<LampTable> tables_;
};

/// The points on lamps that `numbers` choose, of those that isAimedAt().
inline FogLamps fogLamps(const SceneView& scene, const FixedNumbers& numbers) {
  FogLamps lamps;
  lamps.alone = std::all_of(scene.emitters.begin(), scene.emitters.end(), isAimedAt);
  for (int k = 0; k < FogLamps::kCount; ++k) {
    const auto drawn = numbers.lamp(k, FogLamps::kCount);
    const LampChoice lamp = chooseLamp(scene, drawn.choice);
    if (!(lamp.probability > 0)) continue;
    const EmitterView& emitter = scene.emitters[lamp.index];
    if (!isAimedAt(emitter)) continue;
    const LightPoint on = sampleLightPoint(scene, emitter, drawn.u);
    if (!(on.areaPdf > 0)) continue;
    const Rgb sent = (on.pointLike ? emitter.value : emitter.radianceAt(on.uv)) /
                     (on.areaPdf * lamp.probability * static_cast<float>(FogLamps::kCount));
    lamps.known[k] = true;
    lamps.px[k] = on.p.x, lamps.py[k] = on.p.y, lamps.pz[k] = on.p.z;
    lamps.nx[k] = on.normal.x, lamps.ny[k] = on.normal.y, lamps.nz[k] = on.normal.z;
    lamps.all[k] = on.pointLike ? 1.f : 0.f;
    lamps.r[k] = sent.r, lamps.g[k] = sent.g, lamps.b[k] = sent.b;
  }
  return lamps;
}

}  // namespace virga
