// SPDX-License-Identifier: Apache-2.0
#include "app/scene_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "loaders/bare_volume.h"
#include "loaders/mitsuba_xml.h"
#include "volume/volume_io.h"

namespace virga::app {
namespace {

const GridInfo& densityOf(const std::string& file, const std::vector<GridInfo>& grids) {
  const auto usable = [](const GridInfo& g) { return g.problem.empty(); };
  const auto named =
      std::find_if(grids.begin(), grids.end(), [&](const GridInfo& g) { return usable(g) && g.name == "density"; });
  if (named != grids.end()) return *named;
  const auto first = std::find_if(grids.begin(), grids.end(), usable);
  if (first != grids.end()) return *first;
  Error::Details details;
  for (const GridInfo& g : grids) details.notes.push_back(fmt::format("grid \"{}\": {}", g.name, g.problem));
  throw Error(fmt::format("\"{}\" has no grid that can be rendered", file), std::move(details));
}

}  // namespace

bool isVolumeFile(const std::string& path) {
  const std::string extension = std::filesystem::path(path).extension().string();
  return extension == ".vdb" || extension == ".nvdb" || extension == ".vol";
}

SceneDescription sceneAroundVolume(const std::string& file) {
  const std::vector<GridInfo> grids = listGrids(file);
  const GridInfo& density = densityOf(file, grids);
  return describeBareVolume({.file = file,
                             .grid = grids.size() > 1 ? density.name : "",
                             .worldBounds = density.worldBounds,
                             .maximumDensity = density.maximum,
                             .meanDensity = density.mean});
}

SceneDescription loadScene(const SceneOptions& options, std::vector<std::string>& warnings) {
  if (!isVolumeFile(options.file))
    return loadMitsubaXml(options.file,
                          {.defines = options.defines, .lenient = options.lenient, .warnings = &warnings});
  if (!options.defines.empty())
    throw Error(fmt::format("-D has no meaning for \"{}\": a volume has no variables", options.file));
  return sceneAroundVolume(options.file);
}

}  // namespace virga::app
