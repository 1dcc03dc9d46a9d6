// SPDX-License-Identifier: Apache-2.0
#include "methods/brute_force_media.h"

namespace virga::testing::brute {
namespace {

bool contains(const Region& r, Vector p) {
  if (r.form == Region::Form::box)
    return p.x > r.lo.x && p.y > r.lo.y && p.z > r.lo.z && p.x < r.hi.x && p.y < r.hi.y && p.z < r.hi.z;
  const Vector v = p - middle(r);
  return dot(v, v) < radiusOf(r) * radiusOf(r);
}

bool exclusive(const Region& r) { return r.within >= 0; }

Vector interpolate(const Grid& grid, const Region& region, Vector p) {
  const Vector q = p - region.lo, e = region.hi - region.lo;
  const double where[3] = {q.x / e.x, q.y / e.y, q.z / e.z};
  int low[3], high[3];
  double f[3];
  for (int a = 0; a < 3; ++a) {
    const double x = std::clamp(where[a] * grid.n - 0.5, 0.0, grid.n - 1.0);
    low[a] = static_cast<int>(x);
    high[a] = std::min(low[a] + 1, grid.n - 1);
    f[a] = x - low[a];
  }
  Vector sum;
  for (int corner = 0; corner < 8; ++corner) {
    int at[3];
    double w = 1;
    for (int a = 0; a < 3; ++a) {
      const bool up = (corner >> a) & 1;
      at[a] = up ? high[a] : low[a];
      w *= up ? f[a] : 1 - f[a];
    }
    sum = sum + grid.values[static_cast<size_t>((at[2] * grid.n + at[1]) * grid.n + at[0])] * w;
  }
  return sum;
}

/// The grid's value where there is one, else the constant.
Vector valueAt(const Grid& grid, Vector constant, const Region& region, Vector p) {
  return grid.n > 0 ? interpolate(grid, region, p) : constant;
}

double extinction(const Region& r, Vector p, int channel) {
  const Vector density = valueAt(r.medium.density, {1, 1, 1}, r, p);
  return r.medium.sigmaT * (r.medium.spectrum * density).channel(channel);
}

double largestExtinction(const Medium& m, int channel) {
  double largest = m.density.n > 0 ? 0 : 1;
  for (const Vector& v : m.density.values) largest = std::max(largest, v.channel(channel));
  return largest * m.sigmaT * m.spectrum.channel(channel);
}

/// Media at a point.
struct Mixture {
  static constexpr size_t kMost = 8;
  std::array<const Region*, kMost> regions = {};
  size_t count = 0;

  Mixture(const World& world, Vector p) {
    for (const Region& r : world.regions) {
      if (!contains(r, p)) continue;
      if (exclusive(r)) count = 0;
      regions[count++] = &r;
      if (exclusive(r)) return;
    }
  }
};

// --- phase functions ---

/// Piecewise linear in the cosine, relative to its mean over the sphere.
double tabulated(const std::vector<double>& table, double cosine) {
  const auto last = static_cast<double>(table.size() - 1);
  double mean = 0;
  for (size_t i = 0; i + 1 < table.size(); ++i) mean += (table[i] + table[i + 1]) / 2 / last;
  const double x = (cosine + 1) / 2 * last;
  const size_t i = std::min(static_cast<size_t>(x), table.size() - 2);
  const double f = x - static_cast<double>(i);
  return (table[i] * (1 - f) + table[i + 1] * f) / mean;
}

/// Relative to an even distribution, at the cosine of the scattering angle; of lobes that are sampled evenly.
double evenly(const Lobe& lobe, double c) {
  if (lobe.phase == Phase::rayleigh || lobe.phase == Phase::cornetteShanks) return 0.75 * (1 + c * c);
  if (lobe.phase == Phase::schlick) return (1 - lobe.g * lobe.g) / ((1 - lobe.g * c) * (1 - lobe.g * c));
  return lobe.phase == Phase::table ? tabulated(lobe.table, c) : 1;
}

/// The cosine of a new direction; scales the throughput by what the sampling leaves over.
double sampleCosine(const Lobe& lobe, Vector& throughput, Random& random) {
  const double g = lobe.g, u = random();
  const bool likeHenyeyGreenstein = lobe.phase == Phase::henyeyGreenstein || lobe.phase == Phase::cornetteShanks;
  if (!likeHenyeyGreenstein || g == 0) {
    const double c = 2 * u - 1;
    throughput = throughput * evenly(lobe, c);
    return c;
  }
  const double s = (1 - g * g) / (1 - g + 2 * g * u), c = (1 + g * g - s * s) / (2 * g);
  if (lobe.phase == Phase::cornetteShanks) throughput = throughput * (1.5 * (1 + c * c) / (2 + g * g));
  return c;
}

}  // namespace

bool chromatic(const World& world) {
  const auto grey = [](Vector v) { return v.x == v.y && v.y == v.z; };
  return std::any_of(world.regions.begin(), world.regions.end(), [&](const Region& r) {
    const auto& densities = r.medium.density.values;
    return !grey(r.medium.spectrum) || !std::all_of(densities.begin(), densities.end(), grey);
  });
}

Media::Media(const World& world, int channel) : world_(world), channel_(channel) {
  for (const Region& r : world.regions) {
    majorant_ += largestExtinction(r.medium, channel);
    const Vector e = r.hi - r.lo, c = middle(r);
    radius_ = std::max(radius_, std::sqrt(dot(c, c)) + std::sqrt(dot(e, e)) / 2);
    glows_ |= !black(r.medium.emission);
  }
}

double Media::lastPlace(const Line& line, double end) const { return std::min(end, radius_ - dot(line.o, line.d)); }

Event Media::collide(const Line& line, double end, Random& random) const {
  if (majorant_ == 0) return {};
  end = lastPlace(line, end);
  for (double t = 0;;) {
    t -= std::log(1 - random()) / majorant_;
    if (!(t < end)) return {};
    const Vector x = line.at(t);
    const Mixture here(world_, x);
    double u = random() * majorant_;
    for (size_t i = 0; i < here.count; ++i)
      if ((u -= extinction(*here.regions[i], x, channel_)) < 0) return {t, here.regions[i]};
  }
}

Glow Media::glow(const Line& line, double end, Random& random) const {
  end = lastPlace(line, end);
  if (!glows_ || !(end > 0)) return {};
  const double t = end * random();
  const Vector x = line.at(t);
  const Mixture here(world_, x);
  Vector sum;
  for (size_t i = 0; i < here.count; ++i) {
    const Medium& m = here.regions[i]->medium;
    sum = sum + m.emission * valueAt(m.emissionGrid, {1, 1, 1}, *here.regions[i], x);
  }
  return {t, sum * end};
}

void scatter(const Event& event, Line& line, Vector& throughput, Random& random) {
  const Medium& m = event.region->medium;
  const Vector x = line.at(event.t);
  throughput = throughput * valueAt(m.albedoGrid, m.albedo, *event.region, x);
  const double share = valueAt(m.shareGrid, {m.share, 0, 0}, *event.region, x).x;
  const Lobe& lobe = share > 0 && random() < share ? m.other : m.lobe;
  line = {x, around(line.d, sampleCosine(lobe, throughput, random), random)};
}

}  // namespace virga::testing::brute
