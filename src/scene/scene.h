// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "rays/ray_scene.h"
#include "scene/description.h"
#include "scene/scene_view.h"

namespace virga {

/// What the scene file says about rendering; methods read it where their own settings are silent.
struct IntegratorHints {
  int maxDepth = -1;     ///< longest path in segments; -1: no limit
  int rrDepth = 5;       ///< segments before Russian roulette begins
  int sampleCount = 16;  ///< samples a pixel
};

/// An immutable, renderable scene. Made by buildScene; parts that an edit does not touch are shared with the scene
/// before.
struct Scene {
  SceneDescription description;
  PerspectiveCamera camera;
  PixelFilter filter;
  IntegratorHints integrator;
  SceneView view;
  std::shared_ptr<const RayScene> surfaceRays;   ///< all shapes that scatter or emit
  std::shared_ptr<const RayScene> boundaryRays;  ///< all shapes of null BSDF
  std::vector<std::string> warnings;

  struct Parts;  ///< owners of what `view` points to; the builder's business
  std::shared_ptr<const Parts> parts;
};

using SceneSnapshot = std::shared_ptr<const Scene>;

/// What an edit can touch.
enum class Aspect {
  camera,
  film,
  emitterIntensity,
  emitterPose,
  emitterSet,
  mediumParameters,
  mediumGrid,
  mediumPose,
  shapePose,
  shapeTopology,
  material,
  setting,
};

struct Change {
  std::string objectId;
  Aspect aspect;
  friend bool operator==(const Change&, const Change&) = default;
};

/// All that differs between two snapshots.
struct ChangeSet {
  std::vector<Change> changes;

  bool empty() const { return changes.empty(); }
  bool touches(Aspect) const;
  bool cameraAlone() const;  ///< nothing but the camera has changed, if anything has
};

/// By the ids of the objects in both descriptions.
ChangeSet differences(const SceneDescription& before, const SceneDescription& after);

/// The media around a point, away from all surfaces and boundaries, by the closed shapes that it lies in: the interiors
/// of null boundaries, or of the innermost shape that replaces. `endless`: the medium that is around everything, if
/// there is one.
MediaState mediaAt(const Scene&, Vec3 p, int endless = MediaState::kNone);

/// 64 bits of everything that the description says and of the contents of the files that it names (not of where they
/// lie), for metadata. Reads those files.
uint64_t contentHash(const SceneDescription&);

}  // namespace virga
