// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "methods/render_session.h"
#include "stats/stats.h"

namespace virga::testing {

/// The scene of a Mitsuba XML text, the elements inside <scene> alone. Relative files lie in `directory`.
SceneSnapshot sceneOf(const std::string& elements, const std::string& directory = ".");

struct Run {
  int passes = 8;
  uint64_t seed = 1;
  LayerMask layers = LayerMask::none();
  std::string method = "path";
  std::map<std::string, std::string, std::less<>> settings = {};
};

/// A session after its passes.
RenderSession rendered(SceneSnapshot scene, const Run& run = {});

/// All pixels of a picture are estimates of the same number: their moments, of the mean of the channels.
stats::Moments pixelMoments(const Image& image);

/// Means over the picture, one for each replicate: independent estimates of the picture's mean.
stats::Moments replicateMoments(const Film& film);
stats::Moments replicateMoments(const Film& film, Layer layer);

/// Largest absolute difference of two pictures' channels.
float largestDifference(const Image& a, const Image& b);

/// A camera at `origin` that sees `target` in a tiny field of view, so that all pixels of its size x size film agree.
std::string pinpointSensor(const std::string& origin, const std::string& target, const std::string& up, int size,
                           const std::string& extra = "");

}  // namespace virga::testing
