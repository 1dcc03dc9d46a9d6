// SPDX-License-Identifier: Apache-2.0
#include "transport/virtual_lights.h"

#include <algorithm>

#include "core/parallel.h"
#include "transport/media_bounds.h"

namespace virga {

int endlessMedium(const Scene& scene) {
  const int declared = scene.view.cameraMedia.base();
  if (declared == MediaState::kNone) return declared;
  const MediaState around = mediaAt(scene, scene.view.cameraMediaPoint);
  for (int i = 0; i < around.count(); ++i)
    if (around.medium(i) == declared) return MediaState::kNone;
  return declared;
}

namespace {

// Walks are traced in blocks, each into a list of its own; the lists are joined in order.
constexpr int kBlock = 64;

VirtualLights traceBlock(const Scene& scene, const WalkStarts& starts, const WalkOptions& options, const SampleId& id,
                         int first, int end) {
  const EmbreeRays rays{*scene.surfaceRays, *scene.boundaryRays};
  const LightWalker<EmbreeRays> walker(scene.view, rays, options.maxDepth, options.flights);
  VirtualLights block;
  for (int w = first; w < end; ++w) {
    block.firstOf.push_back(static_cast<uint32_t>(block.lights.size()));
    Sampler sampler(SampleId{id.seed, id.replicate, static_cast<uint32_t>(w), id.index});
    const WalkStarts::Start start = starts.sample(sampler);
    walker.walk(start.at, start.flux, sampler, [&](LightVertex v, const SurfaceScattering* surface) {
      if (surface) {
        v.surface = static_cast<int>(block.surfaces.size());
        block.surfaces.push_back(*surface);
      }
      block.lights.push_back(v);
    });
  }
  return block;
}

void append(VirtualLights& all, const VirtualLights& block) {
  const auto lights = static_cast<uint32_t>(all.lights.size());
  const int surfaces = static_cast<int>(all.surfaces.size());
  for (const uint32_t first : block.firstOf) all.firstOf.push_back(first + lights);
  for (LightVertex v : block.lights) {
    if (v.surface >= 0) v.surface += surfaces;
    all.lights.push_back(v);
  }
  all.surfaces.insert(all.surfaces.end(), block.surfaces.begin(), block.surfaces.end());
}

}  // namespace

VirtualLights joined(const std::vector<VirtualLights>& parts) {
  VirtualLights all;
  for (const VirtualLights& part : parts) append(all, part);
  all.firstOf.push_back(static_cast<uint32_t>(all.lights.size()));
  return all;
}

namespace {

bool isLitFromInfinity(const SceneView& scene) {
  return std::any_of(scene.emitters.begin(), scene.emitters.end(), [](const EmitterView& e) { return e.infinite(); });
}

/// Density where a grid's values end, and from there on.
float densityFarAway(const MediumView& medium) { return medium.homogeneous ? 1 : medium.density.background; }

/// What of light from infinity gets to where walks start, in a medium that has no end there: 1 or 0 for each channel.
Rgb transmittanceFromInfinity(const MediumView& medium) {
  Rgb through;
  for (int c = 0; c < 3; ++c) through[c] = medium.sigmaT * medium.spectrum[c] * densityFarAway(medium) > 0 ? 0 : 1;
  return through;
}
Rgb transmittanceFromInfinity(const SceneView& scene, const MediaState& media) {
  Rgb through(1.f);
  for (int i = 0; i < media.count(); ++i) through *= transmittanceFromInfinity(scene.media[media.medium(i)]);
  return through;
}

/// All shapes, and the values of a grid that is around them: where it is 0 far away, light from infinity meets them.
Bounds reachFromInfinity(const SceneView& scene, int endless) {
  Bounds reach = scene.bounds;
  if (endless == MediaState::kNone || !isLitFromInfinity(scene)) return reach;
  const MediumView& medium = scene.media[endless];
  if (endsByItself(medium)) reach.extend(boundsInWorld(medium, {medium.density.supportLo, medium.density.supportHi}));
  return reach;
}

bool contains(const Bounds& outer, Bounds inner) {
  inner.extend(outer);
  return inner == outer;
}

}  // namespace

WalkStarts::WalkStarts(const Scene& scene, const EmissionTargets& targets)
    : scene_(scene),
      targets_(targets),
      endless_(endlessMedium(scene)),
      reach_(reachFromInfinity(scene.view, endless_)) {}

bool WalkStarts::serve(const WalkStarts& next) const {
  if (endless_ != next.endless_ || !contains(reach_, next.reach_)) return false;
  const auto sameThrough = [](const MediumView& a, const MediumView& b) {
    return transmittanceFromInfinity(a) == transmittanceFromInfinity(b);
  };
  const View<MediumView>&media = scene_.view.media, &others = next.scene_.view.media;
  return !isLitFromInfinity(scene_.view) ||
         std::equal(media.begin(), media.end(), others.begin(), others.end(), sameThrough);
}

WalkStarts::Start WalkStarts::sample(Sampler& sampler) const {
  const SceneView& view = scene_.view;
  if (!view.hasLamps()) return {};
  const auto choice = view.emitterChoice.sample(sampler.next1D());
  const EmitterView& emitter = view.emitters[choice.index];
  const Vec2 uPosition = sampler.next2D(), uDirection = sampler.next2D();
  const EmittedRay emitted = sampleEmittedRay(view, emitter, reach_, uPosition, uDirection, targets_);
  if (isBlack(emitted.flux)) return {};
  Start start{{emitted.ray, mediaAt(scene_, emitted.ray.o, endless_), 0}, emitted.flux / choice.probability};
  if (emitter.infinite()) start.flux *= transmittanceFromInfinity(view, start.at.media);
  return start;
}

int mediumWithoutEnd(const Scene& scene) {
  const int around = endlessMedium(scene);
  return around != MediaState::kNone && endsByItself(scene.view.media[around]) ? MediaState::kNone : around;
}

EmissionTargets mediaTargets(const Scene& scene, float share) {
  if (!(share > 0)) return {};
  const std::vector<Bounds> boxes = boxesOfMedia(scene, EmissionTargets::kMost, mediumWithoutEnd(scene));
  EmissionTargets targets;
  for (const Bounds& box : boxes)
    if (const float radius = 0.5f * length(box.extent()); radius > 0)
      targets.add({box.center(), radius, share / static_cast<float>(boxes.size())});
  return targets;
}

VirtualLights traceVirtualLights(const Scene& scene, const WalkOptions& options, const SampleId& id,
                                 const std::stop_token& stop) {
  const int blocks = (options.walks + kBlock - 1) / kBlock;
  const WalkStarts starts(scene, mediaTargets(scene, options.aimed));
  std::vector<VirtualLights> parts(static_cast<size_t>(blocks));
  parallelFor(blocks, 1, [&](int64_t b) {
    if (stop.stop_requested()) return;
    const int first = static_cast<int>(b) * kBlock;
    parts[static_cast<size_t>(b)] =
        traceBlock(scene, starts, options, id, first, std::min(first + kBlock, options.walks));
  });
  return joined(parts);
}

}  // namespace virga
