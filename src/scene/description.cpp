// SPDX-License-Identifier: Apache-2.0
#include "scene/description.h"

#include <fmt/format.h>

#include <iterator>
#include <unordered_map>
#include <unordered_set>

namespace virga {
namespace {

NodePtr child(const Property& property) {
  const NodePtr* node = std::get_if<NodePtr>(&property.value);
  return node ? *node : nullptr;
}

// Visits every node once, however often it is referenced: shared nodes would otherwise cost exponential time.
template <class Visit>
void forEachNode(const NodePtr& node, std::unordered_set<const Node*>& seen, const Visit& visit) {
  if (!node || !seen.insert(node.get()).second) return;
  visit(node);
  for (const Property& property : node->properties) forEachNode(child(property), seen, visit);
}

template <class Visit>
void forEachNode(const SceneDescription& scene, const Visit& visit) {
  std::unordered_set<const Node*> seen;
  forEachNode(scene.root, seen, visit);
}

Error unknownId(const SceneDescription& scene, std::string_view id) {
  std::vector<std::string> ids;
  forEachNode(scene, [&](const NodePtr& node) { ids.push_back(node->id); });
  return Error(fmt::format("the scene has no object with the id \"{}\"", id),
               {.position = {}, .hint = didYouMean(id, ids), .notes = {}});
}

// Replaces one node and copies the nodes on the ways from the root to it. The memo keeps shared nodes shared.
class PathCopy {
 public:
  PathCopy(const Node* target, NodePtr replacement) { copies_.emplace(target, std::move(replacement)); }

  NodePtr operator()(const NodePtr& node) {
    if (const auto known = copies_.find(node.get()); known != copies_.end()) return known->second;
    std::shared_ptr<Node> copy;
    for (size_t i = 0; i < node->properties.size(); ++i) {
      const NodePtr before = child(node->properties[i]);
      const NodePtr after = before ? (*this)(before) : nullptr;
      if (after == before) continue;
      if (!copy) copy = std::make_shared<Node>(*node);
      copy->properties[i].value = after;
    }
    return copies_.emplace(node.get(), copy ? NodePtr(copy) : node).first->second;
  }

 private:
  std::unordered_map<const Node*, NodePtr> copies_;
};

NodePtr withProperty(const Node& node, std::string_view name, Value value) {
  auto copy = std::make_shared<Node>(node);
  const auto sameName = [&](const Property& property) { return property.name == name; };
  const auto found = std::find_if(copy->properties.begin(), copy->properties.end(), sameName);
  if (found == copy->properties.end()) {
    copy->properties.push_back({.name = std::string(name), .value = std::move(value)});
  } else {
    found->value = std::move(value);
    found->valuePosition = {};  // the text there is not this value
  }
  return copy;
}

std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    const auto code = static_cast<unsigned char>(c);
    // A plain '$' would start a variable.
    const bool special = code < 32 || c == '&' || c == '<' || c == '>' || c == '"' || c == '$';
    if (special)
      fmt::format_to(std::back_inserter(out), "&#{};", static_cast<int>(code));
    else
      out += c;
  }
  return out;
}

class XmlWriter {
 public:
  explicit XmlWriter(const SceneDescription& scene) { countUses(scene.root); }

  std::string write(const SceneDescription& scene) {
    line("<scene version=\"3.0.0\"{}>", idAttribute(*scene.root));
    ++depth_;
    // The reader puts a later path before an earlier one.
    for (auto path = scene.searchPaths.rbegin(); path != scene.searchPaths.rend(); ++path)
      line("<path value=\"{}\"/>", escaped(path->string()));
    for (const Property& property : scene.root->properties) writeProperty(property);
    --depth_;
    line("</scene>");
    return std::move(out_);
  }

 private:
  void countUses(const NodePtr& node) {
    if (++uses_[node.get()] > 1) return;
    for (const Property& property : node->properties)
      if (const NodePtr c = child(property)) countUses(c);
  }

  template <class... Args>
  void line(fmt::format_string<Args...> format, Args&&... args) {
    out_.append(static_cast<size_t>(4 * depth_), ' ');
    fmt::format_to(std::back_inserter(out_), format, std::forward<Args>(args)...);
    out_ += '\n';
  }

  std::string idAttribute(const Node& node) const {
    const bool needed = !node.hasGeneratedId() || uses_.at(&node) > 1;
    return needed ? fmt::format(" id=\"{}\"", escaped(node.id)) : "";
  }

  static std::string nameAttribute(const Property& property) {
    return property.name.empty() ? "" : fmt::format(" name=\"{}\"", escaped(property.name));
  }

  void writeProperty(const Property& property) {
    const std::string name = nameAttribute(property);
    std::visit([&](const auto& value) { writeValue(name, value); }, property.value);
  }

  void writeValue(const std::string& name, bool value) { line("<boolean{} value=\"{}\"/>", name, value); }
  void writeValue(const std::string& name, int64_t value) { line("<integer{} value=\"{}\"/>", name, value); }
  void writeValue(const std::string& name, double value) { line("<float{} value=\"{}\"/>", name, value); }
  void writeValue(const std::string& name, const std::string& value) {
    line("<string{} value=\"{}\"/>", name, escaped(value));
  }
  void writeValue(const std::string& name, Vec3 v) {
    line("<point{} x=\"{}\" y=\"{}\" z=\"{}\"/>", name, v.x, v.y, v.z);
  }
  void writeValue(const std::string& name, Rgb c) { line("<rgb{} value=\"{}, {}, {}\"/>", name, c.r, c.g, c.b); }
  void writeValue(const std::string& name, const Matrix4& matrix) {
    line("<transform{}>", name);
    ++depth_;
    line("<matrix value=\"{}\"/>", fmt::join(matrix.m, " "));
    --depth_;
    line("</transform>");
  }
  void writeValue(const std::string& name, const NodePtr& node) {
    if (!written_.insert(node.get()).second) return line("<ref id=\"{}\"{}/>", escaped(node->id), name);
    const std::string start =
        fmt::format("<{} type=\"{}\"{}{}", node->tag, escaped(node->type), idAttribute(*node), name);
    if (node->properties.empty()) return line("{}/>", start);
    line("{}>", start);
    ++depth_;
    for (const Property& property : node->properties) writeProperty(property);
    --depth_;
    line("</{}>", node->tag);
  }

  std::unordered_map<const Node*, int> uses_;
  std::unordered_set<const Node*> written_;
  std::string out_;
  int depth_ = 0;
};

// Compares two graphs in step. A node has one counterpart: sharing is part of the structure.
class Comparison {
 public:
  bool same(const NodePtr& a, const NodePtr& b) {
    if (!a || !b) return a == b;
    const auto [forth, newA] = inB_.emplace(a.get(), b.get());
    const auto [back, newB] = inA_.emplace(b.get(), a.get());
    if (!newA || !newB) return forth->second == b.get() && back->second == a.get();
    return sameHead(*a, *b) && std::equal(a->properties.begin(), a->properties.end(), b->properties.begin(),
                                          b->properties.end(), [&](const Property& p, const Property& q) {
                                            return p.name == q.name && sameValue(p.value, q.value);
                                          });
  }

 private:
  // Generated ids count positions in a file, which an equal description may arrange in another way.
  static bool sameHead(const Node& a, const Node& b) {
    const bool sameId = a.hasGeneratedId() ? b.hasGeneratedId() : a.id == b.id;
    return a.tag == b.tag && a.type == b.type && sameId;
  }

  bool sameValue(const Value& a, const Value& b) {
    const NodePtr* nodeA = std::get_if<NodePtr>(&a);
    const NodePtr* nodeB = std::get_if<NodePtr>(&b);
    return nodeA && nodeB ? same(*nodeA, *nodeB) : a == b;
  }

  std::unordered_map<const Node*, const Node*> inA_, inB_;
};

}  // namespace

NodePtr findNode(const SceneDescription& scene, std::string_view id) {
  NodePtr found;
  forEachNode(scene, [&](const NodePtr& node) {
    if (node->id == id) found = node;
  });
  return found;
}

std::optional<std::filesystem::path> findFile(const SceneDescription& scene, const std::filesystem::path& name) {
  std::error_code ignored;
  if (name.is_absolute()) return std::filesystem::exists(name, ignored) ? std::optional(name) : std::nullopt;
  for (const std::filesystem::path& folder : scene.searchPaths)
    if (std::filesystem::exists(folder / name, ignored)) return folder / name;
  return std::nullopt;
}

std::vector<std::filesystem::path> filesOf(const SceneDescription& scene) {
  std::vector<std::filesystem::path> files = scene.sources;
  forEachNode(scene, [&](const NodePtr& node) {
    for (const Property& p : node->properties)
      if (const auto* name = std::get_if<std::string>(&p.value); name && p.name == "filename")
        if (const auto file = findFile(scene, *name)) files.push_back(*file);
  });
  return files;
}

SceneDescription edited(const SceneDescription& scene, std::string_view nodeId, std::string_view property,
                        Value value) {
  const NodePtr target = findNode(scene, nodeId);
  if (!target) throw unknownId(scene, nodeId);
  PathCopy copy(target.get(), withProperty(*target, property, std::move(value)));
  return {copy(scene.root), scene.searchPaths, scene.sources};
}

std::string toXml(const SceneDescription& scene) { return XmlWriter(scene).write(scene); }

bool equal(const SceneDescription& a, const SceneDescription& b) {
  return a.root == b.root || Comparison().same(a.root, b.root);
}

}  // namespace virga
