// SPDX-License-Identifier: Apache-2.0
// Few lights for many, from frame to frame: in expectation as bright as all, and the same ones where little changes.
#include "methods/instant_scattering/light_choice.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "core/random.h"

namespace virga {
namespace {

constexpr size_t kLights = 600, kMost = 60;
using Candidates = std::vector<LightChoice::Candidate>;

Candidates lightsOf(uint64_t seed) {
  Pcg32 random(seed);
  Candidates lights;
  for (size_t i = 0; i < kLights; ++i) {
    const Vec3 p(random.next(), random.next(), random.next());
    lights.push_back({i, p, 0.1f + random.next() * random.next() * 5});
  }
  return lights;
}

/// A later frame: weights times factors about 1, but for some lights that have gone and come.
Candidates changed(Candidates lights, float by, uint64_t seed) {
  Pcg32 random(seed);
  for (auto& l : lights) l.weight *= std::exp(by * (2 * random.next() - 1));
  return lights;
}
Candidates without(const Candidates& lights, uint64_t every) {
  Candidates left;
  std::copy_if(lights.begin(), lights.end(), std::back_inserter(left),
               [&](const auto& l) { return l.name % every != 0; });
  return left;
}

/// What lights send from a half of their box.
double sent(const Candidates& all, const std::vector<LightChoice::Chosen>& chosen) {
  double sum = 0;
  for (const auto& [i, scale] : chosen)
    if (all[i].p.x + all[i].p.y < 1) sum += static_cast<double>(all[i].weight * scale);
  return sum;
}
double sent(const Candidates& all) {
  double sum = 0;
  for (const auto& l : all)
    if (l.p.x + l.p.y < 1) sum += static_cast<double>(l.weight);
  return sum;
}

TEST(LightChoice, IsAsBrightAsAllInEveryFrame) {
  const Candidates first = lightsOf(1);
  const std::vector<Candidates> frames = {without(first, 5), changed(first, 1.5f, 2), without(changed(first, 3, 3), 7),
                                          first};
  constexpr int kTurns = 1000;
  std::vector<double> sums(frames.size()), stale(frames.size());
  for (int n = 0; n < kTurns; ++n) {
    LightChoice choice;
    const Candidates* before = &frames[0];
    for (size_t f = 0; f < frames.size(); ++f) {
      const auto chosen = choice.choose(frames[f], kMost, (static_cast<float>(n) + 0.5f) / kTurns);
      EXPECT_NEAR(static_cast<double>(chosen.size()), kMost, 0.6 * kMost);
      sums[f] += sent(frames[f], chosen) / kTurns;
      // With weights of the frame before, of which some lights are missing.
      if (before->size() == frames[f].size()) continue;
      stale[f] += sent(*before, LightChoice().choose(*before, kMost, 0.5f)) / kTurns;
      before = &frames[f];
    }
  }
  for (size_t f = 0; f < frames.size(); ++f)
    EXPECT_NEAR(sums[f] / sent(frames[f]), 1, f == 0 ? 2e-3 : 1.5e-2) << "frame " << f;
  EXPECT_GT(std::fabs(stale[2] / sent(frames[2]) - 1), 0.1) << "the test cannot fail";
}

std::set<uint64_t> namesOf(const Candidates& all, const std::vector<LightChoice::Chosen>& chosen) {
  std::set<uint64_t> names;
  for (const auto& [i, scale] : chosen) names.insert(all[i].name);
  return names;
}

TEST(LightChoice, StaysWhereWeightsHardlyChange) {
  const Candidates first = lightsOf(1), next = changed(first, 0.1f, 2);
  LightChoice choice;
  const auto before = namesOf(first, choice.choose(first, kMost, 0.5f));
  EXPECT_EQ(namesOf(next, choice.choose(next, kMost, 0.5f)), before);
  EXPECT_NE(namesOf(next, LightChoice().choose(next, kMost, 0.5f)), before) << "anew, the test cannot fail";
}

TEST(LightChoice, AFrameThatIsAskedForTwiceIsTheSame) {
  const Candidates first = lightsOf(1), next = changed(without(first, 3), 2, 2);
  LightChoice choice;
  choice.choose(first, kMost, 0.5f);
  const auto once = choice.choose(next, kMost, 0.5f), twice = choice.choose(next, kMost, 0.5f);
  EXPECT_EQ(namesOf(next, once), namesOf(next, twice));
}

TEST(LightChoice, FewAreAllKept) {
  const Candidates first = lightsOf(1);
  const auto chosen = LightChoice().choose(first, kLights, 0.5f);
  EXPECT_EQ(chosen.size(), kLights);
  EXPECT_DOUBLE_EQ(sent(first, chosen), sent(first));
  EXPECT_TRUE(LightChoice().choose({}, kMost, 0.5f).empty());
}

}  // namespace
}  // namespace virga
