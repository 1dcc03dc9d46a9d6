// SPDX-License-Identifier: Apache-2.0
#include "methods/brute_force.h"

#include "core/parallel.h"
#include "methods/brute_force_bsdf.h"
#include "methods/brute_force_media.h"

namespace virga::testing::brute {
namespace {

constexpr double kOffSurface = 1e-9;

// --- geometry ---

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
  const double a = dot(q, r.x) / dot(r.x, r.x), b = dot(q, r.y) / dot(r.y, r.y);
  if (std::fabs(a) <= 1 && std::fabs(b) <= 1) hit = {t, n, &r.material, (a + 1) / 2, (b + 1) / 2};
}

Hit nearest(const World& world, const Line& line) {
  Hit hit;
  for (const Sphere& s : world.spheres) meetSphere(line, s.center, s.radius, s.material, hit);
  for (const Rectangle& r : world.rectangles) meetRectangle(line, r, hit);
  for (const Region& r : world.regions)
    if (r.form == Region::Form::glassBall) meetSphere(line, middle(r), radiusOf(r), r.wall, hit);
  return hit;
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

/// What is traced at once: all channels, where media do not tell them apart, or one.
struct Band {
  Vector channels;
  Media media;
};

std::vector<Band> bandsOf(const World& world) {
  if (!chromatic(world)) return {{{1, 1, 1}, Media(world, 0)}};
  return {{{1, 0, 0}, Media(world, 0)}, {{0, 1, 0}, Media(world, 1)}, {{0, 0, 1}, Media(world, 2)}};
}

void trace(const World& world, const Band& band, Line line, Layers& sum, Random& random) {
  Vector throughput = band.channels;
  std::string history;
  const auto shine = [&](Vector light) {
    Vector& layer = sum[static_cast<size_t>(layerOf(history))];
    layer = layer + throughput * light;
  };
  for (int segment = 0; segment < world.maxDepth;) {
    const Hit hit = nearest(world, line);
    const Event event = band.media.collide(line, hit.t, random);
    // What the path would glow with if it reached the place: it is added if it does.
    if (const Glow glow = band.media.glow(line, hit.t, random); glow.t < event.t) shine(glow.light);
    if (event.region) {
      scatter(event, line, throughput, random);
      history += 'm';
      ++segment;
      continue;
    }
    if (!hit.material) return shine(world.sky);
    if (dot(line.d, hit.normal) < 0) shine(hit.material->emission);
    const Outcome outcome = reflect(hit, line, throughput, history, random);
    if (outcome == Outcome::absorbed) return;
    if (outcome == Outcome::scattered) ++segment;
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
  const std::vector<Band> bands = bandsOf(world);
  parallelFor(world.size * world.size, 1, [&](int64_t pixel) {
    Random random(seed * picture.size() + static_cast<uint64_t>(pixel));
    Layers& sum = picture[static_cast<size_t>(pixel)];
    for (int i = 0; i < samples; ++i)
      for (const Band& band : bands) {
        const double x = static_cast<double>(pixel % world.size) + random(),
                     y = static_cast<double>(pixel / world.size) + random();
        trace(world, band, cameraLine(world, x, y), sum, random);
      }
    for (Vector& layer : sum) layer = layer * (1.0 / samples);
  });
  return picture;
}

}  // namespace virga::testing::brute
