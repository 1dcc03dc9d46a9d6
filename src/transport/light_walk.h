// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/sampler.h"
#include "transport/marched_flight.h"
#include "transport/roulette.h"
#include "transport/vertex.h"

namespace virga {

/// Where a walk from a light scatters. A cache line.
struct alignas(64) LightVertex {
  VertexKind kind = VertexKind::none;
  Vec3 p;            ///< world
  Vec3 wi;           ///< unit, toward where the light came from
  Rgb weight;        ///< light that is scattered here, before phase function or bsdf * |cosine of wi| [W]
  int medium = -1;   ///< the one that scatters; -1 on surfaces
  int depth = 0;     ///< scattering events, this one included; specular ones count, thin glass that is passed does not
  int surface = -1;  ///< where its SurfaceScattering is kept; -1: it is Lambertian, with reflectance / pi in the weight
  Vec3 normal;       ///< geometric, on the side of the bsdf's frame; 0 in media
};

/// Random numbers of a walk's step: of a low-discrepancy sequence at first.
struct WalkNumbers {
  static constexpr int kStratifiedBounces = 4;

  VIRGA_HD static Vec2 pair(int depth, Sampler& sampler) {
    return depth < kStratifiedBounces ? sampler.next2D() : sampler.random2D();
  }
  VIRGA_HD static float one(int depth, Sampler& sampler) {
    return depth < kStratifiedBounces ? sampler.next1D() : sampler.random();
  }
};

/// What a surface makes of the flux that arrives on it.
struct SurfaceBounce {
  LightVertex vertex;            ///< without a kind where no light is left: on narrow bsdfs (Bsdf::broad)
  SurfaceScattering scattering;  ///< of the vertex
  bool lambertian = false;       ///< then the vertex does without
  float arrival = 1;             ///< |cosine| of the light to the geometry
  MediaRay onward;
  Rgb weight;                      ///< of the bsdf's sample; black: the walk ends here
  float refraction = 1, tilt = 1;  ///< what makes it that of flux, and of the geometry's cosines
  bool passes = false;             ///< straight through thin glass, which does not count as scattering

  /// The weight of the vertex.
  VIRGA_HD Rgb left(Rgb flux) const {
    return lambertian ? flux / arrival * scattering.scattering(vertex.normal, vertex.wi) : flux / arrival;
  }
  /// The flux that goes on.
  VIRGA_HD Rgb carried(Rgb flux) const { return flux * weight * refraction * tilt; }
};

/// Surfaces scatter light by the adjoint of their bsdf: no scaling of refracted radiance, corrected for shading normals
/// (Veach 1997, 5.3). `media` are around the point where `at` arrives; `depth` counts the scattering events before.
VIRGA_HD inline SurfaceBounce bounceOff(const SceneView& scene, const Ray& at, const MediaState& media,
                                        const RayHit& hit, int depth, Sampler& sampler) {
  SurfaceBounce bounce;
  const SurfacePoint point = surfacePoint(scene.surfaces[hit.shape], at, hit, scene.scale);
  const Vec3 wi = -at.d;
  Bsdf textured;
  const Side side = sideOf(scene, point, hit, wi, textured);
  const bool fromBehind = side.wo.z <= 0 && !side.bsdf->transmits();  // black, as one-sided bsdfs are there
  if (fromBehind || side.leaks(wi, side.wo)) return bounce;
  bounce.arrival = std::fabs(dot(wi, point.geometricNormal));
  if (side.bsdf->broad()) {
    bounce.scattering = SurfaceScattering(side);
    LightVertex& v = bounce.vertex;
    v.kind = VertexKind::surface, v.p = point.p, v.wi = wi;
    v.depth = depth + 1, v.normal = side.normal;
    bounce.lambertian = side.bsdf->kind() == Bsdf::Kind::diffuse && point.shadingNormal == point.geometricNormal;
  }
  const float choice = WalkNumbers::one(depth, sampler);
  const BsdfSample s = side.bsdf->sample(side.wo, WalkNumbers::pair(depth, sampler), choice);
  if (!(s.pdf > 0) || isBlack(s.weight)) return bounce;
  const Vec3 w = side.frame.toWorld(s.wi);
  if (side.leaks(w, s.wi)) return bounce;
  bounce.passes = side.bsdf->isThin() && s.wi.z * side.wo.z < 0;
  bounce.onward = leaveSurface(scene, point, wi, w, media);
  // The bsdf's sample is that of radiance, which refraction scales and which knows the shading normal's cosine alone.
  bounce.weight = s.weight, bounce.refraction = square(s.eta);
  if (!side.bsdf->specular())
    bounce.tilt = std::fabs(side.wo.z * dot(w, point.geometricNormal) / (s.wi.z * bounce.arrival));
  return bounce;
}

/// Random walks that carry flux from the lights (methods.md 2.1; Dachsbacher et al.'s virtual point lights in media,
/// equations of section 3 of the instant-scattering paper). Shared by all methods that trace light.
///
/// A vertex in a medium is found by an exact free flight: its weight is the flux times the albedo.
template <class Rays>
class LightWalker {
 public:
  VIRGA_HD LightWalker(const SceneView& scene, const Rays& rays, int maxDepth,
                       FlightMode flights = FlightMode::tracking)
      : scene_(scene), rays_(rays), maxDepth_(maxDepth), flights_(flights) {}

  /// From `start`, which carries `flux`. visit(vertex, scattering) at each vertex in a medium or on a broad bsdf
  /// (Bsdf::broad); `scattering` is null in media. maxDepth: scattering events; -1: no limit.
  template <class Visit>
  VIRGA_HD void walk(const MediaRay& start, Rgb flux, Sampler& sampler, Visit&& visit) const {
    State state{start, flux};
    while (!isBlack(state.flux) && step(state, sampler, visit)) {
    }
  }

 private:
  struct State {
    MediaRay at;
    Rgb flux;
    int depth = 0;
  };

  template <class Visit>
  VIRGA_HD bool step(State& state, Sampler& sampler, Visit& visit) const {
    if (maxDepth_ >= 0 && state.depth >= maxDepth_) return false;
    const RayHit hit = rays_.nearest(state.at.ray, kInfinity);
    MediaRay flown = state.at;
    Collision collision;
    SpectralFlight spectral(state.flux, scene_.chromatic ? WalkNumbers::one(state.depth, sampler) : 0.f);
    walkMedia(scene_, rays_, flown, hit.t, [&](float t0, float t1) {
      if (flown.media.vacuum()) return true;
      collision = scene_.chromatic ? collide(flown, t0, t1, sampler.stream(), spectral)
                                   : collide(flown, t0, t1, sampler.stream());
      return !collision.found();
    });
    if (scene_.chromatic) state.flux *= spectral.weight(state.flux);
    if (collision.found()) return scatterInMedium(state, flown.media, collision, sampler, visit);
    return hit.found() && scatterOnSurface(state, flown.media, hit, sampler, visit);
  }

  template <class... Spectral>
  VIRGA_HD Collision collide(const MediaRay& r, float t0, float t1, Pcg32& random, Spectral&... spectral) const {
    return flights_ == FlightMode::marching ? marchCollision(scene_, r, t0, t1, random, spectral...)
                                            : sampleCollision(scene_, r, t0, t1, random, spectral...);
  }

  template <class Visit>
  VIRGA_HD bool scatterInMedium(State& state, const MediaState& media, const Collision& collision, Sampler& sampler,
                                Visit& visit) const {
    const MediumView& medium = scene_.media[collision.medium];
    const Vec3 p = state.at.ray.at(collision.t), wi = -state.at.ray.d;
    const Rgb scattered = state.flux * medium.albedoAt(p);
    if (isBlack(scattered)) return false;
    LightVertex v;
    v.kind = VertexKind::medium, v.p = p, v.wi = wi, v.weight = scattered, v.medium = collision.medium;
    v.depth = ++state.depth;
    visit(v, nullptr);
    const PhaseSample s = medium.phaseAt(p).sample(wi, WalkNumbers::pair(state.depth, sampler));
    state.at = {{p, s.wi}, media, 0};
    return survives(state, scattered * (s.value / s.pdf), sampler);
  }

  template <class Visit>
  VIRGA_HD bool scatterOnSurface(State& state, const MediaState& media, const RayHit& hit, Sampler& sampler,
                                 Visit& visit) const {
    const SurfaceBounce bounce = bounceOff(scene_, state.at.ray, media, hit, state.depth, sampler);
    if (bounce.vertex.kind == VertexKind::surface) {
      LightVertex v = bounce.vertex;
      v.weight = bounce.left(state.flux);
      if (!isBlack(v.weight)) visit(v, bounce.lambertian ? nullptr : &bounce.scattering);
    }
    const Rgb next = bounce.carried(state.flux);
    if (isBlack(next)) return false;
    state.at = bounce.onward;
    if (bounce.passes) {
      state.flux = next;
      return true;
    }
    ++state.depth;
    return survives(state, next, sampler);
  }

  /// Russian roulette by what scattering has left of the flux.
  VIRGA_HD bool survives(State& state, Rgb next, Sampler& sampler) const {
    const float q = std::min(maxComponent(next) / maxComponent(state.flux), mostSurvival(state.depth));
    if (!(sampler.random() < q)) return false;
    state.flux = next / q;
    return true;
  }

  const SceneView& scene_;
  const Rays& rays_;
  int maxDepth_;
  FlightMode flights_;
};

}  // namespace virga
