// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/ims_options.h"

#include <fmt/format.h>

#include <algorithm>

#include "methods/instant_scattering/eye_march.h"
#include "methods/instant_scattering/ims_method.h"
#include "methods/settings_reader.h"
#include "transport/kept_walks.h"
#include "transport/lamp_tables.h"

namespace virga {
namespace {

constexpr std::string_view kMode[] = {"exact", "fast", "frame"};
constexpr std::string_view kCompensate[] = {"path", "sampled", "none", "spread"};
constexpr std::string_view kEnding[] = {"nothing", "reduced", "unclamped"};
constexpr std::string_view kTransmittance[] = {"exact", "mean", "gradient"};
constexpr std::string_view kVisibility[] = {"exact", "shadow_map", "minimum_depth", "none"};
constexpr std::string_view kFlights[] = {"tracking", "marching"};
constexpr std::string_view kShow[] = {"picture", "lost", "compensation"};

/// Random walks in each pass; shadow maps take time and memory for each of their lights.
constexpr int kWalks = 8192, kWalksWithMaps = 256, kFrameWalks = 16384;
/// Of a frame's walks. Measured: docs/decisions/ims-frames.md.
constexpr float kFrameAim = 0.5f;
constexpr float kMostAim = 0.95f;
/// Of the scene's largest extent: the clamping radius where none is given. Measured: docs/methods/ims.md.
constexpr float kRadiusShare = 0.3f;
/// Each leaves some lights of 64 bytes.
constexpr int kMostWalks = 1 << 22;
/// Of coarse pixels: farther apart than pictures are wide.
constexpr int kMostSpacing = 1 << 14;
/// Of a frame, whose thousand lights share smaller maps' memory.
constexpr int kFramePoints = 4, kFrameMapResolution = 32, kFrameMapPoints = 0;
/// Virtual lights for a vertex: where a medium is heterogeneous the way to each must be tracked, and paths are cheaper.
constexpr int kLights = 8, kLightsWhereTracked = 1;

template <size_t N>
std::string wordOf(const std::string_view (&words)[N], auto value) {
  return std::string(words[static_cast<size_t>(value)]);
}

/// Of the shapes; where there are none, the longest mean free path of the media, or one unit.
float extentOf(const SceneView& scene) {
  const float extent = maxComponent(scene.bounds.extent());
  if (extent > 0) return extent;
  float longest = 0;
  for (const MediumView& medium : scene.media)
    if (medium.sigmaT > 0) longest = std::max(longest, 1 / medium.sigmaT);
  return longest > 0 ? longest : 1;
}

void readVisibility(const SettingsReader& reader, ImsOptions::Mode mode, LightVisibilityOptions& o) {
  using Seen = LightVisibilityOptions::Mode;
  const bool isFrame = mode == ImsOptions::Mode::frame;
  const Seen byDefault = isFrame ? Seen::shadowMap : Seen::exact;
  o.mode = static_cast<Seen>(reader.choice("visibility", kVisibility).value_or(static_cast<int>(byDefault)));
  if (isFrame && o.mode == Seen::minimumDepth)
    throw Error("--set ims.visibility=minimum_depth needs ims.mode=exact or fast: a frame has shadow maps");
  o.resolution = reader.integer("map_resolution", 1).value_or(isFrame ? kFrameMapResolution : o.resolution);
  o.points = reader.integer("map_points", 0).value_or(isFrame ? kFrameMapPoints : o.points);
  if (o.resolution > LightVisibilityOptions::kMostResolution)
    throw Error(fmt::format("--set ims.map_resolution may be at most {}", LightVisibilityOptions::kMostResolution));
  if (o.points > LightVisibilityOptions::kMostPoints)
    throw Error(fmt::format("--set ims.map_points may be at most {}", LightVisibilityOptions::kMostPoints));
}

/// How a frame's kernels see lights.
ReceiverBatch::Visibility frameVisibility(LightVisibilityOptions::Mode mode) {
  using Seen = LightVisibilityOptions::Mode;
  if (mode == Seen::none) return ReceiverBatch::Visibility::none;
  return mode == Seen::shadowMap ? ReceiverBatch::Visibility::maps : ReceiverBatch::Visibility::exact;
}

}  // namespace

bool ImsOptions::biased() const {
  if (mode != Mode::exact) return true;
  if (show != Show::picture || compensate == Compensate::none) return true;
  if (flights == FlightMode::marching) return true;
  using Seen = LightVisibilityOptions::Mode;
  if (visibility.mode == Seen::shadowMap || visibility.mode == Seen::none) return true;
  if (compensate != Compensate::sampled) return false;
  return compensation.transmittance != CompensationOptions::Transmittance::exact ||
         (compensation.levels >= 0 && compensation.ending != CompensationOptions::Ending::unclamped);
}

namespace {

/// A setting that would change nothing is a mistake.
void refuseIdle(const Settings& settings, bool idle, std::initializer_list<std::string_view> names,
                std::string_view needs) {
  if (!idle) return;
  for (const std::string_view name : names)
    if (settings.values.contains(name))
      throw Error(fmt::format("--set ims.{} needs {}: here it would do nothing", name, needs));
}

void refuseIdle(const Settings& settings, const ImsOptions& o) {
  const bool isFrame = o.mode == ImsOptions::Mode::frame;
  refuseIdle(settings, isFrame, {"levels", "ending", "v1", "v2", "p1", "p2", "transmittance"},
             "ims.mode=exact or fast");
  refuseIdle(settings, o.compensate != ImsOptions::Compensate::sampled,
             {"levels", "ending", "v1", "v2", "p1", "p2", "transmittance"}, "ims.compensation=sampled");
  refuseIdle(settings, o.visibility.mode != LightVisibilityOptions::Mode::shadowMap, {"map_resolution", "map_points"},
             "ims.visibility=shadow_map");
  refuseIdle(settings, o.mode == ImsOptions::Mode::exact, {"samples", "spacing"}, "ims.mode=fast or frame");
  refuseIdle(settings, o.mode == ImsOptions::Mode::exact, {"eye_steps"}, "ims.mode=fast or frame");
  refuseIdle(settings, o.mode != ImsOptions::Mode::fast, {"lamp_table"}, "ims.mode=fast");
  refuseIdle(settings, o.mode == ImsOptions::Mode::frame, {"paths"}, "ims.mode=exact or fast");
}

}  // namespace

ImsSettings::ImsSettings(const Settings& settings) {
  const SettingsReader reader(settings, kImsSettings, "ims");
  ImsOptions& o = given_;
  o.mode = static_cast<ImsOptions::Mode>(reader.choice("mode", kMode).value_or(0));
  o.spacing = reader.integer("spacing", 1, kMostSpacing).value_or(o.spacing);
  readMarching(reader);
  walks_ = reader.integer("walks", 1, kMostWalks, "ask for more passes instead: each has walks of its own");
  o.flights = static_cast<FlightMode>(reader.choice("walk_flights", kFlights).value_or(0));
  o.aim = reader.share("aim").value_or(o.mode == ImsOptions::Mode::frame ? kFrameAim : 0);
  if (o.aim > kMostAim)
    throw Error(fmt::format("--set ims.aim may be at most {}: some walks must go elsewhere", kMostAim));
  o.retrace = reader.share("retrace").value_or(o.retrace);
  if (o.retrace < 1 && o.flights == FlightMode::marching)
    throw Error("--set ims.retrace needs ims.walk_flights=tracking: kept walks have flights of their own");
  if (o.retrace < 1 && walks_ && !WalkStore::keeps(0, *walks_))
    throw Error(fmt::format("--set ims.retrace={} would keep nothing: a pass has {} walks, and at most {} are kept",
                            settings.values.at("retrace"), *walks_, WalkStore::kMostWalks),
                {{}, "leave it out, or ask for fewer walks and more passes", {}});
  o.amount.walks = reader.integer("paths", 0).value_or(0);
  lights_ = reader.integer("lights", 1);
  const bool isFrame = o.mode == ImsOptions::Mode::frame;
  o.samples = reader.integer("samples", 1).value_or(isFrame ? kFramePoints : o.samples);
  o.compensate =
      static_cast<ImsOptions::Compensate>(reader.choice("compensation", kCompensate).value_or(isFrame ? 3 : 0));
  o.show = static_cast<ImsOptions::Show>(reader.choice("show", kShow).value_or(0));
  readVisibility(reader, o.mode, o.visibility);
  o.gather.lostLight = o.show == ImsOptions::Show::lost;
  CompensationOptions& c = o.compensation;
  c.levels = reader.integer("levels", -1).value_or(-1);
  c.ending = static_cast<CompensationOptions::Ending>(reader.choice("ending", kEnding).value_or(2));
  c.vertices[0] = reader.integer("v1", 1).value_or(1);
  c.vertices[1] = reader.integer("v2", 1).value_or(1);
  c.amounts[0].walks = reader.integer("p1", 0).value_or(0);
  c.amounts[1].walks = reader.integer("p2", 0).value_or(0);
  c.transmittance =
      static_cast<CompensationOptions::Transmittance>(reader.choice("transmittance", kTransmittance).value_or(0));
  radius_ = reader.number("radius", 0);
  const std::optional<float> bound = reader.number("bound", 0);
  if (radius_ && bound) throw Error("--set ims.radius and ims.bound say the same: give one of them");
  if (bound) radius_ = 1 / std::sqrt(*bound);
  if (o.show == ImsOptions::Show::compensation && o.compensate != ImsOptions::Compensate::sampled)
    throw Error("--set ims.show=compensation needs ims.compensation=sampled: path does not tell it apart");
  if (o.show != ImsOptions::Show::picture && o.mode != ImsOptions::Mode::exact)
    throw Error("--set ims.show needs ims.mode=exact: others do not tell parts of the picture apart");
  if (isFrame && o.compensate == ImsOptions::Compensate::path)
    throw Error("--set ims.mode=frame follows no paths: give ims.compensation=spread, sampled or none");
  if (!isFrame && o.compensate == ImsOptions::Compensate::spread)
    throw Error("--set ims.compensation=spread needs ims.mode=frame");
  maxDepth_ = reader.integer("max_depth", -1);
  rrDepth_ = reader.integer("rr_depth", 1);
  refuseIdle(settings, o);
}

void ImsSettings::readMarching(const SettingsReader& reader) {
  // The steps of a frame are the same in all pixels: where they are few, they show.
  const bool isFrame = given_.mode == ImsOptions::Mode::frame;
  given_.eyeSteps = reader.integer("eye_steps", 1).value_or(isFrame ? MarchedEye::kSteps : given_.eyeSteps);
  if (given_.eyeSteps > MarchedEye::kSteps)
    throw Error(fmt::format("--set ims.eye_steps may be at most {}", MarchedEye::kSteps));
  lampTable_ = LampTableSetting(reader, "ims");
}

ImsOptions ImsSettings::forScene(const Scene& scene) const {
  ImsOptions o = given_;
  o.path.maxDepth = o.gather.maxDepth = maxDepth_.value_or(scene.integrator.maxDepth);
  o.path.rrDepth = rrDepth_.value_or(scene.integrator.rrDepth);
  const bool tracked = std::any_of(scene.view.media.begin(), scene.view.media.end(),
                                   [](const MediumView& medium) { return !medium.homogeneous; });
  if (!tracked) o.flights = FlightMode::tracking;  // it is the same, and exact
  const bool isFrame = o.mode == ImsOptions::Mode::frame;
  const int lights = tracked ? kLightsWhereTracked : kLights;
  for (GatherAmount* amount : {&o.amount, &o.compensation.amounts[0], &o.compensation.amounts[1]})
    amount->lights = isFrame ? lights : lights_.value_or(lights);
  if (isFrame) o.frameLights = lights_.value_or(o.frameLights);
  const bool maps = o.visibility.mode == LightVisibilityOptions::Mode::shadowMap;
  o.lampTable =
      mayHaveLampTables(scene.view) ? lampTable_.nodes(scene.view, lampTableSide(scene)) : 0;  // 0: it is marched
  o.walks = walks_.value_or(isFrame ? kFrameWalks : maps ? kWalksWithMaps : kWalks);
  const float extent = extentOf(scene.view);
  o.compensation.radius = radius_.value_or(kRadiusShare * extent);
  constexpr float kLeast = 1e-6f, kMost = 1e3f;
  if (o.compensation.radius < kLeast * extent || o.compensation.radius > kMost * extent)
    throw Error(
        fmt::format("ims.radius, or 1 / sqrt(ims.bound), is {} in a scene with an extent of {}: out of proportion",
                    o.compensation.radius, extent),
        {{}, fmt::format("choose a radius from {} to {}", kLeast * extent, kMost * extent), {}});
  o.gather.bound = 1 / square(o.compensation.radius);
  const bool spread = o.compensate == ImsOptions::Compensate::spread;
  o.frame.visibility = frameVisibility(o.visibility.mode);
  o.frame.near = {spread ? NearField::Kind::spread : NearField::Kind::clamped, radius_ ? o.gather.bound : 0};
  return o;
}

SettingValues valuesOf(const ImsOptions& o) {
  const bool isFrame = o.mode == ImsOptions::Mode::frame, byLights = isFrame && !(o.frame.near.bound > 0);
  const CompensationOptions& c = o.compensation;
  return {{"mode", wordOf(kMode, o.mode)},
          {"samples", std::to_string(o.samples)},
          {"spacing", std::to_string(o.spacing)},
          {"eye_steps", std::to_string(o.eyeSteps)},
          {"lamp_table", std::to_string(o.lampTable)},
          {"walks", std::to_string(o.walks)},
          {"walk_flights", wordOf(kFlights, o.flights)},
          {"aim", fmt::format("{}", o.aim)},
          {"retrace", fmt::format("{}", o.retrace)},
          {"lights", std::to_string(isFrame ? o.frameLights : o.amount.lights)},
          {"paths", std::to_string(o.amount.walks)},
          {"radius", byLights ? "by the lights" : fmt::format("{}", c.radius)},
          {"bound", byLights ? "by the lights" : fmt::format("{}", o.gather.bound)},
          {"compensation", wordOf(kCompensate, o.compensate)},
          {"levels", std::to_string(c.levels)},
          {"ending", wordOf(kEnding, c.ending)},
          {"v1", std::to_string(c.vertices[0])},
          {"v2", std::to_string(c.vertices[1])},
          {"p1", std::to_string(c.amounts[0].walks)},
          {"p2", std::to_string(c.amounts[1].walks)},
          {"transmittance", wordOf(kTransmittance, c.transmittance)},
          {"visibility", wordOf(kVisibility, o.visibility.mode)},
          {"map_resolution", std::to_string(o.visibility.resolution)},
          {"map_points", std::to_string(o.visibility.points)},
          {"show", wordOf(kShow, o.show)},
          {"max_depth", std::to_string(o.path.maxDepth)},
          {"rr_depth", std::to_string(o.path.rrDepth)}};
}

}  // namespace virga
