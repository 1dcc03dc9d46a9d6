// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "transport/media_walk.h"

namespace virga {

/// The side of a surface that light arrives on or leaves from.
struct Side {
  const Bsdf* bsdf = nullptr;
  Frame frame{Vec3(0, 0, 1)};  ///< around the shading normal; turned over for the back of a two-sided bsdf
  Vec3 wo;                     ///< local
  Vec3 normal;                 ///< geometric, on the frame's side

  /// Shading and true normal disagree about which side a direction is on: light would leak through the surface.
  /// Mirrors and glass go by the shading normal alone, or their outlines would be dark.
  VIRGA_HD bool leaks(Vec3 world, Vec3 local) const { return !bsdf->specular() && dot(world, normal) * local.z <= 0; }
};

/// `textured` holds the bsdf, where textures say what its colours are here.
VIRGA_HD inline Side sideOf(const SceneView& scene, const SurfacePoint& point, const RayHit& hit, Vec3 wo,
                            Bsdf& textured) {
  const ShapeView& shape = scene.surfaces[point.shape];
  const SurfaceBsdf& surface = scene.bsdfs[shape.bsdf];
  const bool back = surface.twoSided && dot(wo, point.geometricNormal) < 0;
  const Vec3 n = back ? -point.shadingNormal : point.shadingNormal;
  Frame frame(n);
  const Bsdf* bsdf = back ? &surface.back : &surface.front;
  if (surface.anisotropic) frame = Frame(n, surfaceTangent(shape, point.p, hit.primitive));
  if (surface.textured) {
    const Vec2 uv = surfaceUv(shape, point.p, hit.primitive, {hit.u, hit.v});
    textured = bsdfAt(scene, *bsdf, back ? surface.backTextures : surface.frontTextures, uv);
    bsdf = &textured;
  }
  return {bsdf, frame, frame.toLocal(wo), back ? -point.geometricNormal : point.geometricNormal};
}

/// The ray toward wi off a surface that was reached from wo: if it passes, the media of the other side are around it.
VIRGA_HD inline MediaRay leaveSurface(const SceneView& scene, const SurfacePoint& point, Vec3 wo, Vec3 wi,
                                      const MediaState& media) {
  MediaRay leaving = leaveSurface(point, wi, media);
  const MediumTransition& transition = scene.surfaces[point.shape].media;
  const float side = dot(wi, point.geometricNormal);
  if (transition.replaces && side * dot(wo, point.geometricNormal) < 0)
    leaving.media.pass(transition, side < 0 ? Passing::inward : Passing::outward);
  return leaving;
}

/// A point where light scatters other than in a perfect mirror or window, remembered so that it can be connected to.
class Vertex {
 public:
  enum class Kind : uint8_t { none, surface, medium };

  Kind kind = Kind::none;
  Vec3 p;            ///< world
  Vec3 wo;           ///< unit, toward the vertex that the path came from
  MediaState media;  ///< around p, on wo's side of a surface
  int medium = -1;   ///< in which the light scatters; -1 on surfaces

  VIRGA_HD static Vertex inMedium(const SceneView& scene, int medium, Vec3 p, Vec3 wo, const MediaState& media) {
    Vertex v;
    v.kind = Kind::medium, v.p = p, v.wo = wo, v.media = media, v.medium = medium;
    v.phase_ = scene.media[medium].phaseAt(p);
    v.albedo_ = scene.media[medium].albedoAt(p);
    return v;
  }
  VIRGA_HD static Vertex onSurface(const SurfacePoint& point, const Side& side, Vec3 wo, const MediaState& media) {
    Vertex v;
    v.kind = Kind::surface, v.p = point.p, v.wo = wo, v.media = media;
    v.point_ = point;
    v.bsdf_ = *side.bsdf, v.frame_ = side.frame, v.normal_ = side.normal;
    return v;
  }

  /// What light from wi adds toward `to`: albedo times phase function, or bsdf times |cosine of wi|; with the density
  /// [1/sr] with which a path that arrives from `to` goes on to wi.
  struct Scattering {
    Rgb value;
    float pdf = 0;  ///< 0 where the value is black: such a path would have ended
  };
  VIRGA_HD Scattering scattering(Vec3 to, Vec3 wi) const {
    if (kind == Kind::medium) return {albedo_ * phase_.value(to, wi), isBlack(albedo_) ? 0 : phase_.pdf(to, wi)};
    const Vec3 localTo = frame_.toLocal(to), local = frame_.toLocal(wi);
    const bool leaks = dot(to, normal_) * localTo.z <= 0 || dot(wi, normal_) * local.z <= 0;
    // From the other side of the surface it is another vertex, if it is two-sided.
    if (leaks || dot(to, normal_) * dot(wo, normal_) <= 0) return {};
    const Rgb value = bsdf_.value(localTo, local) * std::fabs(local.z);
    return {value, isBlack(value) ? 0 : bsdf_.pdf(localTo, local)};
  }
  /// |cosine| of w to the surface; 1 in a medium.
  VIRGA_HD float cosine(Vec3 w) const { return kind == Kind::surface ? std::fabs(dot(w, point_.geometricNormal)) : 1; }

  /// The ray from here toward wi.
  VIRGA_HD MediaRay leave(const SceneView& scene, Vec3 wi) const {
    if (kind == Kind::medium) return {{p, wi}, media, 0};
    return leaveSurface(scene, point_, wo, wi, media);
  }

 private:
  PhaseFunction phase_{Isotropic{}};
  Rgb albedo_;
  SurfacePoint point_;
  Bsdf bsdf_;
  Frame frame_{Vec3(0, 0, 1)};
  Vec3 normal_;
};

}  // namespace virga
