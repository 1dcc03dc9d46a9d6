// SPDX-License-Identifier: Apache-2.0
#include "transport/kept_walks.h"

#include <algorithm>
#include <cmath>

#include "core/parallel.h"
#include "scene/scene_parts.h"
#include "transport/optical_depth.h"

namespace virga {
namespace {

/// Walks of a block: what is traced anew is traced by whole blocks.
constexpr int kBlock = 16;

/// Of a medium's albedo, by channel, for the choice whether a walk goes on: it may be more in a later frame.
constexpr float kLeastAlbedo = 0.5f;

/// Mean of the density where it is not 0: over the coarse cells.
float meanDensity(const MediumView& medium) {
  if (medium.homogeneous) return 1;
  const GridView& grid = medium.density;
  double sum = grid.background;
  int count = grid.background > 0 ? 1 : 0;
  const int cells = grid.kind == GridView::Kind::constant ? 0 : grid.mean.nx * grid.mean.ny * grid.mean.nz;
  for (int i = 0; i < cells; ++i)
    if (grid.mean.values[i] > 0) sum += grid.mean.values[i], ++count;
  return count > 0 ? static_cast<float>(sum / count) : 0;
}

/// Extents of the shapes that each medium fills [unit]; the scene's where that is not known.
std::vector<float> extents(const Scene& scene) {
  std::vector<Bounds> bounds(static_cast<size_t>(scene.view.media.size));
  const auto extend = [&](const MediumTransition& media, const Bounds& shape) {
    if (media.interior != MediumTransition::kNone) bounds[static_cast<size_t>(media.interior)].extend(shape);
    if (media.exterior != MediumTransition::kNone)
      bounds[static_cast<size_t>(media.exterior)].extend(scene.view.bounds);
  };
  for (size_t i = 0; i < scene.parts->boundaries.size(); ++i)
    extend(scene.parts->boundaries[i], scene.parts->boundaryShapes[i]->bounds);
  for (size_t i = 0; i < scene.parts->surfaces.size(); ++i)
    extend(scene.parts->surfaces[i].media, scene.parts->surfaceShapes[i]->bounds);
  std::vector<float> result;
  for (const Bounds& b : bounds) {
    const float across = b.empty() ? 0 : length(b.extent()), whole = length(scene.view.bounds.extent());
    result.push_back(across > 0 ? across : whole > 0 ? whole : scene.view.scale);
  }
  return result;
}

/// sigma_t of each medium where it is not 0, on average [1/unit].
std::vector<Rgb> meanExtinctions(const Scene& scene) {
  std::vector<Rgb> result;
  for (const MediumView& m : scene.view.media) result.push_back(m.spectrum * (m.sigmaT * meanDensity(m)));
  return result;
}

/// The media's rates, and what they point to.
struct Defence {
  std::vector<DefensiveRates> rates;
  std::vector<std::vector<float>> spread;
};

/// Means over each cell and those around it: where smoke may be a few frames later.
std::vector<float> spreadOut(const CoarseGridView& cells) {
  std::vector<float> result;
  const auto range = [](int i, int n) { return std::pair(std::max(0, i - 1), std::min(n - 1, i + 1)); };
  for (int k = 0; k < cells.nz; ++k)
    for (int j = 0; j < cells.ny; ++j)
      for (int i = 0; i < cells.nx; ++i) {
        const auto [x0, x1] = range(i, cells.nx);
        const auto [y0, y1] = range(j, cells.ny);
        const auto [z0, z1] = range(k, cells.nz);
        float sum = 0;
        for (int z = z0; z <= z1; ++z)
          for (int y = y0; y <= y1; ++y)
            for (int x = x0; x <= x1; ++x) sum += cells.cell(x, y, z);
        result.push_back(sum / 27);
      }
  return result;
}

/// Of the mean extinction, the floor under means that are spread.
constexpr float kFloor = 0.7f;

Defence defenceOf(const Scene& scene, const std::vector<Rgb>& extinctions) {
  Defence defence;
  const std::vector<float> across = extents(scene);
  for (size_t m = 0; m < across.size(); ++m) {
    const MediumView& medium = scene.view.media[static_cast<int>(m)];
    const bool grid = !medium.homogeneous && medium.density.kind != GridView::Kind::constant;
    DefensiveRates r{1 / across[m], mean(extinctions[m]) * (grid ? kFloor : 1), 0, {}};
    defence.spread.push_back(grid ? spreadOut(medium.density.mean) : std::vector<float>());
    if (grid) {
      r.spreadRate = medium.sigmaT * mean(medium.spectrum);
      r.spread = medium.density.mean;
      r.spread.values = defence.spread.back().data();
    }
    defence.rates.push_back(r);
  }
  return defence;
}

/// Media may become so many times as dense until walks that were drawn in them before are too noisy to be kept. It is
/// the media that decide, not what the walks found: that would bias what they tell.
constexpr float kMostGrowth = 2;

bool outgrown(const std::vector<Rgb>& now, const std::vector<Rgb>& then) {
  for (size_t m = 0; m < now.size(); ++m)
    for (int c = 0; c < 3; ++c)
      if (now[m][c] > kMostGrowth * then[m][c]) return true;
  return false;
}

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
    while (!isBlack(state.expected) && step(state, sampler, block)) {
    }
  }

 private:
  struct State {
    MediaRay at;
    Rgb expected;  ///< flux, as if each flight had been exact: for the choice whether the walk goes on
    int depth = 0;
  };

  bool step(State& state, Sampler& sampler, KeptBlock& block) const {
    if (maxDepth_ >= 0 && state.depth >= maxDepth_) return false;
    const RayHit hit = rays_.nearest(state.at.ray, kInfinity);
    const size_t piecesBefore = block.pieces.size();
    MediaRay flown = state.at;
    DefensiveFlight flight(scene_, rates_, sampler.stream());
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
    segment.inverseDensity = 1 / (collision.found() ? flight.collisionPdf(collision.medium) : flight.survival());
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
  return a.view.media.size == b.view.media.size && WalkStarts(a).endless() == WalkStarts(b).endless() &&
         same(a.view.boundaries, b.view.boundaries, [](const MediumTransition& m) { return m; }) &&
         same(a.view.surfaces, b.view.surfaces, [](const ShapeView& s) { return s.media; });
}

/// Directions were drawn from a phase function that may have been 0 where the next one is not.
bool phasesMayChange(const Scene& scene, const Change& change) {
  const NodePtr node = findNode(scene.description, change.objectId);
  const bool blends = std::any_of(scene.view.media.begin(), scene.view.media.end(),
                                  [](const MediumView& m) { return m.phaseBlends.size > 0; });
  return !node || node->tag == "phase" || blends;
}

bool keepsWalks(const Scene& next, const Change& change) {
  switch (change.aspect) {
    case Aspect::camera:
    case Aspect::film:
      return true;
    case Aspect::mediumParameters:
    case Aspect::mediumGrid:
    case Aspect::mediumPose:
      return !phasesMayChange(next, change);
    default:
      return false;
  }
}

}  // namespace

VirtualLights KeptWalks::lights(const Scene& scene, const WalkOptions& options, const SampleId& id, int64_t frame,
                                float retrace, const std::stop_token& stop) {
  const auto count = static_cast<size_t>((options.walks + kBlock - 1) / kBlock);
  const bool isNew =
      blocks_.size() != count || options.walks != options_.walks || options.maxDepth != options_.maxDepth;
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
  const WalkStarts starts(scene);
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

void WalkStore::edit(const Scene& before, const Scene& next, const ChangeSet& changes) {
  ++frame_;
  const bool kept = sameSpaces(before, next) && std::all_of(changes.changes.begin(), changes.changes.end(),
                                                            [&](const Change& c) { return keepsWalks(next, c); });
  if (!kept) passes_.clear();
}

VirtualLights WalkStore::lights(const Scene& scene, const WalkOptions& options, const SampleId& id, int64_t pass,
                                float retrace, const std::stop_token& stop) {
  if (pass * options.walks > kMostWalks - options.walks) return traceVirtualLights(scene, options, id, stop);
  return passes_[pass].lights(scene, options, id, frame_, retrace, stop);
}

}  // namespace virga
