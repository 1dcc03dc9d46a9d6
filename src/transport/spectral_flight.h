// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/rgb.h"

namespace virga {

/// Spectral multiple importance sampling of a free flight (docs/decisions/spectral-mis.md). One channel, the hero, is
/// chosen in proportion to the throughput and draws the flight; every channel could have drawn the same. What this
/// holds is how likely that was, as the logarithm of each channel's density over the hero's.
struct SpectralFlight {
  int hero = 0;
  Rgb logRatio;

  /// u in [0, 1) chooses the hero.
  VIRGA_HD SpectralFlight(Rgb throughput, float u) {
    const float x = u * (throughput.r + throughput.g + throughput.b);
    hero = x < throughput.r ? 0 : (x < throughput.r + throughput.g || !(throughput.b > 0) ? 1 : 2);
  }

  /// `events` points of a Poisson process whose density is `spectrum` times one that all channels share, over a stretch
  /// in which that one expects `depth` points.
  VIRGA_HD void note(Rgb spectrum, int events, float depth) {
    for (int c = 0; c < 3; ++c) {
      const float difference = spectrum[c] - spectrum[hero];
      if (difference == 0) continue;  // also where the depth is infinite
      logRatio[c] -= difference * depth;
      if (events > 0) logRatio[c] += static_cast<float>(events) * std::log(spectrum[c] / spectrum[hero]);
    }
  }
  /// An event that channel c would have had with probability[c].
  VIRGA_HD void note(Rgb probability) {
    if (isGrey(probability)) return;
    for (int c = 0; c < 3; ++c)
      if (c != hero) logRatio[c] += std::log(probability[c] / probability[hero]);
  }

  /// Each channel's density over the mean of all, weighted by the throughput: what the throughput is multiplied by. The
  /// sum of its channels stays what it was, so that colours never come out of the sampling brighter than they went in.
  VIRGA_HD Rgb weight(Rgb throughput) const {
    float top = 0;
    for (int c = 0; c < 3; ++c)
      if (throughput[c] > 0) top = std::max(top, logRatio[c]);
    Rgb density;
    for (int c = 0; c < 3; ++c)
      if (throughput[c] > 0) density[c] = std::exp(logRatio[c] - top);
    const Rgb share = throughput * density;
    return density * ((throughput.r + throughput.g + throughput.b) / (share.r + share.g + share.b));
  }
};

}  // namespace virga
