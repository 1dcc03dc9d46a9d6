// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "transport/layer_path.h"
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

/// Geometric normal on the side of w.
VIRGA_HD inline Vec3 facing(const SurfacePoint& point, Vec3 w) {
  return dot(point.geometricNormal, w) > 0 ? point.geometricNormal : -point.geometricNormal;
}

/// |cosine| of w to a surface; 1 in a medium, whose normal is 0.
VIRGA_HD inline float generalCosine(Vec3 normal, Vec3 w) {
  return normal.x == 0 && normal.y == 0 && normal.z == 0 ? 1 : std::fabs(dot(normal, w));
}
/// Generalised geometry term D_x D_y / |x - y|^2 [1/unit^2], visibility and transmittance left out
/// (docs/architecture.md).
VIRGA_HD inline float geometryTerm(Vec3 x, Vec3 normalX, Vec3 y, Vec3 normalY) {
  const Vec3 way = y - x;
  const float d2 = lengthSquared(way);
  if (!(d2 > 0)) return kInfinity;
  const Vec3 w = way / std::sqrt(d2);
  return generalCosine(normalX, w) * generalCosine(normalY, w) / d2;
}

/// The part of a geometry term that min(g, bound) takes away: max(0, g - bound) / g.
VIRGA_HD inline float clampedShareOf(float g, float bound) { return g > bound ? 1 - bound / g : 0; }

/// A surface at one point, reached on one of its sides, kept for directions that come later.
struct SurfaceScattering {
  Bsdf bsdf;
  Frame frame{Vec3(0, 0, 1)};
  Vec3 normal;  ///< as in Side

  SurfaceScattering() = default;
  VIRGA_HD explicit SurfaceScattering(const Side& side) : bsdf(*side.bsdf), frame(side.frame), normal(side.normal) {}

  /// What light from wi adds toward `to`: bsdf times |cosine of wi| [1/sr].
  VIRGA_HD Rgb scattering(Vec3 to, Vec3 wi) const {
    const Vec3 localTo = frame.toLocal(to), local = frame.toLocal(wi);
    if (dot(to, normal) * localTo.z <= 0 || dot(wi, normal) * local.z <= 0) return {};  // it would leak: Side::leaks()
    return bsdf.value(localTo, local) * std::fabs(local.z);
  }
};

/// A point where light scatters other than in a perfect mirror or window, as a path from the eye comes to it.
struct Vertex {
  VertexKind kind = VertexKind::none;
  Vec3 p;            ///< world
  Vec3 wo;           ///< unit, toward where the path came from
  MediaState media;  ///< around p, on wo's side of a surface
  int medium = -1;   ///< the one that scatters; -1 on surfaces
  PhaseFunction phase{Isotropic{}};
  Rgb albedo;
  SurfacePoint point;  ///< on surfaces
  SurfaceScattering surface;

  VIRGA_HD static Vertex inMedium(const SceneView& scene, int medium, Vec3 p, Vec3 wo, const MediaState& media) {
    Vertex v;
    v.kind = VertexKind::medium, v.p = p, v.wo = wo, v.media = media, v.medium = medium;
    v.phase = scene.media[medium].phaseAt(p), v.albedo = scene.media[medium].albedoAt(p);
    return v;
  }
  VIRGA_HD static Vertex onSurface(const SurfacePoint& point, const Side& side, Vec3 wo, const MediaState& media) {
    Vertex v;
    v.kind = VertexKind::surface, v.p = point.p, v.wo = wo, v.media = media;
    v.point = point, v.surface = SurfaceScattering(side);
    return v;
  }

  /// What light from wi adds toward where the path came from [1/sr].
  VIRGA_HD Rgb scattering(Vec3 wi) const {
    return kind == VertexKind::surface ? surface.scattering(wo, wi) : albedo * phase.value(wo, wi);
  }
  /// Geometric; 0 in a medium.
  VIRGA_HD Vec3 normal() const { return kind == VertexKind::surface ? point.geometricNormal : Vec3(0); }
  struct Direction {
    Vec3 wi;
    Rgb weight;     ///< scattering(wi) over its pdf
    float pdf = 0;  ///< [1/sr]; 0: the path ends here
    float eta = 1;  ///< as in BsdfSample
  };
  /// Chooses where a path goes on.
  VIRGA_HD Direction sample(Vec2 u, float choice) const {
    if (kind == VertexKind::medium) {
      const PhaseSample s = phase.sample(wo, u);
      return {s.wi, albedo * (s.value / s.pdf), isBlack(albedo) ? 0 : s.pdf, 1};
    }
    const BsdfSample s = surface.bsdf.sample(surface.frame.toLocal(wo), u, choice);
    const Vec3 wi = surface.frame.toWorld(s.wi);
    const bool ends = !(s.pdf > 0) || isBlack(s.weight) || dot(wi, surface.normal) * s.wi.z <= 0;
    return {wi, s.weight, ends ? 0 : s.pdf, s.eta};
  }
  /// The ray from here toward wi.
  VIRGA_HD MediaRay leave(const SceneView& scene, Vec3 wi) const {
    if (kind == VertexKind::medium) return {{p, wi}, media, 0};
    return leaveSurface(scene, point, wo, wi, media);
  }
};

}  // namespace virga
