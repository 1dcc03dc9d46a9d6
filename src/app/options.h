// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "app/frames.h"
#include "app/stopping.h"

namespace virga::app {

// What the command line says, one struct for each command. Each command returns the exit code; bad input throws Error.

struct SceneOptions {
  std::string file;
  std::map<std::string, std::string> defines;
  std::string frame;  ///< of a sequence: the value of $frame; empty: a picture by itself
  bool lenient = false;
};

struct RenderOptions {
  SceneOptions scene;
  std::string method = "path";
  std::vector<std::string> outputs;
  StopRules stop;
  std::optional<double> auditSeconds;  ///< to hold the finished picture against `path`
  std::optional<std::pair<int, int>> size;
  std::optional<FrameRange> frames;  ///< a picture for each, with $frame set to its number
  uint64_t seed = 0;
  int threads = 0;                    ///< 0: as many as there are
  std::vector<std::string> settings;  ///< "method.param=value"
  std::string stats;
  std::string dots;  ///< PNG with the method's overlay
  bool layers = false;
  bool quiet = false;
};
int render(const RenderOptions&);

struct CompareOptions {
  std::string image, reference;
  std::string layer;  ///< "": the beauty
  std::string difference;
  bool json = false;
};
int compare(const CompareOptions&);

int info(const SceneOptions&);

struct MakeOptions {
  std::string kind;
  std::string output;
  std::string scene;
  int resolution = 128;
  uint32_t seed = 0;
  int frames = 0;  ///< 0: a single volume, without a number in its name
};
int make(const MakeOptions&);

/// "": all of them.
int methods(const std::string& name);

}  // namespace virga::app
