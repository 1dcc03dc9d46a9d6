// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <fstream>
#include <map>

#include "core/byte_hash.h"
#include "scene/scene.h"

namespace virga {
namespace {

std::string hashOfFile(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) return "absent";
  ByteHash hash;
  std::vector<char> chunk(size_t{1} << 20);
  while (in) {
    in.read(chunk.data(), static_cast<std::streamsize>(chunk.size()));
    hash.add({chunk.data(), static_cast<size_t>(in.gcount())});
  }
  return fmt::format("{:016x}", hash.value());
}

/// A copy of a description in which the contents of files stand in place of their names.
class WithContents {
 public:
  explicit WithContents(const SceneDescription& description) : description_(description) {}

  NodePtr of(const NodePtr& node) {
    NodePtr& copy = copies_[node.get()];
    if (copy) return copy;
    Node changed = *node;
    for (Property& p : changed.properties) {
      if (const auto* child = std::get_if<NodePtr>(&p.value)) p.value = of(*child);
      if (const auto* name = std::get_if<std::string>(&p.value); name && p.name == "filename") {
        const auto file = findFile(description_, *name);
        p.value = file ? hashOfFile(*file) : "absent";
      }
    }
    return copies_[node.get()] = std::make_shared<const Node>(std::move(changed));
  }

 private:
  const SceneDescription& description_;
  std::map<const Node*, NodePtr> copies_;
};

}  // namespace

uint64_t contentHash(const SceneDescription& description) {
  const std::string xml = toXml({WithContents(description).of(description.root), {}});
  ByteHash hash;
  hash.add(xml);
  return hash.value();
}

}  // namespace virga
