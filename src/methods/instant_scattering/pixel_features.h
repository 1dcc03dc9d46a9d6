// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "methods/instant_scattering/eye_march.h"
#include "scene/scene.h"

namespace virga {

/// What a pixel shows, as far as it says how like another's its multiply scattered light is.
struct PixelFeatures {
  bool regular = false;  ///< false: a mirror or glass is seen, of which nothing can be said
  float depth = 0;       ///< to the surface along the ray [unit]; infinite without one
  Vec3 p, normal;        ///< of the surface, world; the normal toward the eye
  Rgb surface;           ///< its reflectance times the transmittance to it: what light on it is seen through
  Rgb opacity;           ///< 1 - transmittance to the surface, or to the end: likewise for light from the media
  float mediaDepth = 0;  ///< mean distance of the media, by how much of them is seen there [unit]
};

/// Of an eye ray.
PixelFeatures pixelFeatures(const MarchedEye& eye);
/// Of one whose steps were not kept; `mediaDepth` as above.
PixelFeatures pixelFeatures(const MarchedEye& eye, float mediaDepth);
/// Marches the ray through the middle of pixel (x, y). Nothing is random; the steps of neighbours are shifted against
/// each other, so that what they miss does not add up to a pattern.
void marchMiddle(const Scene& scene, int x, int y, int steps, MarchedEye& eye);
/// Of that ray.
PixelFeatures pixelFeatures(const Scene& scene, int x, int y, int steps = MarchedEye::kSteps);

}  // namespace virga
