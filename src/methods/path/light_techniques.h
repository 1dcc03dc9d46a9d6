// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "methods/path/eye_path.h"

namespace virga {

/// How the paths of PathTracer find the light of lamps.
///
/// Techniques for the light at a medium vertex, weighted against each other by the power heuristic:
///   A  free flight to the vertex, then a point on a light (not at lights in thin fog: there B is better alone);
///   B  a point on a light, then an equiangular distance (first medium on the ray if homogeneous; lights at finite
///   distance); C  free flight to the vertex, then the phase function, which meets the light.
/// At a surface vertex: A' a point on a light, C' the BSDF.
/// Light of lamps with tables is gathered on the flight to the vertex (FlightLight), where nothing else finds it.
/// In fog around a lamp directions are guided (LampGuide). The weights are those of unguided ones: they need only sum
/// to 1.
template <class Rays>
class LightTechniques {
 public:
  using Path = EyePath;

  VIRGA_HD LightTechniques(const SceneView& scene, const Rays& rays, const PathOptions& options)
      : scene_(scene),
        rays_(rays),
        options_(options),
        lamps_(options.sources != PathOptions::Sources::glow),
        aims_(lamps_ && hasLightsToAimAt(scene)),
        flightLight_(scene, rays, lamps_ ? options.tabled : View<TabledLamp>{}) {}

  /// What technique B needs of [t0, t1] of a ray, if it is used there.
  VIRGA_HD EquiangularSegment equiangularSegment(const Path& path, const MediaRay& r, float t0, float t1) const {
    const bool largeLights = lamps_ && path.depth < options_.equiangularDepth;
    if (r.media.count() != 1 || !(largeLights || aims_)) return {};
    const int index = r.media.medium(0);
    const MediumView& medium = scene_.media[index];
    if (!medium.homogeneous || !(medium.sigmaT > 0)) return {};
    const Rgb choice = path.throughput / (path.throughput.r + path.throughput.g + path.throughput.b);
    const Vec3 lampsFor = path.lamp.drawn() ? path.lamp.lampsFor : r.ray.o;
    return {index, largeLights, r.ray, lampsFor, t0, t1, medium.sigmaT, medium.grey, medium.spectrum, choice};
  }

  /// Of the surroundings, where the path has left the scene.
  VIRGA_HD void addEnvironment(Path& path) const {
    if (scene_.environment < 0 || !lamps_) return;
    const EmitterView& emitter = scene_.emitters[scene_.environment];
    const Vec3 w = path.at.ray.d;
    const auto connection = [&] {
      return emitterProbability(scene_, path.last.lampsFor, scene_.environment) * environmentPdf(emitter, w);
    };
    path.addMet(environmentRadiance(emitter, w) * (path.last.connected ? weight(path.last.pdf, connection()) : 1));
  }

  /// Of the lamp, if it is one, that the path has met.
  VIRGA_HD void addAreaLight(Path& path, const SurfacePoint& point, const RayHit& hit) const {
    const ShapeView& shape = scene_.surfaces[point.shape];
    if (shape.emitter < 0 || !lamps_) return;
    const EmitterView& emitter = scene_.emitters[shape.emitter];
    if (dot(point.geometricNormal, path.at.ray.d) >= 0) return;
    float w = 1;
    const EyePath::LastVertex& last = path.last;
    if (last.connected) {
      const float seen = areaLightPdf(shape, emitter, last.p, point.p, point.geometricNormal);
      const float connection = emitterProbability(scene_, last.lampsFor, shape.emitter) * seen;
      if (last.segment.aimsAt(emitter)) {
        const float flight = last.segment.freeFlightPdf(last.t);
        const float perArea = uniformPointPdf(emitter, last.p, point.p, point.geometricNormal);
        const float equiangular = aimPdf(last.segment, shape.emitter, point.p, last.t, seen, perArea);
        w = weight(flight * last.pdf, last.segment.replacesFlights(emitter) ? 0 : flight * connection, equiangular);
      } else {
        w = weight(last.pdf, connection);
      }
    }
    path.addMet(emitter.radianceAt(lightUv(shape, emitter, point.p, hit.primitive, {hit.u, hit.v})) * w);
  }

  /// The number that chooses a light before a flight, if a flight may gather its light; else below 0.
  VIRGA_HD float numberForFlight(Path& path, Sampler& sampler) const {
    path.ahead = {};
    return flightLight_.any() && hasLights() ? path.one(sampler) : -1;
  }
  /// Before a flight to a vertex in a medium, which has [t0, t1] to itself: the light that is looked for there is
  /// chosen now. (Two choices, one for flights and one at vertices, would leave more noise.)
  VIRGA_HD Gathered beginFlight(Path& path, float number, float t0, float t1) const {
    if (number < 0) return {};
    const Vec3 middle = path.at.ray.at(t1 < kInfinity ? 0.5f * (t0 + t1) : t0);
    path.ahead = {virga::chooseEmitter(scene_, middle, number), middle};
    return flightLight_.begin(path.ahead.light, path.throughput);
  }
  VIRGA_HD const FlightLight<Rays>& flightLight() const { return flightLight_; }
  /// Light that a free flight has gathered on its way to a vertex in a medium.
  VIRGA_HD void addGathered(Path& path, const Gathered& gathered) const {
    LayerPath layers = path.layers;
    layers.scatter(VertexKind::medium);
    path.add(layers, gathered.light);
  }

  /// Technique B: a vertex on the segment by its angle about a point on a light, connected to that point.
  VIRGA_HD void connectEquiangular(Path& path, const EquiangularSegment& segment, const MediaState& media,
                                   Sampler& sampler) const {
    if (!hasLights() || (!path.lightsX1 && !path.layers.hasX1())) return;
    const LampGuide lamp = path.lamp.drawn() ? path.lamp : drawLamp(path, segment.lampsFor, sampler);
    const EmitterView& emitter = scene_.emitters[lamp.emitter];
    const float uDistance = path.one(sampler);
    if (!segment.aimsAt(emitter)) return;
    const bool atMiddle = aimsAtMiddle(emitter);
    const EquiangularSegment::Sample distance = segment.sample(atMiddle ? middleOf(emitter) : lamp.on.p, uDistance);
    if (!(distance.pdf > 0)) return;
    const Vec3 x = segment.ray.at(distance.t), wo = -segment.ray.d;
    const LightSample light = atMiddle ? sampleLight(scene_, emitter, x, lamp.place) : towardPoint(emitter, x, lamp.on);
    const float share = path.clampedShare(x, Vec3(0));
    if (!(light.pdf > 0) || !(share > 0) || isBlack(light.radiance)) return;

    const MediumView& medium = scene_.media[segment.medium];
    const PhaseFunction phase = medium.phaseAt(x);
    const float flight = segment.freeFlightPdf(distance.t);
    const float own = lamp.choice * distance.pdf * light.pdf;
    const float connected = segment.replacesFlights(emitter) ? 0 : flight * emitterProbability(scene_, x, lamp.emitter);
    float w = 1;
    if (light.delta) {
      w = weight(own, connected);
    } else {
      const ShapeView& shape = scene_.surfaces[emitter.shape];
      const auto connection = [&] {
        return atMiddle ? light.pdf : areaLightPdf(shape, emitter, x, lamp.on.p, lamp.on.normal);
      };
      w = weight(own, connected > 0 ? connected * connection() : 0, flight * phase.pdf(wo, light.wi));
    }
    LayerPath layers = path.layers;
    layers.scatter(VertexKind::medium);
    const Rgb seen = visibility({{x, light.wi}, media, 0}, x, light, layers, sampler);
    // sigma_s tau = albedo * sigma_t tau
    const Rgb scattered = medium.albedoAt(x) * segment.flight(distance.t) * light.radiance;
    path.add(layers, scattered * seen * (phase.value(wo, light.wi) * w * share / own));
  }

  /// Technique A at a medium vertex.
  VIRGA_HD void connectMedium(Path& path, const PhaseFunction& phase, const MediaState& media, Vec3 x, Vec3 wo,
                              Sampler& sampler) const {
    if (!connectsHere(path)) return;
    const EmitterChoice choice = path.ahead.light.drawn() ? path.ahead.light : chooseEmitter(path, x, sampler);
    if (flightLight_.has(choice.emitter)) return;
    const Connection c = sampleConnection(path, x, choice, sampler);
    if (!(c.light.pdf > 0) || isBlack(c.light.radiance)) return;
    const float own = c.choice * c.light.pdf;
    const float phasePdf = c.light.delta ? 0 : phase.pdf(wo, c.light.wi);
    float w = weight(own, phasePdf);
    const EquiangularSegment& segment = path.last.segment;
    const EmitterView& emitter = scene_.emitters[c.emitter];
    if (segment.aimsAt(emitter)) {
      const Vec3 y = x + c.light.wi * c.light.distance;
      const float flight = segment.freeFlightPdf(path.last.t);
      const float equiangular = aimPdf(segment, c.emitter, y, path.last.t, c.light.pdf, c.light.uniformPdf);
      w = weight(flight * own, flight * phasePdf, equiangular);
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
    const Connection c = sampleConnection(path, point.p, chooseEmitter(path, point.p, sampler), sampler);
    if (!(c.light.pdf > 0) || isBlack(c.light.radiance)) return;
    const Vec3 wi = side.frame.toLocal(c.light.wi);
    const Rgb value = side.leaks(c.light.wi, wi) ? Rgb() : side.bsdf->value(side.wo, wi);
    if (isBlack(value)) return;
    const float own = c.choice * c.light.pdf;
    const float w = weight(own, c.light.delta ? 0 : side.bsdf->pdf(side.wo, wi));
    const MediaRay leaving = leaveSurface(scene_, point, -path.at.ray.d, c.light.wi, media);
    LayerPath layers = path.layers;
    const Rgb seen = visibility(leaving, point.p, c.light, layers, sampler);
    path.add(layers, value * c.light.radiance * seen * (std::fabs(wi.z) * w / own));
  }

  /// For a ray that leaves x into these media: it is guided where the lamp lies in the same fog, and not too deep.
  VIRGA_HD LampGuide guideFrom(const Path& path, const MediaState& media, Vec3 x, Sampler& sampler) const {
    if (!aims_ || media.count() != 1 || !hasLights()) return {};
    LampGuide lamp = drawLamp(path, x, sampler);
    const EmitterView& emitter = scene_.emitters[lamp.emitter];
    const MediumView& fog = scene_.media[media.medium(0)];
    if (!emitter.isLocal() || emitter.medium != media.medium(0) || !fog.homogeneous) return lamp;
    const Vec3 toLamp = lamp.on.p - x;
    const float d = length(toLamp);
    if (d > 0 && fog.sigmaT * d < EquiangularSegment::kThin) lamp.axis = toLamp / d;
    return lamp;
  }

 private:
  /// Power heuristic (exponent 2) of a technique against up to two others.
  VIRGA_HD static float weight(float own, float other, float third = 0) {
    return own > 0 ? 1 / (1 + square(other / own) + square(third / own)) : 0;
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

  /// Technique B at a sphere: an equiangular distance about its middle, then a point as seen from there; points that
  /// are chosen before lie on the far side half of the time.
  VIRGA_HD bool aimsAtMiddle(const EmitterView& emitter) const {
    if (emitter.kind != EmitterView::Kind::area) return false;
    const ShapeView& shape = scene_.surfaces[emitter.shape];
    return shape.kind == ShapeView::Kind::sphere && shape.orientation > 0;
  }
  VIRGA_HD Vec3 middleOf(const EmitterView& emitter) const { return scene_.surfaces[emitter.shape].center; }
  /// Density with which technique B finds the vertex at t and from there the point `on` of an emitter [1/(sr unit)].
  /// What is seen from there is chosen with the density `seen`, any point with `any` [1/sr].
  VIRGA_HD float aimPdf(const EquiangularSegment& segment, int index, Vec3 on, float t, float seen, float any) const {
    const EmitterView& emitter = scene_.emitters[index];
    const float choice = emitterProbability(scene_, segment.lampsFor, index);
    return choice * (aimsAtMiddle(emitter) ? seen * segment.pdf(middleOf(emitter), t) : any * segment.pdf(on, t));
  }

  VIRGA_HD bool hasLights() const { return lamps_ && scene_.hasLamps(); }
  /// At a vertex that is in the path's layers already.
  VIRGA_HD bool connectsHere(const Path& path) const { return hasLights() && (path.lightsX1 || path.layers.hasX2()); }

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
  VIRGA_HD Connection sampleConnection(const Path& path, Vec3 x, const EmitterChoice& choice, Sampler& sampler) const {
    const EmitterView& emitter = scene_.emitters[choice.emitter];
    if (path.last.segment.replacesFlights(emitter)) return {};
    return {sampleLight(scene_, emitter, x, path.pair(sampler)), choice.emitter, choice.probability};
  }
  VIRGA_HD EmitterChoice chooseEmitter(const Path& path, Vec3 x, Sampler& sampler) const {
    return virga::chooseEmitter(scene_, x, path.one(sampler));
  }

  VIRGA_HD LampGuide drawLamp(const Path& path, Vec3 x, Sampler& sampler) const {
    const EmitterChoice choice = chooseEmitter(path, x, sampler);
    const EmitterView& emitter = scene_.emitters[choice.emitter];
    const Vec2 u = path.pair(sampler);
    LampGuide lamp;
    lamp.emitter = choice.emitter, lamp.choice = choice.probability, lamp.lampsFor = x, lamp.place = u;
    if (emitter.isLocal()) lamp.on = sampleLightPoint(scene_, emitter, u);
    return lamp;
  }

  const SceneView& scene_;
  const Rays& rays_;
  const PathOptions& options_;
  bool lamps_;  ///< does their light count?
  bool aims_;
  FlightLight<Rays> flightLight_;
};

}  // namespace virga
