// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <span>

#include "methods/pixels.h"

namespace virga {

struct PixelAt {
  int x, y;
};

/// Groups of pixels that are near each other, but not neighbours: a tile of 16 x 16 pixels is 16 cells of 4 x 4, and a
/// group has one pixel of each cell, so that errors that its pixels have in common make no spots. Which one, and where
/// the tiles begin, is another matter in each pass: `key` says.
class PixelGroups {
 public:
  static constexpr int kCells = 4, kCell = 4;  ///< a tile's width in cells, and a cell's in pixels
  static constexpr int kTile = kCells * kCell, kMostPixels = kCells * kCells, kGroups = kCell * kCell;

  PixelGroups(int width, int height, uint64_t key)
      : width_(width),
        height_(height),
        key_(hash64(key)),
        shiftX_(static_cast<int>(key_ % kTile)),
        shiftY_(static_cast<int>(key_ / kTile % kTile)) {}

  int tilesX() const { return (width_ + shiftX_ + kTile - 1) / kTile; }
  int tilesY() const { return (height_ + shiftY_ + kTile - 1) / kTile; }

  /// Group `group` < kGroups of a tile; fewer than kMostPixels, even none, at the picture's edges.
  std::span<const PixelAt> group(int64_t tile, int group, std::array<PixelAt, kMostPixels>& pixels) const {
    const int x0 = static_cast<int>(tile % tilesX()) * kTile - shiftX_;
    const int y0 = static_cast<int>(tile / tilesX()) * kTile - shiftY_;
    size_t count = 0;
    for (int cell = 0; cell < kCells * kCells; ++cell) {
      const uint64_t hash = hash64(key_ ^ hash64(static_cast<uint64_t>(tile * kMostPixels + cell)));
      const int place = static_cast<int>((static_cast<uint64_t>(group) + hash) % kGroups);
      const int x = x0 + cell % kCells * kCell + place % kCell, y = y0 + cell / kCells * kCell + place / kCell;
      if (x >= 0 && x < width_ && y >= 0 && y < height_) pixels[count++] = {x, y};
    }
    return {pixels.data(), count};
  }

 private:
  int width_, height_;
  uint64_t key_;
  int shiftX_, shiftY_;
};

/// body(pixels) for each group that has any, tile by tile on all threads; returns early when it shall stop.
template <class Body>
void forEachGroup(const PixelGroups& groups, const std::stop_token& stop, const Body& body) {
  parallelFor(int64_t{groups.tilesX()} * groups.tilesY(), 1, [&](int64_t tile) {
    std::array<PixelAt, PixelGroups::kMostPixels> storage;
    for (int g = 0; g < PixelGroups::kGroups && !stop.stop_requested(); ++g)
      if (const auto pixels = groups.group(tile, g, storage); !pixels.empty()) body(pixels);
  });
}

}  // namespace virga
