// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "methods/settings_reader.h"
#include "scene/scene_view.h"

namespace virga {

/// The setting `lamp_table` of a method: nodes along the edges of its LampTables. Throws Error where it makes no sense.
class LampTableSetting {
 public:
  LampTableSetting() = default;
  LampTableSetting(const SettingsReader& reader, std::string_view method);

  /// In force for a scene that may have tables and where `usual` nodes are a good choice.
  int nodes(const SceneView& scene, int usual) const;

 private:
  std::string method_;
  std::optional<int> given_;
};

}  // namespace virga
