// SPDX-License-Identifier: Apache-2.0
#include "volume/samples.h"

#define NANOVDB_USE_ZIP
#include <nanovdb/util/IO.h>
#include <nanovdb/util/OpenToNanoVDB.h>
#include <openvdb/io/Compression.h>
#include <openvdb/openvdb.h>
#include <unistd.h>

#include <atomic>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>
#include <sstream>

namespace virga::test {
namespace fs = std::filesystem;
namespace {

openvdb::math::Transform::Ptr transformOf(const SampleGrid& sample) {
  if (sample.transform == SampleGrid::Transform::frustum)
    return openvdb::math::Transform::createFrustumTransform(openvdb::BBoxd({0, 0, 0}, {10, 10, 10}), 0.5, 10);
  openvdb::Mat4R m;
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 4; ++column) m(column, row) = sample.indexToWorld(row, column);
  return openvdb::math::Transform::createLinearTransform(m);
}

template <class GridType>
openvdb::GridBase::Ptr filled(const SampleGrid& sample) {
  using Value = typename GridType::ValueType;
  const auto grid = openvdb::gridPtrCast<GridType>(openvdb::GridBase::createGrid(GridType::gridType()));
  grid->tree().root().setBackground(Value(sample.background), false);
  for (const Fill& fill : sample.fills)
    grid->sparseFill(openvdb::CoordBBox(openvdb::Coord(fill.lo.data()), openvdb::Coord(fill.hi.data())),
                     Value(fill.value), fill.active);
  return grid;
}

// What no density may be stays empty: by name the library makes it, and its trees need not be compiled here.
openvdb::GridBase::Ptr valuesOf(const SampleGrid& sample) {
  switch (sample.type) {
    case SampleGrid::Type::doubles:
      return filled<openvdb::DoubleGrid>(sample);
    case SampleGrid::Type::vectors:
      return openvdb::GridBase::createGrid("Tree_vec3s_5_4_3");
    case SampleGrid::Type::integers:
      return openvdb::GridBase::createGrid("Tree_int32_5_4_3");
    case SampleGrid::Type::booleans:
      return openvdb::GridBase::createGrid("Tree_bool_5_4_3");
    default:
      return filled<openvdb::FloatGrid>(sample);
  }
}

openvdb::GridBase::Ptr gridOf(const SampleGrid& sample) {
  openvdb::initialize();
  const openvdb::GridBase::Ptr grid = valuesOf(sample);
  grid->setName(sample.name);
  grid->setTransform(transformOf(sample));
  grid->setGridClass(sample.levelSet ? openvdb::GRID_LEVEL_SET : openvdb::GRID_FOG_VOLUME);
  grid->setSaveFloatAsHalf(sample.type == SampleGrid::Type::halves);
  return grid;
}

nanovdb::GridHandle<> nanoOf(const SampleGrid& sample, NvdbChecksum checksum) {
  const auto grid = openvdb::gridPtrCast<openvdb::FloatGrid>(gridOf(sample));
  return nanovdb::openToNanoVDB(
      *grid, nanovdb::StatsMode::All,
      checksum == NvdbChecksum::full ? nanovdb::ChecksumMode::Full : nanovdb::ChecksumMode::Disable);
}

// NanoVDB's writer knows Blosc only with its headers there; OpenVDB's stream writer makes the same chunk.
std::vector<char> packedWithBlosc(const std::vector<char>& file, size_t gridSize) {
  const size_t head = file.size() - gridSize;
  std::ostringstream chunk;
  openvdb::io::bloscToStream(chunk, file.data() + head, 4, gridSize / 4);
  const std::string packed = chunk.str();
  std::vector<char> out(file.begin(), file.begin() + static_cast<std::ptrdiff_t>(head));
  const uint16_t codec = 2;
  const uint64_t fileSize = packed.size();
  std::memcpy(out.data() + 14, &codec, sizeof(codec));
  std::memcpy(out.data() + 16 + 8, &fileSize, sizeof(fileSize));
  out.insert(out.end(), packed.begin(), packed.end());
  return out;
}

}  // namespace

TemporaryFolder::TemporaryFolder() {
  static std::atomic<int> count{0};
  path_ = fs::temp_directory_path() / ("virga_volume_" + std::to_string(::getpid()) + "_" + std::to_string(count++));
  fs::create_directories(path_);
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

std::vector<char> bytesOf(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

void writeBytes(const fs::path& path, const std::vector<char>& bytes) {
  std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

float SampleGrid::at(int x, int y, int z) const {
  for (auto fill = fills.rbegin(); fill != fills.rend(); ++fill)
    if (x >= fill->lo[0] && y >= fill->lo[1] && z >= fill->lo[2] && x <= fill->hi[0] && y <= fill->hi[1] &&
        z <= fill->hi[2])
      return fill->active ? fill->value : background;
  return background;
}

double SampleGrid::interpolated(double x, double y, double z) const {
  const int i = static_cast<int>(std::floor(x)), j = static_cast<int>(std::floor(y)),
            k = static_cast<int>(std::floor(z));
  double sum = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const int dx = corner & 1, dy = corner >> 1 & 1, dz = corner >> 2;
    const double weight = (1 - std::fabs(x - i - dx)) * (1 - std::fabs(y - j - dy)) * (1 - std::fabs(z - k - dz));
    sum += weight * static_cast<double>(at(i + dx, j + dy, k + dz));
  }
  return sum;
}

void writeVdbSample(const fs::path& path, const std::vector<SampleGrid>& grids) {
  openvdb::GridPtrVec all;
  for (const SampleGrid& grid : grids) all.push_back(gridOf(grid));
  openvdb::io::File(path.string()).write(all);
}

void writeNvdbSample(const fs::path& path, const SampleGrid& grid, NvdbCodec codec, NvdbChecksum checksum) {
  const auto handle = nanoOf(grid, checksum);
  nanovdb::io::writeGrid(path.string(), handle,
                         codec == NvdbCodec::zip ? nanovdb::io::Codec::ZIP : nanovdb::io::Codec::NONE);
  if (codec == NvdbCodec::blosc) writeBytes(path, packedWithBlosc(bytesOf(path), handle.size()));
}

void writeRawNvdbSample(const fs::path& path, const SampleGrid& grid) {
  const auto handle = nanoOf(grid, NvdbChecksum::full);
  std::vector<char> bytes(handle.size());
  std::memcpy(bytes.data(), handle.data(), bytes.size());
  std::memcpy(bytes.data(), "NanoVDB1", 8);
  writeBytes(path, bytes);
}

SampleGrid lumpyGrid(float background) {
  SampleGrid grid;
  grid.background = background;
  grid.fills.push_back({{16, 16, 16}, {31, 31, 31}, 0.7f});        // tiles of 8^3
  grid.fills.push_back({{20, 20, 20}, {22, 22, 22}, 9.f, false});  // a hole with values in it that do not count
  Sequence random(5);
  for (int n = 0; n < 700; ++n) {
    const std::array<int, 3> at{random.below(30) - 10, random.below(24) - 8, random.below(20) - 4};
    grid.fills.push_back({at, at, static_cast<float>(random.next()) * 3});
  }
  grid.fills.push_back({{55, -20, 7}, {55, -20, 7}, 2.5f});
  return grid;
}

}  // namespace virga::test
