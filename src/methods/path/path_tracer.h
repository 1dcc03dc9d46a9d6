// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "methods/path/eye_path.h"
#include "methods/path/flight_light.h"
#include "transport/roulette.h"
#include "transport/visibility.h"

namespace virga {

/// Unidirectional volumetric path tracing with next-event estimation and multiple importance sampling. Unbiased.
///
/// Techniques for the light at a medium vertex, weighted against each other by the power heuristic:
///   A  free flight to the vertex, then a point on a light (not at lights in thin fog: there B is better alone);
///   B  a point on a light, then an equiangular distance (first medium on the ray if homogeneous; lights at finite
///   distance); C  free flight to the vertex, then the phase function, which meets the light.
/// At a surface vertex: A' a point on a light, C' the BSDF.
/// In fog around a lamp directions are guided (LampGuide). The weights are those of unguided ones: they need only sum
/// to 1.
template <class Rays>
class PathTracer {
 public:
  VIRGA_HD PathTracer(const SceneView& scene, const Rays& rays, const PathOptions& options)
      : scene_(scene),
        rays_(rays),
        options_(options),
        lamps_(options.sources != PathOptions::Sources::glow),
        glow_(scene.emissive && options.sources != PathOptions::Sources::lamps),
        aims_(lamps_ && hasLightsToAimAt(scene)),
        flightLight_(scene, rays, lamps_ ? options.tabled : View<TabledLamp>{}) {}

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
    if (flightLight_.any() && mayScatter(path) && hasLights())
      gathered = flightLight_.begin(path.throughput, path.one(sampler));
    Rgb glow;
    bool first = true;
    walkMedia(scene_, rays_, walk, hit.found() ? hit.t : path.tMax, [&](float t0, float t1) {
      if (walk.media.vacuum()) return true;
      if (std::exchange(first, false)) {
        segment = equiangularSegment(path, walk, t0, t1);
        if (segment.active()) segmentMedia = walk.media;
      }
      if (gathered.active())
        collision = flightLight_.fly(walk, t0, t1, gathered, sampler.stream());
      else
        collision = scene_.chromatic ? sampleCollision(scene_, walk, t0, t1, sampler.stream(), spectral)
                                     : sampleCollision(scene_, walk, t0, t1, sampler.stream());
      // What glows before a free flight's end counts in full: in expectation that is the transmittance.
      if (glow_) glow += estimateEmission(scene_, walk, t0, std::min(t1, collision.t), sampler.stream());
      return !collision.found();
    });
    if (segment.active() && mayScatter(path)) connectEquiangular(path, segment, segmentMedia, sampler);
    if (scene_.chromatic) path.throughput *= spectral.weight(path.throughput);
    if (glow_) path.add(path.layers, glow);
    if (gathered.active()) addGathered(path, gathered);
    if (collision.found()) return scatterInMedium(path, walk.media, collision, segment, sampler);
    if (hit.found()) return scatterOnSurface(path, walk.media, hit, sampler);
    addEnvironment(path);
    return false;
  }

  /// Scatters at a vertex that was found some other way, of which `record` shall not hear; false at the end of the
  /// path.
  VIRGA_HD bool scatterAt(Path& path, const Vertex& v, Sampler& sampler) const {
    path.link = {true, v.p, v.normal()};
    if (v.kind == VertexKind::medium) {
      path.throughput *= v.albedo;
      return leaveMedium(path, v.phase, v.media, v.p, v.wo, {v.p, 0, true, 0, {}}, sampler);
    }
    const Side side{&v.surface.bsdf, v.surface.frame, v.surface.frame.toLocal(v.wo), v.surface.normal};
    path.at.ray.d = -v.wo;
    path.layers.scatter(VertexKind::surface);
    connectSurface(path, v.point, side, v.media, sampler);
    const BsdfSample s = sampleBsdf(path, v.point, side, v.media, sampler);
    return leave(path, v.point, side, s, v.media, sampler);
  }

 private:
  /// Power heuristic (exponent 2) of a technique against up to two others.
  VIRGA_HD static float weight(float own, float other, float third = 0) {
    return own > 0 ? 1 / (1 + square(other / own) + square(third / own)) : 0;
  }
  VIRGA_HD bool mayScatter(const Path& path) const { return mayScatter(path.depth); }

  VIRGA_HD EquiangularSegment equiangularSegment(const Path& path, const MediaRay& r, float t0, float t1) const {
    const bool largeLights = lamps_ && path.depth < options_.equiangularDepth;
    if (r.media.count() != 1 || !(largeLights || aims_)) return {};
    const int index = r.media.medium(0);
    const MediumView& medium = scene_.media[index];
    if (!medium.homogeneous || !(medium.sigmaT > 0)) return {};
    const Rgb choice = path.throughput / (path.throughput.r + path.throughput.g + path.throughput.b);
    return {index, largeLights, r.ray, t0, t1, medium.sigmaT, medium.grey, medium.spectrum, choice};
  }
  /// Are there lights that technique B aims at on every segment?
  VIRGA_HD static bool hasLightsToAimAt(const SceneView& scene) {
    for (const EmitterView& e : scene.emitters)
      for (int m = 0; m < scene.media.size; ++m) {
        const MediumView& medium = scene.media[m];
        const bool isSmall = e.area * square(medium.sigmaT) < EquiangularSegment::kSmallLight;
        if (medium.homogeneous && e.isLocal() && (isSmall || e.medium == m)) return true;
      }
    return false;
  }

  // --- light that the path meets ---

  VIRGA_HD void addEnvironment(Path& path) const {
    if (scene_.environment < 0 || !lamps_) return;
    const EmitterView& emitter = scene_.emitters[scene_.environment];
    const Vec3 w = path.at.ray.d;
    const float connection = scene_.emitterChoice.probability(scene_.environment) * environmentPdf(emitter, w);
    path.addMet(environmentRadiance(emitter, w) * (path.last.connected ? weight(path.last.pdf, connection) : 1));
  }

  VIRGA_HD void addAreaLight(Path& path, const SurfacePoint& point, const RayHit& hit) const {
    const ShapeView& shape = scene_.surfaces[point.shape];
    const EmitterView& emitter = scene_.emitters[shape.emitter];
    if (dot(point.geometricNormal, path.at.ray.d) >= 0) return;
    float w = 1;
    const EyePath::LastVertex& last = path.last;
    if (last.connected) {
      const float choice = scene_.emitterChoice.probability(shape.emitter);
      const float connection = choice * areaLightPdf(shape, emitter, last.p, point.p, point.geometricNormal);
      if (last.segment.aimsAt(emitter)) {
        const float flight = last.segment.freeFlightPdf(last.t);
        const float uniform = uniformPointPdf(emitter, last.p, point.p, point.geometricNormal);
        const float equiangular = choice * uniform * last.segment.pdf(point.p, last.t);
        w = weight(flight * last.pdf, last.segment.replacesFlights(emitter) ? 0 : flight * connection, equiangular);
      } else {
        w = weight(last.pdf, connection);
      }
    }
    path.addMet(emitter.radianceAt(lightUv(shape, emitter, point.p, hit.primitive, {hit.u, hit.v})) * w);
  }

  // --- next-event estimation ---

  VIRGA_HD Rgb visibility(const MediaRay& r, Vec3 x, const LightSample& light, LayerPath& layers,
                          Sampler& sampler) const {
    return virga::visibility(scene_, rays_, r, x, light, layers, sampler.stream());
  }

  struct Connection {
    LightSample light;
    int emitter = -1;
    float choice = 0;  ///< probability of the emitter
  };

  /// Nothing for lights that technique B finds by itself on the segment to x.
  VIRGA_HD Connection sampleConnection(const Path& path, Vec3 x, Sampler& sampler) const {
    const auto choice = scene_.emitterChoice.sample(path.one(sampler));
    const EmitterView& emitter = scene_.emitters[choice.index];
    if (path.last.segment.replacesFlights(emitter)) return {};
    return {sampleLight(scene_, emitter, x, path.pair(sampler)), choice.index, choice.probability};
  }

  VIRGA_HD bool hasLights() const {
    return lamps_ && scene_.emitters.size > 0 && scene_.emitterChoice.cdf[scene_.emitters.size] > 0;
  }

  /// At a vertex that is in the path's layers already.
  VIRGA_HD bool connectsHere(const Path& path) const { return hasLights() && (path.lightsX1 || path.layers.hasX2()); }

  VIRGA_HD LampGuide drawLamp(const Path& path, Sampler& sampler) const {
    const auto choice = scene_.emitterChoice.sample(path.one(sampler));
    const EmitterView& emitter = scene_.emitters[choice.index];
    const Vec2 u = path.pair(sampler);
    LampGuide lamp;
    lamp.emitter = choice.index, lamp.choice = choice.probability;
    if (emitter.isLocal()) lamp.on = sampleLightPoint(scene_, emitter, u);
    return lamp;
  }
  /// For a ray that leaves x into these media: it is guided where the lamp lies in the same fog, and not too deep.
  VIRGA_HD LampGuide guideFrom(const Path& path, const MediaState& media, Vec3 x, Sampler& sampler) const {
    if (!aims_ || media.count() != 1 || !hasLights()) return {};
    LampGuide lamp = drawLamp(path, sampler);
    const EmitterView& emitter = scene_.emitters[lamp.emitter];
    const MediumView& fog = scene_.media[media.medium(0)];
    if (!emitter.isLocal() || emitter.medium != media.medium(0) || !fog.homogeneous) return lamp;
    const Vec3 toLamp = lamp.on.p - x;
    const float d = length(toLamp);
    if (d > 0 && fog.sigmaT * d < EquiangularSegment::kThin) lamp.axis = toLamp / d;
    return lamp;
  }

  /// Technique B: a vertex on the segment by its angle about a point on a light, connected to that point.
  VIRGA_HD void connectEquiangular(Path& path, const EquiangularSegment& segment, const MediaState& media,
                                   Sampler& sampler) const {
    if (!hasLights() || (!path.lightsX1 && !path.layers.hasX1())) return;
    const LampGuide lamp = path.lamp.drawn() ? path.lamp : drawLamp(path, sampler);
    const EmitterView& emitter = scene_.emitters[lamp.emitter];
    const LightPoint& on = lamp.on;
    const float uDistance = path.one(sampler);
    if (!segment.aimsAt(emitter)) return;
    const EquiangularSegment::Sample distance = segment.sample(on.p, uDistance);
    if (!(distance.pdf > 0)) return;
    const Vec3 x = segment.ray.at(distance.t), wo = -segment.ray.d;
    const LightSample light = towardPoint(emitter, x, on);
    const float share = path.clampedShare(x, Vec3(0));
    if (!(light.pdf > 0) || !(share > 0) || isBlack(light.radiance)) return;

    const MediumView& medium = scene_.media[segment.medium];
    const PhaseFunction phase = medium.phaseAt(x);
    const float flight = segment.freeFlightPdf(distance.t);
    const float own = lamp.choice * distance.pdf * light.pdf;
    const float connected = segment.replacesFlights(emitter) ? 0 : flight * lamp.choice;
    float w = 1;
    if (light.delta) {
      w = weight(own, connected);
    } else {
      const ShapeView& shape = scene_.surfaces[emitter.shape];
      const float connection = connected > 0 ? areaLightPdf(shape, emitter, x, on.p, on.normal) : 0;
      w = weight(own, connected * connection, flight * phase.pdf(wo, light.wi));
    }
    LayerPath layers = path.layers;
    layers.scatter(VertexKind::medium);
    const Rgb seen = visibility({{x, light.wi}, media, 0}, x, light, layers, sampler);
    // sigma_s tau = albedo * sigma_t tau
    const Rgb scattered = medium.albedoAt(x) * segment.flight(distance.t) * light.radiance;
    path.add(layers, scattered * seen * (phase.value(wo, light.wi) * w * share / own));
  }

  /// Light that a free flight has gathered on its way to a vertex in a medium.
  VIRGA_HD void addGathered(Path& path, const Gathered& gathered) const {
    LayerPath layers = path.layers;
    layers.scatter(VertexKind::medium);
    path.add(layers, gathered.light);
  }

  /// Technique A at a medium vertex.
  VIRGA_HD void connectMedium(Path& path, const PhaseFunction& phase, const MediaState& media, Vec3 x, Vec3 wo,
                              Sampler& sampler) const {
    if (!connectsHere(path)) return;
    const Connection c = sampleConnection(path, x, sampler);
    if (!(c.light.pdf > 0) || isBlack(c.light.radiance) || flightLight_.has(c.emitter)) return;
    const float own = c.choice * c.light.pdf;
    const float phasePdf = c.light.delta ? 0 : phase.pdf(wo, c.light.wi);
    float w = weight(own, phasePdf);
    const EquiangularSegment& segment = path.last.segment;
    const EmitterView& emitter = scene_.emitters[c.emitter];
    if (segment.aimsAt(emitter)) {
      const Vec3 y = x + c.light.wi * c.light.distance;
      const float flight = segment.freeFlightPdf(path.last.t);
      w = weight(flight * own, flight * phasePdf, c.choice * c.light.uniformPdf * segment.pdf(y, path.last.t));
    }
    LayerPath layers = path.layers;
    const Rgb seen = visibility({{x, c.light.wi}, media, 0}, x, c.light, layers, sampler);
    path.add(layers, c.light.radiance * seen * (phase.value(wo, c.light.wi) * w / own));
  }

  /// Technique A' at a surface vertex.
  VIRGA_HD void connectSurface(Path& path, const SurfacePoint& point, const Side& side, const MediaState& media,
                               Sampler& sampler) const {
    if (!connectsHere(path)) return;
    path.last.segment = {};
    const Connection c = sampleConnection(path, point.p, sampler);
    if (!(c.light.pdf > 0) || isBlack(c.light.radiance)) return;
    const Vec3 wi = side.frame.toLocal(c.light.wi);
    const Rgb value = side.leaks(c.light.wi, wi) ? Rgb() : side.bsdf->value(side.wo, wi);
    if (isBlack(value)) return;
    const float own = c.choice * c.light.pdf;
    const float w = weight(own, c.light.delta ? 0 : side.bsdf->pdf(side.wo, wi));
    const MediaRay leaving = leaveSurface(scene_, point, -path.at.ray.d, c.light.wi, media);
    LayerPath layers = path.layers;
    const Rgb seen =
        flightLight_.has(c.emitter)
            ? Rgb(flightLight_.seen(c.emitter, leaving, point.p, maxComponent(path.throughput), sampler.stream()))
            : visibility(leaving, point.p, c.light, layers, sampler);
    path.add(layers, value * c.light.radiance * seen * (std::fabs(wi.z) * w / own));
  }

  // --- vertices ---

  VIRGA_HD bool scatterInMedium(Path& path, const MediaState& media, const Collision& collision,
                                const EquiangularSegment& segment, Sampler& sampler) const {
    if (!mayScatter(path)) return false;
    const MediumView& medium = scene_.media[collision.medium];
    const Vec3 x = path.at.ray.at(collision.t), wo = -path.at.ray.d;
    if (!path.survivesClamping(x, Vec3(0), sampler)) return false;
    if (path.record) path.writeDown(Vertex::inMedium(scene_, collision.medium, x, wo, media));
    path.throughput *= medium.albedoAt(x);
    EyePath::LastVertex last{x, 0, true, collision.t, {}};
    if (segment.contains(collision.t) && collision.medium == segment.medium) last.segment = segment;
    return leaveMedium(path, medium.phaseAt(x), media, x, wo, last, sampler);
  }

  /// Connects the lights at a vertex in a medium, and goes on from it.
  VIRGA_HD bool leaveMedium(Path& path, const PhaseFunction& phase, const MediaState& media, Vec3 x, Vec3 wo,
                            const EyePath::LastVertex& last, Sampler& sampler) const {
    if (isBlack(path.throughput)) return false;
    path.layers.scatter(VertexKind::medium);
    path.last = last;
    connectMedium(path, phase, media, x, wo, sampler);

    path.lamp = guideFrom(path, media, x, sampler);
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
    if (shape.emitter >= 0 && lamps_) addAreaLight(path, point, hit);
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
      connectSurface(path, point, side, media, sampler);
    }
    const BsdfSample s = sampleBsdf(path, point, side, media, sampler);
    return leave(path, point, side, s, media, sampler);
  }

  /// A direction by the bsdf, or by the guide.
  VIRGA_HD BsdfSample sampleBsdf(Path& path, const SurfacePoint& point, const Side& side, const MediaState& media,
                                 Sampler& sampler) const {
    path.lamp = side.bsdf->broad() ? guideFrom(path, media, point.p, sampler) : LampGuide{};
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
    path.last = {point.p, s.pdf, !s.specular, 0, {}};
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
  bool lamps_, glow_;  ///< does their light count?
  bool aims_;
  FlightLight<Rays> flightLight_;
};

}  // namespace virga
