// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <stop_token>
#include <vector>

#include "transport/defensive_flight.h"
#include "transport/virtual_lights.h"

namespace virga {

/// A straight part of a kept walk, up to where it scatters. Everything but what depends on the media's coefficients is
/// in the factors.
struct KeptSegment {
  Ray ray;
  float length = 0;          ///< [unit]
  int medium = -1;           ///< that scatters at the end; -1: a surface does
  uint32_t firstPiece = 0;   ///< of its pieces of media; the next segment's are behind them
  float inverseDensity = 0;  ///< of the flight, given those before: over its density [unit] or its probability
  int light = -1;            ///< which light of the block stands at the end, if any
  Rgb onward;                ///< of the flux that goes on, survival included
};

/// Some walks, stored together.
struct KeptBlock {
  struct Walk {
    Rgb flux;  ///< that it starts with [W]
    uint32_t firstSegment = 0;
  };
  std::vector<Walk> walks;
  std::vector<KeptSegment> segments;
  std::vector<MediaPiece> pieces;
  std::vector<LightVertex> lights;  ///< `weight`: for a flux of 1 that arrives
  std::vector<SurfaceScattering> surfaces;
  std::shared_ptr<const std::vector<Rgb>> drawnIn;  ///< mean sigma_t of the media when they were traced; null: not yet
};

/// Random walks from the lights that stand from frame to frame while only the media's coefficients change: what each
/// carries is computed anew, and a part of them is traced anew, in turn (methods.md 2.4). For each frame by itself the
/// lights are an unbiased sample, as those of traceVirtualLights are, though with more noise.
class KeptWalks {
 public:
  /// The lights of the walks in `frame`. In the first one, and where the options differ from before, all walks are
  /// traced; in each later one the part `retrace` in [0, 1] of them; a second time in one frame, none. A stop leaves
  /// walks out, and they are traced when they are asked for again.
  VirtualLights lights(const Scene& scene, const WalkOptions& options, const SampleId& id, int64_t frame, float retrace,
                       const std::stop_token& stop = {});

 private:
  std::vector<KeptBlock> blocks_;
  WalkOptions options_;
  int64_t frame_ = -1;
  size_t next_ = 0;  ///< block whose turn it is
};

/// The kept walks of a method, pass by pass, and whether an edit leaves them as they are.
class WalkStore {
 public:
  /// The scene is `next` from now on: forgets the walks if they could be other ones, or could not reach everything that
  /// is in it, and begins a new frame. Kept are walks where nothing changes but the camera, the film, and the grids,
  /// places and coefficients of media. Says whether they are.
  bool edit(const Scene& before, const Scene& next, const ChangeSet& changes);

  /// As KeptWalks::lights, but for a `retrace` above 0: the more the media have changed, the more walks are traced
  /// anew, all where that is kMostChange. Passes beyond kMostWalks are not kept; their walks are traced by exact
  /// flights.
  VirtualLights lights(const Scene& scene, const WalkOptions& options, const SampleId& id, int64_t pass, float retrace,
                       const std::stop_token& stop = {});

  /// By how much media may change while a walk is kept. Measured: docs/decisions/frame-sequences.md.
  static constexpr float kMostChange = 0.05f;
  /// In all passes together: about 1 kB each.
  static constexpr int64_t kMostWalks = 1 << 18;
  /// Are the walks of this pass among them?
  static bool keeps(int64_t pass, int walks) { return (pass + 1) * walks <= kMostWalks; }

 private:
  std::map<int64_t, KeptWalks> passes_;
  int64_t frame_ = 0;
  float change_ = 0;    ///< by the edits since walks were last asked for: see changeOfMedia()
  bool asked_ = false;  ///< for the walks of this frame
};

}  // namespace virga
