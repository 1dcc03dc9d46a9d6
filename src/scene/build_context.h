// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <span>

#include "scene/builder.h"
#include "scene/plugin_reader.h"
#include "scene/scene_parts.h"

namespace virga {

/// What the parts of the builder share while one scene is built.
struct BuildContext {
  const SceneDescription& description;
  const BuildOptions& options;
  BuildDiagnostics diagnostics;
  Scene& scene;
  Scene::Parts& parts;
  const PartCache* previous = nullptr;

  bool wantsNoMedia = false;  ///< the integrator is one that leaves them out

  std::map<const Node*, int> mediumIndex, bsdfIndex;  ///< objects that are referred to several times are built once

  /// The file that a plugin's parameter names, found along the search paths. Throws where there is none.
  std::filesystem::path file(PluginReader& reader, std::string_view parameter) const;

  /// The object of that key: from this scene's cache, the previous scene's, or made now.
  template <class T>
  std::shared_ptr<const T> cached(std::map<std::string, std::shared_ptr<const T>> PartCache::*map,
                                  const std::string& key, const std::function<std::shared_ptr<const T>()>& make) {
    std::shared_ptr<const T>& slot = (parts.cache.*map)[key];
    if (!slot && previous)
      if (const auto old = (previous->*map).find(key); old != (previous->*map).end()) slot = old->second;
    if (!slot) slot = make();
    return slot;
  }
};

/// A row of a table of plugins: the name in the scene file and what builds it.
template <class Build>
struct PluginRow {
  std::string_view type;
  Build build;
};

/// Throws the error for a plugin of unknown type, or of one that is known but not supported yet.
[[noreturn]] void failUnknownType(const Node& node, std::span<const std::string_view> available,
                                  std::span<const std::string_view> notYet);

/// The row of node's type. Throws where there is none.
template <class Build, size_t N>
const Build& findPlugin(const Node& node, const PluginRow<Build> (&rows)[N], std::span<const std::string_view> notYet) {
  std::vector<std::string_view> available;
  for (const auto& row : rows) {
    if (row.type == node.type) return row.build;
    available.push_back(row.type);
  }
  failUnknownType(node, available, notYet);
}

/// Type and own parameters (no children) as text: equal for plugins that make equal objects.
std::string parameterKey(const Node& node);
/// Path and time of last change: a key of a file's content.
std::string fileKey(const std::filesystem::path& path);

/// A colour of a plugin, or a texture in its place.
struct ColorOrTexture {
  Rgb maximum, mean;    ///< of a texture: by channel, over its picture; of a colour: that
  TextureView texture;  ///< present() where it is one
};
/// A parameter that may be a texture; every channel of all its values within the range.
ColorOrTexture colorOrTexture(BuildContext&, PluginReader&, std::string_view name, Rgb fallback,
                              const PluginReader::Range& range);
/// Throws what is wrong with a texture that stands in the scene for others to refer to.
void checkTexture(BuildContext&, const Node& texture);

void buildSensor(BuildContext&, const Node& sensor);
void buildIntegrator(BuildContext&, const Node& integrator);
int buildBsdf(BuildContext&, const Node& bsdf);      ///< index into parts.bsdfs
int buildMedium(BuildContext&, const Node& medium);  ///< index into parts.media
void readPhase(BuildContext&, PluginReader& medium, MediumView&);

/// A volume of numbers, and where it stands. The scene's parts own its grid.
struct ScalarField {
  GridView grid;
  Affine worldToGrid;
  float maximum = 0;
};
ScalarField buildScalarVolume(BuildContext&, const Node& volume);
/// Of the same storage.
bool sameGrid(const GridView&, const GridView&);

void buildShape(BuildContext&, const Node& shape);
void buildEmitter(BuildContext&, const Node& emitter);
void addAreaEmitter(BuildContext&, const Node& emitter, int surface, const BuiltShape&);
/// Power of every emitter, once the scene's bounds are known [W].
void chooseEmittersByPower(BuildContext&);
/// LampStrength of every emitter.
void measureLamps(BuildContext&);
/// Steps of tracking are of the order of a mean free path: throws where the medium is so many of them thick that they
/// drown in the rounding of distances.
void requireTrackable(const SourcePosition& medium, float thickness);
/// Throws, or warns, where sizes and places are beyond single precision. Once the scene's bounds are known.
void checkLimits(BuildContext&);
bool isNullBsdf(const Node& bsdf);

}  // namespace virga
