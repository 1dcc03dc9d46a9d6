// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "methods/instant_scattering/compensation.h"
#include "methods/instant_scattering/receivers.h"
#include "methods/lamp_table_setting.h"
#include "methods/method.h"
#include "methods/settings_reader.h"

namespace virga {

/// All that `ims` can be told, with the scene's own values where the settings are silent.
struct ImsOptions {
  enum class Mode { exact, fast, frame };
  enum class Compensate { path, sampled, none, spread };
  enum class Show { picture, lost, compensation };

  Mode mode = Mode::exact;
  int samples = 16;   ///< fast: of a coarse pixel in each pass; frame: points of its eye ray that are lit
  int spacing = 8;    ///< fast, frame: of coarse pixels [pixels]
  int eyeSteps = 64;  ///< fast, frame: of an eye ray through each stretch of media
  int lampTable = 0;  ///< fast: nodes of lamps' tables in either direction; 0: light from lamps is marched
  int walks = 0;
  FlightMode flights = FlightMode::tracking;  ///< of the walks
  float aim = 0;                              ///< share of the walks that start toward the media
  float retrace = 1;  ///< part of the walks that is traced anew in each frame; 1: all, and none is kept
  PathOptions path;
  GatherAmount amount;  ///< on the eye ray
  GatherOptions gather;
  LightVisibilityOptions visibility;
  int frameLights = 1300;        ///< frame: virtual lights that are kept
  ReceiverBatch::Options frame;  ///< frame: how receivers are lit; a bound of 0: by how the lights lie
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

  /// Throws Error for a clamping radius that is out of proportion to the scene.
  ImsOptions forScene(const Scene& scene) const;

 private:
  void readMarching(const SettingsReader& reader);

  ImsOptions given_;
  std::optional<float> radius_;
  LampTableSetting lampTable_;
  std::optional<int> walks_, lights_, maxDepth_, rrDepth_;
};

/// The values that are in force, by the names of kImsSettings.
SettingValues valuesOf(const ImsOptions& options);

}  // namespace virga
