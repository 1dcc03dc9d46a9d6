// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/distribution.h"
#include "core/rgb.h"
#include "core/transform.h"
#include "core/warp.h"
#include "scene/shape.h"
#include "scene/spherical_rectangle.h"
#include "scene/texture.h"

namespace virga {

/// A latitude-longitude picture around the scene: u = 0 at -z of its own frame, 0.25 at +x; v from +y down. As in
/// Mitsuba 3 the first and the last row of pixels are the poles, whereas the columns' centres lie at (i + 0.5) / width.
struct EnvironmentView {
  const Rgb* pixels = nullptr;
  int width = 0, height = 0;
  DiscreteView rows;               ///< marginal, over pixel rows
  const float* columns = nullptr;  ///< conditional cumulative tables, width + 1 values a row
  Affine toWorld, toLocal;         ///< rotations
  float scale = 1;

  /// Radiance from direction w (away from the scene) [W/(m^2 sr)], bilinear between pixels.
  VIRGA_HD Rgb radiance(Vec3 w) const {
    const Vec2 uv = toUv(toLocal.vector(w));
    const float x = uv.x * static_cast<float>(width) - 0.5f;
    const float y = uv.y * static_cast<float>(height - 1);
    const float fx = x - std::floor(x), fy = y - std::floor(y);
    const int x0 = (static_cast<int>(std::floor(x)) + width) % width, x1 = (x0 + 1) % width;
    const int y0 = static_cast<int>(y), y1 = y0 + 1 < height ? y0 + 1 : y0;
    const auto at = [&](int i, int j) {
      return pixels[static_cast<size_t>(j) * static_cast<size_t>(width) + static_cast<size_t>(i)];
    };
    const Rgb top = at(x0, y0) * (1 - fx) + at(x1, y0) * fx, bottom = at(x0, y1) * (1 - fx) + at(x1, y1) * fx;
    return (top * (1 - fy) + bottom * fy) * scale;
  }
  struct Sample {
    Vec3 w;
    float pdf;  ///< [1/sr]
  };
  VIRGA_HD Sample sample(Vec2 u) const {
    const auto row = rows.sample(u.y);
    const auto column = rowTable(row.index).sample(u.x);
    const float v = (static_cast<float>(row.index) + row.remapped) / static_cast<float>(height);
    const float phi = kTwoPi * ((static_cast<float>(column.index) + column.remapped) / static_cast<float>(width));
    const float sinTheta = std::sin(kPi * v);
    const Vec3 local(std::sin(phi) * sinTheta, std::cos(kPi * v), -std::cos(phi) * sinTheta);
    return {toWorld.vector(local), solidAngleDensity(row.probability * column.probability, sinTheta)};
  }
  VIRGA_HD float pdf(Vec3 w) const {
    const Vec3 local = toLocal.vector(w);
    const Vec2 uv = toUv(local);
    const int i = clampIndex(uv.x, width), j = clampIndex(uv.y, height);
    const float sinTheta = std::sqrt(std::max(0.f, local.x * local.x + local.z * local.z));
    return solidAngleDensity(rows.probability(j) * rowTable(j).probability(i), sinTheta);
  }

 private:
  VIRGA_HD static Vec2 toUv(Vec3 local) {
    const float u = std::atan2(local.x, -local.z) * (0.5f * kInvPi);
    return {u < 0 ? u + 1 : u, std::acos(clamp(local.y, -1, 1)) * kInvPi};
  }
  VIRGA_HD static int clampIndex(float unit, int count) {
    const int i = static_cast<int>(unit * static_cast<float>(count));
    return i < 0 ? 0 : (i >= count ? count - 1 : i);
  }
  VIRGA_HD DiscreteView rowTable(int row) const {
    return {columns + static_cast<size_t>(row) * static_cast<size_t>(width + 1), width};
  }
  VIRGA_HD float solidAngleDensity(float pixelProbability, float sinTheta) const {
    return sinTheta > 0
               ? pixelProbability * static_cast<float>(width) * static_cast<float>(height) / (2 * kPi * kPi * sinTheta)
               : 0;
  }
};

/// A light, in world coordinates.
struct EmitterView {
  enum class Kind : uint8_t { point, spot, directional, area, constant, environment };

  Kind kind = Kind::point;
  Rgb value;  ///< intensity [W/sr], irradiance across the beam [W/m^2] or radiance [W/(m^2 sr)]; its mean, if textured
  Vec3 position;                         ///< point, spot
  Vec3 direction;                        ///< spot, directional: unit, in which the light travels
  float cutoffAngle = 0, beamWidth = 0;  ///< spot [rad]
  int shape = -1;                        ///< area: index of its surface
  float area = 0;                        ///< area [unit^2]
  TextureView texture;                   ///< area: radiance over the surface, in place of `value`
  bool isRectangle = false;              ///< area: a rectangle...
  RectangleView rectangle;               ///< ...this one
  EnvironmentView environment;
  int medium = -1;  ///< index of the one medium that a light at a finite distance lies in; -1: none, or several

  VIRGA_HD bool infinite() const {
    return kind == Kind::directional || kind == Kind::constant || kind == Kind::environment;
  }
  /// Can only be met by sampling it: no ray hits it by chance.
  VIRGA_HD bool isDelta() const { return kind == Kind::point || kind == Kind::spot || kind == Kind::directional; }
  /// Has positions at a finite distance to aim at (equiangular sampling).
  VIRGA_HD bool isLocal() const { return !infinite(); }

  /// Radiance of an area light where its surface has these texture coordinates.
  VIRGA_HD Rgb radianceAt(Vec2 uv) const { return texture.present() ? texture.lookup(uv) : value; }

  /// Radiant intensity toward unit direction w of a point or spot light [W/sr]. Spot: full within the beam width,
  /// linear in the angle down to 0 at the cutoff.
  VIRGA_HD Rgb intensity(Vec3 w) const {
    if (kind == Kind::point) return value;
    const float angle = std::acos(clamp(dot(direction, w), -1, 1));
    if (angle >= cutoffAngle) return {};
    return angle <= beamWidth ? value : value * ((cutoffAngle - angle) / (cutoffAngle - beamWidth));
  }
};

/// An emitter from afar: how much light it sends where nothing is in its way, to within a small factor.
struct LampStrength {
  float strength = 0;  ///< irradiance of lights at infinity, else radiant intensity; relative to the scene's strongest
  bool infinite = false;  ///< the rest does not matter
  bool sky = false;       ///< from all around
  Vec3 center;
  float radius = 0;   ///< of a ball around it [unit]
  Vec3 axis;          ///< unit: it shines to this side, or around it...
  float least = -1;   ///< ...where the cosine is above this; -1: everywhere
  bool flat = false;  ///< by the cosine

  VIRGA_HD float lightAt(Vec3 p) const {
    if (infinite) return strength;
    constexpr float kAside = 0.1f;  // p may stand for places around it
    const Vec3 way = p - center;
    constexpr float kNear = 1e-15f;  // [unit] no sum of lamps overflows
    const float d = std::fmax(length(way), std::fmax(radius, kNear));
    const float cosine = dot(axis, way) / d;
    const float toward = flat ? clamp(cosine + radius / d, kAside, 1) : (cosine > least ? 1 : kAside);
    return strength * toward / (d * d);
  }
};

/// A point on (or direction to) an emitter, as seen from a receiver.
struct LightSample {
  Vec3 wi;             ///< unit, from the receiver to the light
  float distance = 0;  ///< [unit]; infinite for lights at infinity
  Rgb radiance;        ///< toward the receiver; for delta lights the incident irradiance [W/m^2] across wi
  float pdf = 0;       ///< [1/sr] of wi; 1 for delta lights; 0: no sample
  bool delta = false;
  float uniformPdf =
      0;  ///< [1/sr] that wi would have, were the point chosen uniformly on the light; 1 for point-like lights
};

/// A point on an emitter, chosen without regard to any receiver.
struct LightPoint {
  Vec3 p;
  Vec3 normal;        ///< of an area light
  float areaPdf = 0;  ///< [1/unit^2]; 1 for point-like lights; 0: no sample
  bool pointLike = false;
  Vec2 uv{};  ///< on a textured area light
};

/// Texture coordinates of a point on a light; of no interest where it is of one colour.
VIRGA_HD inline Vec2 lightUv(const ShapeView& shape, const EmitterView& emitter, Vec3 p, uint32_t primitive = 0,
                             Vec2 barycentric = {}) {
  return emitter.texture.present() ? surfaceUv(shape, p, primitive, barycentric) : Vec2();
}

VIRGA_HD inline LightPoint uniformPointOnShape(const ShapeView& shape, const EmitterView& emitter, Vec2 u) {
  if (emitter.isRectangle) {
    const RectangleView& r = emitter.rectangle;
    const Vec3 p = r.corner + r.edgeX * u.x + r.edgeY * u.y;
    return {p, r.normal * shape.orientation, 1 / emitter.area, false, r.uvX * u.x + r.uvY * u.y};
  }
  const ShapePoint s = uniformPointOnShape(shape, u);
  return {s.p, s.normal, 1 / emitter.area, false, lightUv(shape, emitter, s.p, s.primitive, s.barycentric)};
}

/// 1 - cos of the half angle under which a sphere is seen from distance d > radius, without cancellation.
VIRGA_HD inline float coneHeight(float radius, float d) {
  const float s2 = square(radius / d);
  return s2 / (1 + std::sqrt(std::max(0.f, 1 - s2)));
}

/// A sphere light is sampled by the cone that it fills, as seen from outside at distance d of its centre.
VIRGA_HD inline bool seenAsCone(const ShapeView& sphere, float d) {
  return d > sphere.radius && sphere.orientation > 0;
}

/// Density [1/sr, seen from x] of a point that is chosen uniformly on an area light.
VIRGA_HD inline float uniformPointPdf(const EmitterView& emitter, Vec3 x, Vec3 on, Vec3 normal) {
  const Vec3 toLight = on - x;
  const float d2 = lengthSquared(toLight);
  const float cosLight = std::fabs(dot(normal, toLight)) / std::sqrt(d2);
  return cosLight > 0 ? d2 / (cosLight * emitter.area) : 0;
}

/// Density [1/sr] with which sampleLight picks the point `on` of an area emitter, seen from x; the point is known to
/// face x.
VIRGA_HD inline float areaLightPdf(const ShapeView& shape, const EmitterView& emitter, Vec3 x, Vec3 on, Vec3 normal) {
  if (shape.kind == ShapeView::Kind::sphere) {
    const float d = distance(x, shape.center);
    if (seenAsCone(shape, d)) return 1 / (kTwoPi * coneHeight(shape.radius, d));
  }
  if (emitter.isRectangle) {
    const SphericalRectangle seen(emitter.rectangle, x);
    if (seen.usable()) return 1 / seen.solidAngle();
  }
  return uniformPointPdf(emitter, x, on, normal);
}

/// Light of a point on an area emitter toward x; invalid (pdf 0) from behind.
VIRGA_HD inline LightSample towardPoint(const EmitterView& emitter, Vec3 x, const LightPoint& on) {
  const Vec3 toLight = on.p - x;
  const float d2 = lengthSquared(toLight);
  if (!(d2 > 0)) return {};
  const float d = std::sqrt(d2);
  const Vec3 wi = toLight / d;
  if (on.pointLike) return {wi, d, emitter.intensity(-wi) / d2, 1, true, 1};
  const float cosLight = -dot(on.normal, wi);
  if (cosLight <= 0) return {};
  const float pdf = on.areaPdf * d2 / cosLight;
  return {wi, d, emitter.radianceAt(on.uv), pdf, false, pdf};
}

VIRGA_HD inline LightSample sampleRectangleLight(const ShapeView& shape, const EmitterView& emitter, Vec3 x, Vec2 u) {
  const SphericalRectangle seen(emitter.rectangle, x);
  if (!seen.usable()) return towardPoint(emitter, x, uniformPointOnShape(shape, emitter, u));
  const Vec3 on = seen.sample(u), normal = emitter.rectangle.normal * shape.orientation;
  LightSample s = towardPoint(emitter, x, {on, normal, 1 / emitter.area, false, emitter.rectangle.uvAt(on)});
  if (s.pdf > 0) s.pdf = 1 / seen.solidAngle();
  return s;
}

VIRGA_HD inline LightSample sampleSphereLight(const ShapeView& shape, const EmitterView& emitter, Vec3 x, Vec2 u) {
  const Vec3 toCenter = shape.center - x;
  const float d = length(toCenter);
  if (!seenAsCone(shape, d)) return towardPoint(emitter, x, uniformPointOnShape(shape, emitter, u));
  const float height = coneHeight(shape.radius, d);
  const Vec3 local = uniformCone(u, height);
  // By the triangle of receiver, centre and hit: the ray passes the centre at d sin(theta), and half the chord is r
  // times the cosine at the light. From afar the hit point's own coordinates would not tell.
  const float miss2 = d * d * (local.x * local.x + local.y * local.y);
  const float half = std::sqrt(std::fmax(0.f, shape.radius * shape.radius - miss2));
  const float t = std::fmax(0.f, d * local.z - half);
  const float uniform = half > 0 ? t * t * shape.radius / (half * emitter.area) : 0;
  const Vec3 wi = Frame(toCenter / d).toWorld(local);
  const Rgb radiance = emitter.radianceAt(lightUv(shape, emitter, x + wi * t));
  return {wi, t, radiance, 1 / (kTwoPi * height), false, uniform};
}

}  // namespace virga
