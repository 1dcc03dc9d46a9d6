// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>
#include <optional>
#include <span>
#include <string_view>

#include "methods/method.h"

namespace virga {

/// Reads a method's settings. Unknown names and values that are of the wrong kind or out of range throw Error with a
/// remedy.
class SettingsReader {
 public:
  SettingsReader(const Settings& settings, std::span<const SettingInfo> known, std::string_view method);

  /// Empty where the setting was not given.
  std::optional<int> integer(std::string_view name, int lowest, int highest = std::numeric_limits<int>::max(),
                             std::string_view remedy = "") const;
  /// Finite and above `above`.
  std::optional<float> number(std::string_view name, float above) const;
  /// From 0 to 1, both included.
  std::optional<float> share(std::string_view name) const;
  /// Index of the word among `words`.
  std::optional<int> choice(std::string_view name, std::span<const std::string_view> words) const;
  std::optional<bool> boolean(std::string_view name) const;

 private:
  const std::string* find(std::string_view name) const;
  [[noreturn]] void fail(std::string_view name, std::string_view expected, std::string_view remedy = "") const;

  const Settings& settings_;
  std::string_view method_;
};

}  // namespace virga
