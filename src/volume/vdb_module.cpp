// SPDX-License-Identifier: Apache-2.0
#include "volume/vdb_module.h"

#include <dlfcn.h>
#include <fmt/format.h>

#include "volume/file_bytes.h"

namespace virga {
namespace {

constexpr const char* kFile = "libvirga_vdb.so";

// Beside the program, where an install puts it, or one folder up from a test; by whole paths, because a sanitizer's
// dlopen looks along its own.
void* openLibrary() {
  std::error_code ignored;
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", ignored).parent_path();
  for (const char* folder : {".", "../lib", ".."})
    if (const auto file = program / folder / kFile; std::filesystem::exists(file, ignored))
      return ::dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
  return ::dlopen(kFile, RTLD_NOW | RTLD_LOCAL);
}

const VdbModule& open() {
  void* library = openLibrary();
  void* entry = library ? ::dlsym(library, "virgaVdbModule") : nullptr;
  if (!entry)
    throw Error(fmt::format("cannot open {}, which reads and writes OpenVDB files: {}", kFile, ::dlerror()),
                {{}, "it belongs beside the program", {}});
  return reinterpret_cast<const VdbModule& (*)()>(entry)();
}

}  // namespace

const VdbModule& vdbModule() {
  static const VdbModule& module = open();
  return module;
}

bool isVdb(const AlignedBytes& bytes) {
  constexpr int64_t kMagic = 0x56444220;  // "VDB " in a 64-bit word
  return bytes.size() >= sizeof(kMagic) && ByteReader(bytes.data(), bytes.size()).read<int64_t>() == kMagic;
}

}  // namespace virga
