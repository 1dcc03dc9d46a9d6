// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "methods/path/path_tracer.h"

namespace virga {

/// Paths through several pixels that share what they find beyond their second vertex x2 (Bekaert, Sbert and Halton
/// 2002): the light that leaves the x2 of each goes to the x1 of all, over the sum of the densities with which they
/// choose it (balance heuristic). Unbiased. In fog and between walls a random walk's own variance prevails: it falls
/// with the number of paths, at the price of one connection for each pair. The pixels' errors are no longer
/// independent.
///
/// Light that lamps send straight to x2 stays with its own path: its weights (PathTracer) depend on where that came
/// from. So does all that cannot be shared: paths by way of mirrors, and x2 that scatter more to some sides than to
/// others, as the light that leaves them was found for one direction only.
template <class Rays>
class SharedPaths {
 public:
  static constexpr int kMost = RayPacket::kSize;  ///< paths at once

  VIRGA_HD SharedPaths(const SceneView& scene, const Rays& rays, const PathTracer<Rays>& tracer)
      : scene_(scene), rays_(rays), tracer_(tracer) {
    if (scene.cameraMedia.count() > 0) sigmaT_ = scene.media[scene.cameraMedia.medium(0)].sigmaT;
  }

  /// The densities are known where all space is filled with one homogeneous medium whose extinction is grey.
  static bool possible(const SceneView& scene, const PathOptions& options) {
    if (scene.boundaries.size > 0 || scene.cameraMedia.count() != 1 || scene.chromatic || scene.thinGlass) return false;
    if (!scene.media[scene.cameraMedia.medium(0)].homogeneous) return false;
    for (const ShapeView& surface : scene.surfaces)
      if (surface.media.replaces) return false;
    // Russian roulette must not begin before x2; and there has to be something to share.
    return options.rrDepth >= 2 && (options.maxDepth < 0 || options.maxDepth > 3);
  }

  /// Radiance along each of `count` <= kMost camera rays, layer by layer [W/(m^2 sr)].
  VIRGA_HD void trace(const CameraRay* cameras, Sampler* samplers, int count, LayerRadiance* radiance) const {
    First firsts[kMost];
    Second seconds[kMost];
    int members = 0;
    for (int i = 0; i < count; ++i) {
      radiance[i] = {};
      Path path = tracer_.start(cameras[i]);
      First& first = firsts[members];
      bool goesOn = extend(path, first.at, samplers[i]);
      if (mayChooseX2(first.at)) {
        first.lamp = path.lamp;
        first.sum = &radiance[i];
        take(path, *first.sum);
        if (goesOn) follow(path, seconds[members], *first.sum, samplers[i]);
        ++members;
      } else {
        while (goesOn) goesOn = tracer_.extend(path, samplers[i]);
        take(path, radiance[i]);
      }
    }
    for (int i = 0; i < members; ++i)
      if (!isBlack(seconds[i].light)) share(firsts, members, i, seconds[i]);
  }

 private:
  using Path = EyePath;
  using Record = EyePath::Record;

  /// The x1 of a path, how it chose where to go on, and where its light is added up.
  struct First {
    Record at;
    LampGuide lamp;
    LayerRadiance* sum = nullptr;
  };
  /// The x2 of a path, and the radiance that leaves it but for what lamps sent there.
  struct Second {
    Vertex at;
    Rgb light;
  };
  /// What an x1 has to do with an x2. What is the same for all of one x2 is left out of both numbers: it cancels.
  struct Connection {
    Rgb weight;         ///< with which radiance that leaves x2 counts, per unit of space there
    float density = 0;  ///< with which x1 chooses x2, likewise
  };

  VIRGA_HD bool extend(Path& path, Record& record, Sampler& sampler) const {
    record.vertex.kind = VertexKind::none;
    path.record = &record;
    const bool goesOn = tracer_.extend(path, sampler);
    path.record = nullptr;
    path.link = {};
    return goesOn;
  }
  /// Adds what the path has found so far, times `weight`, to `sum`; the path forgets it.
  VIRGA_HD static void take(Path& path, LayerRadiance& sum, Rgb weight = Rgb(1.f)) {
    add(path.radiance, sum, weight);
    path.radiance = {};
  }
  VIRGA_HD static void add(const LayerRadiance& found, LayerRadiance& sum, Rgb weight) {
    for (int l = 0; l < kLayerCount; ++l) sum.value[l] += found.value[l] * weight;
  }

  /// Whether or not it did in the end: those that chose no direction count in the densities.
  VIRGA_HD static bool mayChooseX2(const Record& x1) {
    if (x1.vertex.kind == VertexKind::medium) return !isBlack(x1.throughput * x1.vertex.albedo);
    return x1.vertex.kind == VertexKind::surface;
  }
  /// The same light leaves it to all sides.
  VIRGA_HD static bool isEven(const Vertex& v) {
    if (v.kind == VertexKind::medium) return v.phase.template get<Isotropic>() != nullptr;
    return v.kind == VertexKind::surface && v.surface.bsdf.kind() == Bsdf::Kind::diffuse;
  }

  /// Follows a path that has left its x1 to its end. Behind x1 it begins anew with a throughput of 1, as what it finds
  /// beyond x2 is for others, too: own weights may be next to nothing where a guide went against the bsdf.
  VIRGA_HD void follow(Path& path, Second& second, LayerRadiance& sum, Sampler& sampler) const {
    const Rgb weight = std::exchange(path.throughput, Rgb(1.f));
    Record x2;
    bool goesOn = extend(path, x2, sampler);
    const bool shared = goesOn && isEven(x2.vertex);
    if (shared) {
      take(path, sum, weight);
      LayerRadiance met;
      path.met = &met;
      goesOn = tracer_.extend(path, sampler);
      path.met = nullptr;
      add(met, sum, weight);
    }
    while (goesOn) goesOn = tracer_.extend(path, sampler);
    if (shared)
      second = {x2.vertex, path.radiance.sum()};
    else
      take(path, sum, weight);
  }

  /// Light from the x2 of path `own` to all x1.
  VIRGA_HD void share(const First* firsts, int members, int own, const Second& second) const {
    Connection connections[kMost];
    RayPacket between;
    for (int m = 0; m < members; ++m) {
      connections[m] = connect(firsts[m], second.at);
      if (m == own || !(connections[m].density > 0)) continue;  // an own x2 is seen
      const Vertex& x1 = firsts[m].at.vertex;
      const ConnectingRay ray = aimAt(scene_, x1.leave(scene_, normalize(second.at.p - x1.p)), second.at.p);
      if (ray.tMax > 0) between.set(m, ray.at.ray, ray.tMax);
    }
    const uint32_t hidden = rays_.occluded(between);
    float density = 0;
    for (int m = 0; m < members; ++m) {
      if (hidden >> m & 1u) connections[m] = {};
      density += connections[m].density;
    }
    if (!(density > 0)) return;
    const Rgb light = second.light / density;
    for (int m = 0; m < members; ++m) {
      LayerPath layers;
      layers.scatter(firsts[m].at.vertex.kind);
      layers.scatter(second.at.kind);
      firsts[m].sum->add(layers.layer(), connections[m].weight * light);
    }
  }

  /// Visibility left out.
  VIRGA_HD Connection connect(const First& first, const Vertex& x2) const {
    const Vertex& x1 = first.at.vertex;
    const Vec3 way = x2.p - x1.p;
    const float d2 = lengthSquared(way);
    if (!(d2 > 0)) return {};
    const float d = std::sqrt(d2);
    const Vec3 w = way / d;
    float space = std::exp(-sigmaT_ * d) / d2;
    if (x2.kind == VertexKind::surface) {
      const float cosine = -dot(w, x2.surface.normal);
      if (!(cosine > 0) || !(x2.surface.frame.toLocal(-w).z > 0)) return {};  // behind it, or it would leak
      space *= cosine;
    }
    const Rgb scattering = x1.scattering(w);
    if (isBlack(scattering)) return {};
    return {first.at.throughput * scattering * space, directionPdf(x1, first.lamp, w) * space};
  }
  /// Density of directions that leave x1 [1/sr].
  VIRGA_HD static float directionPdf(const Vertex& x1, const LampGuide& lamp, Vec3 w) {
    if (x1.kind == VertexKind::medium) return lamp.mixture(x1.phase.pdf(x1.wo, w), Vec3(0), w);
    const SurfaceScattering& surface = x1.surface;
    const float own = surface.bsdf.pdf(surface.frame.toLocal(x1.wo), surface.frame.toLocal(w));
    return lamp.mixture(own, facing(x1.point, x1.wo), w);
  }

  const SceneView& scene_;
  const Rays& rays_;
  const PathTracer<Rays>& tracer_;
  float sigmaT_ = 0;  ///< [1/unit] all around
};

}  // namespace virga
