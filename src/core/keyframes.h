// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "core/transform.h"

namespace virga {

/// A pose that holds at one time.
struct Keyframe {
  double time = 0;  ///< [frames]
  Matrix4 pose;     ///< affine and regular
};

/// The pose at any time, between the two keyframes around it: translation and stretch linearly, rotation along the
/// shorter great circle at constant speed (Shoemake and Duff 1992: polar decomposition; Shoemake 1985: slerp). Before
/// the first keyframe and after the last one the pose stands still. At a keyframe, and between equal ones, it is that
/// pose bit for bit. At least one keyframe; times increase.
Matrix4 poseAt(std::span<const Keyframe> keyframes, double time);

}  // namespace virga
