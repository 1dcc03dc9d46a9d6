// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "methods/instant_scattering/eye_kernels.h"
#include "methods/instant_scattering/eye_march.h"

namespace virga {

/// Neighbouring rays, of eyes above all, that pass one stretch of the same smoke: a dense grid whose phase function and
/// albedo are the same everywhere. They are marched side by side, with the same steps as by marchMedia().
class EyePacket {
 public:
  static constexpr int kSize = KernelEyes::kSize;

  void clear();
  /// Takes the stretch from t0 to t1 of ray number `lane`; false if its media are not of this kind, or others than
  /// those that are there.
  bool add(const SceneView& scene, size_t lane, const Ray& ray, const MediaState& media, float t0, float t1, int steps,
           float shift);
  void remove(size_t lane);
  /// Of all that have been added.
  void march();

  bool empty() const { return taken_ == 0; }
  bool has(size_t lane) const { return (taken_ >> lane & 1u) != 0; }
  const MediumView& medium() const { return *medium_; }

  /// Once they are marched; lanes that were not added have none.
  const KernelEyes& eyes() const { return eyes_; }
  const KernelDepths& depths() const { return depths_; }
  Rgb depth(size_t lane) const { return medium_->spectrum * depths_.total[lane]; }
  /// Optical depths of the densest channel at distances along a ray, which was not shifted.
  void depthsAt(size_t lane, std::span<const float> distances, float* out) const;
  float meanPlace(size_t lane) const { return depths_.meanPlace[lane]; }

 private:
  KernelEyes eyes_;
  KernelDepths depths_;
  const MediumView* medium_ = nullptr;
  uint32_t taken_ = 0;  ///< a bit for each lane
};

}  // namespace virga
