// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <charconv>

#include "scene/build_context.h"

namespace virga {
namespace {

PlainPhase buildIsotropic(BuildContext&, PluginReader&) { return PlainPhase(Isotropic{}); }
PlainPhase buildRayleigh(BuildContext&, PluginReader&) { return PlainPhase(Rayleigh{}); }

float asymmetry(PluginReader& reader, std::string_view name) {
  return reader.number(name, 0.8f, {.lo = -1, .hi = 1, .openLo = true, .openHi = true});
}

PlainPhase buildHenyeyGreenstein(BuildContext&, PluginReader& reader) {
  return PlainPhase(HenyeyGreenstein{asymmetry(reader, "g")});
}

PlainPhase buildCornetteShanks(BuildContext&, PluginReader& reader) {
  return PlainPhase(CornetteShanks{asymmetry(reader, "g")});
}

PlainPhase buildSchlick(BuildContext&, PluginReader& reader) {
  if (reader.has("k")) {
    if (reader.has("g")) reader.fail("k", "give either \"g\" or \"k\", not both");
    return PlainPhase(Schlick{asymmetry(reader, "k")});
  }
  const float g = asymmetry(reader, "g"), k = Schlick::likeHenyeyGreenstein(g);
  if (!(std::fabs(k) < 1))
    reader.fail("g", fmt::format("g = {} stands for k = {:.4f}, which must lie between -1 and 1", g, k),
                "keep |g| below 0.938, or give \"k\"");
  return PlainPhase(Schlick{k});
}

// Numbers with commas or blanks between them.
std::vector<float> readList(PluginReader& reader, std::string_view name) {
  const std::string text = reader.text(name, "");
  std::vector<float> numbers;
  constexpr std::string_view kSeparators = ", \t\r\n";
  for (size_t at = text.find_first_not_of(kSeparators); at != std::string::npos;) {
    const size_t end = std::min(text.find_first_of(kSeparators, at), text.size());
    double number = 0;
    const auto [stop, error] = std::from_chars(text.data() + at, text.data() + end, number);
    const auto single = static_cast<float>(number);
    if (error != std::errc() || stop != text.data() + end || !std::isfinite(single) || single < 0)
      reader.fail(name, fmt::format("\"{}\" is not a finite number >= 0", text.substr(at, end - at)));
    numbers.push_back(single);
    at = text.find_first_not_of(kSeparators, end);
  }
  return numbers;
}

PlainPhase buildTable(BuildContext& context, PluginReader& reader) {
  const std::vector<float> values = readList(reader, "values");
  if (values.size() < 2)
    reader.fail("values", fmt::format("a tabphase needs two values or more, this one has {}", values.size()),
                "list them from backward to forward scattering, with commas between them");
  if (*std::max_element(values.begin(), values.end()) == 0) reader.fail("values", "all values are 0");
  // Equal tables are one, so that media of equal content are.
  auto table = std::make_shared<const PhaseTable>(values);
  for (const auto& known : context.parts.phaseTables)
    if (*known == *table) return PlainPhase(known->view());
  context.parts.phaseTables.push_back(table);
  return PlainPhase(table->view());
}

using Build = PlainPhase (*)(BuildContext&, PluginReader&);
constexpr PluginRow<Build> kPhases[] = {
    {"isotropic", buildIsotropic}, {"hg", buildHenyeyGreenstein}, {"cornette_shanks", buildCornetteShanks},
    {"rayleigh", buildRayleigh},   {"schlick", buildSchlick},     {"tabphase", buildTable},
    {"blendphase", nullptr}};

void addLobes(BuildContext& context, const Node& node, BuiltMixture& mixture);

void readWeight(BuildContext& context, PluginReader& reader, PhaseBlend& blend) {
  if (const NodePtr volume = reader.child("volume", "weight")) {
    const ScalarField field = buildScalarVolume(context, *volume);
    if (!(field.maximum <= 1))
      reader.fail("weight", fmt::format("the weight reaches {}; it must be at most 1", field.maximum));
    blend.weight = field.grid;
    blend.worldToWeight = field.worldToGrid;
    return;
  }
  if (!reader.has("weight"))
    reader.failHere("a blendphase needs a \"weight\"", "give the share of the second phase function, from 0 to 1");
  blend.weight.background = reader.number("weight", 0, reader.unit());
}

void addBlend(BuildContext& context, PluginReader& reader, BuiltMixture& mixture) {
  const std::vector<NodePtr> phases = reader.children("phase");
  if (phases.size() != 2)
    reader.failHere(fmt::format("a blendphase blends two phase functions, this one has {}", phases.size()),
                    "put two <phase> elements into it");
  PhaseBlend blend;
  readWeight(context, reader, blend);
  const auto lobes = [&] { return static_cast<int>(mixture.lobes.size()); };
  blend.first = lobes();
  addLobes(context, *phases[0], mixture);
  blend.middle = lobes();
  addLobes(context, *phases[1], mixture);
  blend.last = lobes();
  mixture.blends.push_back(blend);
}

// The tree of blends becomes a list of its leaves.
void addLobes(BuildContext& context, const Node& node, BuiltMixture& mixture) {
  PluginReader reader(node, context.diagnostics);
  const Build build = findPlugin(node, kPhases, {});
  if (!build) {
    addBlend(context, reader, mixture);
  } else {
    if (mixture.lobes.size() == static_cast<size_t>(PhaseMixture::kMostLobes))
      reader.failHere(fmt::format("more than {} phase functions in one blend", PhaseMixture::kMostLobes),
                      "leave some out, or make a tabphase of them");
    mixture.lobes.push_back(build(context, reader));
  }
  reader.finish();
}

bool sameBlend(const PhaseBlend& a, const PhaseBlend& b) {
  return a.first == b.first && a.middle == b.middle && a.last == b.last && sameGrid(a.weight, b.weight) &&
         a.worldToWeight == b.worldToWeight;
}

const BuiltMixture& shared(BuildContext& context, BuiltMixture mixture) {
  for (const auto& known : context.parts.phaseMixtures)
    if (known->lobes == mixture.lobes &&
        std::equal(known->blends.begin(), known->blends.end(), mixture.blends.begin(), mixture.blends.end(), sameBlend))
      return *known;
  context.parts.phaseMixtures.push_back(std::make_shared<const BuiltMixture>(std::move(mixture)));
  return *context.parts.phaseMixtures.back();
}

}  // namespace

void readPhase(BuildContext& context, PluginReader& reader, MediumView& medium) {
  const NodePtr node = reader.child("phase");
  if (!node) return;
  BuiltMixture built;
  addLobes(context, *node, built);
  if (built.blends.empty()) {
    built.lobes[0].visit([&](const auto& phase) { medium.phase = PhaseFunction(phase); });
    return;
  }
  const BuiltMixture& mixture = shared(context, std::move(built));
  const PhaseBlends blends{mixture.blends.data(), static_cast<int>(mixture.blends.size())};
  medium.phase = PhaseFunction(blends.at({}, {mixture.lobes.data(), static_cast<int>(mixture.lobes.size())}));
  const bool varies = std::any_of(mixture.blends.begin(), mixture.blends.end(),
                                  [](const PhaseBlend& b) { return b.weight.kind != GridView::Kind::constant; });
  if (varies) medium.phaseBlends = blends;
}

}  // namespace virga
