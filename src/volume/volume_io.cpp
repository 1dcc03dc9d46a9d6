// SPDX-License-Identifier: Apache-2.0
#include "volume/volume_io.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <system_error>

#include "core/atomic_write.h"
#include "core/extension.h"
#include "core/large_array.h"
#include "volume/file_bytes.h"
#include "volume/nvdb_file.h"
#include "volume/vdb_module.h"
#include "volume/vol_file.h"

namespace virga {
namespace {

// Readers know bytes only; here their errors learn the file's name, and whatever else a library throws becomes an
// Error.
template <class Body>
auto withFile(const std::filesystem::path& path, const Body& body) {
  try {
    auto result = body(readFile(path));
    returnFreedMemory();  // the file, and what it took to read it
    return result;
  } catch (const Error& e) {
    if (e.details().position.known()) throw;
    throw e.at(inFile(path));
  } catch (const std::bad_alloc&) {
    throw Error("needs more memory than there is, or is damaged", {inFile(path), "", {}});
  } catch (const std::exception& e) {
    throw Error(fmt::format("file is damaged: {}", e.what()), {inFile(path), "", {}});
  }
}

VolumeFormat formatOf(const AlignedBytes& bytes) {
  if (isVol(bytes)) return VolumeFormat::vol;
  if (isVdb(bytes)) return VolumeFormat::vdb;
  return isNvdb(bytes) ? VolumeFormat::nvdb : VolumeFormat::none;
}

AlignedBytes firstBytes(const std::filesystem::path& path) {
  constexpr size_t kMagicBytes = 8;
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) return {};
  AlignedBytes bytes(std::min<size_t>(kMagicBytes, std::filesystem::file_size(path, error)));
  std::ifstream in(path, std::ios::binary);
  in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  return in ? std::move(bytes) : AlignedBytes();
}

[[noreturn]] void refuseFormat() { throw Error("is not a volume: known are .vol, .vdb and .nvdb"); }

}  // namespace

VolumeFormat volumeFormat(const std::filesystem::path& path) {
  if (const VolumeFormat format = formatOf(firstBytes(path)); format != VolumeFormat::none) return format;
  const std::string extension = lowerCaseExtension(path);
  if (extension == ".vol") return VolumeFormat::vol;
  if (extension == ".vdb") return VolumeFormat::vdb;
  return extension == ".nvdb" ? VolumeFormat::nvdb : VolumeFormat::none;
}

std::shared_ptr<const Grid> loadVolume(const std::filesystem::path& path, const VolumeRequest& request,
                                       const GridOptions& options) {
  return withFile(path, [&](AlignedBytes bytes) {
    if (isVol(bytes)) return loadVol(bytes, request, options);
    if (isVdb(bytes)) return vdbModule().load(std::move(bytes), request, options);
    if (isNvdb(bytes)) return loadNvdb(std::move(bytes), request, options);
    refuseFormat();
  });
}

RgbGrid loadRgbVolume(const std::filesystem::path& path) {
  return withFile(path, [&](const AlignedBytes& bytes) {
    if (!isVol(bytes)) throw Error("is not a .vol file; only those hold colours");
    return loadRgbVol(bytes);
  });
}

bool holdsColors(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return volChannels(in) == 3;
}

Bounds volBounds(const std::filesystem::path& path) {
  return withFile(path, [&](const AlignedBytes& bytes) {
    if (!isVol(bytes)) throw Error("is not a .vol file; others carry a transform, not a box");
    const VolFile file = parseVol(bytes);
    requireSoundBox(file);
    return file.bounds;
  });
}

std::vector<GridInfo> listGrids(const std::filesystem::path& path) {
  return withFile(path, [&](AlignedBytes bytes) {
    if (isVol(bytes)) return std::vector<GridInfo>{volInfo(bytes)};
    if (isVdb(bytes)) return vdbModule().info(std::move(bytes));
    if (isNvdb(bytes)) return nvdbInfo(bytes);
    refuseFormat();
  });
}

void writeVdb(const std::filesystem::path& path, const DenseVolume& volume) {
  writeAtomically(path, vdbModule().encodeVdb(volume));
}

void writeNvdb(const std::filesystem::path& path, const DenseVolume& volume) {
  writeAtomically(path, vdbModule().encodeNvdb(volume));
}

}  // namespace virga
