// SPDX-License-Identifier: Apache-2.0
#include "volume/vol_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <sstream>

#include "core/atomic_write.h"

namespace virga {
namespace {

constexpr char kMagic[] = {'V', 'O', 'L'};
constexpr int kFloat32 = 1;
constexpr int kVersion = 3;

std::vector<float> floatsOf(const VolFile& file) {
  std::vector<float> values(file.voxels() * static_cast<size_t>(file.channels));
  std::memcpy(values.data(), file.values, values.size() * sizeof(float));
  return values;
}

// The dimensions are believed only as far as the file has bytes for them.
void requireSize(const VolFile& file, size_t bytes) {
  double needed = sizeof(float);
  for (int n : {file.nx, file.ny, file.nz, file.channels}) {
    if (n < 1)
      throw Error(
          fmt::format("header says {} x {} x {} voxels of {} channels", file.nx, file.ny, file.nz, file.channels));
    needed *= n;
  }
  if (needed != static_cast<double>(bytes))
    throw Error(fmt::format("header says {} x {} x {} voxels of {} channels, which take {:.0f} bytes, but {} follow",
                            file.nx, file.ny, file.nz, file.channels, needed, bytes));
}

template <class T>
void put(std::ostream& out, T value) {
  out.write(reinterpret_cast<const char*>(&value), sizeof(T));
}

// World box of an axis-aligned volume.
Bounds axisAlignedBounds(const DenseVolume& volume) {
  const Matrix4& m = volume.indexToWorld;
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column)
      if (row == column ? !(m(row, column) > 0) : m(row, column) != 0)
        throw Error("a .vol file holds axis-aligned boxes only");
  const Affine map(m);
  Bounds box;
  box.extend(map.point(Vec3(-0.5f)));
  box.extend(map.point(
      Vec3(static_cast<float>(volume.nx), static_cast<float>(volume.ny), static_cast<float>(volume.nz)) - Vec3(0.5f)));
  return box;
}

// The transform that puts the voxels where the file's box says.
Matrix4 indexToBox(const VolFile& file) {
  const Vec3 lo = file.bounds.lo, extent = file.bounds.extent();
  const double dx = static_cast<double>(extent.x) / file.nx, dy = static_cast<double>(extent.y) / file.ny,
               dz = static_cast<double>(extent.z) / file.nz;
  return Matrix4::translation(static_cast<double>(lo.x) + 0.5 * dx, static_cast<double>(lo.y) + 0.5 * dy,
                              static_cast<double>(lo.z) + 0.5 * dz) *
         Matrix4::scaling(dx, dy, dz);
}

std::string problemOf(const AlignedBytes& bytes) try {
  loadVol(bytes, {}, {});
  return "";
} catch (const Error& e) {
  return e.message();
}

}  // namespace

void requireSoundBox(const VolFile& file) {
  const Bounds& b = file.bounds;
  const Vec3 extent = b.extent();
  if (isFinite(b.lo) && isFinite(b.hi) && isFinite(extent) && minComponent(extent) > 0) return;
  throw Error(fmt::format("header says a box from ({:g}, {:g}, {:g}) to ({:g}, {:g}, {:g}), which has no volume",
                          b.lo.x, b.lo.y, b.lo.z, b.hi.x, b.hi.y, b.hi.z),
              {{}, "leave out \"use_grid_bbox\" and place the grid by \"to_world\"", {}});
}

bool isVol(const AlignedBytes& bytes) {
  return bytes.size() >= sizeof(kMagic) && std::memcmp(bytes.data(), kMagic, sizeof(kMagic)) == 0;
}

int volChannels(std::istream& in) {
  struct Header {
    char magic[3];
    uint8_t version;
    int32_t type, dimensions[3], channels;
  } header{};
  static_assert(sizeof(Header) == 24);
  in.read(reinterpret_cast<char*>(&header), sizeof header);
  return in && std::memcmp(header.magic, kMagic, sizeof kMagic) == 0 ? header.channels : 0;
}

VolFile parseVol(const AlignedBytes& bytes) {
  ByteReader in(bytes.data(), bytes.size(), sizeof(kMagic));
  const int version = in.read<uint8_t>();
  if (version != kVersion)
    throw Error(fmt::format("has version {} of the .vol format; only {} is known", version, kVersion));
  const int type = in.read<int32_t>();
  if (type != kFloat32)
    throw Error(fmt::format("has values of .vol type {}; only {} (float32) is known", type, kFloat32));
  VolFile file;
  file.nx = in.read<int32_t>(), file.ny = in.read<int32_t>(), file.nz = in.read<int32_t>();
  file.channels = in.read<int32_t>();
  const auto box = in.read<std::array<float, 6>>();
  file.bounds = {{box[0], box[1], box[2]}, {box[3], box[4], box[5]}};
  requireSize(file, in.left());
  file.values = in.take(in.left());
  return file;
}

std::shared_ptr<const Grid> loadVol(const AlignedBytes& bytes, const VolumeRequest& request,
                                    const GridOptions& options) {
  if (!request.grid.empty())
    throw Error(fmt::format("no grid \"{}\": the grid of a .vol file has no name", request.grid));
  const VolFile file = parseVol(bytes);
  if (file.channels != 1) throw Error(fmt::format("has {} channels where one is wanted", file.channels));
  return Grid::dense(file.nx, file.ny, file.nz, floatsOf(file), options);
}

RgbGrid loadRgbVol(const AlignedBytes& bytes) {
  const VolFile file = parseVol(bytes);
  if (file.channels != 1 && file.channels != 3)
    throw Error(fmt::format("has {} channels where 3 or 1 are wanted", file.channels));
  if (file.channels == 1) return RgbGrid::grey(file.nx, file.ny, file.nz, floatsOf(file));
  std::vector<Rgb> colours(file.voxels());
  std::memcpy(colours.data(), file.values, colours.size() * sizeof(Rgb));  // no third copy of what may be large
  return RgbGrid(file.nx, file.ny, file.nz, std::move(colours));
}

GridInfo volInfo(const AlignedBytes& bytes) {
  const VolFile file = parseVol(bytes);
  GridInfo info;
  info.kind = "fog volume", info.valueType = "float", info.format = "vol 3";
  info.problem = problemOf(bytes);
  const std::vector<float> values = floatsOf(file);  // not while a grid has its own of them
  info.activeVoxels = file.voxels();
  info.indexHi = {file.nx - 1, file.ny - 1, file.nz - 1};
  info.worldBounds = file.bounds;
  info.indexToWorld = indexToBox(file);
  info.bytes = values.size() * sizeof(float);
  const auto [lo, hi] = std::minmax_element(values.begin(), values.end());
  const double sum = std::accumulate(values.begin(), values.end(), 0.0);
  if (!std::isfinite(sum)) return info;
  info.valuesKnown = true;
  info.minimum = *lo, info.maximum = *hi;
  info.mean = static_cast<float>(sum / static_cast<double>(values.size()));
  return info;
}

void writeVol(const std::filesystem::path& path, const DenseVolume& volume) {
  const Bounds box = axisAlignedBounds(volume);
  std::ostringstream out;
  out.write(kMagic, sizeof(kMagic));
  put(out, static_cast<uint8_t>(kVersion));
  for (int32_t n : {kFloat32, volume.nx, volume.ny, volume.nz, 1}) put(out, n);
  for (float x : {box.lo.x, box.lo.y, box.lo.z, box.hi.x, box.hi.y, box.hi.z}) put(out, x);
  out.write(reinterpret_cast<const char*>(volume.values.data()),
            static_cast<std::streamsize>(volume.values.size() * sizeof(float)));
  writeAtomically(path, std::move(out).str());
}

}  // namespace virga
