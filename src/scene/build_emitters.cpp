// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "image/image_io.h"
#include "scene/build_context.h"

namespace virga {
namespace {

constexpr std::string_view kNotYet[] = {"directionalarea", "projector", "sunsky", "sky", "sun"};
constexpr float kRadiansPerDegree = kPi / 180;

Vec3 unitDirection(PluginReader& reader, std::string_view parameter, Vec3 v) {
  if (!(lengthSquared(v) > 0)) reader.fail(parameter, fmt::format("\"{}\" has no length", parameter));
  return normalize(v);
}

EmitterView buildPoint(BuildContext&, PluginReader& reader) {
  EmitterView e;
  e.kind = EmitterView::Kind::point;
  if (reader.has("position") && reader.has("to_world"))
    reader.fail("position", "give either \"position\" or \"to_world\"");
  e.position =
      reader.has("position") ? reader.vector("position", {}) : Affine(reader.transform("to_world")).translation;
  e.value = reader.color("intensity", Rgb(1.f));
  return e;
}

EmitterView buildSpot(BuildContext&, PluginReader& reader) {
  EmitterView e;
  e.kind = EmitterView::Kind::spot;
  const Affine toWorld(reader.transform("to_world"));
  e.position = toWorld.translation;
  e.direction = normalize(toWorld.vector({0, 0, 1}));
  e.value = reader.color("intensity", Rgb(1.f));
  const float cutoff = reader.number("cutoff_angle", 20, {.lo = 0, .hi = 180, .openLo = true});
  const float beam = reader.number("beam_width", cutoff * 0.75f, {.lo = 0, .hi = static_cast<double>(cutoff)});
  e.cutoffAngle = cutoff * kRadiansPerDegree;
  e.beamWidth = beam * kRadiansPerDegree;
  return e;
}

EmitterView buildDirectional(BuildContext&, PluginReader& reader) {
  EmitterView e;
  e.kind = EmitterView::Kind::directional;
  if (reader.has("direction") && reader.has("to_world"))
    reader.fail("direction", "give either \"direction\" or \"to_world\"");
  e.direction = reader.has("direction") ? unitDirection(reader, "direction", reader.vector("direction", {}))
                                        : normalize(Affine(reader.transform("to_world")).vector({0, 0, 1}));
  e.value = reader.color("irradiance", Rgb(1.f));
  return e;
}

EmitterView buildConstant(BuildContext&, PluginReader& reader) {
  EmitterView e;
  e.kind = EmitterView::Kind::constant;
  e.value = reader.color("radiance", Rgb(1.f));
  return e;
}

// Luminance around a pixel: never 0 where the bilinear interpolant inside the pixel is not.
float spreadLuminance(const Image& image, int x, int y) {
  float sum = 0;
  for (int j = std::max(0, y - 1); j <= std::min(image.height - 1, y + 1); ++j)
    for (int i = -1; i <= 1; ++i)
      sum += luminance(image.at((x + i + image.width) % image.width, j)) * (i == 0 ? 2 : 1) * (j == y ? 2 : 1);
  return sum;
}

// Piecewise constant density over pixels, in proportion to luminance and solid angle.
void makeTables(BuiltEnvironment& environment) {
  const Image& image = environment.image;
  std::vector<float> rows(static_cast<size_t>(image.height)), row(static_cast<size_t>(image.width));
  double sum = 0, weight = 0;
  for (int y = 0; y < image.height; ++y) {
    const float sinTheta = std::sin(kPi * (static_cast<float>(y) + 0.5f) / static_cast<float>(image.height));
    for (int x = 0; x < image.width; ++x) {
      row[static_cast<size_t>(x)] = spreadLuminance(image, x, y) * sinTheta;
      sum += static_cast<double>(mean(image.at(x, y)) * sinTheta);
    }
    weight += static_cast<double>(sinTheta) * image.width;
    const Discrete columns(row);
    rows[static_cast<size_t>(y)] = static_cast<float>(columns.total());
    const DiscreteView table = columns.view();
    environment.columns.insert(environment.columns.end(), table.cdf, table.cdf + image.width + 1);
  }
  environment.rows = Discrete(rows);
  environment.meanRadiance = static_cast<float>(sum / weight);
}

void checkRadiance(const Image& image) {
  size_t bad = 0, first = 0;
  for (size_t i = image.pixels.size(); i-- > 0;)
    if (!isFinite(image.pixels[i]) || minComponent(image.pixels[i]) < 0) ++bad, first = i;
  const auto width = static_cast<size_t>(image.width);
  if (bad > 0)
    throw Error(
        fmt::format("the picture has {} pixels that are negative, infinite or not a number, the first at ({}, {})", bad,
                    first % width, first / width));
}

std::shared_ptr<const BuiltEnvironment> loadEnvironment(const std::filesystem::path& path) {
  auto environment = std::make_shared<BuiltEnvironment>();
  environment->image = readImage(path);
  checkRadiance(environment->image);
  for (const Rgb& pixel : environment->image.pixels)
    environment->brightest = std::max(environment->brightest, maxComponent(pixel));
  makeTables(*environment);
  return environment;
}

EmitterView buildEnvironment(BuildContext& context, PluginReader& reader) {
  const std::filesystem::path path = context.file(reader, "filename");
  std::shared_ptr<const BuiltEnvironment> built;
  try {
    built = context.cached<BuiltEnvironment>(&PartCache::environments, fileKey(path),
                                             [&] { return loadEnvironment(path); });
  } catch (const Error& error) {
    throw error.at(reader.positionOf("filename"));
  }
  EmitterView e;
  e.kind = EmitterView::Kind::environment;
  const Matrix4 toWorld = reader.transform("to_world");
  EnvironmentView& view = e.environment;
  view = {built->image.pixels.data(), built->image.width,
          built->image.height,        built->rows.view(),
          built->columns.data(),      Affine(toWorld),
          Affine(toWorld.inverse()),  reader.number("scale", 1, reader.nonNegative())};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < i; ++j) {
      const Vec3 a = view.toWorld.vector(Vec3(i == 0, i == 1, i == 2)),
                 b = view.toWorld.vector(Vec3(j == 0, j == 1, j == 2));
      if (std::fabs(dot(a, b)) > 1e-4f || std::fabs(lengthSquared(a) - 1) > 1e-3f)
        reader.fail("to_world", "an environment map's transform must be a rotation");
    }
  e.value = Rgb(built->meanRadiance * view.scale);
  constexpr float kBrightest = 1e30f;  // sums over directions and paths stay finite
  if (!(built->brightest * view.scale <= kBrightest))
    reader.fail("scale", fmt::format("the map reaches {:g}, with its scale {:g}; it must be at most {:g}",
                                     built->brightest, double{built->brightest} * double{view.scale}, kBrightest));
  reader.ignore("mis_compensation");
  return e;
}

// The radius of the scene stands in for the cross-section that light from infinity meets. Double precision: the
// brightest light that single precision holds must not make all others of no account.
double power(const EmitterView& e, float sceneRadius) {
  constexpr double pi = static_cast<double>(kPi);
  const double section = pi * static_cast<double>(sceneRadius) * static_cast<double>(sceneRadius);
  const double v = 1e3 * static_cast<double>(luminance(e.value * 1e-3f));
  switch (e.kind) {
    case EmitterView::Kind::point:
      return 4 * pi * v;
    case EmitterView::Kind::spot:
      return 2 * pi * v * (1 - 0.5 * static_cast<double>(std::cos(e.cutoffAngle) + std::cos(e.beamWidth)));
    case EmitterView::Kind::directional:
      return v * section;
    case EmitterView::Kind::area:
      return pi * v * static_cast<double>(e.area);
    default:
      return 4 * pi * v * section;
  }
}

// Of light at infinity, what it sends through a surface; else intensity, where it is greatest. Relative to all others
// only.
double strength(const EmitterView& e, bool flat) {
  constexpr double pi = static_cast<double>(kPi);
  const double v = 1e3 * static_cast<double>(mean(e.value * 1e-3f));
  switch (e.kind) {
    case EmitterView::Kind::area:
      return v * static_cast<double>(e.area) * (flat ? 1 : 0.25);
    case EmitterView::Kind::constant:
    case EmitterView::Kind::environment:
      return pi * v;
    default:
      return v;
  }
}

LampStrength fromAfar(const EmitterView& e, const Scene::Parts& parts) {
  LampStrength lamp;
  lamp.infinite = e.infinite();
  lamp.sky = lamp.infinite && !e.isDelta();
  lamp.center = e.position;
  if (e.kind == EmitterView::Kind::spot) lamp.axis = e.direction, lamp.least = std::cos(e.cutoffAngle);
  if (e.kind != EmitterView::Kind::area) return lamp;
  const auto index = static_cast<size_t>(e.shape);
  const Bounds& bounds = parts.surfaceShapes[index]->bounds;
  const ShapeView& shape = parts.surfaces[index];
  lamp.center = bounds.center();
  lamp.radius = 0.5f * length(bounds.extent());
  lamp.flat = e.isRectangle || shape.kind == ShapeView::Kind::disk;
  if (lamp.flat) lamp.axis = (e.isRectangle ? e.rectangle.normal : shape.normal) * shape.orientation;
  return lamp;
}

}  // namespace

void buildEmitter(BuildContext& context, const Node& node) {
  using Build = EmitterView (*)(BuildContext&, PluginReader&);
  static constexpr PluginRow<Build> kEmitters[] = {
      {"point", buildPoint},       {"spot", buildSpot},          {"directional", buildDirectional},
      {"constant", buildConstant}, {"envmap", buildEnvironment}, {"area", nullptr}};
  const Build build = findPlugin(node, kEmitters, kNotYet);
  PluginReader reader(node, context.diagnostics);
  if (!build && !node.hasGeneratedId()) return;  // a definition for shapes to refer to, which check it
  if (!build) reader.failHere("an area emitter belongs inside a shape");
  const EmitterView emitter = build(context, reader);
  reader.ignore("sampling_weight");
  reader.finish();
  if (emitter.kind == EmitterView::Kind::constant || emitter.kind == EmitterView::Kind::environment) {
    if (context.scene.view.environment >= 0)
      reader.failHere("the scene has a second environment", "keep one constant or envmap emitter");
    context.scene.view.environment = static_cast<int>(context.parts.emitters.size());
  }
  context.parts.emitters.push_back(emitter);
}

void addAreaEmitter(BuildContext& context, const Node& node, int surface, const BuiltShape& shape) {
  static constexpr PluginRow<int> kRows[] = {{"area", 0}};
  for (const std::string_view alone : {"point", "spot", "directional", "constant", "envmap"})
    if (node.type == alone)
      PluginReader(node, context.diagnostics)
          .failHere(fmt::format("a {} emitter has no place in a shape", node.type), "only area emitters have");
  findPlugin(node, kRows, kNotYet);
  PluginReader reader(node, context.diagnostics);
  EmitterView e;
  e.kind = EmitterView::Kind::area;
  const ColorOrTexture radiance = colorOrTexture(context, reader, "radiance", Rgb(1.f), reader.nonNegative());
  e.value = radiance.mean;
  e.texture = radiance.texture;
  e.shape = surface;
  e.area = shape.view.area;
  e.isRectangle = shape.rectangle.has_value();
  if (e.isRectangle) e.rectangle = *shape.rectangle;
  reader.ignore("sampling_weight");
  reader.finish();
  context.parts.surfaces[static_cast<size_t>(surface)].emitter = static_cast<int>(context.parts.emitters.size());
  context.parts.emitters.push_back(e);
}

void chooseEmittersByPower(BuildContext& context) {
  const float radius = 0.5f * length(context.scene.view.bounds.extent());
  std::vector<double> powers;
  for (const EmitterView& e : context.parts.emitters) powers.push_back(power(e, std::max(radius, 1e-3f)));
  const double most = powers.empty() ? 0 : *std::max_element(powers.begin(), powers.end());
  std::vector<float> shares;
  for (const double p : powers) shares.push_back(most > 0 ? static_cast<float>(p / most) : 0);
  context.parts.emitterChoice = Discrete(shares);
}

void measureLamps(BuildContext& context) {
  std::vector<LampStrength>& lamps = context.parts.lamps;
  std::vector<double> strengths;
  for (const EmitterView& e : context.parts.emitters) {
    lamps.push_back(fromAfar(e, context.parts));
    strengths.push_back(strength(e, lamps.back().flat));
  }
  const double most = lamps.empty() ? 0 : *std::max_element(strengths.begin(), strengths.end());
  for (size_t i = 0; i < lamps.size(); ++i) lamps[i].strength = most > 0 ? static_cast<float>(strengths[i] / most) : 0;
}

}  // namespace virga
