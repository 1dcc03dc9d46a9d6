// SPDX-License-Identifier: Apache-2.0
#include "volume/grid_listing.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "core/error.h"

namespace virga {
namespace {

const char* kindName(nanovdb::GridClass kind) {
  switch (kind) {
    case nanovdb::GridClass::LevelSet:
      return "level set";
    case nanovdb::GridClass::FogVolume:
      return "fog volume";
    case nanovdb::GridClass::Staggered:
      return "staggered";
    default:
      return "unknown";
  }
}

std::array<int64_t, 3> arrayOf(nanovdb::Coord c) { return {c.x(), c.y(), c.z()}; }

Bounds worldBounds(const GridInfo& info) {
  const auto corner = [&](int bits, int axis) {
    const auto a = static_cast<size_t>(axis);
    return (bits >> axis & 1) != 0 ? static_cast<double>(info.indexHi[a]) + 0.5
                                   : static_cast<double>(info.indexLo[a]) - 0.5;
  };
  Bounds box;
  for (int bits = 0; bits < 8; ++bits) {
    std::array<float, 3> p{};
    for (int row = 0; row < 3; ++row) {
      double sum = info.indexToWorld(row, 3);
      for (int axis = 0; axis < 3; ++axis) sum += info.indexToWorld(row, axis) * corner(bits, axis);
      p[static_cast<size_t>(row)] = static_cast<float>(sum);
    }
    box.extend(Vec3(p[0], p[1], p[2]));
  }
  return box;
}

std::string problemOf(const TreeContent& content, const GridInfo& info, nanovdb::GridClass kind) try {
  requireFog(info.name, kind);
  content.requireSound();
  if (!info.indexToWorld.isFinite() || info.indexToWorld.isSingular())
    return "grid has a transform that cannot be inverted";
  return "";
} catch (const Error& e) {
  return e.message();
}

}  // namespace

std::vector<std::string> uniqueNames(const std::vector<std::string>& names) {
  std::map<std::string, int> seen;
  std::vector<std::string> unique;
  for (const std::string& name : names) {
    const int n = seen[name]++;
    unique.push_back(n == 0 ? name : fmt::format("{}[{}]", name, n));
  }
  return unique;
}

size_t chooseGrid(const std::vector<std::string>& names, const VolumeRequest& request) {
  if (names.empty()) throw Error("file has no grids");
  if (request.grid.empty() && names.size() == 1) return 0;
  const std::string wanted = request.grid.empty() ? "density" : request.grid;
  const auto found = std::find(names.begin(), names.end(), wanted);
  if (found != names.end()) return static_cast<size_t>(found - names.begin());
  const std::vector<std::string> notes{"available: " + joined(names)};
  if (request.grid.empty())
    throw Error(fmt::format("file has {} grids and none is called \"density\"; say which", names.size()),
                {{}, "", notes});
  throw Error(fmt::format("no grid \"{}\"", wanted), {{}, didYouMean(wanted, names), notes});
}

void requireFog(const std::string& name, nanovdb::GridClass kind) {
  if (kind == nanovdb::GridClass::LevelSet)
    throw Error(fmt::format(
        "grid \"{}\" is a level set (distances to a surface), not a density; convert it to a fog volume", name));
}

void describeTree(nanovdb::FloatGrid& grid, size_t bytes, GridInfo& info) {
  const TreeContent content = takeStock(grid);
  const nanovdb::Map& map = grid.map();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) info.indexToWorld(row, column) = map.mMatD[3 * row + column];
    info.indexToWorld(row, 3) = map.mVecD[row];
  }
  info.kind = kindName(grid.gridClass());
  info.bytes = bytes;
  info.activeVoxels = content.activeVoxels;
  info.problem = problemOf(content, info, grid.gridClass());
  if (content.activeVoxels == 0) return;
  info.indexLo = arrayOf(content.lo), info.indexHi = arrayOf(content.hi);
  info.worldBounds = worldBounds(info);
  if (!std::isfinite(content.sum)) return;
  info.valuesKnown = true;
  info.minimum = content.minimum, info.maximum = content.maximum;
  info.mean = static_cast<float>(content.sum / static_cast<double>(content.activeVoxels));
}

}  // namespace virga
