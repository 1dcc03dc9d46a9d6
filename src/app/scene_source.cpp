// SPDX-License-Identifier: Apache-2.0
#include "app/scene_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "core/large_array.h"
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

// A `.vol` has no inactive voxels, so its listed mean is one over empty space as well.
float meanOfNonZero(const std::string& volFile) {
  const std::shared_ptr<const Grid> grid = loadVolume(volFile);
  const DenseGridView& dense = grid->view().dense;
  if (grid->view().kind != GridView::Kind::dense) return 0;
  double sum = 0;
  int64_t count = 0;
  const int64_t voxels = int64_t{dense.nx} * dense.ny * dense.nz;
  for (int64_t i = 0; i < voxels; ++i) {
    sum += static_cast<double>(dense.values[i]);
    count += dense.values[i] != 0 ? 1 : 0;
  }
  return count == 0 ? 0 : static_cast<float>(sum / static_cast<double>(count));
}

}  // namespace

bool isVolumeFile(const std::string& path) { return volumeFormat(path) != VolumeFormat::none; }

SceneDescription sceneAroundVolume(const std::vector<std::string>& frames, double thickness) {
  BareVolume all{.file = frames.front(), .thickness = thickness};
  for (const std::string& file : frames) {
    const std::vector<GridInfo> grids = listGrids(file);
    const GridInfo& density = densityOf(file, grids);
    const bool isVol = volumeFormat(file) == VolumeFormat::vol;
    if (&file == &frames.front() && grids.size() > 1) all.grid = density.name;
    all.worldBounds.extend(density.worldBounds);
    all.maximumDensity = std::max(all.maximumDensity, density.maximum);
    all.meanDensity += (isVol ? meanOfNonZero(file) : density.mean) / static_cast<float>(frames.size());
  }
  returnFreedMemory();  // the scene is to load them again
  return describeBareVolume(all);
}

SceneDescription loadScene(const SceneOptions& options, std::vector<std::string>& warnings) {
  if (!isVolumeFile(options.file))
    return loadMitsubaXml(
        options.file,
        {.defines = options.defines, .frame = options.frame, .lenient = options.lenient, .warnings = &warnings});
  if (!options.defines.empty())
    throw Error(fmt::format("-D has no meaning for \"{}\": a volume has no variables", options.file));
  return sceneAroundVolume({options.file}, BareVolume{}.thickness);
}

}  // namespace virga::app
