// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/vec.h"

namespace virga {

/// Which of many lights stand for all: some of them, evenly in space and by their weight, in expectation as bright as
/// all are.
///
/// Lights are laid one behind the other along a curve that fills space, each as long as it weighs, and those are chosen
/// on which the even steps of a ruler fall. Each remembers how far before the next step it began: its place, which is
/// an even random number whatever the light weighs. In later frames a light is chosen by its place and its importance,
/// so that a light comes or goes only as the importance does, and that follows the weight only where they have grown
/// apart (docs/decisions/frame-sequences.md).
class LightChoice {
 public:
  struct Candidate {
    uint64_t name;  ///< the same in each frame
    Vec3 p;         ///< world
    float weight;   ///< > 0
  };
  struct Chosen {
    size_t index;  ///< of the candidate
    float scale;   ///< by which its weight counts
  };

  /// About `most` of the candidates, along the curve, or all if there are no more than that. Their names rise.
  /// `turn` in [0, 1): where the ruler begins, in the first frame.
  std::vector<Chosen> choose(std::span<const Candidate> candidates, size_t most, float turn);

 private:
  struct Known {
    uint64_t name;
    double importance, place;
  };
  std::vector<Known> known_;  ///< those of the last frame, by name
  double ahead_ = -1;  ///< of the ruler's next step before the next new light, in steps; below 0: there were none
};

}  // namespace virga
