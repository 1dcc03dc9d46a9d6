// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "methods/instant_scattering/shadow_maps.h"
#include "transport/visibility.h"

namespace virga {

/// How it is found out whether something lies between a virtual light and what it lights (section 4.4 of the paper,
/// "local visibility").
struct LightVisibilityOptions {
  enum class Mode {
    exact,         ///< by a ray
    shadowMap,     ///< from the light's ShadowMaps: biased
    minimumDepth,  ///< by a ray, unless the light is nearer than any surface is to it
    none,          ///< nothing does: biased
  };
  static constexpr size_t kMostMemory = size_t{1} << 30;  ///< that shadow maps may take [bytes]

  static constexpr int kMostResolution = 1024, kMostPoints = 1'000'000;

  Mode mode = Mode::exact;
  int resolution = 128;  ///< of shadow maps
  int points = 8192;     ///< of the scene's surfaces in each; 0: a ray for each texel
};

/// What is known around the point that virtual lights were gathered at; from there, new vertices are looked for.
struct KnownSpace {
  float clearance = 0;  ///< [unit] no surface is nearer
  float distance = kInfinity;
  uint32_t light = 0;  ///< the nearest one that sees the point, if the distance is finite
};

/// As kernels take it. Lights are named by their number.
struct LightVisibilityView {
  using Mode = LightVisibilityOptions::Mode;

  Mode mode = Mode::exact;
  ShadowMapsView maps{};
  const float* minimumDepths = nullptr;  ///< [unit]

  /// Does a surface block the way `w` (unit) from x to a light, `distance` away? `ray` goes along it.
  template <class Rays>
  VIRGA_HD bool blocked(const Rays& rays, const ConnectingRay& ray, const Vertex& x, Vec3 w, float distance,
                        uint32_t light) const {
    switch (mode) {
      case Mode::none:
        return false;
      case Mode::shadowMap:
        return !maps.visible(light, -w, distance, generalCosine(x.normal(), w));
      case Mode::minimumDepth:
        if (x.kind == VertexKind::medium && distance < minimumDepths[light]) return false;
        [[fallthrough]];
      default:
        return rays.occluded(ray.at.ray, ray.tMax);
    }
  }
  /// Adds what a light that sees x tells about the surfaces around x. `w`: from x to the light.
  VIRGA_HD void learn(KnownSpace& known, const LightVertex& from, uint32_t light, Vec3 w, float distance) const {
    if (mode == Mode::shadowMap && distance < known.distance) known.distance = distance, known.light = light;
    if (mode != Mode::minimumDepth) return;
    // A light on a surface knows of its own side alone.
    const float free = minimumDepths[light] - distance;
    const float above = from.kind == VertexKind::surface ? std::fabs(dot(w, from.normal)) * distance : free;
    known.clearance = std::max(known.clearance, std::min(free, above));
  }
  /// Is it known that no surface lies on the way to a point that is `t` away?
  VIRGA_HD bool isFree(const KnownSpace& known, const View<LightVertex>& lights, Vec3 to, float t) const {
    if (mode == Mode::none) return true;
    if (mode == Mode::minimumDepth) return t < known.clearance;
    if (mode == Mode::exact || !(known.distance < kInfinity)) return false;
    const Vec3 way = to - lights[known.light].p;
    const float d = length(way);
    return d > 0 && maps.visible(known.light, way, d);
  }
};

/// From where maps without points are traced, beside a light's surface [unit].
inline float mapOffset(const SceneView& scene) { return 1e-4f * scene.scale; }

/// Throws Error where so many maps take too much memory. `fewer`: the setting that their number comes from.
void refuseTooManyMaps(size_t lights, int resolution, std::string_view fewer);

/// What the visibility of virtual lights needs to know about each.
class LightVisibility {
 public:
  /// Throws Error where shadow maps would take too much memory. `points` are used by shadow maps alone; `seed` says
  /// which of them each light draws.
  LightVisibility(const Scene& scene, const VirtualLights& lights, const SurfacePoints& points,
                  const LightVisibilityOptions& options, uint64_t seed, const std::stop_token& stop = {});

  LightVisibilityView view() const { return {mode_, maps_.view(), minimumDepths_.data()}; }

 private:
  LightVisibilityOptions::Mode mode_;
  ShadowMaps maps_;
  std::vector<float> minimumDepths_;
};

/// Of each light, a distance within which no surface lies that could block its light (infinity where nothing could):
/// surfaces that nowhere rise above the light's own do not count.
std::vector<float> minimumDepths(const RayScene& surfaces, std::span<const LightVertex> lights,
                                 const std::stop_token& stop = {});

}  // namespace virga
