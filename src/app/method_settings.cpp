// SPDX-License-Identifier: Apache-2.0
#include "app/method_settings.h"

#include <fmt/format.h>

#include "app/usage_error.h"
#include "core/error.h"

namespace virga::app {
namespace {

struct Assignment {
  std::string method, parameter, value;
};

Assignment parse(const std::string& text) {
  const size_t equals = text.find('='), dot = text.find('.');
  if (equals == std::string::npos || dot == std::string::npos || dot > equals || dot == 0 || dot + 1 == equals)
    throw UsageError(fmt::format("--set {}: write --set method.param=value", text));
  return {text.substr(0, dot), text.substr(dot + 1, equals - dot - 1), text.substr(equals + 1)};
}

}  // namespace

Settings methodSettings(const MethodInfo& info, const std::vector<std::string>& assignments, uint64_t seed) {
  Settings settings{.values = {}, .seed = seed};
  for (const std::string& text : assignments) {
    const Assignment a = parse(text);
    if (a.method != info.name)
      throw Error(fmt::format("--set {}: the method is \"{}\", not \"{}\"", text, info.name, a.method));
    settings.values[a.parameter] = a.value;
  }
  return settings;
}

}  // namespace virga::app
