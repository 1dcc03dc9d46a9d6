// SPDX-License-Identifier: Apache-2.0
#include "volume/nvdb_file.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>

#include "core/large_array.h"
#include "volume/grid_factory.h"
#include "volume/grid_listing.h"
#include "volume/vdb_module.h"

namespace virga {
namespace {

constexpr uint64_t kMagic = 0x304244566f6e614eUL;      // "NanoVDB0": a file of segments, or a grid in memory
constexpr uint64_t kGridMagic = 0x314244566f6e614eUL;  // "NanoVDB1": a grid in memory, also written to files as it is
constexpr uint64_t kFileMagic = 0x324244566f6e614eUL;  // "NanoVDB2": a file of segments

enum class Codec : uint16_t { none, zip, blosc };

// Start of a segment and of each grid in it, as they lie in a file.
struct SegmentHeader {
  uint64_t magic;
  uint32_t version;
  uint16_t gridCount;
  uint16_t codec;
};
static_assert(sizeof(SegmentHeader) == 16);

struct GridHeader {
  uint64_t gridSize, fileSize, nameKey, voxelCount;
  uint32_t gridType, gridClass;
  std::array<double, 6> worldBox;
  std::array<int32_t, 6> indexBox;
  std::array<double, 3> voxelSize;
  uint32_t nameSize;
  std::array<uint32_t, 4> nodeCount;
  std::array<uint32_t, 3> tileCount;
  uint16_t codec, padding;
  uint32_t version;
};
static_assert(sizeof(GridHeader) == 176);

struct Entry {
  std::string name;
  uint32_t gridType, version;
  Codec codec;
  uint64_t gridSize;  // in memory, as the header has it: checked before anything is allocated
  const std::byte* data;
  uint64_t dataSize;
};

uint32_t majorOf(uint32_t version) { return version >> 21; }
uint32_t minorOf(uint32_t version) { return (version >> 10) & 2047; }

std::string versionText(uint32_t version) {
  return fmt::format("{}.{}.{}", majorOf(version), minorOf(version), version & 1023);
}

void requireVersion(uint32_t version) {
  if (majorOf(version) != NANOVDB_MAJOR_VERSION_NUMBER)
    throw Error(fmt::format("has version {} of NanoVDB's format; only {}.x is known", versionText(version),
                            NANOVDB_MAJOR_VERSION_NUMBER));
}

// One segment: its header, the headers of its grids, then their data.
void parseSegment(ByteReader& in, std::vector<Entry>& entries) {
  const auto header = in.read<SegmentHeader>();
  if (header.magic != kMagic && header.magic != kFileMagic) throw Error("file is truncated or damaged");
  requireVersion(header.version);
  if (header.codec > static_cast<uint16_t>(Codec::blosc))
    throw Error(fmt::format("is compressed by codec {}, which is not known", header.codec));
  const size_t first = entries.size();
  std::vector<uint64_t> sizes;
  for (int i = 0; i < header.gridCount; ++i) {
    const auto grid = in.read<GridHeader>();
    std::string name = in.text(grid.nameSize);
    name.resize(std::min(name.size(), name.find('\0')));
    entries.push_back({std::move(name), grid.gridType, header.version, static_cast<Codec>(header.codec), grid.gridSize,
                       nullptr, grid.fileSize});
  }
  for (size_t i = first; i < entries.size(); ++i) entries[i].data = in.take(entries[i].dataSize);
}

// Grids in memory, one after the other.
void parseRawGrid(ByteReader& in, std::vector<Entry>& entries) {
  const std::byte* start = in.take(0);
  nanovdb::GridData grid = in.read<nanovdb::GridData>();
  if (grid.mMagic != kGridMagic || grid.mGridSize < sizeof(grid)) throw Error("file is truncated or damaged");
  requireVersion(grid.mVersion.id());
  in.take(grid.mGridSize - sizeof(grid));
  const std::string name(grid.mGridName, strnlen(grid.mGridName, sizeof(grid.mGridName)));
  entries.push_back({name, static_cast<uint32_t>(grid.mGridType), grid.mVersion.id(), Codec::none, grid.mGridSize,
                     start, grid.mGridSize});
}

std::vector<Entry> parse(const AlignedBytes& bytes) {
  std::vector<Entry> entries;
  ByteReader in(bytes.data(), bytes.size());
  const bool raw = ByteReader(bytes.data(), bytes.size()).read<uint64_t>() == kGridMagic;
  while (in.left() > 0) raw ? parseRawGrid(in, entries) : parseSegment(in, entries);
  return entries;
}

std::vector<std::string> namesOf(const std::vector<Entry>& entries) {
  std::vector<std::string> names;
  for (const Entry& entry : entries) names.push_back(entry.name);
  return uniqueNames(names);
}

[[noreturn]] void damaged(const Entry& entry, const std::string& what) {
  throw Error(fmt::format("grid \"{}\" {}", entry.name, what));
}

void unzip(const Entry& entry, AlignedBytes& out) {
  ByteReader in(entry.data, entry.dataSize);
  const auto size = in.read<uint64_t>();
  uLongf expanded = out.size();
  const std::byte* data = in.take(size);
  const int status =
      uncompress(reinterpret_cast<Bytef*>(out.data()), &expanded, reinterpret_cast<const Bytef*>(data), size);
  if (status != Z_OK || expanded != out.size()) damaged(entry, "cannot be unzipped: file is damaged");
}

void unblosc(const Entry& entry, AlignedBytes& out) {
  constexpr size_t kChunk = size_t{1} << 30;
  ByteReader in(entry.data, entry.dataSize);
  for (size_t at = 0; at < out.size(); at += kChunk) {
    const auto size = in.read<uint64_t>();
    const std::byte* data = in.take(size);
    if (!vdbModule().expandBlosc(data, size, out.data() + at, std::min(kChunk, out.size() - at)))
      damaged(entry, "cannot be decompressed: file is damaged");
  }
}

// No codec packs tighter than this, so a header that claims more lies: nothing is allocated for it.
uint64_t mostBytes(const Entry& entry) {
  constexpr uint64_t kZip = 1040, kBlosc = 300;
  switch (entry.codec) {
    case Codec::none:
      return entry.dataSize;
    case Codec::zip:
      return entry.dataSize * kZip;
    case Codec::blosc:
      return entry.dataSize * kBlosc;
  }
  return 0;
}

uint32_t crc(uint32_t sum, const void* data, size_t size) {
  return static_cast<uint32_t>(crc32_z(sum, static_cast<const Bytef*>(data), size));
}

// Offsets of the nodes of each level (0 leaves, 1 lower, 2 upper).
using NodeOffsets = std::array<std::vector<size_t>, 3>;

NodeOffsets nodeOffsets(const nanovdb::FloatGrid& grid) {
  NodeOffsets offsets;
  const auto note = [&](size_t level, const auto* node) {
    offsets[level].push_back(
        static_cast<size_t>(reinterpret_cast<const char*>(node) - reinterpret_cast<const char*>(&grid)));
  };
  for (auto upper = grid.tree().root().beginChild(); upper; ++upper) {
    note(2, &*upper);
    for (auto lower = upper->beginChild(); lower; ++lower) {
      note(1, &*lower);
      for (auto leaf = lower->beginChild(); leaf; ++leaf) note(0, &*leaf);
    }
  }
  for (auto& level : offsets) std::sort(level.begin(), level.end());
  return offsets;
}

// Checksum of the checksums of the nodes: upper, lower, leaves, each in the order of memory, as 64-bit words.
uint32_t nodesChecksum(const nanovdb::FloatGrid& grid) {
  const size_t sizes[] = {sizeof(nanovdb::NanoLeaf<float>), sizeof(nanovdb::NanoLower<float>),
                          sizeof(nanovdb::NanoUpper<float>)};
  const NodeOffsets offsets = nodeOffsets(grid);
  std::vector<uint64_t> sums;
  for (size_t level : {2, 1, 0})
    for (size_t offset : offsets[level])
      sums.push_back(crc(0, reinterpret_cast<const char*>(&grid) + offset, sizes[level]));
  return crc(0, sums.data(), sums.size() * sizeof(uint64_t));
}

// The first half of the checksum covers what precedes the nodes, the second the nodes; either may be absent. Only
// layouts up to 32.4 compute it like this.
bool checksumHolds(const nanovdb::FloatGrid& grid) {
  const auto* data = reinterpret_cast<const nanovdb::GridData*>(&grid);
  const auto head = static_cast<uint32_t>(data->mChecksum), nodes = static_cast<uint32_t>(data->mChecksum >> 32);
  if (data->mVersion.getMinor() > 4 || head == ~0u) return true;
  const size_t size = sizeof(nanovdb::GridData) + sizeof(nanovdb::TreeData<3>) + grid.tree().root().memUsage();
  if (crc(0, reinterpret_cast<const Bytef*>(data) + 16, size - 16) != head) return false;
  return nodes == ~0u || nodesChecksum(grid) == nodes;
}

std::string typeName(uint32_t type) {
  return type < static_cast<uint32_t>(nanovdb::GridType::End) ? nanovdb::toStr(static_cast<nanovdb::GridType>(type))
                                                              : "?";
}

AlignedBytes extract(const Entry& entry) {
  if (entry.gridType != static_cast<uint32_t>(nanovdb::GridType::Float))
    damaged(entry, fmt::format("holds values of type {}; only float can be a density", typeName(entry.gridType)));
  if (entry.gridSize > mostBytes(entry)) damaged(entry, "is larger than its data: file is truncated or damaged");
  AlignedBytes out(entry.gridSize);
  switch (entry.codec) {
    case Codec::none:
      std::memcpy(out.data(), entry.data, out.size());
      break;
    case Codec::zip:
      unzip(entry, out);
      break;
    case Codec::blosc:
      unblosc(entry, out);
      break;
  }
  return out;
}

AlignedBytes validTree(const Entry& entry) {
  AlignedBytes bytes = extract(entry);
  const std::string fault = faultOfTree(bytes.data(), bytes.size());
  if (!fault.empty()) damaged(entry, fault + ": file is damaged");
  if (!checksumHolds(*reinterpret_cast<const nanovdb::FloatGrid*>(bytes.data())))
    damaged(entry, "does not match its checksum: file is damaged");
  return bytes;
}

AlignedBytes chosenTree(const AlignedBytes& bytes, const VolumeRequest& request) {
  const std::vector<Entry> entries = parse(bytes);
  const std::vector<std::string> names = namesOf(entries);
  const size_t chosen = chooseGrid(names, request);
  AlignedBytes tree = validTree(entries[chosen]);
  requireFog(names[chosen], reinterpret_cast<const nanovdb::FloatGrid*>(tree.data())->gridClass());
  return tree;
}

}  // namespace

bool isNvdb(const AlignedBytes& bytes) {
  if (bytes.size() < sizeof(uint64_t)) return false;
  const auto magic = ByteReader(bytes.data(), bytes.size()).read<uint64_t>();
  return magic == kMagic || magic == kGridMagic || magic == kFileMagic;
}

std::shared_ptr<const Grid> loadNvdb(AlignedBytes bytes, const VolumeRequest& request, const GridOptions& options) {
  AlignedBytes tree = chosenTree(bytes, request);
  bytes = {};  // not while a dense grid is made of the tree
  returnFreedMemory();
  return GridFactory::tree(std::move(tree), options);
}

std::vector<GridInfo> nvdbInfo(const AlignedBytes& bytes) {
  const char* const codecs[] = {"", ", zip", ", blosc"};
  const std::vector<Entry> entries = parse(bytes);
  const std::vector<std::string> names = namesOf(entries);
  std::vector<GridInfo> list;
  for (size_t i = 0; i < entries.size(); ++i) {
    const Entry& entry = entries[i];
    GridInfo& info = list.emplace_back();
    info.name = names[i];
    info.kind = "unknown";
    info.valueType = typeName(entry.gridType);
    info.format = fmt::format("nvdb {}{}", versionText(entry.version), codecs[static_cast<size_t>(entry.codec)]);
    try {
      AlignedBytes tree = validTree(entry);
      describeTree(*reinterpret_cast<nanovdb::FloatGrid*>(tree.data()), tree.size(), info);
    } catch (const Error& e) {
      info.problem = e.message();
    }
  }
  return list;
}

}  // namespace virga
