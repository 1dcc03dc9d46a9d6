// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/vec.h"

namespace virga {

/// corner + a edgeX + b edgeY for a, b in [0, 1]; the edges are at a right angle.
struct RectangleView {
  Vec3 corner, edgeX, edgeY;
  Vec3 normal;                ///< unit: of edgeX x edgeY
  Vec2 uvX{1, 0}, uvY{0, 1};  ///< what the edges add to the texture coordinates

  VIRGA_HD Vec2 uvAt(Vec3 p) const {
    const Vec3 d = p - corner;
    return uvX * (dot(d, edgeX) / lengthSquared(edgeX)) + uvY * (dot(d, edgeY) / lengthSquared(edgeY));
  }
};

/// A rectangle as it is seen from a point: sampled uniformly in solid angle (Urena, Fajardo and King 2013).
class SphericalRectangle {
 public:
  /// Below this solid angle [sr], sampling by area is as good, and float begins to lose the excess of the angles' sum.
  static constexpr float kSmallest = 0.05f;

  VIRGA_HD SphericalRectangle(const RectangleView& r, Vec3 from) : origin_(from) {
    const float lengthX = length(r.edgeX), lengthY = length(r.edgeY);
    x_ = r.edgeX / lengthX, y_ = r.edgeY / lengthY, z_ = cross(x_, y_);
    const Vec3 d = r.corner - from;
    x0_ = dot(d, x_), y0_ = dot(d, y_), z0_ = dot(d, z_);
    if (z0_ > 0) z_ = -z_, z0_ = -z0_;
    x1_ = x0_ + lengthX, y1_ = y0_ + lengthY;
    const float nearX = std::fmax(0.f, std::fmax(x0_, -x1_)), nearY = std::fmax(0.f, std::fmax(y0_, -y1_));
    const float nearest2 = nearX * nearX + nearY * nearY + z0_ * z0_;
    if (lengthX * lengthY * -z0_ < 0.9f * kSmallest * nearest2 * std::sqrt(nearest2)) return;  // not usable
    // z components of the unit normals of the planes through the point and an edge.
    const float below = -y0_ / std::sqrt(z0_ * z0_ + y0_ * y0_), right = x1_ / std::sqrt(z0_ * z0_ + x1_ * x1_);
    const float above = y1_ / std::sqrt(z0_ * z0_ + y1_ * y1_), left = -x0_ / std::sqrt(z0_ * z0_ + x0_ * x0_);
    const float g2 = angle(-above * left), g3 = angle(-left * below);
    below_ = below, above_ = above;
    shift_ = kTwoPi - g2 - g3;
    solidAngle_ = angle(-below * right) + angle(-right * above) - shift_;
  }

  /// [sr]; not to be trusted below kSmallest, and not a number in the rectangle's plane.
  VIRGA_HD float solidAngle() const { return solidAngle_; }
  VIRGA_HD bool usable() const { return solidAngle_ > kSmallest; }

  /// A point of the rectangle; density 1 / solidAngle() [1/sr] of the direction to it.
  VIRGA_HD Vec3 sample(Vec2 u) const {
    const float a = u.x * solidAngle_ + shift_;
    const float f = (std::cos(a) * below_ - above_) / std::sin(a);
    const float c = clamp(std::copysign(1 / std::sqrt(f * f + below_ * below_), f), -1, 1);
    const float x = clamp(-c * z0_ / std::sqrt(std::max(1e-12f, 1 - c * c)), x0_, x1_);
    const float d = std::sqrt(x * x + z0_ * z0_);
    const float h0 = y0_ / std::sqrt(d * d + y0_ * y0_), h1 = y1_ / std::sqrt(d * d + y1_ * y1_);
    const float h = lerp(h0, h1, u.y), h2 = h * h;
    const float y = h2 < 1 - 1e-6f ? h * d / std::sqrt(1 - h2) : (h > 0 ? y1_ : y0_);
    return origin_ + x_ * x + y_ * clamp(y, y0_, y1_) + z_ * z0_;
  }

 private:
  VIRGA_HD static float angle(float cosine) { return std::acos(clamp(cosine, -1, 1)); }

  Vec3 origin_, x_, y_, z_;
  float x0_, x1_, y0_, y1_, z0_;
  float below_ = 0, above_ = 0, shift_ = 0, solidAngle_ = 0;
};

}  // namespace virga
