// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "scene/lamp_choice.h"
#include "transport/tabled_lamps.h"

namespace virga {

/// What a free flight gathers of a lamp's light on its way.
struct Gathered {
  EmitterChoice lamp;  ///< none: nothing is gathered
  float weight = 0;    ///< largest channel of the path's throughput
  Rgb light;           ///< so far, without the throughput [W/(m^2 sr)]

  VIRGA_HD bool active() const { return lamp.drawn(); }
};

/// Light from lamps with tables, by an expected value in place of a sample: at *all* tentative collisions of a free
/// flight, each weighted by its chance to be real, rather than at the real one alone (Spanier 1966; with null
/// collisions Miller, Georgiev and Jarosz 2019). A look-up costs a fraction of a shadow ray.
/// docs/decisions/flight-light.md
template <class Rays>
class FlightLight {
 public:
  VIRGA_HD FlightLight(const SceneView& scene, const Rays& rays, View<TabledLamp> lamps)
      : scene_(scene), rays_(rays), lamps_(lamps) {}

  VIRGA_HD bool any() const { return lamps_.size > 0; }
  /// Is the light of this emitter gathered along flights?
  VIRGA_HD bool has(int emitter) const { return any() && lamps_[emitter].present(); }

  /// Begins to gather the light of an emitter, if that has a table.
  VIRGA_HD Gathered begin(const EmitterChoice& choice, Rgb throughput) const {
    if (!has(choice.emitter)) return {};
    return {choice, maxComponent(throughput), {}};
  }

  /// The first real collision within [t0, t1], as sampleCollision() finds it; adds to what is gathered.
  VIRGA_HD Collision fly(const MediaRay& r, float t0, float t1, Gathered& gathered, Pcg32& random) const {
    if (r.media.count() == 1) {
      const int index = r.media.medium(0);
      const auto met = [&](float t, float ratio) {
        // Collisions that are hardly real are not worth a look-up each.
        constexpr float kLeast = 0.1f;
        if (ratio >= kLeast || random.next() * kLeast < ratio)
          gather(r, t, index, std::max(ratio, kLeast), gathered, random);
      };
      const float t = trackFreeFlight(scene_.media[index], r.ray, t0, t1, random, met);
      return t < t1 ? Collision{t, index} : Collision{};
    }
    // Flights through several media end one another: only where they end in fact is known to count.
    const Collision c = sampleCollision(scene_, r, t0, t1, random);
    if (c.found()) gather(r, c.t, c.medium, 1, gathered, random);
    return c;
  }

 private:
  VIRGA_HD void gather(const MediaRay& r, float t, int medium, float ratio, Gathered& gathered, Pcg32& random) const {
    const Vec3 x = r.ray.at(t), wo = -r.ray.d;
    const EmitterView& emitter = scene_.emitters[gathered.lamp.emitter];
    const LightSample light = towardPoint(emitter, x, {emitter.position, {}, 1, true});
    if (!(light.pdf > 0) || isBlack(light.radiance)) return;
    const MediumView& here = scene_.media[medium];
    const float phase =
        here.phaseBlends.size == 0 ? here.phase.value(wo, light.wi) : here.phaseAt(x).value(wo, light.wi);
    const float scattered = ratio * phase / (gathered.lamp.probability * light.pdf);
    const float visible =
        seen(lamps_[gathered.lamp.emitter], {{x, light.wi}, r.media, 0}, ratio * gathered.weight, random);
    gathered.light += here.albedoAt(x) * light.radiance * (scattered * visible);
  }
  /// Transmittance times visibility from where `r` starts to the lamp, to count `weight` times.
  VIRGA_HD float seen(const TabledLamp& lamp, const MediaRay& r, float weight, Pcg32& random) const {
    const ConnectingRay ray = aimAt(scene_, r, lamp.table.p);
    if (!(ray.tMax > 0)) return 1;
    if (!lamp.clear && rays_.occluded(ray.at.ray, ray.tMax)) return 0;
    return estimateTransmittance(scene_, rays_, lamp, r.ray.o, ray, weight, random);
  }

  const SceneView& scene_;
  const Rays& rays_;
  View<TabledLamp> lamps_;
};

}  // namespace virga
