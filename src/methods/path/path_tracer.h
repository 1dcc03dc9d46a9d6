// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "methods/path/light_techniques.h"
#include "transport/roulette.h"
#include "transport/visibility.h"

namespace virga {

/// Unidirectional volumetric path tracing with next-event estimation and multiple importance sampling. Unbiased.
template <class Rays>
class PathTracer {
 public:
  VIRGA_HD PathTracer(const SceneView& scene, const Rays& rays, const PathOptions& options)
      : scene_(scene),
        rays_(rays),
        options_(options),
        lights_(scene, rays, options),
        glow_(scene.emissive && options.sources != PathOptions::Sources::lamps) {}

  using Path = EyePath;
  using Record = EyePath::Record;

  /// Radiance along a camera ray, layer by layer [W/(m^2 sr)].
  VIRGA_HD LayerRadiance trace(const CameraRay& camera, Sampler& sampler) const {
    Path path = start(camera);
    while (extend(path, sampler)) {
    }
    return path.radiance;
  }

  /// May light still be connected after one more scattering event than these?
  VIRGA_HD bool mayScatter(int events) const { return options_.maxDepth < 0 || events + 2 <= options_.maxDepth; }

  VIRGA_HD Path start(const CameraRay& camera) const {
    Path path;
    path.at = leaveCamera(scene_, camera.ray);
    path.tMax = camera.tMax;
    return path;
  }

  /// Follows the ray to its next vertex and scatters there; false at the end of the path.
  VIRGA_HD bool extend(Path& path, Sampler& sampler) const {
    const RayHit hit = rays_.nearest(path.at.ray, path.tMax);
    MediaRay walk = path.at;
    MediaState segmentMedia;
    EquiangularSegment segment;
    Collision collision;
    SpectralFlight spectral(path.throughput, scene_.chromatic ? path.one(sampler) : 0.f);
    Gathered gathered;
    const float chooses = mayScatter(path) ? lights_.numberForFlight(path, sampler) : -1;
    Rgb glow;
    bool first = true;
    walkMedia(scene_, rays_, walk, hit.found() ? hit.t : path.tMax, [&](float t0, float t1) {
      if (walk.media.vacuum()) return true;
      if (std::exchange(first, false)) {
        segment = lights_.equiangularSegment(path, walk, t0, t1);
        if (segment.active()) segmentMedia = walk.media;
        gathered = lights_.beginFlight(path, chooses, t0, t1);
      }
      if (gathered.active())
        collision = lights_.flightLight().fly(walk, t0, t1, gathered, sampler.stream());
      else
        collision = scene_.chromatic ? sampleCollision(scene_, walk, t0, t1, sampler.stream(), spectral)
                                     : sampleCollision(scene_, walk, t0, t1, sampler.stream());
      // What glows before a free flight's end counts in full: in expectation that is the transmittance.
      if (glow_) glow += estimateEmission(scene_, walk, t0, std::min(t1, collision.t), sampler.stream());
      return !collision.found();
    });
    if (segment.active() && mayScatter(path)) lights_.connectEquiangular(path, segment, segmentMedia, sampler);
    if (scene_.chromatic) path.throughput *= spectral.weight(path.throughput);
    if (glow_) path.add(path.layers, glow);
    if (gathered.active()) lights_.addGathered(path, gathered);
    if (collision.found()) return scatterInMedium(path, walk.media, collision, segment, sampler);
    if (hit.found()) return scatterOnSurface(path, walk.media, hit, sampler);
    lights_.addEnvironment(path);
    return false;
  }

  /// Scatters at a vertex that was found some other way, of which `record` shall not hear; false at the end of the
  /// path.
  VIRGA_HD bool scatterAt(Path& path, const Vertex& v, Sampler& sampler) const {
    path.link = {true, v.p, v.normal()};
    if (v.kind == VertexKind::medium) {
      path.throughput *= v.albedo;
      return leaveMedium(path, v.phase, v.media, v.p, v.wo, {v.p, v.p, 0, true, 0, {}}, sampler);
    }
    const Side side{&v.surface.bsdf, v.surface.frame, v.surface.frame.toLocal(v.wo), v.surface.normal};
    path.at.ray.d = -v.wo;
    path.layers.scatter(VertexKind::surface);
    lights_.connectSurface(path, v.point, side, v.media, sampler);
    const BsdfSample s = sampleBsdf(path, v.point, side, v.media, sampler);
    return leave(path, v.point, side, s, v.media, sampler);
  }

 private:
  VIRGA_HD bool mayScatter(const Path& path) const { return mayScatter(path.depth); }

  VIRGA_HD bool scatterInMedium(Path& path, const MediaState& media, const Collision& collision,
                                const EquiangularSegment& segment, Sampler& sampler) const {
    if (!mayScatter(path)) return false;
    const MediumView& medium = scene_.media[collision.medium];
    const Vec3 x = path.at.ray.at(collision.t), wo = -path.at.ray.d;
    if (!path.survivesClamping(x, Vec3(0), sampler)) return false;
    if (path.record) path.writeDown(Vertex::inMedium(scene_, collision.medium, x, wo, media));
    path.throughput *= medium.albedoAt(x);
    EyePath::LastVertex last{x, path.ahead.light.drawn() ? path.ahead.lampsFor : x, 0, true, collision.t, {}};
    if (segment.contains(collision.t) && collision.medium == segment.medium) last.segment = segment;
    return leaveMedium(path, medium.phaseAt(x), media, x, wo, last, sampler);
  }

  /// Connects the lights at a vertex in a medium, and goes on from it.
  VIRGA_HD bool leaveMedium(Path& path, const PhaseFunction& phase, const MediaState& media, Vec3 x, Vec3 wo,
                            const EyePath::LastVertex& last, Sampler& sampler) const {
    if (isBlack(path.throughput)) return false;
    path.layers.scatter(VertexKind::medium);
    path.last = last;
    lights_.connectMedium(path, phase, media, x, wo, sampler);

    path.lamp = lights_.guideFrom(path, media, x, sampler);
    if (path.lamp.hasAxis()) path.lamp.guide(phase.pdf(wo, path.lamp.axis), 1 / (4 * kPi));
    PhaseSample s;
    if (path.lamp.share > 0 && path.one(sampler) < path.lamp.share) {
      s.wi = path.lamp.sample(Vec3(0), path.pair(sampler));
      s.value = phase.value(wo, s.wi), s.pdf = phase.pdf(wo, s.wi);
    } else {
      s = phase.sample(wo, path.pair(sampler));
    }
    const float density = path.lamp.mixture(s.pdf, Vec3(0), s.wi);
    if (!(density > 0)) return false;
    path.promise = path.lamp.promise(Vec3(0), s.wi);
    path.throughput *= s.value / density;
    path.last.pdf = s.pdf;
    path.at = {{x, s.wi}, media, 0};
    path.tMax = kInfinity;
    ++path.depth;
    return survives(path, sampler);
  }

  VIRGA_HD bool scatterOnSurface(Path& path, const MediaState& media, const RayHit& hit, Sampler& sampler) const {
    const ShapeView& shape = scene_.surfaces[hit.shape];
    const SurfacePoint point = surfacePoint(shape, path.at.ray, hit, scene_.scale);
    lights_.addAreaLight(path, point, hit);
    if (!mayScatter(path) && !scene_.thinGlass) return false;
    const Vec3 wo = -path.at.ray.d;
    Bsdf textured;
    const Side side = sideOf(scene_, point, hit, wo, textured);
    if (side.bsdf->isThin()) {
      const BsdfSample s = side.bsdf->sample(side.wo, {}, path.one(sampler));
      if (s.wi.z * side.wo.z < 0) return passStraight(path, point, s.weight, media, hit.t);
      path.layers.scatterSpecularly();
      path.link = {};
      return mayScatter(path) && leave(path, point, side, s, media, sampler);
    }
    if (!mayScatter(path)) return false;
    if (side.leaks(wo, side.wo)) return false;
    const bool specular = side.bsdf->specular();
    if (specular) {
      path.layers.scatterSpecularly();
      path.link = {};
    } else {
      if (path.record && side.bsdf->broad()) {
        if (!path.survivesClamping(point.p, point.geometricNormal, sampler)) return false;
        path.writeDown(Vertex::onSurface(point, side, wo, media));
      } else {
        path.link = {};
      }
      path.layers.scatter(VertexKind::surface);
      lights_.connectSurface(path, point, side, media, sampler);
    }
    const BsdfSample s = sampleBsdf(path, point, side, media, sampler);
    return leave(path, point, side, s, media, sampler);
  }

  /// A direction by the bsdf, or by the guide.
  VIRGA_HD BsdfSample sampleBsdf(Path& path, const SurfacePoint& point, const Side& side, const MediaState& media,
                                 Sampler& sampler) const {
    path.lamp = side.bsdf->broad() ? lights_.guideFrom(path, media, point.p, sampler) : LampGuide{};
    path.promise = 1;
    if (path.lamp.hasAxis()) path.lamp.guide(side.bsdf->pdf(side.wo, side.frame.toLocal(path.lamp.axis)), 1 / kTwoPi);
    if (!(path.lamp.share > 0)) return side.bsdf->sample(side.wo, path.pair(sampler), path.one(sampler));
    const Vec3 n = facing(point, -path.at.ray.d);
    BsdfSample s;
    if (path.one(sampler) < path.lamp.share) {
      s.wi = side.frame.toLocal(path.lamp.sample(n, path.pair(sampler)));
      s.pdf = side.bsdf->pdf(side.wo, s.wi);
      s.weight =
          side.bsdf->value(side.wo, s.wi) * (std::fabs(s.wi.z) / path.lamp.mixture(s.pdf, n, side.frame.toWorld(s.wi)));
    } else {
      s = side.bsdf->sample(side.wo, path.pair(sampler), path.one(sampler));
      if (!(s.pdf > 0)) return s;
      s.weight *= s.pdf / path.lamp.mixture(s.pdf, n, side.frame.toWorld(s.wi));
    }
    path.promise = path.lamp.promise(n, side.frame.toWorld(s.wi));
    return s;
  }

  /// Goes on from a surface as the bsdf has sampled it.
  VIRGA_HD bool leave(Path& path, const SurfacePoint& point, const Side& side, const BsdfSample& s,
                      const MediaState& media, Sampler& sampler) const {
    if (!(s.pdf > 0) || isBlack(s.weight)) return false;
    const Vec3 wo = -path.at.ray.d, wi = side.frame.toWorld(s.wi);
    if (side.leaks(wi, s.wi)) return false;
    path.throughput *= s.weight;
    path.etaScale *= s.eta * s.eta;
    path.last = {point.p, point.p, s.pdf, !s.specular, 0, {}};
    path.at = leaveSurface(scene_, point, wo, wi, media);
    path.tMax = kInfinity;
    ++path.depth;
    return survives(path, sampler);
  }

  /// Through thin glass: no vertex, but that lights behind it are in the caustic layers. Connections have looked
  /// through it.
  VIRGA_HD bool passStraight(Path& path, const SurfacePoint& point, Rgb weight, const MediaState& media,
                             float t) const {
    path.layers.scatterSpecularly();
    path.link = {};
    path.throughput *= weight;
    path.at = leaveSurface(scene_, point, -path.at.ray.d, path.at.ray.d, media);
    path.tMax -= t;
    return !isBlack(path.throughput);
  }

  VIRGA_HD bool survives(Path& path, Sampler& sampler) const {
    if (isBlack(path.throughput)) return false;  // too little to be told from nothing
    // Where guides make the throughput small the light that follows is bright.
    const float promise = path.promise * std::exchange(path.before, path.promise);
    if (path.depth < options_.rrDepth) return true;
    const float q = std::min(maxComponent(path.throughput) * path.etaScale * promise, mostSurvival(path.depth));
    if (!(sampler.random() < q)) return false;
    path.throughput *= 1 / q;
    return true;
  }

  const SceneView& scene_;
  const Rays& rays_;
  const PathOptions& options_;
  LightTechniques<Rays> lights_;
  bool glow_;  ///< does the light of media count?
};

}  // namespace virga
