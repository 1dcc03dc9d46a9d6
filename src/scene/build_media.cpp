// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "scene/build_context.h"
#include "volume/volume_io.h"

namespace virga {
namespace {

/// A volume plugin's values and where they stand: a constant, a grid, or a grid of colours with one that bounds them.
struct VolumeField {
  Rgb constant;
  std::shared_ptr<const Grid> grid;  ///< of an albedo: none
  std::shared_ptr<const RgbGrid> rgbGrid;
  Matrix4 indexToWorld;
};

/// What a volume is for. Extinction and emission may be numbers or colours.
enum class VolumeUse { extinction, albedo, emission, number };

Matrix4 unitCubeToBounds(const Bounds& b) {
  const Vec3 e = b.extent();
  return Matrix4::translation(b.lo.x, b.lo.y, b.lo.z) * Matrix4::scaling(e.x, e.y, e.z);
}

/// Index coordinates of a box of voxels to the unit cube: centres at (i + 0.5) / n.
Matrix4 voxelsToUnitCube(const RgbGridView& v) {
  return Matrix4::scaling(1.0 / v.nx, 1.0 / v.ny, 1.0 / v.nz) * Matrix4::translation(0.5, 0.5, 0.5);
}

// Errors about a file's content gain the place in the scene that named the file.
template <class Load>
auto loadedFrom(PluginReader& reader, std::string_view parameter, const Load& load) {
  try {
    return load();
  } catch (const Error& error) {
    throw error.at(reader.positionOf(parameter));
  }
}

// Of no extent, but where it is an extinction: there Mitsuba takes it for a grid of one voxel (readSigmaT).
VolumeField buildConstantVolume(BuildContext&, PluginReader& reader, VolumeUse) {
  const Matrix4 voxel = reader.transform("to_world") * Matrix4::translation(0.5, 0.5, 0.5);
  return {reader.color("value", Rgb(1.f)), nullptr, nullptr, voxel};
}

// The two plugins place their grids by different rules, so neither reads what is the other's.
void refuseFormat(PluginReader& reader, const std::filesystem::path& path, std::initializer_list<VolumeFormat> refused,
                  std::string_view remedy) {
  if (std::find(refused.begin(), refused.end(), volumeFormat(path)) != refused.end())
    reader.fail("filename", fmt::format("a {} does not read this format", reader.node().type),
                fmt::format("use type=\"{}\"", remedy));
}

void refuseOtherSampling(PluginReader& reader) {
  static constexpr std::string_view kFilters[] = {"trilinear"}, kWraps[] = {"clamp"};
  reader.oneOf("filter_type", "trilinear", kFilters);
  reader.oneOf("wrap_mode", "clamp", kWraps);
  reader.ignore("raw");
  reader.ignore("accel");
}

VolumeField buildGridVolume(BuildContext& context, PluginReader& reader, VolumeUse use) {
  const std::filesystem::path path = context.file(reader, "filename");
  refuseFormat(reader, path, {VolumeFormat::vdb, VolumeFormat::nvdb}, "vdb");
  refuseOtherSampling(reader);
  VolumeField field;
  field.indexToWorld = reader.transform("to_world");
  if (reader.boolean("use_grid_bbox", false))
    field.indexToWorld =
        field.indexToWorld * unitCubeToBounds(loadedFrom(reader, "filename", [&] { return volBounds(path); }));
  const std::string key = fileKey(path);
  loadedFrom(reader, "filename", [&] {
    if (use == VolumeUse::albedo || (use != VolumeUse::number && holdsColors(path)))
      field.rgbGrid = context.cached<RgbGrid>(&PartCache::rgbGrids, key, [&]() -> std::shared_ptr<const RgbGrid> {
        return std::make_shared<const RgbGrid>(loadRgbVolume(path));
      });
    if (use != VolumeUse::albedo)
      field.grid = context.cached<Grid>(&PartCache::grids, key, [&]() -> std::shared_ptr<const Grid> {
        return field.rgbGrid ? field.rgbGrid->largestChannel() : loadVolume(path);
      });
  });
  const Matrix4 voxels = field.grid ? field.grid->indexToWorld() : voxelsToUnitCube(field.rgbGrid->view());
  field.indexToWorld = field.indexToWorld * voxels;
  return field;
}

VolumeField buildVdb(BuildContext& context, PluginReader& reader, VolumeUse use) {
  if (use == VolumeUse::albedo) reader.failHere("a vdb volume for \"albedo\" is not supported yet", "use a gridvolume");
  const std::filesystem::path path = context.file(reader, "filename");
  const std::string grid = reader.text("grid", "");
  refuseFormat(reader, path, {VolumeFormat::vol}, "gridvolume");
  VolumeField field;
  field.grid = loadedFrom(reader, reader.has("grid") ? "grid" : "filename", [&] {
    return context.cached<Grid>(&PartCache::grids, fileKey(path) + "#" + grid,
                                [&] { return loadVolume(path, {grid}); });
  });
  field.indexToWorld = reader.transform("to_world") * field.grid->indexToWorld();
  return field;
}

VolumeField buildVolume(BuildContext& context, const Node& node, VolumeUse use) {
  using Build = VolumeField (*)(BuildContext&, PluginReader&, VolumeUse);
  static constexpr PluginRow<Build> kVolumes[] = {
      {"constvolume", buildConstantVolume}, {"gridvolume", buildGridVolume}, {"vdb", buildVdb}};
  const Build build = findPlugin(node, kVolumes, {});
  PluginReader reader(node, context.diagnostics);
  const VolumeField field = build(context, reader, use);
  reader.finish();
  return field;
}

void setSigmaT(MediumView& medium, Rgb sigmaT) {
  medium.sigmaT = maxComponent(sigmaT);
  medium.spectrum = medium.sigmaT > 0 ? sigmaT / Rgb(medium.sigmaT) : Rgb(1.f);
}

// Mitsuba 0.x names both coefficients; 3 names their sum and the albedo.
void readScatteringAndAbsorption(PluginReader& reader, MediumView& medium) {
  const Rgb sigmaS = reader.color("sigma_s", Rgb(0.f)), sigmaA = reader.color("sigma_a", Rgb(0.f)),
            sum = sigmaS + sigmaA;
  setSigmaT(medium, sum);
  for (int c = 0; c < 3; ++c) medium.albedo[c] = sum[c] > 0 ? sigmaS[c] / sum[c] : 0;
}

void readAlbedo(BuildContext& context, PluginReader& reader, MediumView& medium) {
  if (const NodePtr volume = reader.child("volume", "albedo")) {
    const VolumeField field = buildVolume(context, *volume, VolumeUse::albedo);
    if (field.rgbGrid) {
      if (field.rgbGrid->maximum() > 1)
        reader.fail("albedo", fmt::format("albedo reaches {}; it must be at most 1", field.rgbGrid->maximum()));
      medium.albedoGrid = field.rgbGrid->view();
      medium.worldToAlbedo = Affine(field.indexToWorld.inverse());
    } else {
      if (maxComponent(field.constant) > 1)
        reader.fail("albedo", fmt::format("albedo is {}; it must be at most 1", maxComponent(field.constant)));
      medium.albedo = field.constant;
    }
    return;
  }
  medium.albedo = reader.color("albedo", Rgb(0.75f), reader.unit());
}

// sigma_t of a medium: a colour, or a volume.
void readSigmaT(BuildContext& context, PluginReader& reader, MediumView& medium) {
  const NodePtr volume = reader.child("volume", "sigma_t");
  if (!volume) return setSigmaT(medium, reader.color("sigma_t", Rgb(1.f)));
  VolumeField field = buildVolume(context, *volume, VolumeUse::extinction);
  if (field.grid) {
    medium.sigmaT = 1;
  } else {
    setSigmaT(medium, field.constant);
    if (reader.node().type != "heterogeneous") return;
    field.grid = context.cached<Grid>(&PartCache::grids, "one voxel", [] { return Grid::dense(1, 1, 1, {1.f}); });
  }
  medium.homogeneous = false;
  medium.density = field.grid->view();
  if (field.rgbGrid) medium.densityColors = field.rgbGrid->view();
  medium.worldToDensity = Affine(field.indexToWorld.inverse());
}

// Light that the medium emits itself: a colour, or a volume, times a scale.
void readEmission(BuildContext& context, PluginReader& reader, MediumView& medium) {
  medium.emission = reader.color("emission_scale", Rgb(1.f));
  const NodePtr volume = reader.child("volume", "emission");
  if (!volume) {
    medium.emission *= reader.color("emission", Rgb(0.f));
  } else if (const VolumeField field = buildVolume(context, *volume, VolumeUse::emission); field.grid) {
    medium.glowsEvenly = false;
    medium.emissionGrid = field.grid->view();
    if (field.rgbGrid) medium.emissionColors = field.rgbGrid->view();
    medium.worldToEmission = Affine(field.indexToWorld.inverse());
  } else {
    medium.emission *= field.constant;
  }
  medium.emits = !isBlack(medium.emission);
  if (!isFinite(medium.emission)) reader.fail("emission_scale", "\"emission\" times \"emission_scale\" is too large");
}

void requireTrackable(PluginReader& reader, const MediumView& medium) {
  const GridView& g = medium.density;
  float densest = g.background;
  const size_t cells =
      static_cast<size_t>(g.majorant.nx) * static_cast<size_t>(g.majorant.ny) * static_cast<size_t>(g.majorant.nz);
  for (size_t i = 0; i < cells; ++i) densest = std::max(densest, g.majorant.values[i]);
  const float across = length(g.supportHi - g.supportLo) / length(medium.worldToDensity.x);
  requireTrackable(reader.positionOf("scale"), densest * medium.sigmaT * across);
}

MediumView readMedium(BuildContext& context, PluginReader& reader) {
  MediumView medium;
  if (reader.has("sigma_s") || reader.has("sigma_a")) {
    if (reader.has("sigma_t") || reader.has("albedo"))
      reader.fail("sigma_t", "give either \"sigma_t\" and \"albedo\" or \"sigma_s\" and \"sigma_a\"");
    readScatteringAndAbsorption(reader, medium);
  } else {
    readAlbedo(context, reader, medium);
    readSigmaT(context, reader, medium);
  }
  setSigmaT(medium, medium.spectrum * medium.sigmaT * reader.color("scale", Rgb(1.f)));
  if (!std::isfinite(medium.sigmaT)) reader.fail("scale", "\"scale\" times \"sigma_t\" is too large");
  medium.grey = medium.spectrum == Rgb(1.f) && !medium.densityColors.values;
  readEmission(context, reader, medium);
  if (!medium.homogeneous) requireTrackable(reader, medium);
  readPhase(context, reader, medium);
  if (!reader.boolean("sample_emitters", true))
    reader.warnIgnored("sample_emitters", "the method decides how it finds light");
  reader.ignore("has_spectral_extinction");
  reader.ignore("majorant_resolution_factor");
  return medium;
}

MediumView buildHomogeneous(BuildContext& context, PluginReader& reader) {
  const MediumView medium = readMedium(context, reader);
  if (!medium.homogeneous || medium.albedoGrid.values)
    reader.failHere("a homogeneous medium cannot have a grid", "use type=\"heterogeneous\"");
  if (!medium.glowsEvenly) reader.failHere("a homogeneous medium cannot glow by a grid", "use type=\"heterogeneous\"");
  return medium;
}

bool sameExtinction(const MediumView& a, const MediumView& b) {
  return a.sigmaT == b.sigmaT && a.spectrum == b.spectrum && a.homogeneous == b.homogeneous &&
         sameGrid(a.density, b.density) && a.densityColors.values == b.densityColors.values &&
         a.worldToDensity == b.worldToDensity;
}

bool sameEmission(const MediumView& a, const MediumView& b) {
  return a.emission == b.emission && a.glowsEvenly == b.glowsEvenly && sameGrid(a.emissionGrid, b.emissionGrid) &&
         a.emissionColors.values == b.emissionColors.values && a.worldToEmission == b.worldToEmission;
}

bool sameMedium(const MediumView& a, const MediumView& b) {
  return sameExtinction(a, b) && sameEmission(a, b) && a.albedo == b.albedo &&
         a.albedoGrid.values == b.albedoGrid.values && a.worldToAlbedo == b.worldToAlbedo && a.phase == b.phase &&
         a.phaseBlends == b.phaseBlends;
}

// Media of equal content are one, as if they had been referred to: a boundary whose exterior repeats what surrounds it
// means that very medium.
int indexOf(std::vector<MediumView>& media, const MediumView& medium) {
  const auto known =
      std::find_if(media.begin(), media.end(), [&](const MediumView& m) { return sameMedium(m, medium); });
  if (known == media.end()) return media.push_back(medium), static_cast<int>(media.size()) - 1;
  return static_cast<int>(known - media.begin());
}

}  // namespace

bool sameGrid(const GridView& a, const GridView& b) {
  return a.kind == b.kind && a.dense.values == b.dense.values && a.sparse.grid == b.sparse.grid &&
         a.background == b.background;
}

ScalarField buildScalarVolume(BuildContext& context, const Node& volume) {
  const VolumeField field = buildVolume(context, volume, VolumeUse::number);
  if (field.grid) return {field.grid->view(), Affine(field.indexToWorld.inverse()), field.grid->maximum()};
  if (!isGrey(field.constant))
    throw Error("a volume of numbers is needed here, and this one has a colour",
                {volume.position, "give one value", {}});
  ScalarField constant;
  constant.grid.background = constant.maximum = field.constant.r;
  return constant;
}

void requireTrackable(const SourcePosition& medium, float thickness) {
  constexpr float kMostMeanFreePaths = 1e6f;
  if (thickness <= kMostMeanFreePaths) return;
  throw Error(fmt::format("the medium is {:.2g} mean free paths thick; at most {:.0e} can be tracked", thickness,
                          kMostMeanFreePaths),
              {medium, "reduce \"scale\" or \"sigma_t\"", {}});
}

int buildMedium(BuildContext& context, const Node& node) {
  if (const auto known = context.mediumIndex.find(&node); known != context.mediumIndex.end()) return known->second;
  using Build = MediumView (*)(BuildContext&, PluginReader&);
  static constexpr PluginRow<Build> kMedia[] = {{"homogeneous", buildHomogeneous}, {"heterogeneous", readMedium}};
  const Build build = findPlugin(node, kMedia, {});
  PluginReader reader(node, context.diagnostics);
  const MediumView medium = build(context, reader);
  reader.finish();
  return context.mediumIndex[&node] = indexOf(context.parts.media, medium);
}

}  // namespace virga
