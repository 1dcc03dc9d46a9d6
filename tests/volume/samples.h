// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "core/transform.h"

namespace virga::test {

/// A folder of its own for a test's files, removed with it.
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

std::vector<char> bytesOf(const std::filesystem::path& path);
void writeBytes(const std::filesystem::path& path, const std::vector<char>& bytes);

/// A box of voxels (inclusive) with one value. Boxes that cover 8^3 blocks become tiles.
struct Fill {
  std::array<int, 3> lo, hi;
  float value;
  bool active = true;
};

struct SampleGrid {
  enum class Type { floats, halves, doubles, vectors, integers, booleans };
  enum class Transform { affine, frustum };

  std::string name = "density";
  Type type = Type::floats;
  bool levelSet = false;
  float background = 0;
  std::vector<Fill> fills;  ///< of floats, halves and doubles; grids of other types are empty
  Matrix4 indexToWorld;
  Transform transform = Transform::affine;

  /// What the grid holds at a voxel; inactive ones count as background.
  float at(int x, int y, int z) const;
  /// Trilinear, in double, from at().
  double interpolated(double x, double y, double z) const;
};

void writeVdbSample(const std::filesystem::path& path, const std::vector<SampleGrid>& grids);

enum class NvdbCodec { none, zip, blosc };
enum class NvdbChecksum { full, none };
void writeNvdbSample(const std::filesystem::path& path, const SampleGrid& grid, NvdbCodec codec,
                     NvdbChecksum checksum = NvdbChecksum::full);
/// The bare grid, as newer writers put it into a file.
void writeRawNvdbSample(const std::filesystem::path& path, const SampleGrid& grid);

/// A lump of differing values with a hole, some voxels apart, and tiles; from -20 to 60 or so along each axis.
SampleGrid lumpyGrid(float background = 0);

/// Numbers that are the same everywhere, in [0, 1).
class Sequence {
 public:
  explicit Sequence(unsigned seed) : state_(seed * 2654435761u + 1) {}
  unsigned bits() {
    state_ ^= state_ << 13, state_ ^= state_ >> 17, state_ ^= state_ << 5;
    return state_;
  }
  double next() { return (bits() >> 8) * 0x1p-24; }
  int below(int n) { return static_cast<int>(next() * n); }

 private:
  unsigned state_;
};

}  // namespace virga::test
