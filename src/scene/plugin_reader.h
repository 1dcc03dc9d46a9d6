// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "scene/description.h"

namespace virga {

/// How strict a builder is, and where it leaves its warnings.
struct BuildDiagnostics {
  bool lenient = false;
  std::vector<std::string> warnings;

  /// Throws, or warns where the build is lenient.
  void complain(const Error& error);
  /// The error's text as a warning.
  void warn(const Error& error);
};

/// Reads a plugin's parameters, each with its type and range, and knows in the end which were never asked for: those
/// are errors, with what could have been meant.
class PluginReader {
 public:
  PluginReader(const Node& node, BuildDiagnostics& diagnostics) : node_(node), diagnostics_(diagnostics) {}

  struct Range {
    double lo = -std::numeric_limits<double>::infinity(), hi = std::numeric_limits<double>::infinity();
    bool openLo = false, openHi = false;
  };
  static constexpr Range positive() { return {.lo = 0, .openLo = true}; }
  static constexpr Range nonNegative() { return {.lo = 0}; }
  static constexpr Range unit() { return {.lo = 0, .hi = 1}; }
  static constexpr Range any() { return {}; }

  const Node& node() const { return node_; }
  BuildDiagnostics& diagnostics() { return diagnostics_; }
  bool has(std::string_view name);

  float number(std::string_view name, float fallback, const Range& range = any());
  int integer(std::string_view name, int fallback, const Range& range = any());
  bool boolean(std::string_view name, bool fallback);
  std::string text(std::string_view name, std::string_view fallback);
  Vec3 vector(std::string_view name, Vec3 fallback);
  /// `rgb`, `spectrum` or `float`; every channel within the range.
  Rgb color(std::string_view name, Rgb fallback, const Range& range = nonNegative());
  /// Regular and affine, or an error.
  Matrix4 transform(std::string_view name);
  /// A string that must be one of `words`; its index.
  size_t oneOf(std::string_view name, std::string_view fallback, std::span<const std::string_view> words);

  /// The child of that tag (and name, unless the name is empty), or null; two of them are an error.
  NodePtr child(std::string_view tag, std::string_view name = "");
  std::vector<NodePtr> children(std::string_view tag);

  /// The parameter is known and of no consequence here.
  void ignore(std::string_view name) { (void)find(name); }
  void ignoreChildren(std::string_view tag) { (void)children(tag); }

  /// An error about a parameter's value (or at the plugin, where the parameter is absent).
  [[noreturn]] void fail(std::string_view parameter, std::string message, std::string hint = "",
                         std::vector<std::string> notes = {});
  /// A warning about a parameter whose value asks for what is not done: `"pixel_format" is ignored: ...`.
  void warnIgnored(std::string_view parameter, std::string_view why);
  /// An error about the plugin as a whole.
  [[noreturn]] void failHere(std::string message, std::string hint = "", std::vector<std::string> notes = {});
  /// Where a parameter's value stands.
  SourcePosition positionOf(std::string_view parameter) const;

  /// Complains about what was not asked for. Call once, at the end.
  void finish();

 private:
  const Property* find(std::string_view name);
  float checkedNumber(std::string_view name, double value, const Range& range);

  const Node& node_;
  BuildDiagnostics& diagnostics_;
  std::set<std::string, std::less<>> asked_;  ///< parameters that were read or could have been
  std::set<const Property*> used_;
};

}  // namespace virga
