// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <type_traits>

namespace virga {

/// Memory in large pages, where the system has them: it hands them out faster than many small ones. Throws
/// std::bad_alloc.
void* allocateLarge(size_t bytes);
void freeLarge(void* memory);

/// Gives the system back what has been freed. The C library keeps small blocks for later, and large ones up to the
/// largest that it has seen freed (glibc: 32 MiB at most).
void returnFreedMemory();

/// Room for many plain values, which are written before they are read: nothing is cleared.
template <class T>
class LargeArray {
 public:
  static_assert(std::is_trivially_copyable_v<T> && std::is_trivially_destructible_v<T>);

  LargeArray() = default;
  explicit LargeArray(size_t count) : values_(static_cast<T*>(allocateLarge(count * sizeof(T)))), size_(count) {}

  size_t size() const { return size_; }
  T* data() const { return values_.get(); }
  T& operator[](size_t i) const { return values_.get()[i]; }

 private:
  struct Free {
    void operator()(T* values) const { freeLarge(values); }
  };
  std::unique_ptr<T, Free> values_;
  size_t size_ = 0;
};

}  // namespace virga
