// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "methods/rendering.h"

namespace virga::testing {

/// Means of each layer over the picture and its quarters, in each channel: a moment for each, of independent pictures.
struct LayerMeans {
  static constexpr size_t kPlaces = 15, kWhole = 4;  ///< 5 c + quarter for channel c; the fifth of each is the whole
  std::array<stats::Moments, kPlaces> layers[kLayerCount];
};

/// Of `path`, with three seeds from run.seed on. Expects that all samples are finite.
LayerMeans layerMeans(const SceneSnapshot& scene, Run run);

/// p-value that a layer is the same: of the worst of fifteen tests, times fifteen.
double agreement(const LayerMeans& a, const LayerMeans& b, Layer layer);

/// Expects agreement of all layers, and prints the means.
void expectSameLayers(const LayerMeans& truth, const LayerMeans& own, const char* name);

}  // namespace virga::testing
