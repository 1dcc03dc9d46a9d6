// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/rgb.h"
#include "core/vec.h"

namespace virga {

// BSDFs, in the local shading frame: z is the shading normal; wo and wi point away from the surface, wo to the eye.
// Values are without the cosine [1/sr]; whoever integrates multiplies by |wi.z|.

struct BsdfSample {
  Vec3 wi;
  Rgb weight;     ///< value * |wi.z| / pdf; for a specular BSDF the whole reflectance or transmittance of the branch
  float pdf = 0;  ///< [1/sr]; 0: no sample. For a specular BSDF the probability of the branch.
  bool specular = false;  ///< a Dirac delta: no other direction connects
  float eta = 1;          ///< relative index of refraction that the ray passed (for Russian roulette); 1 for reflection
};

}  // namespace virga
