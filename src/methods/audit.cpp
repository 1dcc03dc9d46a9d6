// SPDX-License-Identifier: Apache-2.0
#include "methods/audit.h"

#include <algorithm>
#include <cassert>
#include <chrono>
#include <cmath>
#include <memory>

#include "core/parallel.h"
#include "image/metrics.h"
#include "methods/path/path_pixels.h"

namespace virga {
namespace {

constexpr uint64_t kPixelSeed = 0x8d2a61f5c3b94e07ull;  // the choice of pixels against the samples in them
constexpr uint64_t kTruthSeed = 0x5bf03635aca3f1d9ull;  // the audit against the render

double relativeSquareWeight(double b) { return 1 / (b * b + kRelativeFloor); }
double relativeWeight(double b) { return 1 / (std::abs(b) + kRelativeFloor); }

// An estimate of weight(E p) from two independent estimates of E p. The weight of their mean is off by c / n + O(1 /
// n^2) for n samples, that of one alone by twice as much: the difference takes the first term away (Quenouille 1956).
template <class Weight>
double jackknifed(const Weight& weight, double p, double q) {
  return 2 * weight((p + q) / 2) - (weight(p) + weight(q)) / 2;
}

using Terms = Audit::Terms;

// One channel of one pixel: the mean over the six ways to give two groups to the difference and two to the denominator.
Terms channelTerms(double a, const std::array<double, Audit::kGroups>& p) {
  constexpr int kPairings[6][4] = {{0, 1, 2, 3}, {0, 2, 1, 3}, {0, 3, 1, 2}, {1, 2, 0, 3}, {1, 3, 0, 2}, {2, 3, 0, 1}};
  Terms sum;
  for (const auto& [i, j, k, l] : kPairings) {
    const double product = (a - p[i]) * (a - p[j]);
    sum += {.bias = (a - (p[i] + p[j]) / 2) * jackknifed(relativeWeight, p[k], p[l]),
            .relMse = product * jackknifed(relativeSquareWeight, p[k], p[l]),
            .uncorrected = product * relativeSquareWeight((p[k] + p[l]) / 2)};
  }
  return sum * (1.0 / 6);
}

// t with P(|T| > t) = 5 %.
double studentQuantile(double degrees) {
  double low = 0, high = 100;
  for (int i = 0; i < 60; ++i) {
    const double middle = (low + high) / 2;
    (studentTwoSided(middle, degrees) > 0.05 ? low : high) = middle;
  }
  return high;
}

template <class Member>
Estimated estimated(const std::vector<Terms>& panels, Member member) {
  const double n = static_cast<double>(panels.size());
  double mean = 0, squares = 0;
  for (const Terms& p : panels) mean += p.*member / n;
  for (const Terms& p : panels) squares += (p.*member - mean) * (p.*member - mean);
  const double half = studentQuantile(n - 1) * std::sqrt(squares / ((n - 1) * n));
  return {mean, mean - half, mean + half};
}

class Clock {
 public:
  double seconds() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

// Pixels in a panel for which the time is enough for kRoundsBeforePixels rounds; no more than the picture has.
int pixelsInPanel(const Image& picture, int fewest, double secondsOfRound, double seconds) {
  constexpr double kRoundsBeforePixels = 256, kMost = 1024;
  const double affordable = fewest * seconds / (secondsOfRound * kRoundsBeforePixels);
  return std::max(fewest, static_cast<int>(std::min({affordable, kMost, static_cast<double>(picture.pixels.size())})));
}

}  // namespace

bool AuditResult::tooShort() const {
  // The correction is of first order in 1 / n, what it leaves of second: about twice its square, relative to relMSE.
  const double half = (relMse.high - relMse.low) / 2, scale = std::max(std::abs(relMse.value), half);
  return 2 * correction * correction > scale * half / 2;
}

Audit::Audit(const Image& picture, Truth truth, uint64_t seed, int pixelsInPanel)
    : picture_(picture), truth_(std::move(truth)), seed_(seed), pixelsInPanel_(pixelsInPanel) {
  assert(pixelsInPanel >= 1 && !picture.pixels.empty());
  const auto place = [](float u, int n) { return std::min(static_cast<int>(u * static_cast<float>(n)), n - 1); };
  for (uint32_t panel = 0; panel < kPanels; ++panel)
    for (int i = 0; i < pixelsInPanel; ++i) {
      const Vec2 u = Sampler({hash64(seed ^ kPixelSeed), panel, 0, static_cast<uint32_t>(i)}).next2D();
      pixels_.push_back({place(u.x, picture.width), place(u.y, picture.height), {}});
    }
}

bool Audit::round(std::stop_token stop) {
  using Samples = std::array<Rgb, kGroups>;
  std::vector<Samples> samples(pixels_.size());
  parallelFor(static_cast<int64_t>(pixels_.size()), 1, [&](int64_t i) {
    const Pixel& pixel = pixels_[static_cast<size_t>(i)];
    for (uint32_t g = 0; g < kGroups && !stop.stop_requested(); ++g)
      samples[static_cast<size_t>(i)][g] =
          truth_(pixel.x, pixel.y, {seed_, g, static_cast<uint32_t>(i), static_cast<uint32_t>(rounds_)});
  });
  if (stop.stop_requested()) return false;
  for (size_t i = 0; i < pixels_.size(); ++i)
    for (size_t g = 0; g < kGroups; ++g)
      for (size_t c = 0; c < 3; ++c)
        pixels_[i].groups[g].value[c] += static_cast<double>(samples[i][g][static_cast<int>(c)]);
  ++rounds_;
  return true;
}

Audit::Terms Audit::pixelTerms(size_t i) const {
  const Pixel& pixel = pixels_[i];
  Terms sum;
  for (int c = 0; c < 3; ++c) {
    std::array<double, kGroups> means{};
    for (size_t g = 0; g < kGroups; ++g)
      means[g] = pixel.groups[g].value[static_cast<size_t>(c)] / static_cast<double>(rounds_);
    sum += channelTerms(static_cast<double>(picture_.at(pixel.x, pixel.y)[c]), means);
  }
  return sum * (1.0 / 3);
}

std::optional<AuditResult> Audit::result() const {
  if (rounds_ == 0) return std::nullopt;
  AuditResult out;
  out.pixels = static_cast<int64_t>(pixels_.size());
  out.samples = rounds_ * kGroups;
  std::vector<Terms> panels;
  for (size_t first = 0; first < pixels_.size(); first += static_cast<size_t>(pixelsInPanel_)) {
    Terms sum;
    int finite = 0;
    for (size_t i = first; i < first + static_cast<size_t>(pixelsInPanel_); ++i) {
      const Terms terms = pixelTerms(i);
      if (!std::isfinite(terms.bias) || !std::isfinite(terms.relMse)) continue;
      sum += terms;
      ++finite;
    }
    out.nonFinite += pixelsInPanel_ - finite;
    if (finite > 0) panels.push_back(sum * (1.0 / finite));
  }
  if (panels.size() < 2) return std::nullopt;
  out.bias = estimated(panels, &Terms::bias);
  out.relMse = estimated(panels, &Terms::relMse);
  out.correction = estimated(panels, &Terms::uncorrected).value - out.relMse.value;
  return out;
}

Audit::Truth pathTruth(const Scene& scene) {
  const PathOptions options{.maxDepth = scene.integrator.maxDepth, .rrDepth = scene.integrator.rrDepth};
  const auto pixels =
      std::make_shared<PathPixels<EmbreeRays>>(scene, EmbreeRays{*scene.surfaceRays, *scene.boundaryRays}, options);
  return [pixels](int x, int y, const SampleId& id) { return pixels->sample(x, y, id).sum(); };
}

std::optional<AuditResult> auditPicture(const Scene& scene, const Image& picture, const AuditBudget& budget,
                                        std::stop_token stop) {
  constexpr size_t kFewest = 32;
  const Clock clock;
  const Audit::Truth truth = pathTruth(scene);
  const uint64_t seed = hash64(budget.seed ^ kTruthSeed);
  const int fewest = static_cast<int>(std::min(kFewest, picture.pixels.size()));
  Audit first(picture, truth, seed, fewest);
  if (!first.round(stop)) return std::nullopt;
  const int more = pixelsInPanel(picture, fewest, clock.seconds(), budget.seconds);
  // What the first round has measured is dropped with its pixels: a 256th of all, at most.
  Audit larger(picture, truth, hash64(seed), more);
  Audit& audit = more > fewest ? larger : first;
  double latest = 0;
  while (audit.rounds() == 0 || clock.seconds() + latest / 2 < budget.seconds) {
    const Clock round;
    if (!audit.round(stop)) break;
    latest = round.seconds();
  }
  auto result = audit.result();
  if (result) result->seconds = clock.seconds();
  return result;
}

}  // namespace virga
