// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <map>
#include <string>
#include <unordered_map>
#include <vector>

#include "scene/description.h"

namespace virga {

/// A node while its file is read: its children and references are not resolved, for an id may be defined after its use.
struct NodeDraft {
  struct Link {
    size_t property;                   ///< which of node.properties it fills
    NodeDraft* child = nullptr;        ///< or null for a reference
    std::string id;                    ///< of the reference
    std::vector<std::string> notes{};  ///< on how the id came about
  };

  Node node;
  std::vector<Link> links;
  int ordinal = 0;  ///< counts the nodes with this tag, from 1
};

/// All nodes of one scene, and the second half of loading it: references become shared nodes.
class NodeDrafts {
 public:
  NodeDraft& add(Node node);

  /// Throws Error where the id names something already.
  void defineId(const std::string& id, NodeDraft& draft, const SourcePosition& position);
  void defineAlias(const std::string& id, const std::string& as, const SourcePosition& idPosition,
                   const SourcePosition& asPosition);

  /// The root with everything below. Throws Error for unknown ids and for nodes that contain themselves.
  NodePtr resolve(NodeDraft& root);

 private:
  struct Definition {
    NodeDraft* draft = nullptr;  // null for an alias
    std::string target;          // of an alias
    SourcePosition position;
    SourcePosition targetPosition;
  };

  enum class State { untouched, open, done };
  struct Progress {
    State state = State::untouched;
    int height = 1;  // levels of nodes, this one included
    NodePtr node;
  };

  void define(const std::string& id, Definition definition);
  void generateIds();
  NodeDraft& lookUp(const std::string& id, const SourcePosition& position, const std::vector<std::string>& notes);
  void requireAliasTargets();
  const Progress& resolve(NodeDraft& draft, int depth);
  const Progress& resolve(const Property& property, const NodeDraft::Link& link, int depth);

  std::deque<NodeDraft> drafts_;  // a deque keeps addresses
  std::map<std::string, Definition> definitions_;
  std::map<std::string, int> counts_;
  std::unordered_map<const NodeDraft*, Progress> progress_;
};

}  // namespace virga
