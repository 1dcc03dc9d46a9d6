// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "scene/build_context.h"

namespace virga {
namespace {

constexpr std::string_view kNotYet[] = {"plastic", "roughplastic", "principled", "mask",
                                        "bumpmap", "normalmap",    "blendbsdf"};

struct NamedIndex {
  std::string_view name;
  float ior;
};
// Refractive indices at 589 nm, from the usual tables.
constexpr NamedIndex kIndices[] = {{"vacuum", 1.f},
                                   {"air", 1.000277f},
                                   {"helium", 1.000036f},
                                   {"water ice", 1.31f},
                                   {"water", 1.3330f},
                                   {"acetone", 1.36f},
                                   {"ethanol", 1.361f},
                                   {"fused quartz", 1.458f},
                                   {"pyrex", 1.470f},
                                   {"acrylic glass", 1.49f},
                                   {"benzene", 1.501f},
                                   {"bk7", 1.5046f},
                                   {"sodium chloride", 1.544f},
                                   {"amber", 1.55f},
                                   {"pet", 1.5750f},
                                   {"diamond", 2.419f}};

struct NamedMetal {
  std::string_view name;
  Rgb eta, k;
};
// Complex indices at about 630, 530 and 465 nm, from the usual tables. "none" is a perfect mirror.
constexpr NamedMetal kMetals[] = {{"none", Rgb(0.f), Rgb(1.f)},
                                  {"Cu", Rgb(0.200f, 0.924f, 1.102f), Rgb(3.912f, 2.452f, 2.142f)},
                                  {"Au", Rgb(0.143f, 0.375f, 1.442f), Rgb(3.983f, 2.386f, 1.603f)},
                                  {"Ag", Rgb(0.155f, 0.117f, 0.138f), Rgb(4.828f, 3.122f, 2.147f)},
                                  {"Al", Rgb(1.657f, 0.880f, 0.521f), Rgb(9.224f, 6.270f, 4.837f)}};

template <class Row, size_t N>
std::vector<std::string_view> names(const Row (&rows)[N]) {
  std::vector<std::string_view> result;
  for (const Row& row : rows) result.push_back(row.name);
  return result;
}

bool isText(const Node& node, std::string_view name) {
  for (const Property& p : node.properties)
    if (p.name == name) return std::holds_alternative<std::string>(p.value);
  return false;
}

// Far beyond all that there is; the squares of their ratios stay finite.
constexpr PluginReader::Range kIndexRange{.lo = 1e-3, .hi = 1e3};
constexpr PluginReader::Range kComplexIndexRange{.lo = 0, .hi = 1e6};

float refractiveIndex(PluginReader& reader, std::string_view name, std::string_view fallback) {
  if (reader.has(name) && !isText(reader.node(), name)) return reader.number(name, 1, kIndexRange);
  return kIndices[reader.oneOf(name, fallback, names(kIndices))].ior;
}

/// Reads the parameters of one bsdf. Its colours come in the order in which its struct numbers them.
class BsdfReader {
 public:
  BsdfReader(BuildContext& context, PluginReader& plugin) : reader(plugin), context_(context) {}

  PluginReader& reader;
  BsdfTextures textures;  ///< those of the colours so far

  /// The next colour; of a texture, the maximum.
  Rgb color(std::string_view name, float fallback, const PluginReader::Range& range = PluginReader::unit()) {
    return scaled(name, Rgb(fallback), range, 1);
  }
  Rgb scaled(std::string_view name, Rgb fallback, const PluginReader::Range& range, float scale) {
    ColorOrTexture c = colorOrTexture(context_, reader, name, fallback, range);
    int& index = textures.index[next_++];
    if (c.texture.present()) {
      index = static_cast<int>(context_.parts.textures.size());
      c.texture.scale = scale;
      context_.parts.textures.push_back(c.texture);
    }
    return c.maximum * scale;
  }

 private:
  BuildContext& context_;
  int next_ = 0;
};

Bsdf buildDiffuse(BsdfReader& in) { return Bsdf(Diffuse{in.color("reflectance", 0.5f)}); }

Bsdf buildPhong(BsdfReader& in) {
  const Rgb diffuse = in.color("diffuse_reflectance", 0.5f);
  const Rgb left = Rgb(1.f) - diffuse;  // the default takes no more than the diffuse part leaves
  const Rgb usual(std::min(0.2f, left.r), std::min(0.2f, left.g), std::min(0.2f, left.b));
  const Rgb specular = in.scaled("specular_reflectance", usual, PluginReader::unit(), 1);
  if (maxComponent(diffuse + specular) > 1)
    in.reader.fail("specular_reflectance", "diffuse and specular reflectance add up to more than 1",
                   in.textures.any() ? "the largest values of textures count, wherever they lie" : "");
  return Bsdf(Phong{diffuse, specular, in.reader.number("exponent", 30, PluginReader::nonNegative())});
}

// Colours 0 to 2: eta, k, reflectance.
Conductor readConductor(BsdfReader& in) {
  PluginReader& reader = in.reader;
  NamedMetal metal = kMetals[0];
  const bool byNumbers = reader.has("eta") || reader.has("k");
  if (byNumbers && reader.has("material"))
    reader.fail("material", "give either \"material\" or \"eta\" and \"k\", not both");
  if (!byNumbers) metal = kMetals[reader.oneOf("material", "none", names(kMetals))];
  const float scale = 1 / refractiveIndex(reader, "ext_eta", "vacuum");
  const Rgb eta = in.scaled("eta", metal.eta, kComplexIndexRange, scale);
  const Rgb k = in.scaled("k", metal.k, kComplexIndexRange, scale);
  return {eta, k, in.color("specular_reflectance", 1)};
}

Microfacet readFacets(PluginReader& reader) {
  static constexpr std::string_view kDistributions[] = {"beckmann", "ggx"};
  constexpr float kSmoothest = 1e-4f;  // as in Mitsuba 3: below it, single precision cannot tell facets apart
  const bool apart = reader.has("alpha_u") || reader.has("alpha_v");
  if (apart && (!reader.has("alpha_u") || !reader.has("alpha_v")))
    reader.fail(reader.has("alpha_u") ? "alpha_u" : "alpha_v", "\"alpha_u\" and \"alpha_v\" come together");
  if (apart && reader.has("alpha")) reader.fail("alpha", "give either \"alpha\" or \"alpha_u\" and \"alpha_v\"");
  const auto alpha = [&](std::string_view name) {
    return std::max(reader.number(name, 0.1f, PluginReader::nonNegative()), kSmoothest);
  };
  Microfacet facets;
  facets.kind = static_cast<Microfacet::Kind>(reader.oneOf("distribution", "beckmann", kDistributions));
  facets.sampling = reader.boolean("sample_visible", true) ? Microfacet::Sampling::visible : Microfacet::Sampling::all;
  facets.alphaX = alpha(apart ? "alpha_u" : "alpha");
  facets.alphaY = alpha(apart ? "alpha_v" : "alpha");
  return facets;
}

// Colours 0 and 1: reflectance, transmittance.
Dielectric readDielectric(BsdfReader& in) {
  const float eta = refractiveIndex(in.reader, "int_ior", "bk7") / refractiveIndex(in.reader, "ext_ior", "air");
  const Rgb reflectance = in.color("specular_reflectance", 1);
  return {eta, reflectance, in.color("specular_transmittance", 1)};
}

Bsdf buildConductor(BsdfReader& in) { return Bsdf(readConductor(in)); }

Bsdf buildRoughConductor(BsdfReader& in) {
  const Conductor smooth = readConductor(in);
  return Bsdf(RoughConductor{readFacets(in.reader), smooth.eta, smooth.k, smooth.reflectance});
}

Bsdf buildDielectric(BsdfReader& in) { return Bsdf(readDielectric(in)); }

Bsdf buildThinDielectric(BsdfReader& in) {
  const Dielectric one = readDielectric(in);
  return Bsdf(ThinDielectric{one.eta, one.reflectance, one.transmittance});
}

Bsdf buildRoughDielectric(BsdfReader& in) {
  const Dielectric smooth = readDielectric(in);
  if (smooth.eta == 1)
    in.reader.failHere("the indices inside and outside are equal: no facet would bend light",
                       "give \"int_ior\" and \"ext_ior\" that differ, or take a \"null\" bsdf");
  return Bsdf(RoughDielectric{readFacets(in.reader), smooth.eta, smooth.reflectance, smooth.transmittance});
}

using Build = Bsdf (*)(BsdfReader&);
constexpr PluginRow<Build> kBsdfs[] = {{"diffuse", buildDiffuse},
                                       {"phong", buildPhong},
                                       {"conductor", buildConductor},
                                       {"dielectric", buildDielectric},
                                       {"thindielectric", buildThinDielectric},
                                       {"roughconductor", buildRoughConductor},
                                       {"roughdielectric", buildRoughDielectric},
                                       {"twosided", nullptr},
                                       {"null", nullptr}};

struct OneSide {
  Bsdf bsdf;
  BsdfTextures textures;
};

OneSide buildOneSided(BuildContext& context, const Node& node) {
  const Build build = findPlugin(node, kBsdfs, kNotYet);
  PluginReader reader(node, context.diagnostics);
  if (!build) reader.failHere(fmt::format("bsdf \"{}\" has no place in a twosided one", node.type));
  BsdfReader in(context, reader);
  const Bsdf bsdf = build(in);
  reader.finish();
  return {bsdf, in.textures};
}

SurfaceBsdf surfaceOf(const OneSide& front, const OneSide& back) {
  return {front.bsdf,
          back.bsdf,
          false,
          front.textures.any() || back.textures.any(),
          front.bsdf.anisotropic() || back.bsdf.anisotropic(),
          front.textures,
          back.textures};
}

SurfaceBsdf buildTwoSided(BuildContext& context, const Node& node) {
  PluginReader reader(node, context.diagnostics);
  const std::vector<NodePtr> sides = reader.children("bsdf");
  reader.finish();
  if (sides.empty() || sides.size() > 2) reader.failHere("a twosided bsdf holds one or two others");
  SurfaceBsdf result = surfaceOf(buildOneSided(context, *sides.front()), buildOneSided(context, *sides.back()));
  result.twoSided = true;
  if (result.front.transmits() || result.back.transmits())
    reader.failHere("only bsdfs that reflect can be made twosided");
  return result;
}

}  // namespace

bool isNullBsdf(const Node& bsdf) { return bsdf.type == "null"; }

int buildBsdf(BuildContext& context, const Node& node) {
  if (const auto known = context.bsdfIndex.find(&node); known != context.bsdfIndex.end()) return known->second;
  findPlugin(node, kBsdfs, kNotYet);
  SurfaceBsdf bsdf;
  if (isNullBsdf(node))
    PluginReader(node, context.diagnostics).finish();
  else if (node.type == "twosided")
    bsdf = buildTwoSided(context, node);
  else
    bsdf = surfaceOf(buildOneSided(context, node), {});
  const int index = static_cast<int>(context.parts.bsdfs.size());
  context.parts.bsdfs.push_back(bsdf);
  context.bsdfIndex[&node] = index;
  return index;
}

}  // namespace virga
