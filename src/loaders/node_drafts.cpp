// SPDX-License-Identifier: Apache-2.0
#include "loaders/node_drafts.h"

#include <fmt/format.h>

#include "loaders/error_at.h"
#include "loaders/xml_document.h"

namespace virga {
namespace {

std::string placeOf(const SourcePosition& position) {
  return fmt::format("{}:{}:{}", position.file->name, position.line(), position.column());
}

// References pile up objects without nesting in the file, so the limit of the XML reader is not enough.
void requireShallow(int depth, const SourcePosition& position) {
  if (depth >= xml::kMaxDepth)
    throw errorAt(position, fmt::format("more than {} objects inside each other", xml::kMaxDepth));
}

}  // namespace

NodeDraft& NodeDrafts::add(Node node) {
  const int ordinal = ++counts_[node.tag];
  drafts_.push_back({.node = std::move(node), .links = {}, .ordinal = ordinal});
  return drafts_.back();
}

void NodeDrafts::defineId(const std::string& id, NodeDraft& draft, const SourcePosition& position) {
  draft.node.id = id;
  define(id, {.draft = &draft, .target = {}, .position = position, .targetPosition = {}});
}

void NodeDrafts::defineAlias(const std::string& id, const std::string& as, const SourcePosition& idPosition,
                             const SourcePosition& asPosition) {
  define(as, {.draft = nullptr, .target = id, .position = asPosition, .targetPosition = idPosition});
}

void NodeDrafts::define(const std::string& id, Definition definition) {
  if (id.empty()) throw errorAt(definition.position, "an id must not be empty");
  const SourcePosition position = definition.position;
  const auto [found, isNew] = definitions_.emplace(id, std::move(definition));
  if (!isNew)
    throw errorAt(position, fmt::format("the id \"{}\" is taken", id), "",
                  {"first given at " + placeOf(found->second.position)});
}

void NodeDrafts::generateIds() {
  for (NodeDraft& draft : drafts_) {
    if (!draft.node.id.empty()) continue;
    draft.node.id = fmt::format("_{}_{}", draft.node.tag, draft.ordinal);
    while (definitions_.contains(draft.node.id)) draft.node.id += '_';
  }
}

NodeDraft& NodeDrafts::lookUp(const std::string& id, const SourcePosition& position,
                              const std::vector<std::string>& notes) {
  const Definition* definition = nullptr;
  SourcePosition place = position;
  std::string name = id;
  for (size_t hops = 0; hops <= definitions_.size(); ++hops) {
    const auto found = definitions_.find(name);
    if (found == definitions_.end()) {
      std::vector<std::string> known, all = notes;
      for (const auto& [other, unused] : definitions_) known.push_back(other);
      all.push_back(known.empty() ? "no object of this scene has an id" : "available: " + joined(known));
      throw errorAt(place, fmt::format("no object has the id \"{}\"", name), didYouMean(name, known), std::move(all));
    }
    definition = &found->second;
    if (definition->draft) return *definition->draft;
    name = definition->target;
    place = definition->targetPosition;
  }
  throw errorAt(place, "these aliases go round in a circle");
}

void NodeDrafts::requireAliasTargets() {
  for (const auto& [as, definition] : definitions_)
    if (!definition.draft) lookUp(definition.target, definition.targetPosition, {});
}

NodePtr NodeDrafts::resolve(NodeDraft& root) {
  requireAliasTargets();
  generateIds();
  return resolve(root, 1).node;
}

const NodeDrafts::Progress& NodeDrafts::resolve(NodeDraft& draft, int depth) {
  Progress& progress = progress_[&draft];
  if (progress.state == State::done) return progress;
  progress.state = State::open;
  const auto node = std::make_shared<Node>(draft.node);
  for (const NodeDraft::Link& link : draft.links) {
    Property& property = node->properties[link.property];
    const Progress& child = resolve(property, link, depth);
    property.value = child.node;
    progress.height = std::max(progress.height, 1 + child.height);
    requireShallow(progress.height, property.valuePosition);
  }
  progress.state = State::done;
  progress.node = node;
  return progress;
}

const NodeDrafts::Progress& NodeDrafts::resolve(const Property& property, const NodeDraft::Link& link, int depth) {
  NodeDraft& target = link.child ? *link.child : lookUp(link.id, property.valuePosition, link.notes);
  if (progress_[&target].state == State::open)
    throw errorAt(property.valuePosition, fmt::format("the object \"{}\" contains itself", link.id), "",
                  {"it begins at " + placeOf(target.node.position)});
  requireShallow(depth, property.valuePosition);
  return resolve(target, depth + 1);
}

}  // namespace virga
