// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>

#include "core/large_array.h"
#include "methods/instant_scattering/frame_pixels.h"
#include "methods/instant_scattering/ims_pixels.h"
#include "methods/pixels.h"
#include "transport/kept_walks.h"

namespace virga {

/// `ims.mode=frame` (section 5 of the paper): few walks, all of whose virtual lights light every coarse pixel. A pass
/// is a function of (scene, camera, settings, number of the pass), and the walks stay the same when the camera moves.
/// In a pixel all is looked at from fixed points, but for what is left to paths (mirrors, glass and what they throw on
/// other things, narrow bsdfs, panes, media that glow): their numbers are fixed for each pixel. Passes are averaged:
/// each has other walks and other fixed points.
class FrameRenderer {
 public:
  /// What an edit has changed is forgotten. `walksStay`: as WalkStore::edit says.
  void forget(const ChangeSet& changes, bool walksStay);

  /// Fills `frame`; false if it was stopped on the way. Walks may stay from frame to frame in `walks`.
  bool pass(const Scene& scene, const ImsOptions& options, const SampleId& id, WalkStore& walks,
            const std::stop_token& stop, PassFrame& frame);

  /// Of the last pass; null before the first.
  const FrameLights* lights() const { return lights_.get(); }

 private:
  bool prepareLights(const Scene& scene, const ImsOptions& options, const SampleId& id, WalkStore& walks,
                     const std::stop_token& stop);

  std::map<uint32_t, FrameLights::Kept> kept_;  ///< from frame to frame, of each pass whose walks are
  std::unique_ptr<FrameLights> lights_;
  std::unique_ptr<FrameLamps> lamps_;   ///< there where lights_ are
  LargeArray<PixelFeatures> features_;  ///< room for them
  uint32_t lightsOf_ = 0;               ///< the pass that they belong to
  int around_ = 0;                      ///< the medium that had no end when they were made
};

}  // namespace virga
