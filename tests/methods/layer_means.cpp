// SPDX-License-Identifier: Apache-2.0
#include "methods/layer_means.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

namespace virga::testing {
namespace {

void addPicture(const Image& image, std::array<stats::Moments, LayerMeans::kPlaces>& moments) {
  double sums[LayerMeans::kPlaces] = {};
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x)
      for (int c = 0; c < 3; ++c) {
        const int quarter = (2 * x >= image.width ? 1 : 0) + (2 * y >= image.height ? 2 : 0);
        const auto value = static_cast<double>(image.at(x, y)[c]);
        sums[5 * c + quarter] += value;
        sums[5 * c + 4] += value;
      }
  for (size_t i = 0; i < LayerMeans::kPlaces; ++i) moments[i].add(sums[i] / (image.width * image.height));
}

}  // namespace

LayerMeans layerMeans(const SceneSnapshot& scene, Run run) {
  LayerMeans result;
  run.layers = LayerMask::all();
  for (const uint64_t last = run.seed + 2; run.seed <= last; ++run.seed) {
    const RenderSession session = rendered(scene, run);
    const Film& film = session.film();
    EXPECT_EQ(film.nonFiniteSamples(), 0u);
    for (size_t l = 0; l < kLayerCount; ++l)
      for (int r = 0; r < Film::kReplicates; ++r)
        addPicture(film.replicateLayer(r, static_cast<Layer>(l)), result.layers[l]);
  }
  return result;
}

double agreement(const LayerMeans& a, const LayerMeans& b, Layer layer) {
  double p = 1;
  for (size_t i = 0; i < LayerMeans::kPlaces; ++i) {
    const auto l = static_cast<size_t>(layer);
    p = std::min(p, static_cast<double>(LayerMeans::kPlaces) * stats::welchTest(a.layers[l][i], b.layers[l][i]));
  }
  return p;
}

void expectSameLayers(const LayerMeans& truth, const LayerMeans& own, const char* name) {
  for (size_t l = 0; l < kLayerCount; ++l) {
    const stats::Moments &a = truth.layers[l][LayerMeans::kWhole], &b = own.layers[l][LayerMeans::kWhole];
    fmt::print("{:18} {:.5f} +- {:.2f} %, {} {:.5f} +- {:.2f} %\n", kLayerNames[l], a.mean(),
               100 * a.standardError() / a.mean(), name, b.mean(), 100 * b.standardError() / b.mean());
    EXPECT_GT(agreement(truth, own, static_cast<Layer>(l)), 1e-3) << kLayerNames[l];
  }
}

}  // namespace virga::testing
