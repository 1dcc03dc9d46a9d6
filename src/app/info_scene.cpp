// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <map>
#include <set>

#include "app/info.h"
#include "app/progress.h"
#include "app/render_report.h"
#include "app/scene_source.h"
#include "scene/builder.h"
#include "scene/scene_parts.h"

namespace virga::app {
namespace {

/// The nodes of a description by tag, each once, in the order of the file.
using NodesByTag = std::map<std::string, std::vector<NodePtr>, std::less<>>;

void collect(const NodePtr& node, NodesByTag& byTag, std::set<const Node*>& seen) {
  if (!seen.insert(node.get()).second) return;
  byTag[node->tag].push_back(node);
  for (const Property& p : node->properties)
    if (const auto* child = std::get_if<NodePtr>(&p.value)) collect(*child, byTag, seen);
}

std::string valueText(const Value& value) {
  struct Text {
    std::string operator()(bool v) const { return v ? "true" : "false"; }
    std::string operator()(int64_t v) const { return fmt::format("{}", v); }
    std::string operator()(double v) const { return fmt::format("{:g}", v); }
    std::string operator()(const std::string& v) const { return v; }
    std::string operator()(Vec3 v) const { return fmt::format("({:g} {:g} {:g})", v.x, v.y, v.z); }
    std::string operator()(Rgb v) const {
      return v.r == v.g && v.g == v.b ? fmt::format("{:g}", v.r) : fmt::format("({:g} {:g} {:g})", v.r, v.g, v.b);
    }
    std::string operator()(const Matrix4&) const { return ""; }
    std::string operator()(const NodePtr& v) const { return v->type; }
  };
  return std::visit(Text{}, value);
}

// "heterogeneous  scale=20 albedo=0.95 phase=hg": enough to tell it from others; transforms are left out.
std::string summary(const Node& node) {
  std::string text = node.type;
  if (!node.hasGeneratedId()) text += fmt::format(" \"{}\"", node.id);
  for (const Property& p : node.properties) {
    const auto* child = std::get_if<NodePtr>(&p.value);
    const std::string name = !p.name.empty() ? p.name : child ? (*child)->tag : "";
    if (const std::string value = valueText(p.value); !value.empty()) text += fmt::format("  {}={}", name, value);
  }
  return text;
}

void printNodes(const NodesByTag& byTag, std::string_view tag, const char* title) {
  const auto found = byTag.find(tag);
  fmt::print("{}: {}\n", title, found == byTag.end() ? 0 : found->second.size());
  if (found == byTag.end()) return;
  for (const NodePtr& node : found->second) fmt::print("  {}\n", summary(*node));
}

size_t trianglesOf(const std::vector<std::shared_ptr<const BuiltShape>>& shapes) {
  size_t count = 0;
  for (const auto& s : shapes) count += s->mesh.triangles.size();
  return count;
}

size_t meshBytes(const std::vector<std::shared_ptr<const BuiltShape>>& shapes) {
  size_t bytes = 0;
  for (const auto& s : shapes) {
    const TriangleMesh& m = s->mesh;
    bytes += m.positions.size() * sizeof(Vec3) + m.normals.size() * sizeof(Vec3) + m.uvs.size() * sizeof(Vec2) +
             m.triangles.size() * sizeof(m.triangles[0]);
  }
  return bytes;
}

void printCamera(const Scene& scene) {
  const PerspectiveCamera& c = scene.camera;
  fmt::print("film: {} x {} pixels", c.width, c.height);
  if (c.width != c.filmWidth || c.height != c.filmHeight)
    fmt::print(", at ({}, {}) of {} x {}", c.cropX, c.cropY, c.filmWidth, c.filmHeight);
  const Vec3 p = c.toWorld.translation, d = normalize(c.toWorld.z);
  constexpr float kDegrees = 360 / kPi;  // of a whole angle, from the radians of half of it
  fmt::print("\ncamera: at ({:g}, {:g}, {:g}) toward ({:.3g}, {:.3g}, {:.3g}), {:.3g} x {:.3g} degrees, in {}\n", p.x,
             p.y, p.z, d.x, d.y, d.z, kDegrees * std::atan(c.tanX), kDegrees * std::atan(c.tanY),
             scene.view.cameraMedia.vacuum() ? "vacuum" : "a medium");
}

void printIntegrator(const IntegratorHints& hints) {
  fmt::print("paths: {}, {} samples a pixel\n",
             hints.maxDepth < 0 ? "of any length" : fmt::format("at most {} segments", hints.maxDepth),
             hints.sampleCount);
}

void printShapes(const Scene& scene) {
  const Scene::Parts& parts = *scene.parts;
  fmt::print("shapes: {} surfaces ({} triangles), {} boundaries of media ({} triangles)\n", parts.surfaceShapes.size(),
             trianglesOf(parts.surfaceShapes), parts.boundaryShapes.size(), trianglesOf(parts.boundaryShapes));
  const Bounds& b = scene.view.bounds;
  fmt::print("bounds: ({:g}, {:g}, {:g}) to ({:g}, {:g}, {:g})\n", b.lo.x, b.lo.y, b.lo.z, b.hi.x, b.hi.y, b.hi.z);
}

void printMemory(const Scene& scene) {
  size_t grids = 0;
  for (const auto& [key, grid] : scene.parts->cache.grids) grids += grid ? grid->bytes() : 0;
  fmt::print(
      "memory: {} of grids, {} of meshes\n", bytesText(static_cast<double>(grids)),
      bytesText(static_cast<double>(meshBytes(scene.parts->surfaceShapes) + meshBytes(scene.parts->boundaryShapes))));
}

}  // namespace

void printScene(const SceneOptions& options) {
  std::vector<std::string> warnings;
  const SceneDescription description = loadScene(options, warnings);
  const SceneSnapshot scene = buildScene(description, {.filmSize = std::nullopt, .lenient = options.lenient});
  warnings.insert(warnings.end(), scene->warnings.begin(), scene->warnings.end());
  NodesByTag byTag;
  std::set<const Node*> seen;
  collect(description.root, byTag, seen);

  fmt::print("{}: scene {}\n", options.file, hashText(contentHash(description)));
  printCamera(*scene);
  printIntegrator(scene->integrator);
  printShapes(*scene);
  printNodes(byTag, "medium", "media");
  printNodes(byTag, "emitter", "emitters");
  printNodes(byTag, "volume", "volumes");
  printMemory(*scene);
  for (const std::string& w : warnings) fmt::print("{}\n", w);
}

}  // namespace virga::app
