// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "scene/build_context.h"

namespace virga {
namespace {

constexpr std::string_view kNotYet[] = {
    "roughconductor", "thindielectric", "roughdielectric", "plastic",   "roughplastic",
    "principled",     "mask",           "bumpmap",         "normalmap", "blendbsdf"};

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

Bsdf buildDiffuse(PluginReader& reader) { return Bsdf(Diffuse{reader.color("reflectance", Rgb(0.5f), reader.unit())}); }

Bsdf buildPhong(PluginReader& reader) {
  const Rgb diffuse = reader.color("diffuse_reflectance", Rgb(0.5f), reader.unit());
  const Rgb left = Rgb(1.f) - diffuse;  // the default takes no more than the diffuse part leaves
  const Rgb usual(std::min(0.2f, left.r), std::min(0.2f, left.g), std::min(0.2f, left.b));
  const Rgb specular = reader.color("specular_reflectance", usual, reader.unit());
  if (maxComponent(diffuse + specular) > 1)
    reader.fail("specular_reflectance", "diffuse and specular reflectance add up to more than 1");
  return Bsdf(Phong{diffuse, specular, reader.number("exponent", 30, reader.nonNegative())});
}

Bsdf buildConductor(PluginReader& reader) {
  NamedMetal metal = kMetals[1];
  const bool byNumbers = reader.has("eta") || reader.has("k");
  if (byNumbers && reader.has("material"))
    reader.fail("material", "give either \"material\" or \"eta\" and \"k\", not both");
  if (!byNumbers) metal = kMetals[reader.oneOf("material", "Cu", names(kMetals))];
  const Rgb eta = reader.color("eta", metal.eta, kComplexIndexRange),
            k = reader.color("k", metal.k, kComplexIndexRange);
  const float outside = refractiveIndex(reader, "ext_eta", "air");
  return Bsdf(Conductor{eta / outside, k / outside, reader.color("specular_reflectance", Rgb(1.f), reader.unit())});
}

Bsdf buildDielectric(PluginReader& reader) {
  const float eta = refractiveIndex(reader, "int_ior", "bk7") / refractiveIndex(reader, "ext_ior", "air");
  return Bsdf(Dielectric{eta, reader.color("specular_reflectance", Rgb(1.f), reader.unit()),
                         reader.color("specular_transmittance", Rgb(1.f), reader.unit())});
}

using Build = Bsdf (*)(PluginReader&);
constexpr PluginRow<Build> kBsdfs[] = {{"diffuse", buildDiffuse},     {"phong", buildPhong},
                                       {"conductor", buildConductor}, {"dielectric", buildDielectric},
                                       {"twosided", nullptr},         {"null", nullptr}};

Bsdf buildOneSided(BuildContext& context, const Node& node) {
  const Build build = findPlugin(node, kBsdfs, kNotYet);
  PluginReader reader(node, context.diagnostics);
  if (!build) reader.failHere(fmt::format("bsdf \"{}\" has no place in a twosided one", node.type));
  const Bsdf bsdf = build(reader);
  reader.finish();
  return bsdf;
}

SurfaceBsdf buildTwoSided(BuildContext& context, const Node& node) {
  PluginReader reader(node, context.diagnostics);
  const std::vector<NodePtr> sides = reader.children("bsdf");
  reader.finish();
  if (sides.empty() || sides.size() > 2) reader.failHere("a twosided bsdf holds one or two others");
  const SurfaceBsdf result{buildOneSided(context, *sides.front()), buildOneSided(context, *sides.back()), true};
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
    bsdf = {buildOneSided(context, node), Bsdf(), false};
  const int index = static_cast<int>(context.parts.bsdfs.size());
  context.parts.bsdfs.push_back(bsdf);
  context.bsdfIndex[&node] = index;
  return index;
}

}  // namespace virga
