// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nanovdb/NanoVDB.h>

#include <cstddef>
#include <memory>
#include <new>
#include <string>
#include <vector>

#include "volume/value_check.h"

namespace virga {

/// Uninitialised bytes, aligned as NanoVDB wants its buffers.
class AlignedBytes {
 public:
  AlignedBytes() = default;
  explicit AlignedBytes(size_t size) : data_(static_cast<std::byte*>(::operator new(size, kAlignment))), size_(size) {}

  std::byte* data() { return data_.get(); }
  const std::byte* data() const { return data_.get(); }
  size_t size() const { return size_; }

 private:
  static constexpr std::align_val_t kAlignment{64};
  struct Free {
    void operator()(std::byte* p) const { ::operator delete(p, kAlignment); }
  };
  std::unique_ptr<std::byte, Free> data_;
  size_t size_ = 0;
};

/// A leaf and where it is. Its place follows from its way through the tree; the box that it stores is not trusted.
struct TreeLeaf {
  nanovdb::Coord origin;
  nanovdb::NanoLeaf<float>* node = nullptr;
};

/// A cube of dim^3 active voxels with one value.
struct TreeTile {
  nanovdb::Coord origin;
  int dim = 0;
  float value = 0;
};

/// What a tree has that is active.
struct TreeContent {
  std::vector<TreeLeaf> leaves;
  std::vector<TreeTile> tiles;
  nanovdb::Coord lo, hi;  ///< box of the active voxels, inclusive
  uint64_t activeVoxels = 0;
  float background = 0;
  float minimum = 0, maximum = 0;  ///< of the active values
  double sum = 0;                  ///< of the active values
  ValueCheck check;                ///< of the active values

  /// Throws Error where an active value is NaN, infinite or negative, or the background is, where nothing is active,
  /// and where an index exceeds 2^30.
  void requireSound() const;
};

/// Checks that `bytes` starts with a whole, undamaged NanoVDB grid of type float, so that a walk of its tree stays
/// inside. Returns what is wrong with it, or "".
std::string faultOfTree(const std::byte* bytes, size_t size);

/// Collects what is active in a valid tree and overwrites what is not with the background, so that lookups need no
/// masks.
TreeContent takeStock(nanovdb::FloatGrid& grid);

}  // namespace virga
