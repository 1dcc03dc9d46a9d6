// SPDX-License-Identifier: Apache-2.0
#include "methods/settings_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

namespace virga {
namespace {

std::optional<float> finite(std::string_view text) {
  float value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool valid = error == std::errc() && end == text.data() + text.size() && std::isfinite(value);
  return valid ? std::optional(value) : std::nullopt;
}

}  // namespace

SettingsReader::SettingsReader(const Settings& settings, std::span<const SettingInfo> known, std::string_view method)
    : settings_(settings), method_(method) {
  std::vector<std::string> names;
  for (const SettingInfo& s : known) names.emplace_back(s.name);
  for (const auto& [name, value] : settings.values)
    if (std::find(names.begin(), names.end(), name) == names.end())
      throw Error(fmt::format("method \"{}\" has no setting \"{}\"", method, name),
                  {{}, didYouMean(name, names), {"available: " + joined(names)}});
}

std::optional<int> SettingsReader::integer(std::string_view name, int lowest, int highest,
                                           std::string_view remedy) const {
  const std::string* text = find(name);
  if (!text) return {};
  int value = 0;
  const auto [end, error] = std::from_chars(text->data(), text->data() + text->size(), value);
  const bool large = error == std::errc::result_out_of_range || value > highest;
  if (large && text->front() != '-') fail(name, fmt::format("an integer from {} to {}", lowest, highest), remedy);
  if (error != std::errc() || end != text->data() + text->size() || value < lowest)
    fail(name, fmt::format("an integer of at least {}", lowest));
  return value;
}

std::optional<float> SettingsReader::number(std::string_view name, float above) const {
  const std::string* text = find(name);
  if (!text) return {};
  const std::optional<float> value = finite(*text);
  if (!value || !(*value > above))
    fail(name, fmt::format("a number above {} and up to {:.1e}", above, std::numeric_limits<float>::max()));
  return value;
}

std::optional<float> SettingsReader::share(std::string_view name) const {
  const std::string* text = find(name);
  if (!text) return {};
  const std::optional<float> value = finite(*text);
  if (!value || !(*value >= 0) || !(*value <= 1)) fail(name, "a number from 0 to 1");
  return value;
}

std::optional<int> SettingsReader::choice(std::string_view name, std::span<const std::string_view> words) const {
  const std::string* text = find(name);
  if (!text) return {};
  const auto it = std::find(words.begin(), words.end(), *text);
  if (it != words.end()) return static_cast<int>(it - words.begin());
  fail(name, "one of " + joined({words.begin(), words.end()}));
}

std::optional<bool> SettingsReader::boolean(std::string_view name) const {
  const std::string* text = find(name);
  if (!text) return {};
  if (*text == "true" || *text == "on" || *text == "1") return true;
  if (*text == "false" || *text == "off" || *text == "0") return false;
  fail(name, "true or false");
}

const std::string* SettingsReader::find(std::string_view name) const {
  const auto it = settings_.values.find(name);
  return it == settings_.values.end() ? nullptr : &it->second;
}

void SettingsReader::fail(std::string_view name, std::string_view expected, std::string_view remedy) const {
  throw Error(fmt::format("--set {}.{}: \"{}\" is not {}", method_, name, *find(name), expected),
              {{}, std::string(remedy), {}});
}

}  // namespace virga
