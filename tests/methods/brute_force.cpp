// SPDX-License-Identifier: Apache-2.0
#include "methods/brute_force.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "core/parallel.h"

namespace virga::testing::brute {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();
constexpr double kOffSurface = 1e-9;
constexpr double kPiExact = std::numbers::pi;

double dot(Vector a, Vector b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Vector cross(Vector a, Vector b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
Vector unit(Vector a) { return a * (1 / std::sqrt(dot(a, a))); }
bool black(Vector a) { return a.x == 0 && a.y == 0 && a.z == 0; }

class Random {
 public:
  explicit Random(uint64_t seed) : engine_(seed) {}
  double operator()() { return std::uniform_real_distribution<double>()(engine_); }

 private:
  std::mt19937_64 engine_;
};

struct Line {
  Vector o, d;
  Vector at(double t) const { return o + d * t; }
};

/// Unit vector at an angle to the axis, of any azimuth.
Vector around(Vector axis, double cosine, Random& random) {
  const Vector helper = std::fabs(axis.x) < 0.5 ? Vector{1, 0, 0} : Vector{0, 1, 0};
  const Vector s = unit(cross(axis, helper)), t = cross(axis, s);
  const double sine = std::sqrt(std::max(0.0, 1 - cosine * cosine)), phi = 2 * kPiExact * random();
  return axis * cosine + s * (sine * std::cos(phi)) + t * (sine * std::sin(phi));
}

// --- geometry ---

struct Hit {
  double t = kNever;
  Vector normal;
  const Material* material = nullptr;
};

void meetSphere(const Line& line, Vector center, double radius, const Material& material, Hit& hit) {
  const Vector v = line.o - center;
  const double b = dot(v, line.d), discriminant = b * b - dot(v, v) + radius * radius;
  if (discriminant < 0) return;
  for (const double t : {-b - std::sqrt(discriminant), -b + std::sqrt(discriminant)})
    if (t > kOffSurface && t < hit.t) hit = {t, unit(line.at(t) - center), &material};
}

void meetRectangle(const Line& line, const Rectangle& r, Hit& hit) {
  const Vector n = unit(cross(r.x, r.y));
  const double t = dot(r.center - line.o, n) / dot(line.d, n);
  if (!(t > kOffSurface && t < hit.t)) return;
  const Vector q = line.at(t) - r.center;
  if (std::fabs(dot(q, r.x)) <= dot(r.x, r.x) && std::fabs(dot(q, r.y)) <= dot(r.y, r.y)) hit = {t, n, &r.material};
}

Vector middle(const Region& r) { return (r.lo + r.hi) * 0.5; }
double radiusOf(const Region& r) { return (r.hi.x - r.lo.x) / 2; }

const Material kPlainGlass{.kind = Material::Kind::glass};

Hit nearest(const World& world, const Line& line) {
  Hit hit;
  for (const Sphere& s : world.spheres) meetSphere(line, s.center, s.radius, s.material, hit);
  for (const Rectangle& r : world.rectangles) meetRectangle(line, r, hit);
  for (const Region& r : world.regions)
    if (r.form == Region::Form::glassBall) meetSphere(line, middle(r), radiusOf(r), kPlainGlass, hit);
  return hit;
}

bool contains(const Region& r, Vector p) {
  if (r.form == Region::Form::box)
    return p.x > r.lo.x && p.y > r.lo.y && p.z > r.lo.z && p.x < r.hi.x && p.y < r.hi.y && p.z < r.hi.z;
  const Vector v = p - middle(r);
  return dot(v, v) < radiusOf(r) * radiusOf(r);
}

// --- media ---

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

double extinction(const Region& r, Vector p) {
  return r.medium.density.n > 0 ? r.medium.sigmaT * interpolate(r.medium.density, r, p).x : r.medium.sigmaT;
}

double largestExtinction(const Medium& m) {
  double largest = m.density.n > 0 ? 0 : 1;
  for (const Vector& v : m.density.values) largest = std::max(largest, v.x);
  return largest * m.sigmaT;
}

bool exclusive(const Region& r) { return r.within >= 0; }

/// Where collisions can be at all, and how often at most.
struct Majorant {
  double sigmaT = 0;  ///< [1/unit]
  Vector center;
  double radius = 0;  ///< of a ball around all media

  explicit Majorant(const World& world) {
    for (const Region& r : world.regions) {
      sigmaT += largestExtinction(r.medium);
      const Vector e = r.hi - r.lo, c = middle(r);
      radius = std::max(radius, std::sqrt(dot(c, c)) + std::sqrt(dot(e, e)) / 2);
    }
  }
};

/// Media at a point, with their extinctions [1/unit].
struct Mixture {
  static constexpr size_t kMost = 8;
  std::array<const Region*, kMost> regions = {};
  std::array<double, kMost> sigmaT = {};
  size_t count = 0;

  Mixture(const World& world, Vector p) {
    for (const Region& r : world.regions) {
      if (!contains(r, p)) continue;
      if (exclusive(r)) count = 0;
      regions[count] = &r;
      sigmaT[count++] = extinction(r, p);
      if (exclusive(r)) return;
    }
  }
};

struct Event {
  double t = kNever;
  const Region* region = nullptr;
};

/// Delta tracking under one majorant.
Event collide(const World& world, const Majorant& majorant, const Line& line, double end, Random& random) {
  end = std::min(end, dot(majorant.center - line.o, line.d) + majorant.radius);
  for (double t = 0;;) {
    t -= std::log(1 - random()) / majorant.sigmaT;
    if (!(t < end)) return {};
    const Mixture here(world, line.at(t));
    double u = random() * majorant.sigmaT;
    for (size_t i = 0; i < here.count; ++i)
      if ((u -= here.sigmaT[i]) < 0) return {t, here.regions[i]};
  }
}

/// The new direction of light that travels along -d; scales the throughput by what the sampling leaves over.
Vector scatter(const Medium& m, Vector d, Vector& throughput, Random& random) {
  const double g = m.g, u = random();
  if (m.phase == Medium::Phase::isotropic || g == 0) {
    const double c = 2 * u - 1;
    if (m.phase == Medium::Phase::cornetteShanks) throughput = throughput * (0.75 * (1 + c * c));
    return around(d, c, random);
  }
  const double s = (1 - g * g) / (1 - g + 2 * g * u), c = (1 + g * g - s * s) / (2 * g);
  if (m.phase == Medium::Phase::cornetteShanks) throughput = throughput * (1.5 * (1 + c * c) / (2 + g * g));
  return around(d, c, random);
}

// --- surfaces ---

Vector mirrored(Vector d, Vector n) { return d - n * (2 * dot(d, n)); }

/// Directions by the cosine, whatever the lobe.
Vector reflectRough(const Material& m, Vector d, Vector n, Vector& throughput, Random& random) {
  const Vector w = around(n, std::sqrt(random()), random);
  Vector factor = m.diffuse;
  if (m.kind == Material::Kind::phong) {
    const double lobe = std::max(0.0, dot(mirrored(d, n), w));
    factor = factor + m.specular * ((m.exponent + 2) / 2 * std::pow(lobe, m.exponent));
  }
  throughput = throughput * factor;
  return w;
}

/// Reflects or refracts as Fresnel's equations divide the light; radiance that enters glass grows by the square of the
/// index.
Vector passGlass(const Material& m, Vector d, Vector n, Vector& throughput, Random& random) {
  const bool entering = dot(d, n) < 0;
  const Vector side = entering ? n : -n;
  const double ratio = entering ? 1 / m.index : m.index;  // of the index before to the one behind
  const double cosine = -dot(d, side), sine2 = ratio * ratio * (1 - cosine * cosine);
  double reflectance = 1, behind = 0;
  if (sine2 < 1) {
    behind = std::sqrt(1 - sine2);
    const double s = (ratio * cosine - behind) / (ratio * cosine + behind);
    const double p = (cosine - ratio * behind) / (cosine + ratio * behind);
    reflectance = (s * s + p * p) / 2;
  }
  if (random() < reflectance) return mirrored(d, n);
  throughput = throughput * (ratio * ratio);
  return unit(d * ratio + side * (ratio * cosine - behind));
}

/// False if the surface swallows the light.
bool reflect(const Hit& hit, Line& line, Vector& throughput, std::string& history, Random& random) {
  const Material& m = *hit.material;
  const bool specular = m.kind == Material::Kind::mirror || m.kind == Material::Kind::glass;
  history += specular ? 'p' : 's';
  const Vector x = line.at(hit.t);
  if (m.kind == Material::Kind::glass) {
    line = {x, passGlass(m, line.d, hit.normal, throughput, random)};
    return true;
  }
  const bool back = dot(line.d, hit.normal) > 0;
  if (!black(m.emission) || (back && !m.twoSided)) return false;
  const Vector n = back ? -hit.normal : hit.normal;
  if (m.kind == Material::Kind::mirror) {
    line = {x, mirrored(line.d, n)};
    throughput = throughput * m.specular;
  } else {
    line = {x, reflectRough(m, line.d, n, throughput, random)};
  }
  return true;
}

// --- paths ---

/// The layer of light at the end of a path: 's', 'm' and 'p' for vertices on surfaces, in media and specular ones.
Layer layerOf(const std::string& history) {
  std::string rough;
  for (const char c : history)
    if (c != 'p') rough += c;
  if (rough.empty()) return Layer::emission;
  if (rough.size() == 1) {
    const bool focused = history.back() == 'p';
    if (rough == "s") return focused ? Layer::causticSurface : Layer::directSurface;
    return focused ? Layer::causticMedia : Layer::directMedia;
  }
  const std::string first = rough.substr(0, 2);
  if (first == "ss") return Layer::surfaceToSurface;
  if (first == "sm") return Layer::mediaToSurface;
  return first == "ms" ? Layer::surfaceToMedia : Layer::mediaToMedia;
}

void trace(const World& world, const Majorant& majorant, Line line, Layers& sum, Random& random) {
  Vector throughput{1, 1, 1};
  std::string history;
  const auto shine = [&](Vector light) {
    Vector& layer = sum[static_cast<size_t>(layerOf(history))];
    layer = layer + throughput * light;
  };
  for (int segment = 0; segment < world.maxDepth; ++segment) {
    const Hit hit = nearest(world, line);
    const Event event = world.regions.empty() ? Event{} : collide(world, majorant, line, hit.t, random);
    if (event.region) {
      const Medium& m = event.region->medium;
      const Vector x = line.at(event.t);
      throughput = throughput * (m.albedoGrid.n > 0 ? interpolate(m.albedoGrid, *event.region, x) : m.albedo);
      line = {x, scatter(m, line.d, throughput, random)};
      history += 'm';
      continue;
    }
    if (!hit.material) return shine(world.sky);
    if (dot(line.d, hit.normal) < 0) shine(hit.material->emission);
    if (!reflect(hit, line, throughput, history, random)) return;
  }
}

Line cameraLine(const World& world, double x, double y) {
  const Vector ahead = unit(world.target - world.eye), right = unit(cross(ahead, {0, 1, 0})), up = cross(right, ahead);
  const double half = std::tan(world.fieldOfView / 2 * kPiExact / 180);
  const double sx = (2 * x / world.size - 1) * half, sy = (1 - 2 * y / world.size) * half;
  return {world.eye, unit(ahead + right * sx + up * sy)};
}

}  // namespace

std::vector<Layers> render(const World& world, int samples, uint64_t seed) {
  std::vector<Layers> picture(static_cast<size_t>(world.size * world.size));
  const Majorant majorant(world);
  parallelFor(world.size * world.size, 1, [&](int64_t pixel) {
    Random random(seed * picture.size() + static_cast<uint64_t>(pixel));
    Layers& sum = picture[static_cast<size_t>(pixel)];
    for (int i = 0; i < samples; ++i) {
      const double x = static_cast<double>(pixel % world.size) + random(),
                   y = static_cast<double>(pixel / world.size) + random();
      trace(world, majorant, cameraLine(world, x, y), sum, random);
    }
    for (Vector& layer : sum) layer = layer * (1.0 / samples);
  });
  return picture;
}

}  // namespace virga::testing::brute
