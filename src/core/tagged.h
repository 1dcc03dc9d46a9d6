// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <new>
#include <tuple>
#include <type_traits>

#include "core/host_device.h"

namespace virga {

/// A value of one of several types, and which: std::variant for kernels. The types are trivially copyable; the first
/// can be made from nothing, and is the default.
template <class... Ts>
class Tagged {
  static_assert((std::is_trivially_copyable_v<Ts> && ...));
  template <size_t i>
  using Type = std::tuple_element_t<i, std::tuple<Ts...>>;

 public:
  VIRGA_HD Tagged() : Tagged(Type<0>{}) {}
  template <class T>
  requires(std::same_as<T, Ts> || ...) VIRGA_HD explicit Tagged(const T& value) : tag_(tagOf<T>()) {
    new (bytes_) T(value);
  }

  /// What it holds, or null where that is no T.
  template <class T>
  VIRGA_HD const T* get() const {
    return tag_ == tagOf<T>() ? reinterpret_cast<const T*>(bytes_) : nullptr;
  }
  /// f of what it holds.
  template <class F>
  VIRGA_HD auto visit(F&& f) const {
    return visitFrom<0>(f);
  }
  friend bool operator==(const Tagged& a, const Tagged& b) {
    return a.visit([&]<class T>(const T& held) { return b.get<T>() && held == *b.get<T>(); });
  }

 private:
  template <class T>
  VIRGA_HD static constexpr uint8_t tagOf() {
    constexpr bool isT[] = {std::is_same_v<T, Ts>...};
    uint8_t tag = 0;
    while (!isT[tag]) ++tag;
    return tag;
  }
  template <size_t i, class F>
  VIRGA_HD auto visitFrom(F& f) const {
    if constexpr (i + 1 < sizeof...(Ts)) {
      if (tag_ != i) return visitFrom<i + 1>(f);
    }
    return f(*reinterpret_cast<const Type<i>*>(bytes_));
  }

  alignas(Ts...) unsigned char bytes_[std::max({sizeof(Ts)...})] = {};
  uint8_t tag_;
};

}  // namespace virga
