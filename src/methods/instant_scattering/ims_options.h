// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "methods/instant_scattering/compensation.h"
#include "methods/method.h"

namespace virga {

/// All that `ims` can be told, with the scene's own values where the settings are silent.
struct ImsOptions {
  enum class Mode { exact, fast };
  enum class Compensate { path, sampled, none };
  enum class Show { picture, lost, compensation };

  Mode mode = Mode::exact;
  int samples = 16;  ///< fast: of a coarse pixel in each pass
  int spacing = 8;   ///< fast: of coarse pixels [pixels]
  int walks = 8192;
  float retrace = 1;  ///< part of the walks that is traced anew in each frame; 1: all, and none is kept
  PathOptions path;
  GatherAmount amount;  ///< on the eye ray
  GatherOptions gather;
  Compensate compensate = Compensate::path;
  CompensationOptions compensation;
  Show show = Show::picture;

  /// The expectation of the picture is not the truth.
  bool biased() const;
};

/// What the settings say; checked once, completed for each scene.
class ImsSettings {
 public:
  ImsSettings() = default;
  /// Throws Error for settings that make no sense.
  explicit ImsSettings(const Settings& settings);

  ImsOptions forScene(const Scene& scene) const;

 private:
  ImsOptions given_;
  std::optional<float> radius_;
  std::optional<int> lights_, maxDepth_, rrDepth_;
};

/// The values that are in force, by the names of kImsSettings.
SettingValues valuesOf(const ImsOptions& options);

}  // namespace virga
