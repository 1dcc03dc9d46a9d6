// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "image/image_io.h"
#include "scene/build_context.h"

namespace virga {
namespace {

Rgb eachMax(Rgb a, Rgb b) { return {std::max(a.r, b.r), std::max(a.g, b.g), std::max(a.b, b.b)}; }

/// A view with what the builder wants to know about the values.
struct BuiltTexture {
  TextureView view;
  Rgb maximum, mean;
};

// Values of `place` that the range does not admit: how many, and where the first is.
void checkPixels(const Image& image, std::string_view place, const PluginReader::Range& range) {
  size_t bad = 0, first = 0;
  const auto admitted = [&](float v) {
    return std::isfinite(v) && static_cast<double>(v) >= range.lo && static_cast<double>(v) <= range.hi;
  };
  for (size_t i = image.pixels.size(); i-- > 0;) {
    const Rgb& p = image.pixels[i];
    if (!admitted(p.r) || !admitted(p.g) || !admitted(p.b)) ++bad, first = i;
  }
  if (bad == 0) return;
  const auto width = static_cast<size_t>(image.width);
  const Rgb& p = image.pixels[first];
  const std::string limits = std::isinf(range.hi) ? "finite and at least 0" : "in [0, 1]";
  throw Error(fmt::format("the picture has {} pixels that \"{}\" cannot take, the first at ({}, {}): {} {} {}", bad,
                          place, first % width, first / width, p.r, p.g, p.b),
              {{}, fmt::format("values must be {}", limits), {}});
}

BuiltTexture buildBitmap(BuildContext& context, PluginReader& reader, std::string_view place,
                         const PluginReader::Range& range) {
  static constexpr std::string_view kWraps[] = {"repeat", "mirror", "clamp"};
  static constexpr std::string_view kFilters[] = {"bilinear", "nearest"};
  const std::filesystem::path path = context.file(reader, "filename");
  const Encoding encoding = reader.boolean("raw", false) ? Encoding::raw : Encoding::sRgb;
  std::shared_ptr<const Image> image;
  try {
    const std::string key = fileKey(path) + (encoding == Encoding::raw ? " raw" : "");
    image = context.cached<Image>(&PartCache::pictures, key,
                                  [&] { return std::make_shared<const Image>(readImage(path, encoding)); });
    checkPixels(*image, place, range);
  } catch (const Error& error) {
    throw error.at(reader.positionOf("filename"));
  }
  BuiltTexture t;
  t.view.kind = TextureView::Kind::bitmap;
  t.view.wrap = static_cast<TextureView::Wrap>(reader.oneOf("wrap_mode", "repeat", kWraps));
  t.view.filter = static_cast<TextureView::Filter>(reader.oneOf("filter_type", "bilinear", kFilters));
  t.view.pixels = image->pixels.data();
  t.view.width = image->width;
  t.view.height = image->height;
  double sum[3] = {};
  for (const Rgb& p : image->pixels) {
    t.maximum = eachMax(t.maximum, p);
    for (int c = 0; c < 3; ++c) sum[c] += static_cast<double>(p[c]);
  }
  for (int c = 0; c < 3; ++c) t.mean[c] = static_cast<float>(sum[c] / static_cast<double>(image->pixels.size()));
  for (const char* storage : {"format", "accel"}) reader.ignore(storage);
  return t;
}

BuiltTexture buildCheckerboard(BuildContext&, PluginReader& reader, std::string_view,
                               const PluginReader::Range& range) {
  BuiltTexture t;
  t.view.kind = TextureView::Kind::checkerboard;
  t.view.color0 = reader.color("color0", Rgb(0.4f), range);
  t.view.color1 = reader.color("color1", Rgb(0.2f), range);
  t.maximum = eachMax(t.view.color0, t.view.color1);
  t.mean = (t.view.color0 + t.view.color1) * 0.5f;
  return t;
}

void readPlacement(PluginReader& reader, TextureView& view) {
  const Matrix4 m = reader.transform("to_uv");
  for (int i = 0; i < 3; ++i) {
    view.uRow[i] = static_cast<float>(m(0, i == 2 ? 3 : i));
    view.vRow[i] = static_cast<float>(m(1, i == 2 ? 3 : i));
  }
}

using Build = BuiltTexture (*)(BuildContext&, PluginReader&, std::string_view, const PluginReader::Range&);
constexpr PluginRow<Build> kTextures[] = {{"bitmap", buildBitmap}, {"checkerboard", buildCheckerboard}};
constexpr std::string_view kNotYet[] = {"mesh_attribute", "volume"};

BuiltTexture buildTexture(BuildContext& context, const Node& node, std::string_view place,
                          const PluginReader::Range& range) {
  const Build build = findPlugin(node, kTextures, kNotYet);
  PluginReader reader(node, context.diagnostics);
  BuiltTexture texture = build(context, reader, place, range);
  readPlacement(reader, texture.view);
  reader.finish();
  return texture;
}

}  // namespace

ColorOrTexture colorOrTexture(BuildContext& context, PluginReader& reader, std::string_view name, Rgb fallback,
                              const PluginReader::Range& range) {
  const NodePtr node = reader.child("texture", name);
  if (!node) {
    const Rgb color = reader.color(name, fallback, range);
    return {color, color, {}};
  }
  const BuiltTexture texture = buildTexture(context, *node, name, range);
  return {texture.maximum, texture.mean, texture.view};
}

void checkTexture(BuildContext& context, const Node& node) {
  buildTexture(context, node, node.id, PluginReader::nonNegative());
}

}  // namespace virga
