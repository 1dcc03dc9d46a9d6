// SPDX-License-Identifier: Apache-2.0
#include "scene/scene.h"

#include <algorithm>
#include <map>
#include <set>
#include <vector>

namespace virga {
namespace {

using NodesById = std::map<std::string, NodePtr>;

void collect(const NodePtr& node, NodesById& nodes) {
  if (!nodes.emplace(node->id, node).second) return;
  for (const Property& p : node->properties)
    if (const NodePtr* child = std::get_if<NodePtr>(&p.value)) collect(*child, nodes);
}

bool sameValue(const Value& a, const Value& b) {
  if (a.index() != b.index()) return false;
  if (const NodePtr* x = std::get_if<NodePtr>(&a)) return (*x)->id == std::get<NodePtr>(b)->id;
  return a == b;
}

// Names of the parameters that one node has and the other has not, or has differently; children by their ids.
std::set<std::string> changedParameters(const Node& a, const Node& b) {
  std::set<std::string> changed;
  const auto compare = [&](const Node& from, const Node& to) {
    for (const Property& p : from.properties)
      if (std::none_of(to.properties.begin(), to.properties.end(),
                       [&](const Property& q) { return q.name == p.name && sameValue(p.value, q.value); }))
        changed.insert(p.name);
  };
  compare(a, b);
  compare(b, a);
  if (a.type != b.type) changed.insert("");
  return changed;
}

bool isPose(std::string_view parameter) {
  return parameter == "to_world" || parameter == "position" || parameter == "direction" || parameter == "center" ||
         parameter == "radius";
}

Aspect aspectOf(std::string_view tag, std::string_view parameter) {
  if (tag == "sensor") return Aspect::camera;
  if (tag == "film" || tag == "rfilter") return Aspect::film;
  if (tag == "emitter") return isPose(parameter) ? Aspect::emitterPose : Aspect::emitterIntensity;
  if (tag == "volume") return isPose(parameter) ? Aspect::mediumPose : Aspect::mediumGrid;
  if (tag == "medium" || tag == "phase") return Aspect::mediumParameters;
  if (tag == "shape") return isPose(parameter) ? Aspect::shapePose : Aspect::shapeTopology;
  if (tag == "bsdf" || tag == "texture") return Aspect::material;
  return Aspect::setting;
}

Aspect aspectOfPresence(std::string_view tag) { return tag == "emitter" ? Aspect::emitterSet : aspectOf(tag, ""); }

}  // namespace

bool ChangeSet::cameraAlone() const {
  return std::all_of(changes.begin(), changes.end(), [](const Change& c) { return c.aspect == Aspect::camera; });
}

bool ChangeSet::touches(Aspect aspect) const {
  return std::any_of(changes.begin(), changes.end(), [&](const Change& c) { return c.aspect == aspect; });
}

ChangeSet differences(const SceneDescription& before, const SceneDescription& after) {
  NodesById a, b;
  collect(before.root, a);
  collect(after.root, b);
  ChangeSet set;
  const auto add = [&](const std::string& id, Aspect aspect) {
    const Change change{id, aspect};
    if (std::find(set.changes.begin(), set.changes.end(), change) == set.changes.end()) set.changes.push_back(change);
  };
  for (const auto& [id, node] : a) {
    const auto other = b.find(id);
    if (other == b.end() || other->second->tag != node->tag) {
      add(id, aspectOfPresence(node->tag));
    } else if (node != other->second && node->tag != "scene") {
      for (const std::string& parameter : changedParameters(*node, *other->second))
        add(id, aspectOf(node->tag, parameter));
    }
  }
  for (const auto& [id, node] : b)
    if (!a.contains(id)) add(id, aspectOfPresence(node->tag));
  return set;
}

namespace {

/// Where a ray first leaves a shape that replaces, and the medium in it.
struct Surroundings {
  float t = kInfinity;
  int medium = MediumTransition::kNone;
};

Surroundings enclosingSurface(const SceneView& view, const RayScene& surfaces, const Ray& ray) {
  std::set<uint32_t> seen;
  for (float from = 0;;) {
    const RayHit hit = surfaces.nearest(ray, from, kInfinity);
    if (!hit.found()) return {};
    const ShapeView& shape = view.surfaces[hit.shape];
    const bool entering = dot(surfacePoint(shape, ray, hit, view.scale).geometricNormal, ray.d) < 0;
    if (seen.insert(hit.shape).second && shape.media.replaces && !entering) return {hit.t, shape.media.interior};
    from = std::nextafter(hit.t, kInfinity);
  }
}

}  // namespace

MediaState mediaAt(const Scene& scene, Vec3 p, int endless) {
  // Along any line, the first crossing of a closed boundary is an exit if and only if the line starts inside. Of those
  // that replace, the nearest is the innermost. Open ones are taken for one: the nearest of them decides.
  const Ray ray{p, normalize(Vec3(0.5377f, 0.7123f, 0.4511f))};
  Surroundings base = enclosingSurface(scene.view, *scene.surfaceRays, ray);
  std::vector<Crossing> around;
  std::set<uint32_t> seen;
  CrossingList list;
  for (float from = 0;; list.clear()) {
    scene.boundaryRays->crossings(ray, from, kInfinity, list);
    for (int i = 0; i < list.count; ++i) {
      const Crossing& c = list.items[i];
      const MediumTransition& media = scene.view.boundaries[c.shape];
      constexpr uint32_t kAllOpen = ~0u;
      if (!seen.insert(media.closed ? c.shape : kAllOpen).second) continue;
      if (c.entering) continue;
      if (!media.replaces) around.push_back(c);
      if (media.replaces && c.t < base.t) base = {c.t, media.interior};
    }
    if (list.complete) break;
    // Once more from the last one: others may lie at the same distance.
    const float last = list.items[list.count - 1].t, before = std::nextafter(last, -kInfinity);
    from = before > from ? before : std::nextafter(last, kInfinity);
  }
  // As if they had been entered from outside: what lies farther than the one that replaces, that one, what lies within
  // it.
  MediaState state;
  state.setBase(endless);
  const auto enter = [&](const Crossing& c) {
    state.enter(static_cast<int>(c.shape), scene.view.boundaries[c.shape].interior);
  };
  for (const Crossing& c : around)
    if (c.t >= base.t) enter(c);
  if (base.t < kInfinity) state.replace(base.medium);
  for (const Crossing& c : around)
    if (c.t < base.t) enter(c);
  return state;
}

}  // namespace virga
