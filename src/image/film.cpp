// SPDX-License-Identifier: Apache-2.0
#include "image/film.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "core/error.h"
#include "core/parallel.h"
#include "core/random.h"

namespace virga {
namespace {

constexpr int64_t kChunk = 4096;  // pixels that one task merges: three planes of it fit a level-2 cache

static_assert(sizeof(Rgb) == 3 * sizeof(float), "planes are merged as arrays of floats");

// True if any float is NaN or infinite. `x * 0` is NaN for exactly those, so that the loop needs no branch.
bool anyNonFinite(const float* x, int64_t n) {
  float probe = 0;
#pragma omp simd reduction(+ : probe)
  for (int64_t i = 0; i < n; ++i) probe += x[i] * 0;
  return probe != 0;
}

// Rounds to float, up or down with the probabilities that make the expectation exact: the 29 bits that float lacks are
// added to random ones, and the carry decides. Floats, infinities and NaNs (whose low bits are zero here) stay.
float roundUnbiased(double x, uint32_t random) {
  constexpr uint64_t kLost = (uint64_t{1} << 29) - 1;
  return static_cast<float>(std::bit_cast<double>((std::bit_cast<uint64_t>(x) + (random & kLost)) & ~kLost));
}

// Welford's update of a running mean, whose steps shrink with the number of samples until they drop below the last bit
// of the mean. Rounding to nearest would then ignore all but the large ones, a bias where samples are skewed (2e-4
// after 1e5 samples of 1000 plus an exponential). Rounded without bias it stays noise, of about 1e-5, and the spread
// between replicates includes it. The mean of equal samples is exactly that sample.
void updateMean(float* mean, const float* sample, int64_t n, int64_t samples, uint32_t salt) {
  const double weight = 1.0 / static_cast<double>(samples);
#pragma omp simd
  for (int64_t i = 0; i < n; ++i) {
    const double before = static_cast<double>(mean[i]), step = (static_cast<double>(sample[i]) - before) * weight;
    mean[i] = roundUnbiased(before + step, hash32(salt + static_cast<uint32_t>(i)));
  }
}

Image sumInOrder(const std::vector<Image>& planes) {
  Image sum = planes.front();
  parallelFor(static_cast<int64_t>(sum.pixels.size()), kChunk, [&](int64_t i) {
    const size_t pixel = static_cast<size_t>(i);
    Rgb total;
    for (const Image& plane : planes) total += plane.pixels[pixel];
    sum.pixels[pixel] = total;
  });
  return sum;
}

struct Rgb64 {
  double c[3] = {0, 0, 0};
};

}  // namespace

// ---- PassFrame ------------------------------------------------------------------------------------------------------

PassFrame::PassFrame(int width, int height, LayerMask layers) : width_(width), height_(height), layers_(layers) {
  VIRGA_ASSERT(width > 0 && height > 0);
  // The beauty of a full set of layers is their sum: it takes no plane.
  planes_.emplace_back(layers == LayerMask::all() ? Image() : Image(width, height));
  for (int i = 0; i < kLayerCount; ++i)
    if (layers.has(static_cast<Layer>(i))) planes_.emplace_back(width, height);
}

void PassFrame::set(int x, int y, const LayerRadiance& radiance) {
  if (!planes_[0].pixels.empty()) planes_[0].at(x, y) = radiance.sum();
  size_t plane = 1;
  for (int i = 0; i < kLayerCount; ++i)
    if (layers_.has(static_cast<Layer>(i))) planes_[plane++].at(x, y) = radiance.value[i];
}

void PassFrame::add(int x, int y, Layer layer, Rgb radiance) {
  if (!planes_[0].pixels.empty()) planes_[0].at(x, y) += radiance;
  if (!layers_.has(layer)) return;
  const uint32_t before = layers_.bits & ((1u << static_cast<int>(layer)) - 1);
  planes_[1 + static_cast<size_t>(std::popcount(before))].at(x, y) += radiance;
}

// ---- Film: the passes -----------------------------------------------------------------------------------------------

Film::Film(int width, int height, LayerMask layers) : frame_(width, height, layers) {}

int Film::width() const { return frame_.width_; }
int Film::height() const { return frame_.height_; }
LayerMask Film::layers() const { return frame_.layers_; }

int64_t Film::passes() const { return passes_; }
uint64_t Film::nonFiniteSamples() const { return nonFinite_; }

int64_t Film::passesOf(int replicate) const {
  VIRGA_ASSERT(replicate >= 0 && replicate < kReplicates);
  return replicates_[static_cast<size_t>(replicate)].passes;
}

// Of pixels [begin, end) of the frame, those with a NaN or an infinity in any plane.
uint64_t Film::countNonFinite(size_t begin, size_t end) const {
  const auto isBad = [this](size_t pixel) {
    return std::any_of(frame_.planes_.begin(), frame_.planes_.end(),
                       [pixel](const Image& plane) { return !plane.pixels.empty() && !isFinite(plane.pixels[pixel]); });
  };
  uint64_t count = 0;
  for (size_t pixel = begin; pixel < end; ++pixel) count += isBad(pixel) ? 1 : 0;
  return count;
}

uint64_t Film::mergeChunk(Replicate& replicate, size_t begin, size_t end) const {
  const int64_t n = 3 * static_cast<int64_t>(end - begin);
  bool suspicious = false;
  for (size_t p = 0; p < frame_.planes_.size(); ++p) {
    if (frame_.planes_[p].pixels.empty()) continue;
    const float* sample = &frame_.planes_[p].pixels[begin].r;
    float* mean = &replicate.planes[p].pixels[begin].r;
    suspicious |= anyNonFinite(sample, n);
    if (replicate.passes == 1) {
      std::copy(sample, sample + n, mean);
    } else {
      // The same picture for every number of threads: the rounding depends on replicate, pass, plane and pixel alone.
      uint32_t salt = hashCombine(static_cast<uint32_t>(&replicate - replicates_.data()), static_cast<uint32_t>(p));
      salt = hashCombine(salt, static_cast<uint32_t>(replicate.passes)) + 3 * static_cast<uint32_t>(begin);
      updateMean(mean, sample, n, replicate.passes, salt);
    }
  }
  return suspicious ? countNonFinite(begin, end) : 0;
}

// Returns how many pixels came with a NaN or an infinity.
uint64_t Film::merge(Replicate& replicate) {
  if (replicate.planes.empty()) replicate.planes = frame_.planes_;  // the first pass overwrites it below: right size
  ++replicate.passes;
  const size_t pixels = static_cast<size_t>(width()) * static_cast<size_t>(height());
  const int64_t chunks = (static_cast<int64_t>(pixels) + kChunk - 1) / kChunk;
  std::vector<uint64_t> bad(static_cast<size_t>(chunks));
  parallelFor(chunks, 1, [&](int64_t chunk) {
    const size_t begin = static_cast<size_t>(chunk * kChunk);
    bad[static_cast<size_t>(chunk)] = mergeChunk(replicate, begin, std::min(pixels, begin + kChunk));
  });
  uint64_t total = 0;
  for (const uint64_t b : bad) total += b;
  return total;
}

void Film::average(int replicate) {
  VIRGA_ASSERT(replicate >= 0 && replicate < kReplicates);
  nonFinite_ += merge(replicates_[static_cast<size_t>(replicate)]);
  ++passes_;
}

void Film::replace() {
  for (Replicate& r : replicates_) r.passes = 0;
  nonFinite_ = merge(replicates_[0]);
  ++passes_;
}

void Film::clear() {
  for (Replicate& r : replicates_) r.passes = 0;
  passes_ = 0;
  nonFinite_ = 0;
}

// ---- Film: the pictures ---------------------------------------------------------------------------------------------

bool Film::storesBeauty() const { return layers() != LayerMask::all(); }

size_t Film::planeOf(Layer layer) const {
  VIRGA_ASSERT(layers().has(layer));
  size_t plane = 1;
  for (int i = 0; i < static_cast<int>(layer); ++i) plane += layers().has(static_cast<Layer>(i)) ? 1 : 0;
  return plane;
}

Image Film::replicatePlane(int replicate, size_t plane) const {
  return passesOf(replicate) == 0 ? Image(width(), height())
                                  : replicates_[static_cast<size_t>(replicate)].planes[plane];
}

Image Film::replicateLayer(int replicate, Layer layer) const { return replicatePlane(replicate, planeOf(layer)); }

Image Film::replicateBeauty(int replicate) const {
  if (storesBeauty()) return replicatePlane(replicate, 0);
  std::vector<Image> planes;
  for (size_t p = 1; p <= kLayerCount; ++p) planes.push_back(replicatePlane(replicate, p));
  return sumInOrder(planes);
}

// The replicates that hold passes, with their share of all passes.
std::vector<Film::Weighted> Film::weighted() const {
  int64_t total = 0;
  for (const Replicate& r : replicates_) total += r.passes;
  std::vector<Weighted> filled;
  for (const Replicate& r : replicates_)
    if (r.passes > 0) filled.push_back({&r, static_cast<double>(r.passes) / static_cast<double>(total)});
  return filled;
}

Image Film::planeMean(size_t plane) const {
  Image out(width(), height());
  const std::vector<Weighted> filled = weighted();
  parallelFor(static_cast<int64_t>(out.pixels.size()), kChunk, [&](int64_t i) {
    const size_t pixel = static_cast<size_t>(i);
    Rgb64 sum;
    for (const Weighted& w : filled) {
      const Rgb m = w.replicate->planes[plane].pixels[pixel];
      for (int c = 0; c < 3; ++c) sum.c[c] += w.weight * static_cast<double>(m[c]);
    }
    for (int c = 0; c < 3; ++c) out.pixels[pixel][c] = static_cast<float>(sum.c[c]);
  });
  return out;
}

Image Film::layer(Layer layer) const { return planeMean(planeOf(layer)); }

Image Film::beauty() const {
  if (storesBeauty()) return planeMean(0);
  std::vector<Image> planes;
  for (size_t p = 1; p <= kLayerCount; ++p) planes.push_back(planeMean(p));
  return sumInOrder(planes);
}

bool Film::hasVariance() const { return weighted().size() >= 2; }

// Variance of the mean m = sum_r w_r m_r over independent replicates with shares w_r = n_r / N, from their spread:
//
//     V = sum_r w_r^2 (m_r - m)^2 / (1 - sum_r w_r^2).
//
// Let s_r = Var(m_r); the m_r have one expectation, so Var(m) = sum w_r^2 s_r and
// E (m_r - m)^2 = s_r (1 - 2 w_r) + Var(m). Hence
//
//     E V (1 - sum w^2) = sum w_r^2 s_r (1 - 2 w_r) + Var(m) sum w^2.
//
// Equal shares 1/R: this is Var(m) (1 - 1/R), so V is unbiased *whatever* the s_r are (and is the textbook
// sum (m_r - m)^2 / (R (R - 1))). Unequal shares with s_r = s / n_r, that is, independent passes: sum w_r^2 s_r w_r
// = (s / N) sum w^2 = Var(m) sum w^2, and V is unbiased again. Unequal shares of a low-discrepancy sequence, s_r = s
// n_r^-p with p > 1: with n_r = (1 + x_r) N / R the first order in x cancels, and V is too high by 2 (p - 1) / (R - 1)
// times the mean of x_r^2. Replicates filled in turn differ by one pass at most: p = 3 and counts of 1 and 2 make that
// 6 %, counts of 10 and 11 make it 0.1 %.
template <class Value>
Film::Moments Film::moments(const std::vector<Weighted>& filled, const Value& value) {
  double rest = 1;
  for (const Weighted& w : filled) rest -= w.weight * w.weight;
  std::array<Rgb, kReplicates> m;
  for (size_t r = 0; r < filled.size(); ++r) m[r] = value(*filled[r].replicate);
  Moments out;
  for (int c = 0; c < 3; ++c) {
    double centre = 0, sum = 0, relative = 0;
    for (size_t r = 0; r < filled.size(); ++r) centre += filled[r].weight * static_cast<double>(m[r][c]);
    for (size_t r = 0; r < filled.size(); ++r) {
      const double share = filled[r].weight, own = static_cast<double>(m[r][c]), d = share * (own - centre);
      const double others = share < 1 ? (centre - share * own) / (1 - share) : centre;
      sum += d * d;
      relative += d * d / (others * others + 0.01);
    }
    out.mean[c] = centre;
    out.variance[c] = sum / rest;
    out.relativeVariance[c] = relative / rest;
  }
  return out;
}

template <class Value>
Image Film::varianceOf(const Value& value) const {
  const std::vector<Weighted> filled = weighted();
  VIRGA_ASSERT(filled.size() >= 2);
  Image out(width(), height());
  parallelFor(static_cast<int64_t>(out.pixels.size()), kChunk, [&](int64_t i) {
    const size_t pixel = static_cast<size_t>(i);
    const Moments m = moments(filled, [&](const Replicate& r) { return value(r, pixel); });
    for (int c = 0; c < 3; ++c) out.pixels[pixel][c] = static_cast<float>(m.variance[c]);
  });
  return out;
}

Image Film::layerVariance(Layer layer) const {
  return varianceOf(
      [plane = planeOf(layer)](const Replicate& r, size_t pixel) { return r.planes[plane].pixels[pixel]; });
}

// A replicate's beauty: stored, or the layers in order.
Rgb Film::beautyAt(const Replicate& replicate, size_t pixel) {
  if (replicate.planes.size() != kLayerCount + 1) return replicate.planes[0].pixels[pixel];
  Rgb total;
  for (size_t p = 1; p <= kLayerCount; ++p) total += replicate.planes[p].pixels[pixel];
  return total;
}

Image Film::beautyVariance() const { return varianceOf(beautyAt); }

// The numerator is unbiased; the ratio is not, because the unknown true value of the denominator is replaced by a mean.
// Were it the mean of all replicates, a firefly would raise it together with the numerator and hide itself: in fog the
// error came out at less than half. The mean of the others does not know of it. What is left is the curvature of 1 /
// x^2, which errs on the safe side, and what no replicate has met, which shows in no spread.
std::optional<double> Film::estimatedRelMse() const {
  if (!hasVariance()) return std::nullopt;
  struct Sum {
    double error = 0, channels = 0;
  };
  const std::vector<Weighted> filled = weighted();
  const auto errorOf = [&](int64_t i) {
    const Moments m = moments(filled, [i](const Replicate& r) { return beautyAt(r, static_cast<size_t>(i)); });
    Sum pixel{0, 3};
    for (int c = 0; c < 3; ++c) pixel.error += m.relativeVariance[c];
    return std::isfinite(pixel.error) ? pixel : Sum{};
  };
  const Sum sum = deterministicReduce<Sum>(int64_t{width()} * height(), {}, errorOf, [](Sum x, Sum y) {
    return Sum{x.error + y.error, x.channels + y.channels};
  });
  if (sum.channels == 0) return std::nullopt;
  return sum.error / sum.channels;
}

}  // namespace virga
