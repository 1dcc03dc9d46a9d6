// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cstdio>
#include <filesystem>

#include "app/frames.h"
#include "app/options.h"
#include "app/ready_scene.h"
#include "app/usage_error.h"
#include "core/atomic_write.h"
#include "core/error.h"
#include "core/extension.h"
#include "volume/procedural.h"
#include "volume/volume_io.h"

namespace virga::app {
namespace {

namespace fs = std::filesystem;

using Writer = void (*)(const fs::path&, const DenseVolume&);

Writer writerFor(const fs::path& file) {
  const std::string extension = lowerCaseExtension(file);
  if (extension == ".vol") return writeVol;
  if (extension == ".vdb") return writeVdb;
  if (extension == ".nvdb") return writeNvdb;
  throw UsageError(fmt::format("\"{}\": volumes are written as .vdb, .nvdb or .vol, scenes as .xml", file.string()));
}

/// The files to make. The volume's name still lacks the number of its frame.
struct Plan {
  fs::path volume;
  fs::path scene;  ///< empty: none
};

Plan planFor(const MakeOptions& options) {
  Plan plan{options.output, options.scene};
  if (lowerCaseExtension(plan.volume) == ".xml") {
    if (!options.scene.empty()) throw UsageError("--scene and an output that is a scene itself exclude each other");
    plan = {fs::path(options.output).replace_extension(".vol"), options.output};
  }
  if (!plan.scene.empty() && lowerCaseExtension(plan.scene) != ".xml")
    throw UsageError(fmt::format("--scene {}: scenes are written as .xml", options.scene));
  return plan;
}

// The volume of a scene is not named on the command line: one that was there before, without the scene, is somebody's.
void requireOwnVolume(const MakeOptions& options, const Plan& plan, const fs::path& firstVolume) {
  if (plan.scene != fs::path(options.output) || !fs::exists(firstVolume) || fs::exists(plan.scene)) return;
  throw Error(fmt::format("\"{}\" exists and would be overwritten", firstVolume.string()),
              {.position = {}, .hint = "name both: -o VOLUME --scene SCENE.xml", .notes = {}});
}

// What one sees through: smoke and cloud have a surface, fog and dust veil what is behind them.
double thicknessOf(ProceduralKind kind) {
  switch (kind) {
    case ProceduralKind::smoke:
    case ProceduralKind::cloud:
      return 10;
    case ProceduralKind::fog:
      return 1.5;
    case ProceduralKind::dust:
      return 1;
  }
  return 1;
}

void writeScene(const Plan& plan, ReadyScene scene) {
  const fs::path folder = plan.scene.has_parent_path() ? plan.scene.parent_path() : fs::path(".");
  const fs::path relative = fs::proximate(plan.volume, folder);
  scene.nameInScene = relative;
  writeAtomically(plan.scene, readySceneXml(scene));
  fmt::print(stderr, "wrote {}\n", plan.scene.string());
}

}  // namespace

int make(const MakeOptions& options) {
  const ProceduralKind kind = proceduralKind(options.kind);
  const Plan plan = planFor(options);
  const Writer write = writerFor(plan.volume);
  const bool isSequence = options.frames > 0;
  const auto fileOf = [&](int frame) {
    return isSequence ? fs::path(numberedFile(plan.volume.string(), frame + 1)) : plan.volume;
  };
  requireOwnVolume(options, plan, fileOf(0));
  checkWritable(fileOf(0));
  if (!plan.scene.empty()) checkWritable(plan.scene);
  std::vector<std::string> files;
  for (int frame = 0; frame < std::max(1, options.frames); ++frame) {
    const ProceduralSettings settings{
        .resolution = options.resolution, .seed = options.seed, .frame = static_cast<float>(frame)};
    files.push_back(fileOf(frame).string());
    write(files.back(), makeProcedural(kind, settings));
    fmt::print(stderr, "wrote {}\n", files.back());
  }
  if (!plan.scene.empty())
    writeScene(
        plan,
        {.frames = std::move(files), .nameInScene = {}, .thickness = thicknessOf(kind), .isSequence = isSequence});
  return 0;
}

}  // namespace virga::app
