// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <bit>
#include <filesystem>
#include <fstream>

#include "methods/brute_force.h"

namespace virga::testing::brute {
namespace {

std::string text(Vector v) { return fmt::format("{}, {}, {}", v.x, v.y, v.z); }
std::string point(const char* name, Vector v) {
  return fmt::format(R"(<point name="{}" x="{}" y="{}" z="{}"/>)", name, v.x, v.y, v.z);
}

bool shines(Vector v) { return v.x > 0 || v.y > 0 || v.z > 0; }

std::string colour(const char* name, Vector v) { return fmt::format(R"(<rgb name="{}" value="{}"/>)", name, text(v)); }
std::string number(const char* name, double v) { return fmt::format(R"(<float name="{}" value="{}"/>)", name, v); }
std::string element(const char* type, const std::string& inner) {
  return fmt::format(R"(<bsdf type="{}">{}</bsdf>)", type, inner);
}

std::string reflectance(const Material& m) {
  if (m.board.u == 0) return colour("reflectance", m.diffuse);
  return fmt::format(R"(<texture name="reflectance" type="checkerboard">{}{}<transform name="to_uv">
    <scale x="{}" y="{}"/></transform></texture>)",
                     colour("color0", m.diffuse), colour("color1", m.board.other), m.board.u, m.board.v);
}
std::string indices(const Material& m) { return number("int_ior", m.index) + number("ext_ior", 1); }
std::string facets(const Material& m) {
  const char* name = m.facets == Material::Facets::ggx ? "ggx" : "beckmann";
  return fmt::format(R"(<string name="distribution" value="{}"/>)", name) + number("alpha", m.alpha);
}

std::string oneSided(const Material& m) {
  switch (m.kind) {
    case Material::Kind::phong:
      return element("phong", colour("diffuse_reflectance", m.diffuse) + colour("specular_reflectance", m.specular) +
                                  number("exponent", m.exponent));
    case Material::Kind::mirror:
      return element("conductor",
                     R"(<string name="material" value="none"/>)" + colour("specular_reflectance", m.specular));
    case Material::Kind::glass:
      return element("dielectric", indices(m));
    case Material::Kind::pane:
      return element("thindielectric", indices(m));
    case Material::Kind::roughMetal:
      return element("roughconductor",
                     facets(m) + colour("eta", m.eta) + colour("k", m.k) + colour("specular_reflectance", m.specular));
    case Material::Kind::roughGlass:
      return element("roughdielectric", facets(m) + indices(m));
    case Material::Kind::diffuse:
      break;
  }
  return element("diffuse", reflectance(m));
}

std::string bsdf(const Material& m) { return m.twoSided ? element("twosided", oneSided(m)) : oneSided(m); }

std::string look(const Material& m) {
  if (!shines(m.emission)) return bsdf(m);
  return fmt::format(R"(<emitter type="area"><rgb name="radiance" value="{}"/></emitter>)", text(m.emission));
}

std::string shape(const Sphere& s) {
  return fmt::format(R"(<shape type="sphere">{}<float name="radius" value="{}"/>{}</shape>)", point("center", s.center),
                     s.radius, look(s.material)) +
         "\n";
}

std::string shape(const Rectangle& r) {
  const Vector n{r.x.y * r.y.z - r.x.z * r.y.y, r.x.z * r.y.x - r.x.x * r.y.z, r.x.x * r.y.y - r.x.y * r.y.x};
  return fmt::format(
             R"(<shape type="rectangle"><transform name="to_world"><matrix value="{} {} {} {} {} {} {} {} {} {} {} {} 0 0 0 1"/>
    </transform>{}</shape>)",
             r.x.x, r.y.x, n.x, r.center.x, r.x.y, r.y.y, n.y, r.center.y, r.x.z, r.y.z, n.z, r.center.z,
             look(r.material)) +
         "\n";
}

template <class T>
void put(std::ofstream& out, T value) {
  out.write(reinterpret_cast<const char*>(&value), sizeof value);
}

void writeGrid(const std::filesystem::path& path, const Grid& grid, int channels) {
  static_assert(std::endian::native == std::endian::little);
  std::ofstream out(path, std::ios::binary);
  out.write("VOL\3", 4);
  for (const int32_t v : {1, grid.n, grid.n, grid.n, channels}) put(out, v);
  for (const float v : {0.f, 0.f, 0.f, 1.f, 1.f, 1.f}) put(out, v);
  for (const Vector& v : grid.values) {
    put(out, static_cast<float>(v.x));
    if (channels == 3) put(out, static_cast<float>(v.y)), put(out, static_cast<float>(v.z));
  }
}

std::string gridVolume(const char* parameter, const Region& r, const std::string& file) {
  return fmt::format(
      R"(<volume name="{}" type="gridvolume"><string name="filename" value="{}"/><transform name="to_world">
    <scale value="{}"/><translate value="{}"/></transform></volume>)",
      parameter, file, text({r.hi.x - r.lo.x, r.hi.y - r.lo.y, r.hi.z - r.lo.z}), text(r.lo));
}

std::string phase(const Lobe& lobe) {
  switch (lobe.phase) {
    case Phase::isotropic:
      return R"(<phase type="isotropic"/>)";
    case Phase::henyeyGreenstein:
      return fmt::format(R"(<phase type="hg">{}</phase>)", number("g", lobe.g));
    case Phase::cornetteShanks:
      return fmt::format(R"(<phase type="cornette_shanks">{}</phase>)", number("g", lobe.g));
    case Phase::rayleigh:
      return R"(<phase type="rayleigh"/>)";
    case Phase::schlick:
      return fmt::format(R"(<phase type="schlick">{}</phase>)", number("k", lobe.g));
    case Phase::table:
      break;
  }
  return fmt::format(R"(<phase type="tabphase"><string name="values" value="{}"/></phase>)",
                     fmt::join(lobe.table, ", "));
}

/// Writes the grids of a region's medium and the elements that refer to them.
class MediumText {
 public:
  MediumText(const Region& r, int index, const std::string& directory, const std::string& name)
      : region_(r), index_(index), directory_(directory), name_(name) {}

  std::string text() const {
    const Medium& m = region_.medium;
    const bool grids = m.density.n > 0 || m.albedoGrid.n > 0 || m.emissionGrid.n > 0;
    return fmt::format(R"(<medium type="{}" id="medium{}">)", grids ? "heterogeneous" : "homogeneous", index_) +
           volumeOr(number("sigma_t", 1), "sigma_t", m.density) + colour("scale", m.spectrum * m.sigmaT) +
           volumeOr(colour("albedo", m.albedo), "albedo", m.albedoGrid) + emission() + phases() + "</medium>\n";
  }

 private:
  std::string volumeOr(const std::string& constant, const char* parameter, const Grid& grid) const {
    if (grid.n == 0) return constant;
    const auto file = std::filesystem::path(directory_) / fmt::format("{}-{}-{}.vol", name_, index_, parameter);
    const bool grey =
        std::all_of(grid.values.begin(), grid.values.end(), [](Vector v) { return v.x == v.y && v.y == v.z; });
    const bool albedo = std::string_view(parameter) == "albedo";
    writeGrid(file, grid, grey && !albedo ? 1 : 3);
    return gridVolume(parameter, region_, file.string());
  }
  std::string emission() const {
    const Medium& m = region_.medium;
    if (!shines(m.emission)) return "";
    if (m.emissionGrid.n == 0) return colour("emission", m.emission);
    return volumeOr("", "emission", m.emissionGrid) + colour("emission_scale", m.emission);
  }
  std::string phases() const {
    const Medium& m = region_.medium;
    if (m.share == 0 && m.shareGrid.n == 0) return phase(m.lobe);
    return R"(<phase type="blendphase">)" + volumeOr(number("weight", m.share), "weight", m.shareGrid) + phase(m.lobe) +
           phase(m.other) + "</phase>";
  }

  const Region& region_;
  int index_;
  const std::string& directory_;
  const std::string& name_;
};

std::string boundary(const Region& r, int index) {
  const Vector c{(r.lo.x + r.hi.x) / 2, (r.lo.y + r.hi.y) / 2, (r.lo.z + r.hi.z) / 2};
  const Vector half{(r.hi.x - r.lo.x) / 2, (r.hi.y - r.lo.y) / 2, (r.hi.z - r.lo.z) / 2};
  std::string inner = fmt::format(R"(<ref name="interior" id="medium{}"/>)", index);
  if (r.within >= 0) inner += fmt::format(R"(<ref name="exterior" id="medium{}"/>)", r.within);
  inner += r.form == Region::Form::glassBall ? bsdf(r.wall) : R"(<bsdf type="null"/>)";
  if (r.form == Region::Form::box)
    return fmt::format(
               R"(<shape type="cube"><transform name="to_world"><scale value="{}"/><translate value="{}"/></transform>{}</shape>)",
               text(half), text(c), inner) +
           "\n";
  return fmt::format(R"(<shape type="sphere">{}<float name="radius" value="{}"/>{}</shape>)", point("center", c),
                     half.x, inner) +
         "\n";
}

}  // namespace

std::string sceneElements(const World& world, const std::string& directory, const std::string& name) {
  std::string xml =
      fmt::format(R"(<integrator type="volpath"><integer name="max_depth" value="{}"/></integrator>
    <sensor type="perspective"><float name="fov" value="{}"/><float name="near_clip" value="0.0001"/><transform name="to_world">
    <lookat origin="{}" target="{}" up="0, 1, 0"/></transform><film type="hdrfilm"><integer name="width" value="{}"/>
    <integer name="height" value="{}"/><rfilter type="box"/></film></sensor>)",
                  world.maxDepth, world.fieldOfView, text(world.eye), text(world.target), world.size, world.size) +
      "\n";
  if (shines(world.sky))
    xml +=
        fmt::format(R"(<emitter type="constant"><rgb name="radiance" value="{}"/></emitter>)", text(world.sky)) + "\n";
  for (const Sphere& s : world.spheres) xml += shape(s);
  for (const Rectangle& r : world.rectangles) xml += shape(r);
  const int count = static_cast<int>(world.regions.size());
  for (int i = 0; i < count; ++i) xml += MediumText(world.regions[static_cast<size_t>(i)], i, directory, name).text();
  for (int i = 0; i < count; ++i) xml += boundary(world.regions[static_cast<size_t>(i)], i);
  return xml;
}

}  // namespace virga::testing::brute
