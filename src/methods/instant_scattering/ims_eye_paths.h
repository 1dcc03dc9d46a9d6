// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>

#include "methods/instant_scattering/ims_options.h"
#include "methods/instant_scattering/marched_light.h"

namespace virga {

/// Is the light of lamps found by marching? Not where there are panes, which it does not see through, nor from lamps in
/// homogeneous media alone: there the tracer's equiangular sampling leaves less noise.
VIRGA_HD inline bool marchesLamps(const SceneView& scene) {
  if (scene.thinGlass) return false;
  bool local = false, grids = false;
  for (const EmitterView& e : scene.emitters) local |= e.isLocal();
  for (const MediumView& medium : scene.media) grids |= !medium.homogeneous;
  return !local || grids;
}

/// Is there light that lamps send by way of mirrors or glass alone, and that paths can find?
VIRGA_HD inline bool hasCaustics(const SceneView& scene) {
  bool met = false, specular = false;
  for (const EmitterView& e : scene.emitters) met |= !e.isDelta();
  for (const SurfaceBsdf& b : scene.bsdfs) specular |= b.front.specular() || (b.twoSided && b.back.specular());
  return met && specular;
}

/// Eye paths that gather the light of virtual lights at each vertex that can be connected to. What it is made from must
/// outlive it.
template <class Rays>
class ImsEyePaths {
 public:
  /// The light of lamps in all layers; without those that virtual lights light: x1 alone; in these alone, the others
  /// are not to be used.
  enum class Part { all, direct, indirect };

  VIRGA_HD ImsEyePaths(const SceneView& scene, const Rays& rays, const VirtualLightsView& lights,
                       const LightVisibilityView& visibility, const ImsOptions& options, View<LampTable> lampTables)
      : scene_(scene),
        rays_(rays),
        options_(options),
        lampPaths_(of(options.path, PathOptions::Sources::lamps)),
        glowPaths_(of(options.path, PathOptions::Sources::glow)),
        tracer_(scene, rays, lampPaths_),
        glowTracer_(scene, rays, glowPaths_),
        gatherer_(scene, rays, lights, visibility, options.gather),
        compensation_(scene, rays, tracer_, gatherer_, options.compensation),
        marched_(scene, rays, lampTables),
        marches_(marchesLamps(scene) && tracer_.mayScatter(0)),
        caustics_(hasCaustics(scene)) {}
  ImsEyePaths(const ImsEyePaths&) = delete;
  ImsEyePaths& operator=(const ImsEyePaths&) = delete;

  /// Radiance along a camera ray, layer by layer [W/(m^2 sr)].
  VIRGA_HD LayerRadiance trace(const CameraRay& camera, Sampler& sampler, Part part = Part::all) const {
    Path path = tracer_.start(camera);
    Record record;
    path.record = &record;
    // The path finds what clamping takes, or nothing of what virtual lights could light.
    const bool compensates = part != Part::direct && options_.compensate == ImsOptions::Compensate::path &&
                             options_.show == ImsOptions::Show::picture;
    path.lightsX1 = part != Part::indirect;
    path.bound = compensates ? options_.gather.bound : kInfinity;
    for (bool goesOn = true; goesOn;) {
      record.vertex.kind = VertexKind::none;
      const int events = path.depth;
      const LayerRadiance before = path.radiance;
      goesOn = tracer_.extend(path, sampler);
      if (options_.show != ImsOptions::Show::picture) path.radiance = before;  // no light straight from lamps
      if (part == Part::direct)
        goesOn = goesOn && !path.layers.hasX2();
      else if (record.vertex.kind != VertexKind::none)
        lightVertex(record, events, path, sampler);
    }
    return path.radiance;
  }
  /// Likewise the light of media that glow, which virtual lights do not carry.
  VIRGA_HD LayerRadiance traceGlow(const CameraRay& camera, Sampler& sampler) const {
    return glowTracer_.trace(camera, sampler);
  }
  /// Is there light that traceCaustics() would find?
  VIRGA_HD bool anyCaustics() const { return caustics_; }
  /// Likewise light that x1 gets from lamps by way of mirrors and glass alone: where lamps are marched to, that is not
  /// looked for.
  VIRGA_HD LayerRadiance traceCaustics(const CameraRay& camera, Sampler& sampler) const {
    LayerRadiance caustics;
    if (!caustics_) return caustics;
    Path path = tracer_.start(camera);
    path.lightsX1 = false;
    while (tracer_.extend(path, sampler) && !path.layers.hasX2()) {
    }
    for (const Layer layer : {Layer::causticSurface, Layer::causticMedia})
      caustics.add(layer, path.radiance.value[static_cast<int>(layer)]);
    return caustics;
  }
  /// Is the light of x1 alone found by marching?
  VIRGA_HD bool marches() const { return marches_; }
  /// That light, of eyes that are plain.
  VIRGA_HD const MarchedLight<Rays>& marched() const { return marched_; }

 private:
  using Tracer = PathTracer<Rays>;
  using Path = typename Tracer::Path;
  using Record = typename Tracer::Record;

  VIRGA_HD static PathOptions of(PathOptions path, PathOptions::Sources sources) {
    path.sources = sources;
    return path;
  }

  VIRGA_HD void lightVertex(const Record& at, int events, Path& path, Sampler& sampler) const {
    KnownSpace known;
    if (options_.show != ImsOptions::Show::compensation)
      known = gatherer_.gather(at, events, path, options_.amount, gatherer_.bound(), sampler);
    if (options_.show != ImsOptions::Show::lost && options_.compensate == ImsOptions::Compensate::sampled)
      compensation_.compensate(at, known, path.layers, events, path.radiance, sampler);
  }

  const SceneView& scene_;
  const Rays& rays_;
  const ImsOptions& options_;
  PathOptions lampPaths_, glowPaths_;
  Tracer tracer_;                    ///< refers to the members above
  Tracer glowTracer_;                ///< likewise
  Gatherer<Rays> gatherer_;          ///< likewise
  Compensation<Rays> compensation_;  ///< likewise
  MarchedLight<Rays> marched_;       ///< likewise
  bool marches_, caustics_;
};

}  // namespace virga
