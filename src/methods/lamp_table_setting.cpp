// SPDX-License-Identifier: Apache-2.0
#include "methods/lamp_table_setting.h"

#include <fmt/format.h>

#include "core/error.h"
#include "transport/lamp_tables.h"

namespace virga {

LampTableSetting::LampTableSetting(const SettingsReader& reader, std::string_view method)
    : method_(method), given_(reader.integer("lamp_table", 0)) {
  if (!given_ || *given_ == 0) return;
  if (*given_ < LampTables::kLeastSide || *given_ > LampTables::kMostSide)
    throw Error(fmt::format("--set {}.lamp_table may be {} to {}, or 0 for none", method_, LampTables::kLeastSide,
                            LampTables::kMostSide));
}

int LampTableSetting::nodes(const SceneView& scene, int usual) const {
  const int nodes = given_.value_or(usual);
  if (lampTableBytes(scene, nodes) > LampTables::kMostBytes)
    throw Error(fmt::format("--set {}.lamp_table={}: the tables would take more than 1 GB", method_, nodes),
                {{}, "choose fewer nodes, or 0 for none", {}});
  return nodes;
}

}  // namespace virga
