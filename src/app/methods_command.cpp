// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>

#include "app/options.h"
#include "methods/method.h"

namespace virga::app {
namespace {

void listAll() {
  size_t width = 0;
  for (const MethodInfo& m : methodRegistry()) width = std::max(width, m.name.size());
  for (const MethodInfo& m : methodRegistry())
    fmt::print("{:{}}  {:10}  {}\n", m.name, width, accuracyName(m.accuracy), m.summary);
  fmt::print("\n\"virga methods NAME\" tells more about one of them.\n");
}

std::string layerNames(LayerMask mask) {
  std::string out;
  for (int i = 0; i < kLayerCount; ++i)
    if (mask.has(static_cast<Layer>(i)))
      out += fmt::format("{}{}", out.empty() ? "" : " ", kLayerNames[static_cast<size_t>(i)]);
  return out;
}

void listSettings(const MethodInfo& method) {
  if (method.settings.empty()) return fmt::print("\nparameters: none\n");
  fmt::print("\nparameters (--set {}.NAME=VALUE):\n", method.name);
  size_t nameWidth = 0, valueWidth = 0;
  for (const SettingInfo& s : method.settings) {
    nameWidth = std::max(nameWidth, s.name.size());
    valueWidth = std::max(valueWidth, s.defaultValue.size());
  }
  for (const SettingInfo& s : method.settings)
    fmt::print("  {:{}} = {:{}}  {}\n", s.name, nameWidth, s.defaultValue, valueWidth, s.summary);
}

}  // namespace

int methods(const std::string& name) {
  if (name.empty()) {
    listAll();
    return 0;
  }
  const MethodInfo& method = findMethod(name);
  fmt::print("{}: {}\n", method.name, method.summary);
  fmt::print("paper:    {}\naccuracy: {}\nlayers:   {}\n", method.paper, accuracyName(method.accuracy),
             layerNames(method.layers));
  listSettings(method);
  return 0;
}

}  // namespace virga::app
