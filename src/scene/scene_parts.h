// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/distribution.h"
#include "image/image.h"
#include "scene/mesh.h"
#include "scene/scene.h"
#include "volume/grid.h"

namespace virga {

/// A shape of the scene file, in world space and ready to be traced; what it is made of and lit by is not its business.
struct BuiltShape {
  ShapeView view;  ///< geometry only
  std::shared_ptr<const RayShape> rays;
  Bounds bounds;
  TriangleMesh mesh;                       ///< world space; empty for spheres, disks and cylinders
  Discrete triangleChoice;                 ///< by area
  size_t openEdges = 0;                    ///< of a shape that a medium fills; more than 0: it does not enclose a space
  std::optional<RectangleView> rectangle;  ///< that the mesh is
};

/// An environment map with its sampling tables.
struct BuiltEnvironment {
  Image image;
  Discrete rows;
  std::vector<float> columns;
  float brightest = 0;     ///< channel of a pixel, before the emitter's scale
  float meanRadiance = 0;  ///< over the sphere, mean of the channels, before the emitter's scale
};

/// What a mixture of phase functions refers to: a tree of blends as the list of its leaves.
struct BuiltMixture {
  std::vector<PlainPhase> lobes;
  std::vector<PhaseBlend> blends;
};

/// Expensive objects by everything that went into them, so that the next snapshot finds them again.
struct PartCache {
  std::map<std::string, std::shared_ptr<const BuiltShape>> shapes;
  std::map<std::string, std::shared_ptr<const Grid>> grids;
  std::map<std::string, std::shared_ptr<const RgbGrid>> rgbGrids;
  std::map<std::string, std::shared_ptr<const BuiltEnvironment>> environments;
  std::map<std::string, std::shared_ptr<const Image>> pictures;  ///< of textures
};

struct Scene::Parts {
  PartCache cache;
  std::vector<std::shared_ptr<const BuiltShape>> surfaceShapes, boundaryShapes;
  std::vector<ShapeView> surfaces;
  std::vector<MediumTransition> boundaries;
  std::vector<SurfaceBsdf> bsdfs;
  std::vector<TextureView> textures;
  std::vector<MediumView> media;
  std::vector<std::shared_ptr<const PhaseTable>> phaseTables;
  std::vector<std::shared_ptr<const BuiltMixture>> phaseMixtures;
  std::vector<EmitterView> emitters;
  std::vector<LampStrength> lamps;
  Discrete emitterChoice;
};

}  // namespace virga
