// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "core/large_array.h"
#include "methods/instant_scattering/ims_pixels.h"
#include "methods/instant_scattering/upsampling.h"

namespace virga {

/// `ims.mode=fast` (section 5 of the paper): light of x1 alone in each pixel; what else there is, at coarse pixels, and
/// from them everywhere.
class FastRenderer {
 public:
  /// What an edit has changed is forgotten.
  void forget(const ChangeSet& changes);

  /// What the lamps' light is looked up in, made when it is asked for. A stop may leave it unfinished.
  View<LampTable> lampTables(const Scene& scene, const ImsOptions& options, const std::stop_token& stop);

  /// Fills `frame`. Where light is marched pass 0 looks at the pixels' middles, for what they show and for their light
  /// at once.
  void pass(const Scene& scene, const ImsPixels& pixels, const ImsOptions& options, const SampleId& id,
            const std::stop_token& stop, PassFrame& frame);

 private:
  LargeArray<PixelFeatures> features_;
  bool known_ = false;                  ///< they are of this scene and camera
  std::unique_ptr<LampTables> tables_;  ///< of this scene
  int around_ = 0;                      ///< the medium that had no end when they were made
};

}  // namespace virga
