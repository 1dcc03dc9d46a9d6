// SPDX-License-Identifier: Apache-2.0
#include "transport/media_bounds.h"

#include "core/octahedral.h"
#include "transport/media_walk.h"
#include "transport/virtual_lights.h"

namespace virga {
namespace {

/// Calls visit(t0, t1, ray) for stretches of media along a ray from p, but for where grids hold nothing.
template <class Visit>
void visitStretches(const SceneView& view, const EmbreeRays& rays, MediaRay r, float tMax, const Visit& visit) {
  walkMedia(view, rays, r, tMax, [&](float t0, float t1) {
    for (int i = 0; i < r.media.count(); ++i) {
      const MediumView& medium = view.media[r.media.medium(i)];
      ClippedRange in{t0, t1};
      if (!medium.homogeneous && !(medium.density.background > 0))
        in = clipToBox(medium.worldToDensity.point(r.ray.o), medium.worldToDensity.vector(r.ray.d),
                       medium.density.supportLo, medium.density.supportHi, t0, t1);
      if (in.t0 < in.t1) visit(in.t0, in.t1, r);
    }
    return true;
  });
}

/// Where boundaries say that media may be; everywhere, if there are media outside of them.
Bounds whereMediaMayBe(const Scene& scene) {
  const bool within =
      endlessMedium(scene) == MediaState::kNone && std::none_of(scene.view.surfaces.begin(), scene.view.surfaces.end(),
                                                                [](const ShapeView& s) { return s.media.declared(); });
  return within ? scene.boundaryRays->bounds() : scene.view.bounds;
}

}  // namespace

bool endsByItself(const MediumView& medium) {
  return !medium.homogeneous && medium.density.kind != GridView::Kind::constant && !(medium.density.background > 0);
}

Bounds boundsInWorld(const MediumView& medium, const Bounds& inGrid) {
  const Affine toWorld = medium.worldToDensity.inverse();
  Bounds bounds;
  for (int i = 0; i < 8; ++i) bounds.extend(toWorld.point(inGrid.corner(i)));
  return bounds;
}

bool mediaAreBounded(const Scene& scene) {
  const SceneView& view = scene.view;
  return view.cameraMedia.base() == MediaState::kNone &&
         std::none_of(view.surfaces.begin(), view.surfaces.end(),
                      [](const ShapeView& s) { return s.media.declared(); }) &&
         std::all_of(view.boundaries.begin(), view.boundaries.end(),
                     [](const MediumTransition& t) { return t.closed; });
}

Bounds boundsOfMedia(const Scene& scene) {
  constexpr int kPoints = 3, kDirections = 12;  // an octahedral map of these
  if (scene.view.media.size == 0) return {};
  const EmbreeRays rays{*scene.surfaceRays, *scene.boundaryRays};
  const int endless = endlessMedium(scene);
  Bounds where = whereMediaMayBe(scene);
  if (where.empty()) where = {Vec3(-1), Vec3(1)};
  // Media without end, and no shapes among them: as far as may matter.
  const float most = scene.view.bounds.empty() ? 1e3f : 2 * length(scene.view.bounds.extent());
  const auto place = [](int n) { return (static_cast<float>(n % kPoints) + 0.5f) / kPoints; };
  Bounds media;
  for (int i = 0; i < kPoints * kPoints * kPoints; ++i) {
    const Vec3 p = where.lo + where.extent() * Vec3(place(i), place(i / kPoints), place(i / kPoints / kPoints));
    const MediaState state = mediaAt(scene, p, endless);
    for (int n = 0; n < kDirections * kDirections; ++n) {
      const Vec3 d = octahedralDirection({n % kDirections, n / kDirections}, kDirections);
      visitStretches(scene.view, rays, {{p, d}, state, 0}, most, [&](float t0, float t1, const MediaRay& r) {
        media.extend(r.ray.at(t0)), media.extend(r.ray.at(t1));
      });
    }
  }
  return media;
}

}  // namespace virga
