// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/receivers.h"

#include "transport/visibility.h"

namespace virga {
namespace {

Vec3 positionOf(const KernelLight& l) { return {l.px, l.py, l.pz}; }

/// Nothing lies between the two.
bool unobstructed(const SceneView& scene, const EmbreeRays& rays, const Vertex& from, Vec3 light) {
  const Vec3 way = light - from.p;
  const float d = length(way);
  if (!(d > 0)) return true;
  const ConnectingRay ray = aimAt(scene, from.leave(scene, way / d), light);
  return !(ray.tMax > 0) || !rays.occluded(ray.at.ray, ray.tMax);
}

}  // namespace

KernelReceivers ReceiverBatch::Group::view() {
  return {static_cast<int>(px.size()), px.data(),     py.data(),     pz.data(),    ax.data(), ay.data(), az.data(),
          anisotropy.data(),           sum[0].data(), sum[1].data(), sum[2].data()};
}

void ReceiverBatch::Group::clearSums() {
  for (int c = 0; c < 3; ++c) sum[c].assign(px.size(), 0), seen[c].resize(px.size());
}

ReceiverBatch::ReceiverBatch() {
  for (const EndKind kind : {EndKind::lambertian, EndKind::isotropic, EndKind::henyeyGreenstein})
    groups_[static_cast<int>(kind)].kind = kind;
  groups_[kGroups - 1].plain = false;
}

void ReceiverBatch::add(const SceneView& scene, const Receiver& receiver) {
  if (isBlack(receiver.throughput)) return;
  const Vertex& v = receiver.vertex;
  Rgb scattered = v.albedo;
  Vec3 axis = v.wo;
  EndKind kind = EndKind::lambertian;
  float g = 0;
  bool plain = v.kind == VertexKind::medium && plainPhase(v.phase, kind, g);
  if (v.kind == VertexKind::surface && v.surface.bsdf.kind() == Bsdf::Kind::diffuse) {
    plain = true;
    axis = v.surface.frame.n;
    scattered = v.surface.bsdf.value(v.surface.frame.toLocal(v.wo), Vec3(0, 0, 1));
  }
  if (plain && isBlack(scattered)) return;
  Group& group = groups_[plain ? static_cast<int>(kind) : kGroups - 1];
  const Vec3 p = v.kind == VertexKind::surface && plain ? v.leave(scene, axis).ray.o : v.p;
  group.px.push_back(p.x), group.py.push_back(p.y), group.pz.push_back(p.z);
  group.ax.push_back(axis.x), group.ay.push_back(axis.y), group.az.push_back(axis.z);
  group.anisotropy.push_back(g);
  group.receivers.push_back(receiver);
  if (plain) group.receivers.back().throughput *= scattered;
}

void ReceiverBatch::gather(const Scene& scene, const FrameLights& lights, const Options& options, const Found& found) {
  size_t i = 0;
  for (const VertexKind kind : {VertexKind::surface, VertexKind::medium}) {
    for (Group& group : groups_) group.clearSums();
    for (; i < lights.lights().size() && lights.lights()[i].vertex->kind == kind; ++i) {
      const FrameLights::Light& from = lights.lights()[i];
      NearField near = options.near;
      if (!(near.bound > 0)) near = {near.kind, 1 / square(from.radius), from.core};
      for (Group& group : groups_) {
        if (group.px.empty()) continue;
        if (from.plain && group.plain && options.visibility == Visibility::maps &&
            lights.gatherAtOnce(i, group.view(), group.kind, near))
          continue;
        float* seen[3] = {group.seen[0].data(), group.seen[1].data(), group.seen[2].data()};
        look(scene, lights, i, group, options, seen);
        if (from.plain && group.plain)
          gatherLight(from.kernel, from.kind, group.view(), group.kind, seen, near);
        else
          gatherSlowly(lights, i, scene.view, group, near, seen);
      }
    }
    for (const Group& group : groups_) distribute(group, kind, found);
  }
}

void ReceiverBatch::look(const Scene& scene, const FrameLights& lights, size_t i, Group& group, const Options& options,
                         float* seen[3]) {
  lights.lookFrom(i, group.view(), group.plain ? group.kind : EndKind::isotropic, seen);
  const FrameLights::Light& from = lights.lights()[i];
  const EmbreeRays rays{*scene.surfaceRays, *scene.boundaryRays};
  if (options.visibility != Visibility::exact) return;
  for (size_t n = 0; n < group.receivers.size(); ++n) {
    if (unobstructed(scene.view, rays, group.receivers[n].vertex, positionOf(from.kernel))) continue;
    for (int c = 0; c < 3; ++c) seen[c][n] = 0;
  }
}

float ReceiverBatch::plainScattering(const Group& group, size_t n, Vec3 w) {
  const float c = dot(Vec3(group.ax[n], group.ay[n], group.az[n]), w);
  if (group.kind == EndKind::lambertian) return kernels::endCosine<EndKind::lambertian>(c);
  return kernels::endScattering<EndKind::henyeyGreenstein>(c, group.anisotropy[n]);
}

void ReceiverBatch::gatherSlowly(const FrameLights& lights, size_t i, const SceneView& scene, Group& group,
                                 const NearField& near, float* const seen[3]) {
  const FrameLights::Light& from = lights.lights()[i];
  const LightVertex& vertex = *from.vertex;
  const VirtualLightsView all = lights.virtualLights().view();
  for (size_t n = 0; n < group.receivers.size(); ++n) {
    if (seen[0][n] == 0 && seen[1][n] == 0 && seen[2][n] == 0) continue;
    const Vertex& x = group.receivers[n].vertex;
    const Vec3 way = positionOf(from.kernel) - x.p;
    const float d2 = lengthSquared(way);
    if (!(d2 > 0)) continue;
    const Vec3 w = way / std::sqrt(d2);
    const float cosine = generalCosine(vertex.normal, w), receiving = generalCosine(x.normal(), w);
    const auto spread = [&](float core) { return kernels::spreadFalloff(d2, near.bound, core); };
    const Rgb term = near.kind == NearField::Kind::spread
                         ? Rgb(spread(near.core.r), spread(near.core.g), spread(near.core.b))
                         : Rgb((1 - clampedShareOf(cosine * receiving / d2, near.bound)) / d2);
    // What plain receivers scatter apart from direction is in their throughput.
    const Rgb scattered = group.plain ? Rgb(plainScattering(group, n, w)) : x.scattering(w);
    const Rgb value = scattered * intensity(all, scene, vertex, -w) * term * (cosine * from.share);
    for (int c = 0; c < 3; ++c) group.sum[c][n] += value[c] * seen[c][n];
  }
}

void ReceiverBatch::distribute(const Group& group, VertexKind lights, const Found& found) {
  for (size_t n = 0; n < group.receivers.size(); ++n) {
    const Receiver& r = group.receivers[n];
    const Rgb sum(group.sum[0][n], group.sum[1][n], group.sum[2][n]);
    const bool isX1 = r.x1 == VertexKind::none;
    found(r.pixel, isX1 ? r.vertex.kind : r.x1, isX1 ? lights : r.vertex.kind, sum * r.throughput);
  }
}

}  // namespace virga
