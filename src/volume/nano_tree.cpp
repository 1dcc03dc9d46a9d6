// SPDX-License-Identifier: Apache-2.0
#include "volume/nano_tree.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "core/error.h"
#include "core/parallel.h"
#include "core/vec.h"

namespace virga {
namespace {

using Root = nanovdb::NanoRoot<float>;
using Upper = nanovdb::NanoUpper<float>;
using Lower = nanovdb::NanoLower<float>;
using Leaf = nanovdb::NanoLeaf<float>;
using nanovdb::Coord;

constexpr int kMaxIndex = 1 << 30;

// Walks a tree whose bytes may be anything: nothing is read before it is known to lie in the buffer.
class Inspector {
 public:
  Inspector(const std::byte* bytes, size_t size) : bytes_(bytes), size_(size) {}

  std::string fault() {
    std::string wrong = headerFault();
    if (wrong.empty()) wrong = rootFault();
    return wrong.empty() ? overlapFault() : wrong;
  }

 private:
  template <class T>
  const T* as(size_t offset) const {
    return reinterpret_cast<const T*>(bytes_ + offset);
  }

  std::string headerFault() {
    constexpr size_t kHead = sizeof(nanovdb::GridData) + sizeof(nanovdb::TreeData<3>);
    if (size_ < kHead + sizeof(Root)) return "is too short for a grid";
    const auto* grid = as<nanovdb::GridData>(0);
    if (grid->mVersion.getMajor() != NANOVDB_MAJOR_VERSION_NUMBER)
      return fmt::format("has version {}.{} of NanoVDB's layout, not {}.x", grid->mVersion.getMajor(),
                         grid->mVersion.getMinor(), NANOVDB_MAJOR_VERSION_NUMBER);
    if (grid->mGridType != nanovdb::GridType::Float) return "does not hold floats";
    if (grid->mGridSize > size_) return "is longer than its buffer";
    size_ = std::max<size_t>(grid->mGridSize, kHead + sizeof(Root));
    return "";
  }

  // Registers a node; false where it cannot be one. More nodes than fit the buffer mean that some are shared.
  template <class Node>
  bool admit(size_t parent, int64_t relative, size_t& offset) {
    const auto limit = static_cast<int64_t>(size_);
    if (relative < -limit || relative > limit) return false;
    const int64_t absolute = static_cast<int64_t>(parent) + relative;
    if (absolute < 0 || absolute % NANOVDB_DATA_ALIGNMENT != 0) return false;
    if (sizeof(Node) > size_ || absolute > limit - static_cast<int64_t>(sizeof(Node))) return false;
    if (nodes_.size() > size_ / sizeof(Leaf)) return false;
    offset = static_cast<size_t>(absolute);
    nodes_.emplace_back(offset, offset + sizeof(Node));
    return true;
  }

  std::string rootFault() {
    size_t rootAt = 0;
    const auto* tree = as<nanovdb::TreeData<3>>(sizeof(nanovdb::GridData));
    if (!admit<Root>(sizeof(nanovdb::GridData), static_cast<int64_t>(tree->mNodeOffset[3]), rootAt))
      return "has its root outside the buffer";
    const auto* root = as<Root::DataType>(rootAt);
    const size_t tilesAt = rootAt + sizeof(Root);
    if (root->mTableSize > (size_ - tilesAt) / sizeof(Root::DataType::Tile)) return "has its root outside the buffer";
    nodes_.back().second = tilesAt + root->mTableSize * sizeof(Root::DataType::Tile);
    nodes_.emplace_back(0, sizeof(nanovdb::GridData) + sizeof(nanovdb::TreeData<3>));
    std::vector<uint64_t> keys;
    for (uint32_t n = 0; n < root->mTableSize; ++n) {
      const auto* tile = root->tile(n);
      keys.push_back(tile->key);
      if (tile->isChild() && !upperIsSound(rootAt, tile->child)) return "has a node outside the buffer";
    }
    std::sort(keys.begin(), keys.end());
    return std::adjacent_find(keys.begin(), keys.end()) == keys.end() ? "" : "has two roots at one place";
  }

  bool upperIsSound(size_t parent, int64_t relative) {
    size_t at = 0;
    if (!admit<Upper>(parent, relative, at)) return false;
    const auto* data = as<Upper::DataType>(at);
    for (auto it = data->mChildMask.beginOn(); it; ++it)
      if (!lowerIsSound(at, data->mTable[*it].child)) return false;
    return true;
  }

  bool lowerIsSound(size_t parent, int64_t relative) {
    size_t at = 0, leafAt = 0;
    if (!admit<Lower>(parent, relative, at)) return false;
    const auto* data = as<Lower::DataType>(at);
    for (auto it = data->mChildMask.beginOn(); it; ++it)
      if (!admit<Leaf>(at, data->mTable[*it].child, leafAt)) return false;
    return true;
  }

  // Nodes that overlap are no danger to a reader, but takeStock writes.
  std::string overlapFault() {
    std::sort(nodes_.begin(), nodes_.end());
    for (size_t i = 1; i < nodes_.size(); ++i)
      if (nodes_[i].first < nodes_[i - 1].second) return "has nodes that overlap";
    return "";
  }

  const std::byte* bytes_;
  size_t size_;
  std::vector<std::pair<size_t, size_t>> nodes_;  // begin and end of each, in bytes
};

// Calls onChild(childPointer, origin) and notes the active tiles; inactive ones become background.
template <class Data, class OnChild>
void openNode(Data* data, Coord origin, int childDim, int log2, TreeContent& content, const OnChild& onChild) {
  const uint32_t size = 1u << (3 * log2), mask = (1u << log2) - 1;
  for (uint32_t n = 0; n < size; ++n) {
    const Coord at =
        origin.offsetBy(static_cast<int>(n >> (2 * log2)) * childDim, static_cast<int>((n >> log2) & mask) * childDim,
                        static_cast<int>(n & mask) * childDim);
    if (data->mChildMask.isOn(n))
      onChild(data->getChild(n), at);
    else if (data->mValueMask.isOn(n))
      content.tiles.push_back({at, childDim, data->mTable[n].value});
    else
      data->mTable[n].value = content.background;
  }
}

void openTree(nanovdb::FloatGrid& grid, TreeContent& content) {
  auto* root = grid.tree().root().data();
  content.background = root->mBackground;
  const auto onLeaf = [&](Leaf* leaf, Coord at) { content.leaves.push_back({at, leaf}); };
  const auto onLower = [&](Lower* lower, Coord at) { openNode(lower->data(), at, 8, 4, content, onLeaf); };
  for (uint32_t n = 0; n < root->mTableSize; ++n) {
    auto* tile = root->tile(n);
    if (tile->isChild())
      openNode(root->getChild(tile)->data(), tile->origin(), 128, 5, content, onLower);
    else if (tile->isActive())
      content.tiles.push_back({tile->origin(), 4096, tile->value});
    else
      tile->value = content.background;
  }
}

struct Stock {
  ValueCheck check;
  Coord lo = Coord::max(), hi = Coord::min();
  uint64_t active = 0;
  float minimum = kInfinity;
  double sum = 0;

  void add(const Stock& other) {
    check = combined(check, other.check);
    minimum = std::min(minimum, other.minimum);
    sum += other.sum;
    lo.minComponent(other.lo), hi.maxComponent(other.hi);
    active += other.active;
  }
};

Stock takeLeaf(const TreeLeaf& leaf, float background) {
  Stock stock;
  auto* data = leaf.node->data();
  for (uint32_t n = 0; n < 512; ++n) {
    if (data->mValueMask.isOff(n)) {
      data->mValues[n] = background;
      continue;
    }
    const Coord at =
        leaf.origin.offsetBy(static_cast<int>(n >> 6), static_cast<int>((n >> 3) & 7), static_cast<int>(n & 7));
    stock.check.add(data->mValues[n], {at.x(), at.y(), at.z()});
    stock.lo.minComponent(at), stock.hi.maxComponent(at);
    stock.minimum = std::min(stock.minimum, data->mValues[n]);
    stock.sum += data->mValues[n];
    ++stock.active;
  }
  return stock;
}

Stock takeTile(const TreeTile& tile) {
  Stock stock;
  stock.active = static_cast<uint64_t>(tile.dim) * static_cast<uint64_t>(tile.dim) * static_cast<uint64_t>(tile.dim);
  stock.check.add(tile.value, {tile.origin.x(), tile.origin.y(), tile.origin.z()}, stock.active);
  stock.minimum = tile.value;
  stock.sum = static_cast<double>(tile.value) * static_cast<double>(stock.active);
  stock.lo = tile.origin;
  stock.hi = tile.origin.offsetBy(tile.dim - 1);
  return stock;
}

void requireBackground(float background) {
  if (!(background >= 0 && background <= std::numeric_limits<float>::max()))
    throw Error(fmt::format("grid has background {}; it must be finite and not negative", background));
}

void requireReach(Coord lo, Coord hi) {
  if (std::min({lo.x(), lo.y(), lo.z()}) < -kMaxIndex || std::max({hi.x(), hi.y(), hi.z()}) > kMaxIndex)
    throw Error(fmt::format("grid has active voxels from ({}, {}, {}) to ({}, {}, {}); indices may reach 2^30 at most",
                            lo.x(), lo.y(), lo.z(), hi.x(), hi.y(), hi.z()));
}

}  // namespace

std::string faultOfTree(const std::byte* bytes, size_t size) { return Inspector(bytes, size).fault(); }

TreeContent takeStock(nanovdb::FloatGrid& grid) {
  TreeContent content;
  openTree(grid, content);
  std::vector<Stock> stocks(content.leaves.size());
  parallelFor(static_cast<int64_t>(stocks.size()), 64, [&](int64_t i) {
    stocks[static_cast<size_t>(i)] = takeLeaf(content.leaves[static_cast<size_t>(i)], content.background);
  });
  Stock total;
  for (const Stock& stock : stocks) total.add(stock);
  for (const TreeTile& tile : content.tiles) total.add(takeTile(tile));
  content.lo = total.lo, content.hi = total.hi;
  content.activeVoxels = total.active;
  content.minimum = total.minimum, content.maximum = total.check.maximum;
  content.sum = total.sum;
  content.check = total.check;
  return content;
}

void TreeContent::requireSound() const {
  if (activeVoxels == 0) throw Error("grid has no active voxels");
  check.require();
  requireBackground(background);
  requireReach(lo, hi);
}

}  // namespace virga
