// SPDX-License-Identifier: Apache-2.0
#include "volume/vdb_module/vdb_walk.h"

#include <algorithm>
#include <array>
#include <bit>
#include <vector>

namespace virga {
namespace {

[[noreturn]] void damaged() { throw Error("file is truncated or damaged"); }

// What precedes a node's array of values and says what is not in it.
enum Inactive : uint8_t { none, minusBackground, oneValue, mask, maskAndOneValue, maskAndTwoValues, allStored };

// The bits of a node, one for each child, value or voxel.
class Bits {
 public:
  Bits(ByteReader& in, size_t count) : bytes_(in.take(count / 8)), count_(count) {}

  size_t on() const {
    size_t sum = 0;
    for (size_t i = 0; i < count_ / 8; ++i)
      sum += static_cast<size_t>(std::popcount(std::to_integer<uint8_t>(bytes_[i])));
    return sum;
  }

 private:
  const std::byte* bytes_;
  size_t count_;
};

class Walk {
 public:
  Walk(const AlignedBytes& file, size_t offset, const VdbEncoding& encoding)
      : in_(file.data(), file.size(), offset), encoding_(encoding) {}

  void tree() {
    if (in_.read<int32_t>() != 1) damaged();  // trees of several buffers have not been written for many years
    root();
    for (size_t i = 0; i < leaves_; ++i) values(512, Bits(in_, 512));
  }

 private:
  void root() {
    in_.take(encoding_.valueSize);  // background
    const auto tiles = in_.read<uint32_t>(), children = in_.read<uint32_t>();
    std::vector<std::array<int32_t, 3>> origins;
    for (uint32_t i = 0; i < tiles; ++i) {
      origins.push_back(origin());
      in_.take(encoding_.valueSize);
      if (in_.read<uint8_t>() > 1) damaged();
    }
    for (uint32_t i = 0; i < children; ++i) {
      origins.push_back(origin());
      node(5);
    }
    // Of two children at one place OpenVDB drops the first, but the file has buffers for both.
    std::sort(origins.begin(), origins.end());
    if (std::adjacent_find(origins.begin(), origins.end()) != origins.end()) damaged();
  }

  std::array<int32_t, 3> origin() {
    const auto at = in_.read<std::array<int32_t, 3>>();
    for (int32_t x : at)
      if ((x & 4095) != 0) damaged();
    return at;
  }

  // An inner node of 2^(3 log2) children or values: 32^3 above 16^3 above leaves.
  void node(int log2) {
    const size_t count = size_t{1} << (3 * log2);
    const size_t children = Bits(in_, count).on();
    values(count, Bits(in_, count));
    for (size_t i = 0; i < children; ++i) {
      if (log2 == 5)
        node(4);
      else
        leaf();
    }
  }

  void leaf() {
    in_.take(512 / 8);
    ++leaves_;
  }

  void values(size_t count, const Bits& active) {
    const auto inactive = in_.read<uint8_t>();
    if (inactive > allStored) damaged();
    if (inactive == oneValue || inactive == maskAndOneValue) in_.take(encoding_.valueSize);
    if (inactive == maskAndTwoValues) in_.take(2 * encoding_.valueSize);
    if (inactive == mask || inactive == maskAndOneValue || inactive == maskAndTwoValues) in_.take(count / 8);
    const bool packed = (encoding_.compression & VdbEncoding::activeMask) != 0 && inactive != allStored;
    array(packed ? active.on() : count);
  }

  void array(size_t count) {
    const bool half = encoding_.storedSize < encoding_.valueSize && encoding_.storedSize == 2;
    if (half && count == 0) return;  // the reader of halves skips even the length then
    const size_t bytes = count * encoding_.storedSize;
    if ((encoding_.compression & (VdbEncoding::zip | VdbEncoding::blosc)) == 0) {
      in_.take(bytes);
      return;
    }
    const auto length = in_.read<int64_t>();
    if (length <= 0) {  // stored as they are
      if (static_cast<uint64_t>(-(length + 1)) + 1 != bytes) damaged();
      in_.take(bytes);
      return;
    }
    const std::byte* chunk = in_.take(static_cast<size_t>(length));
    if ((encoding_.compression & VdbEncoding::blosc) != 0) requireWholeBlosc(chunk, static_cast<size_t>(length));
  }

  ByteReader in_;
  VdbEncoding encoding_;
  size_t leaves_ = 0;
};

}  // namespace

void requireWholeBlosc(const std::byte* chunk, size_t size) {
  ByteReader header(chunk, size, std::min<size_t>(size, 12));
  if (header.read<uint32_t>() != size) damaged();
}

void requireSoundTree(const AlignedBytes& file, size_t offset, const VdbEncoding& encoding) {
  Walk(file, offset, encoding).tree();
}

}  // namespace virga
