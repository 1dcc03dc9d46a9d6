// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "core/error.h"
#include "core/rgb.h"
#include "core/transform.h"
#include "core/vec.h"

namespace virga {

struct Node;
using NodePtr = std::shared_ptr<const Node>;

/// A parameter's value. `float` becomes double, `integer` int64_t, `point` and `vector` Vec3, `rgb` and `spectrum` Rgb.
using Value = std::variant<bool, int64_t, double, std::string, Vec3, Rgb, Matrix4, NodePtr>;

struct Property {
  std::string name;  ///< empty for an unnamed child
  Value value{};
  SourcePosition position{};       ///< of the name, or of the element
  SourcePosition valuePosition{};  ///< of the value's text
};

/// One plugin instance: `<medium type="homogeneous" id="fog"> ... </medium>`.
struct Node {
  std::string tag;     ///< "scene", "medium", "shape", "bsdf", "emitter", "phase", "volume", "sensor", ...
  std::string type{};  ///< "homogeneous", ...; empty for the scene
  std::string id{};    ///< never empty, unique in its description; made up by the loader ("_medium_2") if not given
  std::vector<Property> properties{};  ///< in the order of the file; a child object is a property that holds a NodePtr
  SourcePosition position{};           ///< of the element's name
  SourcePosition typePosition{};       ///< of the type's text

  bool hasGeneratedId() const { return id.starts_with('_'); }
};

/// A scene as its author wrote it: a typed tree with source positions, immutable and shared. Objects that were
/// referenced
/// (`ref`) are the same pointer in several places.
struct SceneDescription {
  NodePtr root;                                    ///< tag "scene"
  std::vector<std::filesystem::path> searchPaths;  ///< for relative file names, first match wins; absolute paths
  std::vector<std::filesystem::path> sources{};    ///< the scene's file and those that it includes
};

/// The node with that id, or null.
NodePtr findNode(const SceneDescription&, std::string_view id);

/// The file that the description means by `name`: absolute, or along the search paths. Nothing where there is none.
std::optional<std::filesystem::path> findFile(const SceneDescription&, const std::filesystem::path& name);

/// All files that the description was read from or names: those that must not be written over.
std::vector<std::filesystem::path> filesOf(const SceneDescription&);

/// A copy in which one parameter of one node has another value (added where it was absent). All nodes that the edit
/// does not reach are shared with the original. Throws Error for an unknown id.
SceneDescription edited(const SceneDescription&, std::string_view nodeId, std::string_view property, Value value);

/// Mitsuba 3 XML that loads to an equal description (ids, types, parameters; references stay references).
std::string toXml(const SceneDescription&);

/// Structural equality: types, ids, parameters; not source positions.
bool equal(const SceneDescription&, const SceneDescription&);

}  // namespace virga
