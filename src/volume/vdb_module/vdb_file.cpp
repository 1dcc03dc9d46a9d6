// SPDX-License-Identifier: Apache-2.0
#include "volume/vdb_module.h"

// The only file that sees OpenVDB: its templates take long to compile.
#define NANOVDB_USE_ZIP
#include <fmt/format.h>
#include <nanovdb/util/IO.h>
#include <nanovdb/util/OpenToNanoVDB.h>
#include <openvdb/io/Archive.h>
#include <openvdb/io/Compression.h>
#include <openvdb/io/GridDescriptor.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/Dense.h>
#include <openvdb/util/logging.h>

#include <mutex>
#include <sstream>

#include "core/byte_hash.h"
#include "core/large_array.h"
#include "volume/grid_factory.h"
#include "volume/grid_listing.h"
#include "volume/vdb_module/memory_stream.h"
#include "volume/vdb_module/vdb_walk.h"

namespace virga {
namespace {

constexpr uint32_t kOldestVersion = 222;

void initialiseOnce() {
  static std::once_flag once;
  std::call_once(once, [] {
    openvdb::logging::setLevel(openvdb::logging::Level::Fatal);
    openvdb::initialize();
  });
}

[[noreturn]] void damaged() { throw Error("file is truncated or damaged"); }

struct Entry {
  std::string name, type;  // "Tree_float_5_4_3", with "_HalfFloat" where it is stored so
  size_t descriptorAt = 0;
  std::string uniqueName, parent;  // in OpenVDB's spelling; an instance shares its parent's tree
};

// Reads the table of contents by itself, because OpenVDB believes every length that it finds there.
class ContentsReader {
 public:
  explicit ContentsReader(const AlignedBytes& bytes) : bytes_(bytes), in_(bytes.data(), bytes.size()) { header(); }

  uint32_t version() const { return version_; }
  bool hasOffsets() const { return hasOffsets_; }

  std::vector<Entry> entries() {
    metadata(in_);
    const auto count = in_.read<int32_t>();
    std::vector<Entry> entries;
    for (int32_t i = 0; i < count; ++i) {
      entries.push_back(descriptor());
      if (!hasOffsets_ && count > 1)
        throw Error("holds several grids without a table of contents; rewrite it as a seekable file");
      if (hasOffsets_) in_ = ByteReader(bytes_.data(), bytes_.size(), static_cast<size_t>(end_));
    }
    return entries;
  }

 private:
  void header() {
    if (!isVdb(bytes_)) throw Error("is not a VDB file");
    in_.take(sizeof(int64_t));  // the mark
    version_ = in_.read<uint32_t>();
    if (version_ < kOldestVersion || version_ > openvdb::OPENVDB_FILE_VERSION)
      throw Error(fmt::format("has VDB file version {}; known are {} to {}", version_, kOldestVersion,
                              static_cast<int>(openvdb::OPENVDB_FILE_VERSION)));
    in_.take(2 * sizeof(uint32_t));  // version of the library
    hasOffsets_ = in_.read<char>() != 0;
    in_.take(36);  // UUID
  }

  static std::string text(ByteReader& in) { return in.text(in.read<uint32_t>()); }

  static void metadata(ByteReader& in) {
    const auto count = in.read<uint32_t>();
    for (uint32_t i = 0; i < count; ++i) {
      text(in), text(in);
      in.take(in.read<uint32_t>());
    }
  }

  Entry descriptor() {
    Entry entry;
    entry.descriptorAt = in_.offset();
    entry.uniqueName = text(in_);
    entry.name = openvdb::io::GridDescriptor::stripSuffix(entry.uniqueName);
    entry.type = text(in_);
    entry.parent = text(in_);
    const auto gridAt = in_.read<int64_t>();
    in_.read<int64_t>();
    end_ = in_.read<int64_t>();
    ByteReader grid = hasOffsets_ ? ByteReader(bytes_.data(), bytes_.size(), static_cast<size_t>(gridAt)) : in_;
    if (hasOffsets_ && end_ < static_cast<int64_t>(in_.offset())) damaged();
    checkGrid(grid);
    return entry;
  }

  // The lengths at the start of a grid's own data.
  static void checkGrid(ByteReader& grid) {
    grid.take(sizeof(uint32_t));  // compression
    metadata(grid);
    text(grid);  // name of the transform's type
  }

  const AlignedBytes& bytes_;
  ByteReader in_;
  uint32_t version_ = 0;
  bool hasOffsets_ = false;
  int64_t end_ = 0;
};

class VdbReader : private openvdb::io::Archive {
 public:
  explicit VdbReader(const AlignedBytes& bytes) : bytes_(bytes), stream_(bytes.data(), bytes.size()) {
    initialiseOnce();
    ContentsReader contents(bytes);
    entries_ = contents.entries();
    hasOffsets_ = contents.hasOffsets();
    version_ = contents.version();
    openvdb::io::setStreamMetadataPtr(stream_, metadata_, /*transfer=*/false);
    readHeader(stream_);
    setFormatVersion(stream_);
    setLibraryVersion(stream_);
    setDataCompression(stream_);
  }

  uint32_t version() const { return version_; }
  const std::vector<Entry>& entries() const { return entries_; }

  openvdb::GridBase::Ptr read(const Entry& entry) {
    openvdb::io::GridDescriptor descriptor;
    stream_.clear();
    stream_.seekg(static_cast<std::streamoff>(entry.descriptorAt));
    openvdb::GridBase::Ptr grid = descriptor.read(stream_);
    if (hasOffsets_) descriptor.seekToGrid(stream_);
    readGridCompression(stream_);
    openvdb::io::setGridBackgroundValuePtr(stream_, nullptr);
    grid->readMeta(stream_);
    openvdb::io::setGridClass(stream_, grid->getGridClass());
    grid->readTransform(stream_);
    if (entry.parent.empty()) readTree(*grid);
    if (!entry.parent.empty()) grid->setTree(read(parentOf(entry))->baseTreePtr());
    return grid;
  }

 private:
  void readTree(openvdb::GridBase& grid) {
    VdbEncoding encoding;
    if (grid.isType<openvdb::DoubleGrid>()) encoding.valueSize = sizeof(double);
    encoding.storedSize = grid.saveFloatAsHalf() ? 2 : encoding.valueSize;
    encoding.compression = openvdb::io::getDataCompression(stream_);
    requireSoundTree(bytes_, static_cast<size_t>(stream_.tellg()), encoding);
    grid.readTopology(stream_);
    grid.readBuffers(stream_);
  }

  const Entry& parentOf(const Entry& entry) const {
    for (const Entry& other : entries_)
      if (other.uniqueName == entry.parent && other.parent.empty()) return other;
    damaged();
  }

  const AlignedBytes& bytes_;
  openvdb::SharedPtr<openvdb::io::StreamMetadata> metadata_ = std::make_shared<openvdb::io::StreamMetadata>();
  MemoryStream stream_;  // refers to metadata_
  std::vector<Entry> entries_;
  bool hasOffsets_ = false;
  uint32_t version_ = 0;
};

std::vector<std::string> namesOf(const std::vector<Entry>& entries) {
  std::vector<std::string> names;
  for (const Entry& entry : entries) names.push_back(entry.name);
  return uniqueNames(names);
}

// "float" from "Tree_float_5_4_3".
std::string valueType(const Entry& entry) {
  std::string type = entry.type;
  const bool half = type.ends_with("_HalfFloat");
  if (half) type.resize(type.size() - std::string("_HalfFloat").size());
  if (type.starts_with("Tree_")) type = type.substr(5, type.find('_', 5) - 5);
  return half && type == "float" ? "half" : type;
}

bool isScalar(const Entry& entry) {
  return entry.type.starts_with("Tree_float_5_4_3") || entry.type.starts_with("Tree_double_5_4_3");
}

void requireScalar(const std::string& name, const Entry& entry) {
  if (!isScalar(entry))
    throw Error(fmt::format("grid \"{}\" holds values of type {}; a density needs float, half or double", name,
                            valueType(entry)));
}

void requireLinear(const std::string& name, const openvdb::GridBase& grid) {
  if (!grid.transform().isLinear())
    throw Error(fmt::format("grid \"{}\" has a perspective (frustum) transform; only affine ones are known", name));
}

/// A buffer for NanoVDB whose bytes can be taken out.
class TakenBuffer {
 public:
  TakenBuffer() = default;
  static TakenBuffer create(uint64_t size, const TakenBuffer* = nullptr) {
    TakenBuffer buffer;
    buffer.bytes_ = AlignedBytes(size);
    return buffer;
  }
  uint8_t* data() { return reinterpret_cast<uint8_t*>(bytes_.data()); }
  const uint8_t* data() const { return reinterpret_cast<const uint8_t*>(bytes_.data()); }
  uint64_t size() const { return bytes_.size(); }
  bool empty() const { return bytes_.size() == 0; }
  void clear() { bytes_ = {}; }
  AlignedBytes take() { return std::move(bytes_); }

 private:
  AlignedBytes bytes_;
};

// By name it is the library that makes it: constructors would instantiate all virtual functions of grid and tree here,
// ten seconds to compile.
openvdb::FloatGrid::Ptr emptyGrid() {
  return openvdb::gridPtrCast<openvdb::FloatGrid>(openvdb::GridBase::createGrid(openvdb::FloatGrid::gridType()));
}

openvdb::FloatGrid::Ptr asFloat(const openvdb::GridBase::Ptr& grid) {
  if (auto floats = openvdb::gridPtrCast<openvdb::FloatGrid>(grid)) return floats;
  const auto doubles = openvdb::gridPtrCast<openvdb::DoubleGrid>(grid);
  if (!doubles) damaged();
  const openvdb::FloatGrid::Ptr floats = emptyGrid();
  floats->insertMeta(*doubles);
  floats->setTransform(doubles->transformPtr());
  floats->tree().root() = doubles->tree().root();
  return floats;
}

AlignedBytes nanoTree(const openvdb::GridBase::Ptr& grid) {
  auto handle =
      nanovdb::openToNanoVDB<TakenBuffer>(*asFloat(grid), nanovdb::StatsMode::Disable, nanovdb::ChecksumMode::Disable);
  return handle.buffer().take();
}

// OpenVDB reports ends of file as failures of the stream.
template <class Body>
auto guarded(const Body& body) {
  try {
    return body();
  } catch (const std::ios_base::failure&) {
    damaged();
  }
}

nanovdb::GridClass kindOf(const openvdb::GridBase& grid) {
  switch (grid.getGridClass()) {
    case openvdb::GRID_LEVEL_SET:
      return nanovdb::GridClass::LevelSet;
    case openvdb::GRID_FOG_VOLUME:
      return nanovdb::GridClass::FogVolume;
    case openvdb::GRID_STAGGERED:
      return nanovdb::GridClass::Staggered;
    default:
      return nanovdb::GridClass::Unknown;
  }
}

/// `read` is called once nothing more is needed of the file.
template <class Read>
void describe(VdbReader& reader, const Entry& entry, GridInfo& info, const Read& read) {
  try {
    requireScalar(info.name, entry);
    const openvdb::GridBase::Ptr grid = reader.read(entry);
    read();
    requireLinear(info.name, *grid);
    AlignedBytes tree = nanoTree(grid);
    describeTree(*reinterpret_cast<nanovdb::FloatGrid*>(tree.data()), tree.size(), info);
  } catch (const Error& e) {
    info.problem = e.message();
  } catch (const std::exception& e) {
    info.problem = fmt::format("is damaged: {}", e.what());
  }
}

openvdb::FloatGrid::Ptr gridOf(const DenseVolume& volume) {
  initialiseOnce();
  const openvdb::FloatGrid::Ptr grid = emptyGrid();
  openvdb::math::Mat4d matrix;
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 4; ++column) matrix(column, row) = volume.indexToWorld(row, column);
  grid->setTransform(openvdb::math::Transform::createLinearTransform(matrix));
  grid->setName(volume.name);
  grid->setGridClass(openvdb::GRID_FOG_VOLUME);
  const openvdb::CoordBBox box({0, 0, 0}, {volume.nx - 1, volume.ny - 1, volume.nz - 1});
  const openvdb::tools::Dense<const float, openvdb::tools::LayoutXYZ> dense(box, volume.values.data());
  openvdb::tools::copyFromDense(dense, *grid, 0.f);
  return grid;
}

// Archive's writer for seekable streams is not public.
class VdbWriter : private openvdb::io::Archive {
 public:
  void write(std::ostream& out, const openvdb::GridBase::Ptr& grid) {
    Archive::write(out, openvdb::GridPtrVec{grid}, /*seekable=*/true);
  }
};

std::shared_ptr<const Grid> loadVdb(AlignedBytes bytes, const VolumeRequest& request, const GridOptions& options) {
  openvdb::GridBase::Ptr grid = guarded([&] {
    VdbReader reader(bytes);
    const std::vector<std::string> names = namesOf(reader.entries());
    const size_t chosen = chooseGrid(names, request);
    requireScalar(names[chosen], reader.entries()[chosen]);
    openvdb::GridBase::Ptr read = reader.read(reader.entries()[chosen]);
    requireFog(names[chosen], kindOf(*read));
    requireLinear(names[chosen], *read);
    return read;
  });
  bytes = {};
  returnFreedMemory();
  AlignedBytes tree = nanoTree(grid);
  grid.reset();
  returnFreedMemory();  // its nodes were many small blocks
  return GridFactory::tree(std::move(tree), options);
}

std::vector<GridInfo> vdbInfo(AlignedBytes bytes) {
  return guarded([&] {
    VdbReader reader(bytes);
    const std::vector<std::string> names = namesOf(reader.entries());
    std::vector<GridInfo> list;
    for (size_t i = 0; i < names.size(); ++i) {
      GridInfo& info = list.emplace_back();
      info.name = names[i];
      info.kind = "unknown";
      info.valueType = valueType(reader.entries()[i]);
      info.format = fmt::format("vdb {}", reader.version());
      describe(reader, reader.entries()[i], info, [&] {
        if (i + 1 == names.size()) bytes = {};
      });
    }
    return list;
  });
}

bool expandBlosc(const std::byte* compressed, size_t compressedSize, std::byte* out, size_t size) try {
  requireWholeBlosc(compressed, compressedSize);
  std::vector<std::byte> framed(sizeof(uint64_t) + compressedSize);
  std::memcpy(framed.data(), &compressedSize, sizeof(uint64_t));
  std::memcpy(framed.data() + sizeof(uint64_t), compressed, compressedSize);
  MemoryStream stream(framed.data(), framed.size());
  openvdb::io::bloscFromStream(stream, reinterpret_cast<char*>(out), size);
  return true;
} catch (const std::exception&) {
  return false;
}

// OpenVDB gives every file a random identifier, as text behind magic number, file version, library version and the flag
// of grid offsets. Ours is a function of what follows it: equal volumes make equal files.
void fixIdentifier(std::string& file) {
  constexpr size_t kStart = 8 + 4 + 2 * 4 + 1, kLength = 36;
  VIRGA_ASSERT(file.size() > kStart + kLength);
  ByteHash hash;
  hash.add(std::string_view(file).substr(kStart + kLength));
  const uint64_t a = hash.value(), b = hash64(a);
  file.replace(kStart, kLength,
               fmt::format("{:08x}-{:04x}-4{:03x}-a{:03x}-{:012x}", a >> 32, a & 0xffff, (a >> 16) & 0xfff, b >> 52,
                           b & 0xffffffffffff));
}

std::string encodeVdb(const DenseVolume& volume) {
  std::ostringstream out;
  VdbWriter().write(out, gridOf(volume));
  std::string file = std::move(out).str();
  fixIdentifier(file);
  return file;
}

std::string encodeNvdb(const DenseVolume& volume) {
  const auto handle = nanovdb::openToNanoVDB(*gridOf(volume), nanovdb::StatsMode::All, nanovdb::ChecksumMode::Full);
  nanovdb::io::Segment header(nanovdb::io::Codec::ZIP);
  header.add(handle);
  // writeGrid first skips the header, which a string allows only where there is something to skip.
  std::ostringstream out(std::string(header.memUsage(), '\0'));
  nanovdb::io::writeGrid(out, handle, nanovdb::io::Codec::ZIP);
  return std::move(out).str();
}

}  // namespace

}  // namespace virga

extern "C" __attribute__((visibility("default"))) const virga::VdbModule& virgaVdbModule() {
  static constexpr virga::VdbModule kModule{virga::loadVdb, virga::vdbInfo, virga::encodeVdb, virga::encodeNvdb,
                                            virga::expandBlosc};
  return kModule;
}
