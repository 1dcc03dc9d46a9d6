// SPDX-License-Identifier: Apache-2.0
#include "methods/ims_scenes.h"

#include <fmt/format.h>

#include <filesystem>

#include "image/scratch.h"
#include "volume/procedural.h"
#include "volume/volume_io.h"

namespace virga::testing {
namespace {

std::string sensor(int size, float x, const char* medium = "") {
  return fmt::format(R"(<sensor type="perspective"><float name="fov" value="40"/>
    <transform name="to_world"><lookat origin="{1}, 0.3, 5" target="{1}, -0.1, 0" up="0, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="{0}"/><integer name="height" value="{0}"/><rfilter type="box"/></film>
    {2}</sensor>)",
                     size, x, medium);
}

std::string smokeFile() {
  const std::filesystem::path path = scratchFile("smoke.vol");
  writeVol(path, makeProcedural(ProceduralKind::smoke, {.resolution = 48}));
  return path.string();
}

constexpr const char* kPlumeLamp =
    R"(<emitter type="point"><point name="position" x="-2.5" y="3" z="1.5"/><rgb name="intensity" value="50"/></emitter>)";

/// The plume's medium; `name`: an attribute.
std::string smoke(const char* name) {
  static const std::string file = smokeFile();
  return fmt::format(
      R"(<medium {} type="heterogeneous"><volume name="sigma_t" type="gridvolume"><string name="filename" value="{}"/>
        <transform name="to_world"><scale value="2"/><translate x="-1" y="-1" z="-1"/></transform></volume>
        <rgb name="albedo" value="0.9"/><float name="scale" value="12"/></medium>)",
      name, file);
}

}  // namespace

std::string plume(int size, float x) {
  return sensor(size, x) + kPlumeLamp + R"(
    <shape type="rectangle"><transform name="to_world"><scale value="6"/><rotate x="1" angle="-90"/><translate y="-1"/></transform>
      <bsdf type="diffuse"><rgb name="reflectance" value="0.5, 0.4, 0.3"/></bsdf></shape>
    <shape type="cube"><transform name="to_world"><scale value="0.3"/><translate x="1.2" y="-0.7" z="0.6"/></transform></shape>
    <shape type="cube"><transform name="to_world"><scale value="0.95"/></transform><bsdf type="null"/>
      )" +
         smoke(R"(name="interior")") + "</shape>";
}

std::string endlessPlume(int size, double z) {
  return smoke(R"(id="smoke")") +
         fmt::format(R"(<sensor type="perspective"><float name="fov" value="40"/><ref name="medium" id="smoke"/>
    <transform name="to_world"><lookat origin="0, 0, {1}" target="0, -0.1, 0" up="0, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="{0}"/><integer name="height" value="{0}"/><rfilter type="box"/></film>
    </sensor>)",
                     size, z) +
         kPlumeLamp +
         R"(<shape type="cube"><transform name="to_world"><scale value="0.2"/></transform><bsdf type="null"/>
    <ref name="interior" id="smoke"/></shape>)";
}

std::string openPlume(int size, const std::string& lights) {
  return smoke(R"(id="smoke")") + sensor(size, 0, R"(<ref name="medium" id="smoke"/>)") + lights + R"(
    <shape type="rectangle"><transform name="to_world"><scale value="0.8"/><rotate x="1" angle="-90"/><translate y="-0.7"/></transform>
      <bsdf type="diffuse"><rgb name="reflectance" value="0.8, 0.7, 0.6"/></bsdf></shape>
    <shape type="rectangle"><transform name="to_world"><scale value="0.6"/><translate z="-0.7"/></transform>
      <bsdf type="diffuse"><rgb name="reflectance" value="0.5, 0.7, 0.8"/></bsdf></shape>)";
}

std::string fog(int size, const std::string& bsdf, float x) {
  const auto wall = [](const char* turn, const char* color) {
    return fmt::format(R"(<shape type="rectangle"><transform name="to_world"><scale value="2"/><translate z="-2"/>{}
      </transform><bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="{}"/></bsdf></bsdf></shape>)",
                       turn, color);
  };
  return sensor(size, x) + wall("", "0.7, 0.7, 0.7") + wall(R"(<rotate x="1" angle="90"/>)", "0.7, 0.7, 0.7") +
         wall(R"(<rotate x="1" angle="-90"/>)", "0.7, 0.7, 0.7") +
         wall(R"(<rotate y="1" angle="90"/>)", "0.6, 0.1, 0.1") +
         wall(R"(<rotate y="1" angle="-90"/>)", "0.1, 0.5, 0.1") +
         fmt::format(
             R"(<shape type="rectangle"><transform name="to_world"><scale value="0.5"/><rotate x="1" angle="90"/>
      <translate y="1.98"/></transform><emitter type="area"><rgb name="radiance" value="8"/></emitter></shape>
      <shape type="sphere"><float name="radius" value="0.6"/><point name="center" x="0.6" y="-1" z="0.4"/>{}</shape>
      <shape type="cube"><transform name="to_world"><scale value="1.9"/></transform><bsdf type="null"/>
      <medium name="interior" type="homogeneous"><float name="sigma_t" value="0.4"/><float name="albedo" value="0.9"/>
      </medium></shape>)",
             bsdf);
}

}  // namespace virga::testing
