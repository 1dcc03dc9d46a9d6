// SPDX-License-Identifier: Apache-2.0
#include "transport/kept_walks.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/parallel.h"
#include "transport/defence.h"
#include "transport/optical_depth.h"

namespace virga {
namespace {

/// Walks of a block: what is traced anew is traced by whole blocks.
constexpr int kBlock = 16;

/// Of a medium's albedo, by channel, for the choice whether a walk goes on: it may be more in a later frame.
constexpr float kLeastAlbedo = 0.5f;

/// Traces walks into a block. Directions are drawn as LightWalker draws them, distances by DefensiveFlight.
class KeptWalker {
 public:
  KeptWalker(const Scene& scene, const std::vector<DefensiveRates>& rates, int maxDepth)
      : scene_(scene.view),
        rays_{*scene.surfaceRays, *scene.boundaryRays},
        rates_{rates.data(), static_cast<int>(rates.size())},
        maxDepth_(maxDepth) {}

  void walk(const WalkStarts::Start& start, Sampler& sampler, KeptBlock& block) const {
    block.walks.push_back({start.flux, static_cast<uint32_t>(block.segments.size())});
    State state{start.at, start.flux};
    if (sampler.random() < WalkDensity::kOwnWalks) state.kind = DefensiveFlight::Walk::own;
    while (!isBlack(state.expected) && step(state, sampler, block)) {
    }
  }

 private:
  struct State {
    MediaRay at;
    Rgb expected;  ///< flux, as if each flight had been exact: for the choice whether the walk goes on
    int depth = 0;
    DefensiveFlight::Walk kind = DefensiveFlight::Walk::wary;
    WalkDensity density = {};
  };

  bool step(State& state, Sampler& sampler, KeptBlock& block) const {
    if (maxDepth_ >= 0 && state.depth >= maxDepth_) return false;
    const RayHit hit = rays_.nearest(state.at.ray, kInfinity);
    const size_t piecesBefore = block.pieces.size();
    MediaRay flown = state.at;
    DefensiveFlight flight(scene_, rates_, state.kind, sampler.stream());
    Collision collision;
    walkMedia(scene_, rays_, flown, hit.t, [&](float t0, float t1) {
      collision = flight.fly(flown, t0, t1, sampler.stream(), [&](const MediaPiece& p) { block.pieces.push_back(p); });
      return !collision.found();
    });
    if (!collision.found() && !hit.found()) {
      block.pieces.resize(piecesBefore);
      return false;
    }
    KeptSegment segment;
    segment.ray = state.at.ray, segment.length = collision.found() ? collision.t : hit.t;
    segment.medium = collision.medium, segment.firstPiece = static_cast<uint32_t>(piecesBefore);
    segment.inverseDensity =
        state.density.inverse(collision.found() ? flight.collision(collision.medium) : flight.survival());
    const bool goesOn = collision.found() ? scatterInMedium(state, segment, flown.media, sampler, block)
                                          : scatterOnSurface(state, segment, flown.media, hit, sampler, block);
    block.segments.push_back(segment);
    return goesOn;
  }

  bool scatterInMedium(State& state, KeptSegment& segment, const MediaState& media, Sampler& sampler,
                       KeptBlock& block) const {
    const MediumView& medium = scene_.media[segment.medium];
    LightVertex v;
    v.kind = VertexKind::medium, v.p = state.at.ray.at(segment.length), v.wi = -state.at.ray.d, v.weight = Rgb(1.f);
    v.medium = segment.medium, v.depth = ++state.depth;
    addLight(v, segment, block);
    const PhaseSample s = medium.phaseAt(v.p).sample(v.wi, WalkNumbers::pair(state.depth, sampler));
    if (!(s.pdf > 0)) return false;
    state.at = {{v.p, s.wi}, media, 0};
    Rgb albedo = medium.albedoAt(v.p);
    for (int c = 0; c < 3; ++c) albedo[c] = std::max(albedo[c], kLeastAlbedo);
    return survives(state, segment, state.expected * albedo, Rgb(s.value / s.pdf), sampler);
  }

  bool scatterOnSurface(State& state, KeptSegment& segment, const MediaState& media, const RayHit& hit,
                        Sampler& sampler, KeptBlock& block) const {
    const SurfaceBounce bounce = bounceOff(scene_, state.at.ray, media, hit, state.depth, sampler);
    LightVertex v = bounce.vertex;
    v.weight = bounce.left(Rgb(1.f));
    if (v.kind == VertexKind::surface && !isBlack(v.weight)) {
      if (!bounce.lambertian) {
        v.surface = static_cast<int>(block.surfaces.size());
        block.surfaces.push_back(bounce.scattering);
      }
      addLight(v, segment, block);
    }
    const Rgb next = bounce.carried(state.expected);
    if (isBlack(next)) return false;
    state.at = bounce.onward;
    if (bounce.passes) {
      state.expected = next;
      segment.onward = bounce.carried(Rgb(1.f));
      return true;
    }
    ++state.depth;
    return survives(state, segment, next, bounce.carried(Rgb(1.f)), sampler);
  }

  static void addLight(const LightVertex& v, KeptSegment& segment, KeptBlock& block) {
    segment.light = static_cast<int>(block.lights.size());
    block.lights.push_back(v);
  }

  /// Russian roulette by the flux that is expected; `factor` is what scattering makes of the real one.
  static bool survives(State& state, KeptSegment& segment, Rgb next, Rgb factor, Sampler& sampler) {
    const float q = std::min(maxComponent(next) / maxComponent(state.expected), mostSurvival(state.depth));
    if (!(sampler.random() < q)) return false;
    state.expected = next / q;
    segment.onward = factor / q;
    return true;
  }

  const SceneView& scene_;
  const EmbreeRays rays_;
  View<DefensiveRates> rates_;
  int maxDepth_;
};

/// What a block's walks carry in a scene: the flux by the transmittance and sigma_s along all their segments. Nothing
/// in it is random: an estimate of transmittance would add its own noise at each scattering
/// (docs/decisions/kept-walks.md).
class Weigher {
 public:
  Weigher(const SceneView& scene, const KeptBlock& block) : scene_(scene), block_(block) {}

  VirtualLights lights() {
    for (size_t w = 0; w < block_.walks.size(); ++w) {
      result_.firstOf.push_back(static_cast<uint32_t>(result_.lights.size()));
      weigh(block_.walks[w].flux, block_.walks[w].firstSegment, endOf(w));
    }
    return std::move(result_);
  }

 private:
  size_t endOf(size_t walk) const {
    return walk + 1 < block_.walks.size() ? block_.walks[walk + 1].firstSegment : block_.segments.size();
  }

  void weigh(Rgb flux, size_t first, size_t end) {
    for (size_t i = first; i < end && !isBlack(flux); ++i) {
      const KeptSegment& segment = block_.segments[i];
      flux *= transmittance(i) * segment.inverseDensity;
      if (segment.medium >= 0) flux *= sigmaS(scene_.media[segment.medium], segment.ray.at(segment.length));
      if (segment.light >= 0) addLight(block_.lights[static_cast<size_t>(segment.light)], flux);
      flux *= segment.onward;
    }
  }

  static Rgb sigmaS(const MediumView& medium, Vec3 p) { return medium.sigmaTAt(p) * medium.albedoAt(p); }

  Rgb transmittance(size_t index) const {
    const KeptSegment& segment = block_.segments[index];
    const size_t end =
        index + 1 < block_.segments.size() ? block_.segments[index + 1].firstPiece : block_.pieces.size();
    Rgb depth;
    for (size_t i = segment.firstPiece; i < end; ++i) {
      const MediaPiece& p = block_.pieces[i];
      depth += opticalDepth(scene_.media[p.medium], segment.ray, p.t0, p.t1);
    }
    return exp(depth * -1.f);
  }

  void addLight(LightVertex v, Rgb flux) {
    v.weight *= flux;
    if (isBlack(v.weight)) return;
    if (v.surface >= 0) {
      const size_t kept = static_cast<size_t>(v.surface);
      v.surface = static_cast<int>(result_.surfaces.size());
      result_.surfaces.push_back(block_.surfaces[kept]);
    }
    result_.lights.push_back(v);
  }

  const SceneView& scene_;
  const KeptBlock& block_;
  VirtualLights result_;
};

KeptBlock traceBlock(const KeptWalker& walker, const WalkStarts& starts, const SampleId& id, int first, int end) {
  KeptBlock block;
  for (int w = first; w < end; ++w) {
    Sampler sampler(SampleId{id.seed, id.replicate, static_cast<uint32_t>(w), id.index});
    walker.walk(starts.sample(sampler), sampler, block);
  }
  return block;
}

bool sameBoundary(const MediumTransition& a, const MediumTransition& b) {
  return a.interior == b.interior && a.exterior == b.exterior && a.replaces == b.replaces && a.closed == b.closed;
}

/// Are the media numbered alike, and in the same places?
bool sameSpaces(const Scene& a, const Scene& b) {
  const auto same = [](const auto& x, const auto& y, const auto& mediaOf) {
    return std::equal(x.begin(), x.end(), y.begin(), y.end(),
                      [&](const auto& p, const auto& q) { return sameBoundary(mediaOf(p), mediaOf(q)); });
  };
  return a.view.media.size == b.view.media.size && WalkStarts(a).serve(WalkStarts(b)) &&
         same(a.view.boundaries, b.view.boundaries, [](const MediumTransition& m) { return m; }) &&
         same(a.view.surfaces, b.view.surfaces, [](const ShapeView& s) { return s.media; });
}

/// Id of a medium's phase function, which may be a reference to any; empty where it has none of its own.
std::string phaseOf(const Node& medium) {
  for (const Property& p : medium.properties)
    if (const auto* child = std::get_if<NodePtr>(&p.value); child && (*child)->tag == "phase") return (*child)->id;
  return {};
}

/// Directions were drawn from a phase function that may have been 0 where the next one is not.
bool phasesMayChange(const Scene& before, const Scene& next, const Change& change) {
  const NodePtr was = findNode(before.description, change.objectId), is = findNode(next.description, change.objectId);
  const bool blends = std::any_of(next.view.media.begin(), next.view.media.end(),
                                  [](const MediumView& m) { return m.phaseBlends.size > 0; });
  return !was || !is || is->tag == "phase" || phaseOf(*was) != phaseOf(*is) || blends;
}

bool keepsWalks(const Scene& before, const Scene& next, const Change& change) {
  switch (change.aspect) {
    case Aspect::camera:
    case Aspect::film:
      return true;
    case Aspect::mediumParameters:
    case Aspect::mediumGrid:
    case Aspect::mediumPose:
      return !phasesMayChange(before, next, change);
    default:
      return false;
  }
}

}  // namespace

VirtualLights KeptWalks::lights(const Scene& scene, const WalkOptions& options, const SampleId& id, int64_t frame,
                                float retrace, const std::stop_token& stop) {
  const auto count = static_cast<size_t>((options.walks + kBlock - 1) / kBlock);
  const bool isNew = blocks_.size() != count || options.walks != options_.walks ||
                     options.maxDepth != options_.maxDepth || options.aimed != options_.aimed;
  if (isNew) blocks_.assign(count, {}), options_ = options, next_ = 0;
  size_t due = 0;
  if (!isNew && frame != frame_)
    due = std::min(count, static_cast<size_t>(std::ceil(retrace * static_cast<float>(count))));
  for (size_t i = 0; i < due; ++i) blocks_[(next_ + i) % count].drawnIn = nullptr;
  next_ = (next_ + due) % count;
  frame_ = frame;

  const auto extinctions = std::make_shared<const std::vector<Rgb>>(meanExtinctions(scene));
  const auto isDue = [&](const KeptBlock& b) { return !b.drawnIn || outgrown(*extinctions, *b.drawnIn); };
  const bool anyDue = std::any_of(blocks_.begin(), blocks_.end(), isDue);
  const Defence defence = anyDue ? defenceOf(scene, *extinctions) : Defence();
  const KeptWalker walker(scene, defence.rates, options.maxDepth);
  const WalkStarts starts(scene, anyDue ? mediaTargets(scene, options.aimed) : EmissionTargets());
  std::vector<VirtualLights> parts(count);
  parallelFor(static_cast<int64_t>(count), 1, [&](int64_t b) {
    if (stop.stop_requested()) return;
    KeptBlock& block = blocks_[static_cast<size_t>(b)];
    const int first = static_cast<int>(b) * kBlock;
    if (isDue(block)) {
      block = traceBlock(walker, starts, id, first, std::min(first + kBlock, options.walks));
      block.drawnIn = extinctions;
    }
    parts[static_cast<size_t>(b)] = Weigher(scene.view, block).lights();
  });
  return joined(parts);
}

bool WalkStore::edit(const Scene& before, const Scene& next, const ChangeSet& changes) {
  ++frame_;
  const bool kept =
      sameSpaces(before, next) && std::all_of(changes.changes.begin(), changes.changes.end(),
                                              [&](const Change& c) { return keepsWalks(before, next, c); });
  if (!kept) passes_.clear();
  const float since = std::exchange(asked_, false) ? 0 : change_;
  change_ = kept && !passes_.empty() ? since + changeOfMedia(before, next) : 0;
  return kept;
}

VirtualLights WalkStore::lights(const Scene& scene, const WalkOptions& options, const SampleId& id, int64_t pass,
                                float retrace, const std::stop_token& stop) {
  if (!keeps(pass, options.walks)) return traceVirtualLights(scene, options, id, stop);
  asked_ = true;
  const float part = retrace > 0 ? std::min(1.f, std::max(retrace, change_ / kMostChange)) : 0;
  return passes_[pass].lights(scene, options, id, frame_, part, stop);
}

}  // namespace virga
