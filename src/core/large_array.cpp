// SPDX-License-Identifier: Apache-2.0
#include "core/large_array.h"

#include <new>
#if defined(__GLIBC__)
#include <malloc.h>
#endif
#if defined(__linux__)
#include <sys/mman.h>
#endif

namespace virga {
namespace {

constexpr std::align_val_t kPage{size_t{1} << 21};

}  // namespace

void* allocateLarge(size_t bytes) {
  void* memory = ::operator new(bytes, kPage);
#if defined(__linux__)
  ::madvise(memory, bytes, MADV_HUGEPAGE);  // without them it is as good, only slower
#endif
  return memory;
}

void freeLarge(void* memory) { ::operator delete(memory, kPage); }

void returnFreedMemory() {
#if defined(__GLIBC__)
  ::malloc_trim(0);
#endif
}

}  // namespace virga
