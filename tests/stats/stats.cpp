// SPDX-License-Identifier: Apache-2.0
#include "stats/stats.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "core/error.h"
#include "core/random.h"

namespace virga::stats {
namespace {

constexpr double kPiDouble = std::numbers::pi;
constexpr double kPooledBelow = 10;      // expected count of a cell that stands alone
constexpr double kStrayShare = 1e-5;     // of all samples: tolerated where the density is 0 (rounding at its border)
constexpr double kIntegralSlack = 2e-3;  // of a density that claims to integrate to 1: its single-precision noise
constexpr double kCellTolerance = 1e-6;  // absolute error of the integral over one cell
constexpr double kNarrowest = 1e-7;      // of a ring or interval, relative to the whole

// --- Quadrature ---

// Gauss-Legendre, three points on [0, 1].
constexpr std::array<double, 3> kNode = {0.11270166537925831, 0.5, 0.88729833462074169};
constexpr std::array<double, 3> kWeight = {5.0 / 18, 8.0 / 18, 5.0 / 18};

struct Rectangle {
  double x0, x1, y0, y1;
};

template <class F>
double gauss(const F& f, double lo, double hi) {
  double sum = 0;
  for (size_t i = 0; i < 3; ++i) sum += kWeight[i] * f(lo + (hi - lo) * kNode[i]);
  return sum * (hi - lo);
}

template <class F>
double gauss(const F& f, const Rectangle& r) {
  return gauss([&](double x) { return gauss([&](double y) { return f(x, y); }, r.y0, r.y1); }, r.x0, r.x1);
}

template <class F>
double adaptive(const F& f, double lo, double hi, double whole, double tolerance, int depth) {
  const double middle = 0.5 * (lo + hi), left = gauss(f, lo, middle), right = gauss(f, middle, hi);
  if (depth == 0 || !(std::fabs(left + right - whole) > tolerance)) return left + right;  // also at once for NaN
  return adaptive(f, lo, middle, left, tolerance / 2, depth - 1) +
         adaptive(f, middle, hi, right, tolerance / 2, depth - 1);
}

// The tolerance does not shrink with the rectangle: along a jump of f the errors of the quarters are independent.
template <class F>
double adaptive(const F& f, const Rectangle& r, double whole, double tolerance, int depth) {
  const double x = 0.5 * (r.x0 + r.x1), y = 0.5 * (r.y0 + r.y1);
  const std::array<Rectangle, 4> quarters = {
      Rectangle{r.x0, x, r.y0, y}, {x, r.x1, r.y0, y}, {r.x0, x, y, r.y1}, {x, r.x1, y, r.y1}};
  std::array<double, 4> part;
  for (size_t i = 0; i < 4; ++i) part[i] = gauss(f, quarters[i]);
  const double sum = part[0] + part[1] + part[2] + part[3];
  if (depth == 0 || !(std::fabs(sum - whole) > tolerance)) return sum;
  double refined = 0;
  for (size_t i = 0; i < 4; ++i) refined += adaptive(f, quarters[i], part[i], tolerance, depth - 1);
  return refined;
}

// --- The sphere about an axis, in double precision ---

struct Axis {
  std::array<double, 3> s, t, n;

  explicit Axis(Vec3 axis) : n{axis.x, axis.y, axis.z} {
    const double length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    VIRGA_ASSERT(length > 0);
    for (double& v : n) v /= length;
    // Any vector that is far from parallel to n, made orthogonal to it.
    const size_t small = std::fabs(n[0]) < 0.6 ? 0 : 1;
    s = {-n[small] * n[0], -n[small] * n[1], -n[small] * n[2]};
    s[small] += 1;
    const double sLength = std::sqrt(s[0] * s[0] + s[1] * s[1] + s[2] * s[2]);
    for (double& v : s) v /= sLength;
    t = {n[1] * s[2] - n[2] * s[1], n[2] * s[0] - n[0] * s[2], n[0] * s[1] - n[1] * s[0]};
  }

  Vec3 direction(double theta, double phi) const {
    const double a = std::sin(theta) * std::cos(phi), b = std::sin(theta) * std::sin(phi), c = std::cos(theta);
    const auto component = [&](size_t i) { return static_cast<float>(a * s[i] + b * t[i] + c * n[i]); };
    return {component(0), component(1), component(2)};
  }
  double theta(Vec3 v) const { return std::atan2(std::hypot(along(s, v), along(t, v)), along(n, v)); }
  double phi(Vec3 v) const {  // in [0, 2 pi]
    const double angle = std::atan2(along(t, v), along(s, v));
    return angle < 0 ? angle + 2 * kPiDouble : angle;
  }

 private:
  static double along(const std::array<double, 3>& a, Vec3 v) { return a[0] * v.x + a[1] * v.y + a[2] * v.z; }
};

// --- Cells ---

// A strip of the domain (a ring, an interval) with the share of the density in each of its cells.
struct Strip {
  double lo, hi;
  std::vector<double> shares;

  double share() const { return std::accumulate(shares.begin(), shares.end(), 0.0); }
};

// Halves [lo, hi] until no strip has more than `limit` by the rough estimate, then integrates the strips well.
template <class Rough, class Fine>
void appendStrips(double lo, double hi, double limit, double narrowest, const Rough& rough, const Fine& fine,
                  std::vector<Strip>& out) {
  const double middle = 0.5 * (lo + hi);
  if (hi - lo > narrowest && rough(lo, middle) + rough(middle, hi) > limit) {
    appendStrips(lo, middle, limit, narrowest, rough, fine, out);
    appendStrips(middle, hi, limit, narrowest, rough, fine, out);
  } else {
    out.push_back({lo, hi, fine(lo, hi)});
  }
}

// Joins neighbours until about `count` strips of similar share are left. A strip without density joins none that has
// some.
std::vector<Strip> joinStrips(const std::vector<Strip>& fine, int count) {
  double total = 0;
  for (const Strip& strip : fine) total += strip.share();
  std::vector<Strip> out;
  double open = 0;  // share of out.back()
  for (const Strip& strip : fine) {
    const double share = strip.share();
    if (out.empty() || open + 0.5 * share > total / count || (open > 0) != (share > 0)) {
      out.push_back(strip);
      open = share;
      continue;
    }
    Strip& last = out.back();
    last.hi = strip.hi, open += share;
    for (size_t i = 0; i < strip.shares.size(); ++i) last.shares[i] += strip.shares[i];
  }
  return out;
}

size_t stripOf(const std::vector<Strip>& strips, double x) {
  const auto behind =
      std::upper_bound(strips.begin(), strips.end(), x, [](double v, const Strip& s) { return v < s.lo; });
  return behind == strips.begin() ? 0 : static_cast<size_t>(behind - strips.begin()) - 1;
}

size_t cellOf(double unit, int cells) {
  return static_cast<size_t>(std::clamp(static_cast<int>(std::floor(unit * cells)), 0, cells - 1));
}

// Sums of the cells that group(i) puts together, and the lost samples behind them.
template <class Group>
std::vector<double> sums(const std::vector<double>& cells, const Group& group, double lost) {
  std::vector<double> out;
  for (size_t i = 0; i < cells.size(); ++i) {
    if (group(i) >= out.size()) out.resize(group(i) + 1, 0.0);
    out[group(i)] += cells[i];
  }
  out.push_back(lost);
  return out;
}

// Compares counts with shares of the density, on a grid of rows of `columns` cells; what is missing to 1 is the share
// of the lost samples. Many cells see sharp errors and miss broad ones, so rows, columns and the total are tested as
// well, and the smallest of the four p-values is paid for with a factor 4 (Bonferroni).
double compare(const std::vector<double>& observed, std::vector<double> expected, int columns, double lost,
               int64_t samples) {
  const auto n = static_cast<double>(samples);
  double missing = 1 - std::accumulate(expected.begin(), expected.end(), 0.0);
  if (!(missing > -kIntegralSlack)) return 0;
  if (missing < 0 || (lost == 0 && missing < kIntegralSlack)) missing = 0;
  for (double& share : expected) share *= n;
  const auto p = [&](const auto& group) {
    return chiSquaredCounts(sums(observed, group, lost), sums(expected, group, missing * n));
  };
  const auto width = static_cast<size_t>(columns);
  const double smallest = std::min({p([](size_t i) { return i; }), p([&](size_t i) { return i / width; }),
                                    p([&](size_t i) { return i % width; }), p([](size_t) { return size_t{0}; })});
  return std::fmin(1.0, 4 * smallest);
}

std::vector<double> flattened(const std::vector<Strip>& strips) {
  std::vector<double> shares;
  for (const Strip& strip : strips) shares.insert(shares.end(), strip.shares.begin(), strip.shares.end());
  return shares;
}

template <class Density>
std::vector<Strip> rings(const SphereTest& test, const Density& density) {
  const double sector = 2 * kPiDouble / test.phi;
  const auto cell = [&](double lo, double hi, int j) { return Rectangle{lo, hi, j * sector, (j + 1) * sector}; };
  const auto rough = [&](double lo, double hi) {
    double sum = 0;
    for (int j = 0; j < test.phi; ++j) sum += gauss(density, cell(lo, hi, j));
    return sum;
  };
  const auto fine = [&](double lo, double hi) {
    std::vector<double> shares;
    for (int j = 0; j < test.phi; ++j)
      shares.push_back(adaptive(density, cell(lo, hi, j), gauss(density, cell(lo, hi, j)), kCellTolerance, 10));
    return shares;
  };
  constexpr int kStart = 32;
  std::vector<Strip> out;
  for (int i = 0; i < kStart; ++i)
    appendStrips(kPiDouble * i / kStart, kPiDouble * (i + 1) / kStart, 0.25 / test.theta, kNarrowest * kPiDouble, rough,
                 fine, out);
  return joinStrips(out, test.theta);
}

// --- Incomplete gamma and beta ---

constexpr double kEpsilon = 1e-15;
constexpr double kTiny = 1e-300;
constexpr int kMaxTerms = 100'000;

// Value of b0 + a1 / (b1 + a2 / (b2 + ...)) by Lentz's method; term(i) gives (a_i, b_i).
template <class Term>
double continuedFraction(double b0, const Term& term) {
  double value = b0 == 0 ? kTiny : b0, c = value, d = 0;
  for (int i = 1; i < kMaxTerms; ++i) {
    const auto [a, b] = term(i);
    d = b + a * d;
    c = b + a / c;
    if (d == 0) d = kTiny;
    if (c == 0) c = kTiny;
    d = 1 / d;
    value *= c * d;
    if (std::fabs(c * d - 1) < kEpsilon) break;
  }
  return value;
}

// x^a e^-x (1/a + x/(a (a+1)) + ...) / Gamma(a)
double gammaLowerSeries(double a, double x) {
  double term = 1 / a, sum = term;
  for (int i = 1; i < kMaxTerms && term > sum * kEpsilon; ++i) sum += term *= x / (a + i);
  return sum * std::exp(a * std::log(x) - x - std::lgamma(a));
}

double betaFraction(double a, double b, double x) {
  const double value = continuedFraction(1, [&](int i) {
    const int m = i / 2;
    const double top =
        i % 2 == 0 ? m * (b - m) * x / ((a + i - 1) * (a + i)) : -(a + m) * (a + b + m) * x / ((a + i - 1) * (a + i));
    return std::pair(top, 1.0);
  });
  return std::exp(a * std::log(x) + b * std::log1p(-x) + std::lgamma(a + b) - std::lgamma(a) - std::lgamma(b)) /
         (a * value);
}

double twoSided(double t, double degreesOfFreedom) { return 2 * studentCdf(-std::fabs(t), degreesOfFreedom); }

}  // namespace

double chiSquared(const SphereTest& test, const std::function<std::optional<Vec3>(Vec2)>& sample,
                  const std::function<double(Vec3)>& density) {
  const Axis axis(test.axis);
  const std::vector<Strip> strips =
      rings(test, [&](double theta, double phi) { return density(axis.direction(theta, phi)) * std::sin(theta); });
  std::vector<double> observed(strips.size() * static_cast<size_t>(test.phi), 0.0);
  double lost = 0;
  Pcg32 rng(test.seed);
  for (int64_t i = 0; i < test.samples; ++i) {
    const float u = rng.next();
    const std::optional<Vec3> direction = sample({u, rng.next()});
    if (!direction) {
      ++lost;
      continue;
    }
    if (!isFinite(*direction)) return 0;
    const size_t sector = cellOf(axis.phi(*direction) / (2 * kPiDouble), test.phi);
    ++observed[stripOf(strips, axis.theta(*direction)) * static_cast<size_t>(test.phi) + sector];
  }
  return compare(observed, flattened(strips), test.phi, lost, test.samples);
}

double chiSquaredInterval(const IntervalTest& test, const std::function<std::optional<double>(float)>& sample,
                          const std::function<double(double)>& density) {
  const auto rough = [&](double lo, double hi) { return gauss(density, lo, hi); };
  const auto fine = [&](double lo, double hi) {
    return std::vector<double>{adaptive(density, lo, hi, gauss(density, lo, hi), kCellTolerance, 20)};
  };
  constexpr int kStart = 64;
  std::vector<Strip> strips;
  const double width = test.hi - test.lo;
  for (int i = 0; i < kStart; ++i)
    appendStrips(test.lo + width * i / kStart, test.lo + width * (i + 1) / kStart, 0.25 / test.cells,
                 kNarrowest * width, rough, fine, strips);
  strips = joinStrips(strips, test.cells);
  std::vector<double> observed(strips.size(), 0.0);
  double lost = 0;
  Pcg32 rng(test.seed);
  for (int64_t i = 0; i < test.samples; ++i) {
    const std::optional<double> x = sample(rng.next());
    if (x && std::isnan(*x)) return 0;
    const bool inside = x && *x >= test.lo && *x <= test.hi;
    ++(inside ? observed[stripOf(strips, *x)] : lost);
  }
  return compare(observed, flattened(strips), std::max(1, test.cells / 8), lost, test.samples);
}

double chiSquaredSquare(const SquareTest& test, const std::function<std::optional<Vec2>(Vec2)>& sample,
                        const std::function<double(Vec2)>& density) {
  const auto f = [&](double x, double y) { return density({static_cast<float>(x), static_cast<float>(y)}); };
  std::vector<double> shares;
  for (int j = 0; j < test.ny; ++j)
    for (int i = 0; i < test.nx; ++i) {
      const Rectangle cell{static_cast<double>(i) / test.nx, (i + 1.0) / test.nx, static_cast<double>(j) / test.ny,
                           (j + 1.0) / test.ny};
      shares.push_back(adaptive(f, cell, gauss(f, cell), kCellTolerance, 10));
    }
  std::vector<double> observed(shares.size(), 0.0);
  double lost = 0;
  Pcg32 rng(test.seed);
  for (int64_t k = 0; k < test.samples; ++k) {
    const float u = rng.next();
    const std::optional<Vec2> p = sample({u, rng.next()});
    if (p && (std::isnan(p->x) || std::isnan(p->y))) return 0;
    const bool inside = p && p->x >= 0 && p->x <= 1 && p->y >= 0 && p->y <= 1;
    ++(inside ? observed[cellOf(p->y, test.ny) * static_cast<size_t>(test.nx) + cellOf(p->x, test.nx)] : lost);
  }
  return compare(observed, std::move(shares), test.nx, lost, test.samples);
}

double chiSquaredCounts(std::span<const double> observed, std::span<const double> expected) {
  VIRGA_ASSERT(observed.size() == expected.size());
  std::vector<size_t> order(expected.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::sort(order.begin(), order.end(), [&](size_t a, size_t b) { return expected[a] < expected[b]; });
  const double total = std::accumulate(observed.begin(), observed.end(), 0.0);
  double statistic = 0, stray = 0, poolObserved = 0, poolExpected = 0;
  int cells = 0;
  for (size_t k = 0; k < order.size(); ++k) {
    const double o = observed[order[k]], e = expected[order[k]];
    if (!(e >= 0)) return 0;
    if (e == 0) stray += o;
    poolObserved += o, poolExpected += e;
    // Cells come in rising order: only if all are small can a remainder stay behind, and it is left out.
    if (poolExpected < kPooledBelow) continue;
    const double deviation = poolObserved - poolExpected;
    statistic += deviation * deviation / poolExpected;
    poolObserved = poolExpected = 0;
    ++cells;
  }
  if (stray > kStrayShare * total) return 0;
  return cells > 1 ? chiSquaredTail(statistic, cells - 1) : 1;
}

double kolmogorovSmirnov(std::vector<double> values, const std::function<double(double)>& cdf) {
  std::sort(values.begin(), values.end());
  const auto n = static_cast<double>(values.size());
  double largest = 0;
  for (size_t i = 0; i < values.size(); ++i) {
    const double f = cdf(values[i]), below = static_cast<double>(i) / n;
    if (std::isnan(f)) return 0;
    largest = std::max({largest, f - below, below + 1 / n - f});
  }
  // Stephens' correction of the asymptotic law for finite n (1970).
  return kolmogorovTail((std::sqrt(n) + 0.12 + 0.11 / std::sqrt(n)) * largest);
}

double integrateSphere(const std::function<double(Vec3)>& f, Vec3 axis, double tolerance) {
  const Axis frame(axis);
  const auto integrand = [&](double theta, double phi) { return f(frame.direction(theta, phi)) * std::sin(theta); };
  constexpr int kRings = 64, kSectors = 32;
  double sum = 0;
  for (int i = 0; i < kRings; ++i)
    for (int j = 0; j < kSectors; ++j) {
      const Rectangle cell{kPiDouble * i / kRings, kPiDouble * (i + 1) / kRings, 2 * kPiDouble * j / kSectors,
                           2 * kPiDouble * (j + 1) / kSectors};
      // The cells' errors are far smaller than what stops the refinement; hence the mild division.
      sum += adaptive(integrand, cell, gauss(integrand, cell), tolerance / kSectors, 12);
    }
  return sum;
}

double integrateInterval(const std::function<double(double)>& f, double lo, double hi, double tolerance) {
  constexpr int kPieces = 32;
  double sum = 0;
  for (int i = 0; i < kPieces; ++i) {
    const double a = lo + (hi - lo) * i / kPieces, b = lo + (hi - lo) * (i + 1) / kPieces;
    sum += adaptive(f, a, b, gauss(f, a, b), tolerance / kPieces, 30);
  }
  return sum;
}

Moments::Moments(std::span<const double> values) {
  for (double v : values) add(v);
}

void Moments::add(double value) {
  const double before = value - mean_;
  mean_ += before / static_cast<double>(++count_);
  squares_ += before * (value - mean_);
}

double Moments::variance() const { return count_ > 1 ? squares_ / static_cast<double>(count_ - 1) : 0; }

double Moments::standardError() const {
  return std::sqrt(variance() / static_cast<double>(std::max<int64_t>(1, count_)));
}

double welchTest(const Moments& a, const Moments& b) {
  const double va = a.standardError() * a.standardError(), vb = b.standardError() * b.standardError();
  if (va + vb == 0) return a.mean() == b.mean() ? 1 : 0;
  const auto freedom = [](double v, const Moments& m) {
    return v * v / static_cast<double>(std::max<int64_t>(1, m.count() - 1));
  };
  return twoSided((a.mean() - b.mean()) / std::sqrt(va + vb),
                  (va + vb) * (va + vb) / (freedom(va, a) + freedom(vb, b)));
}

double oneSampleTest(const Moments& values, double expected) {
  const double error = values.standardError();
  if (error == 0) return values.mean() == expected ? 1 : 0;
  return twoSided((values.mean() - expected) / error, static_cast<double>(values.count() - 1));
}

double zTest(double value, double expected, double standardError) {
  if (standardError == 0) return value == expected ? 1 : 0;
  return std::erfc(std::fabs(value - expected) / standardError * std::numbers::sqrt2 / 2);
}

double medianOfMeans(std::span<const double> values, int groups) {
  VIRGA_ASSERT(groups > 0 && values.size() >= static_cast<size_t>(groups));
  std::vector<double> means;
  const auto count = static_cast<size_t>(groups);
  for (size_t i = 0; i < count; ++i) {
    const size_t begin = values.size() * i / count, end = values.size() * (i + 1) / count;
    means.push_back(Moments(values.subspan(begin, end - begin)).mean());
  }
  std::sort(means.begin(), means.end());
  return 0.5 * (means[(count - 1) / 2] + means[count / 2]);
}

LineFit fitLine(std::span<const double> x, std::span<const double> y) {
  VIRGA_ASSERT(x.size() == y.size() && x.size() >= 2);
  const double mx = Moments(x).mean(), my = Moments(y).mean();
  double xx = 0, xy = 0, residual = 0;
  for (size_t i = 0; i < x.size(); ++i) xx += (x[i] - mx) * (x[i] - mx), xy += (x[i] - mx) * (y[i] - my);
  VIRGA_ASSERT(xx > 0);
  const double slope = xy / xx, intercept = my - slope * mx;
  for (size_t i = 0; i < x.size(); ++i) {
    const double d = y[i] - intercept - slope * x[i];
    residual += d * d;
  }
  return {intercept, slope, x.size() > 2 ? std::sqrt(residual / static_cast<double>(x.size() - 2) / xx) : 0};
}

double gammaUpper(double a, double x) {
  if (!(x > 0)) return 1;
  if (x < a + 1) return 1 - gammaLowerSeries(a, x);
  if (std::isinf(x)) return 0;
  const double fraction =
      continuedFraction(x + 1 - a, [&](int i) { return std::pair(i * (a - i), x + 2 * i + 1 - a); });
  return std::exp(a * std::log(x) - x - std::lgamma(a)) / fraction;
}

double betaRegularised(double a, double b, double x) {
  if (x <= 0) return 0;
  if (x >= 1) return 1;
  // The fraction converges fast below the mean only.
  return x < (a + 1) / (a + b + 2) ? betaFraction(a, b, x) : 1 - betaFraction(b, a, 1 - x);
}

double chiSquaredTail(double statistic, double degreesOfFreedom) {
  return gammaUpper(0.5 * degreesOfFreedom, 0.5 * statistic);
}

double studentCdf(double t, double degreesOfFreedom) {
  const double tail = 0.5 * betaRegularised(0.5 * degreesOfFreedom, 0.5, degreesOfFreedom / (degreesOfFreedom + t * t));
  return t < 0 ? tail : 1 - tail;
}

double normalCdf(double z) { return 0.5 * std::erfc(-z * std::numbers::sqrt2 / 2); }

double kolmogorovTail(double lambda) {
  if (lambda < 0.2) return 1;  // to 12 digits; the series would need many terms
  double sum = 0;
  for (int k = 1; k <= 100; ++k) {
    const double term = std::exp(-2.0 * k * k * lambda * lambda);
    sum += k % 2 == 1 ? term : -term;
    if (term < 1e-16) break;
  }
  return std::clamp(2 * sum, 0.0, 1.0);
}

}  // namespace virga::stats
