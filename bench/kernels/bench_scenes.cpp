// SPDX-License-Identifier: Apache-2.0
#include "bench_scenes.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <sstream>

#include "loaders/mitsuba_xml.h"
#include "scene/builder.h"
#include "volume/procedural.h"
#include "volume/volume_io.h"

namespace virga {
namespace {

const std::string kSensor = R"(<sensor type="perspective"><float name="fov" value="40"/>
  <transform name="to_world"><lookat origin="0, 0.3, 5" target="0, -0.1, 0" up="0, 1, 0"/></transform>
  <film type="hdrfilm"><integer name="width" value="640"/><integer name="height" value="480"/><rfilter type="box"/></film>
  </sensor>)";

std::string fog() {
  std::string walls;
  for (const char* turn : {"", R"(<rotate x="1" angle="90"/>)", R"(<rotate x="1" angle="-90"/>)",
                           R"(<rotate y="1" angle="90"/>)", R"(<rotate y="1" angle="-90"/>)"})
    walls += fmt::format(R"(<shape type="rectangle"><transform name="to_world"><scale value="6"/><translate z="-2"/>{}
      </transform><bsdf type="twosided"><bsdf type="diffuse"/></bsdf></shape>)",
                         turn);
  return R"(<medium type="homogeneous" id="fog"><float name="sigma_t" value="0.4"/><float name="albedo" value="0.9"/></medium>)" +
         kSensor.substr(0, kSensor.rfind("</sensor>")) + R"(<ref name="medium" id="fog"/></sensor>)" + walls +
         R"(<shape type="rectangle"><transform name="to_world"><scale value="0.5"/><rotate x="1" angle="90"/>
      <translate y="1.98"/></transform><emitter type="area"><rgb name="radiance" value="8"/></emitter></shape>
      <shape type="sphere"><float name="radius" value="0.6"/><point name="center" x="0.6" y="-1" z="0.4"/></shape>)";
}

std::string smoke() {
  static const std::string file = [] {
    const auto path = std::filesystem::temp_directory_path() / fmt::format("virga_frames.{}.vol", ::getpid());
    writeVol(path, makeProcedural(ProceduralKind::smoke, {.resolution = 128}));
    std::atexit([] {
      std::filesystem::remove(std::filesystem::temp_directory_path() / fmt::format("virga_frames.{}.vol", ::getpid()));
    });
    return path.string();
  }();
  return kSensor + fmt::format(R"(
    <emitter type="point"><point name="position" x="-2.5" y="3" z="1.5"/><rgb name="intensity" value="50"/></emitter>
    <shape type="rectangle"><transform name="to_world"><scale value="6"/><rotate x="1" angle="-90"/><translate y="-1"/></transform></shape>
    <shape type="cube"><transform name="to_world"><scale value="0.95"/></transform><bsdf type="null"/>
      <medium name="interior" type="heterogeneous"><volume name="sigma_t" type="gridvolume"><string name="filename" value="{}"/>
        <transform name="to_world"><scale value="2"/><translate x="-1" y="-1" z="-1"/></transform></volume>
        <rgb name="albedo" value="0.95"/><float name="scale" value="20"/></medium></shape>)",
                               file);
}

SceneSnapshot own(const std::string& elements) {
  return buildScene(parseMitsubaXml("<scene version=\"3.0.0\">" + elements + "</scene>", "bench_scenes.xml", "."));
}

}  // namespace

std::vector<BenchScene> benchScenes(const char* variable) {
  std::vector<BenchScene> scenes{{"fog", [] { return own(fog()); }}, {"smoke", [] { return own(smoke()); }}};
  if (const char* more = std::getenv(variable)) {
    std::istringstream names(more);
    for (std::string name; std::getline(names, name, ':');)
      scenes.push_back({name, [name] { return buildScene(loadMitsubaXml(name)); }});
  }
  return scenes;
}

}  // namespace virga
