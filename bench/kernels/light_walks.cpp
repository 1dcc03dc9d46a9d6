// SPDX-License-Identifier: Apache-2.0
// Walks from the lights in a frame of a sequence: traced by exact flights, traced to be kept, and kept.
#include <benchmark/benchmark.h>
#include <fmt/format.h>
#include <tbb/global_control.h>
#include <unistd.h>

#include <filesystem>

#include "loaders/mitsuba_xml.h"
#include "scene/builder.h"
#include "transport/kept_walks.h"
#include "volume/procedural.h"
#include "volume/volume_io.h"

namespace virga {
namespace {

enum Place { kSmoke, kFog };
constexpr WalkOptions kWalks{.walks = 1024};
constexpr SampleId kId{1, 0, 0, 0};

/// Smoke over a ground, 15 mean free paths thick, or fog in a hall of columns; frame 0 or 1.
SceneSnapshot sceneOf(int place, int frame) {
  std::string elements =
      R"(<sensor type="perspective"/><emitter type="point"><point name="position" x="-2" y="3" z="1"/></emitter>
    <shape type="rectangle"><transform name="to_world"><scale value="9"/><rotate x="1" angle="-90"/><translate y="-1"/>
    </transform></shape>)";
  const auto file = std::filesystem::temp_directory_path() / fmt::format("virga_walks_{}_{}.vol", ::getpid(), frame);
  if (place == kSmoke) {
    writeVol(file, makeProcedural(ProceduralKind::smoke, {.resolution = 128, .frame = static_cast<float>(frame)}));
    elements += fmt::format(R"(<shape type="cube"><bsdf type="null"/><medium name="interior" type="heterogeneous">
      <float name="albedo" value="0.9"/><float name="scale" value="15"/><volume name="sigma_t" type="gridvolume">
      <string name="filename" value="{}"/><transform name="to_world"><translate value="-0.5"/><scale value="2"/></transform>
      </volume></medium></shape>)",
                            file.string());
  } else {
    for (int i = 0; i < 40; ++i)
      elements +=
          fmt::format(R"(<shape type="cylinder"><float name="radius" value="0.2"/><point name="p0" x="{0}" y="-1"
        z="{1}"/><point name="p1" x="{0}" y="4" z="{1}"/></shape>)",
                      i % 8 - 3.5, i / 8 - 2.0);
    elements +=
        fmt::format(R"(<shape type="cube"><transform name="to_world"><scale value="5"/></transform><bsdf type="null"/>
      <medium name="interior" type="homogeneous"><float name="sigma_t" value="{}"/><float name="albedo" value="0.9"/>
      </medium></shape>)",
                    0.3 + 0.02 * frame);
  }
  const SceneSnapshot scene =
      buildScene(parseMitsubaXml("<scene version=\"3.0.0\">" + elements + "</scene>", "walks.xml", "."));
  std::filesystem::remove(file);
  return scene;
}

template <class Make>
void measure(benchmark::State& state, const Make& make) {
  const tbb::global_control alone(tbb::global_control::max_allowed_parallelism, 1);
  size_t lights = 0;
  for (auto _ : state) {
    const VirtualLights made = make();
    lights = made.lights.size();
    benchmark::DoNotOptimize(lights);
  }
  state.SetItemsProcessed(state.iterations() * kWalks.walks);
  state.counters["lights"] = static_cast<double>(lights);
}

void exactFlights(benchmark::State& state) {
  const SceneSnapshot scene = sceneOf(static_cast<int>(state.range(0)), 1);
  measure(state, [&] { return traceVirtualLights(*scene, kWalks, kId); });
}
BENCHMARK(exactFlights)->Arg(kSmoke)->Arg(kFog);

void tracedToBeKept(benchmark::State& state) {
  const SceneSnapshot scene = sceneOf(static_cast<int>(state.range(0)), 1);
  measure(state, [&] { return KeptWalks().lights(*scene, kWalks, kId, 0, 0); });
}
BENCHMARK(tracedToBeKept)->Arg(kSmoke)->Arg(kFog);

void kept(benchmark::State& state) {
  const int place = static_cast<int>(state.range(0));
  const SceneSnapshot before = sceneOf(place, 0), after = sceneOf(place, 1);
  KeptWalks walks;
  walks.lights(*before, kWalks, kId, 0, 0);
  int frame = 0;
  measure(state, [&] { return walks.lights(*after, kWalks, kId, ++frame, 0); });
}
BENCHMARK(kept)->Arg(kSmoke)->Arg(kFog);

}  // namespace
}  // namespace virga
