// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <charconv>

#include "scene/build_context.h"

namespace virga {
namespace {

constexpr std::string_view kSensorsNotYet[] = {"thinlens", "orthographic"};
constexpr std::string_view kFilmsNotYet[] = {"ldrfilm", "mfilm", "specfilm"};
constexpr std::string_view kFiltersNotYet[] = {"mitchell", "catmullrom", "lanczos"};
constexpr float kRadiansPerDegree = kPi / 180;

/// What the field of view spans.
enum class FovAxis { x, y, diagonal, smaller, larger };
constexpr std::string_view kFovAxes[] = {"x", "y", "diagonal", "smaller", "larger"};

// A truncated Gaussian, exp(-x^2 / (2 s^2)) less its value at the radius (as Mitsuba has it).
PixelFilter gaussianFilter(float sigma) {
  PixelFilter filter{PixelFilter::Kind::gaussian, 4 * sigma, {}};
  constexpr int kSteps = 1 << 14;
  const double radius = static_cast<double>(filter.radius), s = static_cast<double>(sigma);
  const auto value = [&](double x) {
    return std::exp(-x * x / (2 * s * s)) - std::exp(-radius * radius / (2 * s * s));
  };
  // What lies beyond the offset radius * (1 - i / kSteps), summed from the tail inward: small shares keep their digits.
  std::vector<double> beyond(kSteps + 1, 0.0);
  for (int i = 0; i < kSteps; ++i)
    beyond[static_cast<size_t>(i + 1)] = beyond[static_cast<size_t>(i)] + value(radius * (1 - (i + 0.5) / kSteps));
  size_t k = 0;
  for (size_t i = 0; i <= PixelFilter::kTableSize; ++i) {
    const double v = static_cast<double>(i) / PixelFilter::kTableSize, target = beyond.back() * v * v;
    while (k + 1 < kSteps && beyond[k + 1] < target) ++k;
    const double within = (target - beyond[k]) / (beyond[k + 1] - beyond[k]);
    filter.tail[i] = static_cast<float>(radius * (1 - (static_cast<double>(k) + within) / kSteps));
  }
  return filter;
}

PixelFilter buildFilter(BuildContext& context, const NodePtr& node) {
  if (!node) return gaussianFilter(0.5f);
  using Build = PixelFilter (*)(PluginReader&);
  static constexpr PluginRow<Build> kFilters[] = {
      {"box", [](PluginReader&) { return PixelFilter{}; }},
      {"tent",
       [](PluginReader& r) {
         return PixelFilter{PixelFilter::Kind::tent, r.number("radius", 1, r.positive()), {}};
       }},
      {"gaussian", [](PluginReader& r) { return gaussianFilter(r.number("stddev", 0.5f, r.positive())); }}};
  PluginReader reader(*node, context.diagnostics);
  const PixelFilter filter = findPlugin(*node, kFilters, kFiltersNotYet)(reader);
  reader.finish();
  return filter;
}

int pixels(PluginReader& reader, std::string_view name, int fallback) {
  constexpr int kLargest = 1 << 16;
  return reader.integer(name, fallback, {.lo = 1, .hi = kLargest});
}

void readCrop(PluginReader& reader, PerspectiveCamera& camera) {
  camera.cropX = reader.integer("crop_offset_x", 0, reader.nonNegative());
  camera.cropY = reader.integer("crop_offset_y", 0, reader.nonNegative());
  camera.width = reader.has("crop_width") ? pixels(reader, "crop_width", 1) : camera.filmWidth - camera.cropX;
  camera.height = reader.has("crop_height") ? pixels(reader, "crop_height", 1) : camera.filmHeight - camera.cropY;
  if (camera.width < 1 || camera.cropX + camera.width > camera.filmWidth)
    reader.fail("crop_width",
                fmt::format("the crop window leaves the film, which is {} pixels wide", camera.filmWidth));
  if (camera.height < 1 || camera.cropY + camera.height > camera.filmHeight)
    reader.fail("crop_height",
                fmt::format("the crop window leaves the film, which is {} pixels high", camera.filmHeight));
}

// Another size of film shows the same part of it: the crop window grows or shrinks along, to no less than a pixel.
void resizeFilm(PerspectiveCamera& camera, int width, int height) {
  const auto scale = [](int& offset, int& size, int& whole, int wanted) {
    const double factor = static_cast<double>(wanted) / whole;
    const int end = std::min(wanted, static_cast<int>(std::lround((offset + size) * factor)));
    offset = std::min(static_cast<int>(std::lround(offset * factor)), wanted - 1);
    size = std::max(1, end - offset);
    whole = wanted;
  };
  scale(camera.cropX, camera.width, camera.filmWidth, width);
  scale(camera.cropY, camera.height, camera.filmHeight, height);
}

// What a file of Mitsuba's would look like; here the output's name and Virga decide.
void warnOfFormats(PluginReader& reader) {
  const auto check = [&](std::string_view name, std::initializer_list<std::string_view> fitting, std::string_view why) {
    const std::string value = reader.text(name, *fitting.begin());
    if (std::find(fitting.begin(), fitting.end(), value) == fitting.end()) reader.warnIgnored(name, why);
  };
  check("file_format", {"openexr", "exr"}, "the name of the output says whether it is an EXR or a PNG");
  check("pixel_format", {"rgb"}, "pictures are RGB");
  check("component_format", {"float16", "float32"}, "an EXR holds 32-bit floats");
}

void buildFilm(BuildContext& context, const Node& node) {
  static constexpr PluginRow<int> kFilms[] = {{"hdrfilm", 0}};
  findPlugin(node, kFilms, kFilmsNotYet);
  PluginReader reader(node, context.diagnostics);
  PerspectiveCamera& camera = context.scene.camera;
  camera.filmWidth = pixels(reader, "width", 768);
  camera.filmHeight = pixels(reader, "height", 576);
  readCrop(reader, camera);
  if (const auto& size = context.options.filmSize) resizeFilm(camera, size->first, size->second);
  context.scene.filter = buildFilter(context, reader.child("rfilter"));
  warnOfFormats(reader);
  for (const char* name : {"banner", "high_quality_edges", "sample_border", "compensate"}) reader.ignore(name);
  reader.finish();
}

// Half the angle along x for a film of the given shape.
void setFieldOfView(PerspectiveCamera& camera, float degrees, FovAxis axis) {
  const float w = static_cast<float>(camera.filmWidth), h = static_cast<float>(camera.filmHeight);
  const float half = std::tan(0.5f * degrees * kRadiansPerDegree);
  if (axis == FovAxis::smaller) axis = w < h ? FovAxis::x : FovAxis::y;
  if (axis == FovAxis::larger) axis = w < h ? FovAxis::y : FovAxis::x;
  if (axis == FovAxis::x) camera.tanX = half;
  if (axis == FovAxis::y) camera.tanX = half * w / h;
  if (axis == FovAxis::diagonal) camera.tanX = half * w / std::sqrt(w * w + h * h);
  camera.tanY = camera.tanX * h / w;
}

// "50mm": of a 35 mm film, whose diagonal is that of 36 x 24 mm.
float fovOfFocalLength(PluginReader& reader) {
  std::string text = reader.text("focal_length", "50mm");
  if (text.ends_with("mm")) text.resize(text.size() - 2);
  float value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !(value > 0))
    reader.fail("focal_length", "\"focal_length\" must be a positive length such as \"50mm\"");
  return 2 * std::atan(std::sqrt(36.f * 36 + 24 * 24) / (2 * value)) / kRadiansPerDegree;
}

void readFieldOfView(PluginReader& reader, PerspectiveCamera& camera) {
  const bool byLength = reader.has("focal_length");
  if (byLength && reader.has("fov")) reader.fail("fov", "give either \"fov\" or \"focal_length\", not both");
  const auto axis = static_cast<FovAxis>(reader.oneOf("fov_axis", "x", kFovAxes));
  if (byLength || !reader.has("fov")) return setFieldOfView(camera, fovOfFocalLength(reader), FovAxis::diagonal);
  setFieldOfView(camera, reader.number("fov", 0, {.lo = 0, .hi = 180, .openLo = true, .openHi = true}), axis);
}

void buildPerspective(BuildContext& context, PluginReader& reader) {
  PerspectiveCamera& camera = context.scene.camera;
  static const Node kDefaultFilm{"film", "hdrfilm", "_film", {}, {}, {}};
  const NodePtr film = reader.child("film");
  buildFilm(context, film ? *film : kDefaultFilm);
  readFieldOfView(reader, camera);
  camera.toWorld = Affine(reader.transform("to_world"));
  camera.shiftX = reader.number("principal_point_offset_x", 0);
  camera.shiftY = reader.number("principal_point_offset_y", 0);
  camera.nearClip = reader.number("near_clip", 1e-2f, reader.nonNegative());
  camera.farClip = reader.number("far_clip", 1e4f, reader.positive());
  if (camera.farClip <= camera.nearClip) reader.fail("far_clip", "\"far_clip\" must be greater than \"near_clip\"");
  reader.ignore("focus_distance");
  reader.ignore("shutter_open");
  reader.ignore("shutter_close");
  if (const NodePtr medium = reader.child("medium"))
    context.scene.view.cameraMedia.setBase(buildMedium(context, *medium));
}

void readSampler(BuildContext& context, const Node& node) {
  static constexpr PluginRow<int> kSamplers[] = {{"independent", 0}, {"stratified", 0}, {"multijitter", 0},
                                                 {"orthogonal", 0},  {"ldsampler", 0},  {"halton", 0},
                                                 {"hammersley", 0},  {"sobol", 0}};
  findPlugin(node, kSamplers, {});  // Virga has one sampler of its own; of the scene's it takes the number of samples
  PluginReader reader(node, context.diagnostics);
  context.scene.integrator.sampleCount = reader.integer("sample_count", 16, {.lo = 1, .hi = 1e9});
  if (reader.integer("seed", 0) != 0) reader.warnIgnored("seed", "the seed is that of --seed");
  reader.ignore("jitter");
  reader.finish();
}

}  // namespace

void buildSensor(BuildContext& context, const Node& sensor) {
  using Build = void (*)(BuildContext&, PluginReader&);
  static constexpr PluginRow<Build> kSensors[] = {{"perspective", buildPerspective}};
  const Build build = findPlugin(sensor, kSensors, kSensorsNotYet);
  PluginReader reader(sensor, context.diagnostics);
  build(context, reader);
  if (const NodePtr sampler = reader.child("sampler")) readSampler(context, *sampler);
  reader.finish();
}

void buildIntegrator(BuildContext& context, const Node& integrator) {
  static constexpr PluginRow<int> kIntegrators[] = {{"path", 0}, {"volpath", 0}, {"volpathmis", 0}, {"moment", 0}};
  findPlugin(integrator, kIntegrators, {});
  PluginReader reader(integrator, context.diagnostics);
  if (const NodePtr nested = reader.child("integrator")) buildIntegrator(context, *nested);
  IntegratorHints& hints = context.scene.integrator;
  context.wantsNoMedia |= integrator.type == "path";
  hints.maxDepth = reader.integer("max_depth", hints.maxDepth, {.lo = -1});
  hints.rrDepth = reader.integer("rr_depth", hints.rrDepth, {.lo = 1});
  if (reader.boolean("hide_emitters", false)) reader.fail("hide_emitters", "\"hide_emitters\" is not supported yet");
  reader.ignore("strict_normals");
  reader.finish();
}

}  // namespace virga
