// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/ims_options.h"

#include <fmt/format.h>

#include <algorithm>

#include "methods/instant_scattering/ims_method.h"
#include "methods/settings_reader.h"

namespace virga {
namespace {

constexpr std::string_view kMode[] = {"exact", "fast"};
constexpr std::string_view kCompensate[] = {"path", "sampled", "none"};
constexpr std::string_view kEnding[] = {"nothing", "reduced", "unclamped"};
constexpr std::string_view kTransmittance[] = {"exact", "mean"};
constexpr std::string_view kVisibility[] = {"exact", "none"};
constexpr std::string_view kShow[] = {"picture", "lost", "compensation"};

/// Of the scene's largest extent: the clamping radius where none is given. Measured: docs/methods/ims.md.
constexpr float kRadiusShare = 0.3f;
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

}  // namespace

bool ImsOptions::biased() const {
  if (mode == Mode::fast) return true;
  if (show != Show::picture || !gather.visibility || compensate == Compensate::none) return true;
  if (compensate != Compensate::sampled) return false;
  return compensation.localMeanTransmittance ||
         (compensation.levels >= 0 && compensation.ending != CompensationOptions::Ending::unclamped);
}

ImsSettings::ImsSettings(const Settings& settings) {
  const SettingsReader reader(settings, kImsSettings, "ims");
  ImsOptions& o = given_;
  o.mode = static_cast<ImsOptions::Mode>(reader.choice("mode", kMode).value_or(0));
  o.samples = reader.integer("samples", 1).value_or(o.samples);
  o.spacing = reader.integer("spacing", 1).value_or(o.spacing);
  o.walks = reader.integer("walks", 1).value_or(o.walks);
  o.retrace = reader.share("retrace").value_or(o.retrace);
  o.amount.walks = reader.integer("paths", 0).value_or(0);
  lights_ = reader.integer("lights", 1);
  o.compensate = static_cast<ImsOptions::Compensate>(reader.choice("compensation", kCompensate).value_or(0));
  o.show = static_cast<ImsOptions::Show>(reader.choice("show", kShow).value_or(0));
  o.gather.visibility = reader.choice("visibility", kVisibility).value_or(0) == 0;
  o.gather.lostLight = o.show == ImsOptions::Show::lost;
  CompensationOptions& c = o.compensation;
  c.levels = reader.integer("levels", -1).value_or(-1);
  c.ending = static_cast<CompensationOptions::Ending>(reader.choice("ending", kEnding).value_or(2));
  c.vertices[0] = reader.integer("v1", 1).value_or(1);
  c.vertices[1] = reader.integer("v2", 1).value_or(1);
  c.amounts[0].walks = reader.integer("p1", 0).value_or(0);
  c.amounts[1].walks = reader.integer("p2", 0).value_or(0);
  c.localMeanTransmittance = reader.choice("transmittance", kTransmittance).value_or(0) == 1;
  radius_ = reader.number("radius", 0);
  const std::optional<float> bound = reader.number("bound", 0);
  if (radius_ && bound) throw Error("--set ims.radius and ims.bound say the same: give one of them");
  if (bound) radius_ = 1 / std::sqrt(*bound);
  if (o.show == ImsOptions::Show::compensation && o.compensate != ImsOptions::Compensate::sampled)
    throw Error("--set ims.show=compensation needs ims.compensation=sampled: path does not tell it apart");
  if (o.show != ImsOptions::Show::picture && o.mode == ImsOptions::Mode::fast)
    throw Error("--set ims.show needs ims.mode=exact: fast does not tell parts of the picture apart");
  maxDepth_ = reader.integer("max_depth", -1);
  rrDepth_ = reader.integer("rr_depth", 1);
}

ImsOptions ImsSettings::forScene(const Scene& scene) const {
  ImsOptions o = given_;
  o.path.maxDepth = o.gather.maxDepth = maxDepth_.value_or(scene.integrator.maxDepth);
  o.path.rrDepth = rrDepth_.value_or(scene.integrator.rrDepth);
  const bool tracked = std::any_of(scene.view.media.begin(), scene.view.media.end(),
                                   [](const MediumView& medium) { return !medium.homogeneous; });
  for (GatherAmount* amount : {&o.amount, &o.compensation.amounts[0], &o.compensation.amounts[1]})
    amount->lights = lights_.value_or(tracked ? kLightsWhereTracked : kLights);
  o.compensation.radius = radius_.value_or(kRadiusShare * extentOf(scene.view));
  o.gather.bound = 1 / square(o.compensation.radius);
  return o;
}

SettingValues valuesOf(const ImsOptions& o) {
  const CompensationOptions& c = o.compensation;
  return {{"mode", wordOf(kMode, o.mode)},
          {"samples", std::to_string(o.samples)},
          {"spacing", std::to_string(o.spacing)},
          {"walks", std::to_string(o.walks)},
          {"retrace", fmt::format("{}", o.retrace)},
          {"lights", std::to_string(o.amount.lights)},
          {"paths", std::to_string(o.amount.walks)},
          {"radius", fmt::format("{}", c.radius)},
          {"bound", fmt::format("{}", o.gather.bound)},
          {"compensation", wordOf(kCompensate, o.compensate)},
          {"levels", std::to_string(c.levels)},
          {"ending", wordOf(kEnding, c.ending)},
          {"v1", std::to_string(c.vertices[0])},
          {"v2", std::to_string(c.vertices[1])},
          {"p1", std::to_string(c.amounts[0].walks)},
          {"p2", std::to_string(c.amounts[1].walks)},
          {"transmittance", wordOf(kTransmittance, c.localMeanTransmittance ? 1 : 0)},
          {"visibility", wordOf(kVisibility, o.gather.visibility ? 0 : 1)},
          {"show", wordOf(kShow, o.show)},
          {"max_depth", std::to_string(o.path.maxDepth)},
          {"rr_depth", std::to_string(o.path.rrDepth)}};
}

}  // namespace virga
