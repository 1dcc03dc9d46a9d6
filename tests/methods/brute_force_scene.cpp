// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <bit>
#include <cmath>
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

std::string bsdf(const Material& m) {
  std::string inner;
  switch (m.kind) {
    case Material::Kind::diffuse:
      inner = fmt::format(R"(<bsdf type="diffuse"><rgb name="reflectance" value="{}"/></bsdf>)", text(m.diffuse));
      break;
    case Material::Kind::phong:
      inner = fmt::format(R"(<bsdf type="phong"><rgb name="diffuse_reflectance" value="{}"/>
        <rgb name="specular_reflectance" value="{}"/><float name="exponent" value="{}"/></bsdf>)",
                          text(m.diffuse), text(m.specular), m.exponent);
      break;
    case Material::Kind::mirror:
      inner = fmt::format(R"(<bsdf type="conductor"><string name="material" value="none"/>
        <rgb name="specular_reflectance" value="{}"/></bsdf>)",
                          text(m.specular));
      break;
    case Material::Kind::glass:
      inner = fmt::format(
          R"(<bsdf type="dielectric"><float name="int_ior" value="{}"/><float name="ext_ior" value="1"/></bsdf>)",
          m.index);
      break;
  }
  return m.twoSided ? "<bsdf type=\"twosided\">" + inner + "</bsdf>" : inner;
}

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

std::string phase(const Medium& m) {
  if (m.phase == Medium::Phase::isotropic) return "<phase type=\"isotropic\"/>";
  return fmt::format(R"(<phase type="{}"><float name="g" value="{}"/></phase>)",
                     m.phase == Medium::Phase::henyeyGreenstein ? "hg" : "cornette_shanks", m.g);
}

std::string medium(const Region& r, int index, const std::string& directory, const std::string& name) {
  const Medium& m = r.medium;
  const bool grids = m.density.n > 0 || m.albedoGrid.n > 0;
  std::string sigmaT = R"(<float name="sigma_t" value="1"/>)",
              albedo = fmt::format(R"(<rgb name="albedo" value="{}"/>)", text(m.albedo));
  const auto volume = [&](const char* parameter, const Grid& grid, int channels) {
    const std::string file = fmt::format("{}-{}-{}.vol", name, index, parameter);
    writeGrid(std::filesystem::path(directory) / file, grid, channels);
    return gridVolume(parameter, r, file);
  };
  if (m.density.n > 0) sigmaT = volume("sigma_t", m.density, 1);
  if (m.albedoGrid.n > 0) albedo = volume("albedo", m.albedoGrid, 3);
  return fmt::format(R"(<medium type="{}" id="medium{}">{}{}<float name="scale" value="{}"/>{}</medium>)",
                     grids ? "heterogeneous" : "homogeneous", index, sigmaT, albedo, m.sigmaT, phase(m)) +
         "\n";
}

std::string boundary(const Region& r, int index) {
  const Vector c{(r.lo.x + r.hi.x) / 2, (r.lo.y + r.hi.y) / 2, (r.lo.z + r.hi.z) / 2};
  const Vector half{(r.hi.x - r.lo.x) / 2, (r.hi.y - r.lo.y) / 2, (r.hi.z - r.lo.z) / 2};
  std::string inner = fmt::format(R"(<ref name="interior" id="medium{}"/>)", index);
  if (r.within >= 0) inner += fmt::format(R"(<ref name="exterior" id="medium{}"/>)", r.within);
  inner += r.form == Region::Form::glassBall ? bsdf({.kind = Material::Kind::glass}) : R"(<bsdf type="null"/>)";
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
  for (int i = 0; i < count; ++i) xml += medium(world.regions[static_cast<size_t>(i)], i, directory, name);
  for (int i = 0; i < count; ++i) xml += boundary(world.regions[static_cast<size_t>(i)], i);
  return xml;
}

}  // namespace virga::testing::brute
