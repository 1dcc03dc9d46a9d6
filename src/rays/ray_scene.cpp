// SPDX-License-Identifier: Apache-2.0
#include "rays/ray_scene.h"

#include <embree3/rtcore.h>
#include <fmt/format.h>

#include "core/error.h"
#include "rays/analytic_shapes.h"

namespace virga {
namespace {

struct DeviceHolder {
  RTCDevice device = rtcNewDevice(nullptr);
  ~DeviceHolder() { rtcReleaseDevice(device); }
};

RTCDevice device() {
  static DeviceHolder holder;
  return holder.device;
}

// Embree reports through the device, not by what its functions return.
void requireNoError() {
  const RTCError error = rtcGetDeviceError(device());
  if (error == RTC_ERROR_OUT_OF_MEMORY)
    throw Error("not enough memory to sort the scene's triangles for ray queries", {{}, "use simpler meshes", {}});
  if (error != RTC_ERROR_NONE)
    throw Error(fmt::format("Embree, which traces the rays, failed (its error {})", static_cast<int>(error)));
}

}  // namespace

struct RayShape::Impl {
  RTCGeometry geometry = nullptr;
  std::variant<std::monostate, Sphere, Disk, Cylinder, Box> analytic;
  Bounds bounds;  ///< of an analytic shape

  ~Impl() { rtcReleaseGeometry(geometry); }
};

namespace {

/// Extends Embree's context: where `list` is set, every hit goes there and none ends the ray.
struct Context {
  RTCIntersectContext embree;
  CrossingList* list = nullptr;
};

LineHits intersectAnalytic(const RayShape::Impl& shape, Vec3 o, Vec3 d) {
  return std::visit(
      [&](const auto& s) -> LineHits {
        if constexpr (std::is_same_v<std::decay_t<decltype(s)>, std::monostate>)
          return {};
        else
          return intersect(s, o, d);
      },
      shape.analytic);
}

void gatherAnalytic(const RayShape::Impl& shape, uint32_t index, const Ray& ray, float tMin, float tMax,
                    CrossingList& list) {
  const LineHits hits = intersectAnalytic(shape, ray.o, ray.d);
  for (int i = 0; i < hits.count; ++i)
    if (hits.hit[i].t >= tMin && hits.hit[i].t <= tMax) list.insert({hits.hit[i].t, index, hits.hit[i].entering});
}

const RayShape::Impl& implOf(void* userData) { return *static_cast<const RayShape::Impl*>(userData); }

void boundsCallback(const RTCBoundsFunctionArguments* args) {
  const Bounds& b = implOf(args->geometryUserPtr).bounds;
  // Embree's boxes must hold the shape in spite of rounding in the traversal.
  const Vec3 pad = max(abs(b.lo), abs(b.hi)) * 1e-6f;
  *args->bounds_o = {b.lo.x - pad.x, b.lo.y - pad.y, b.lo.z - pad.z, 0,
                     b.hi.x + pad.x, b.hi.y + pad.y, b.hi.z + pad.z, 0};
}

// Nearest of the shape's hits in the ray's open interval.
LineHit nearestOf(const LineHits& hits, float tMin, float tMax) {
  LineHit best{kInfinity, false};
  for (int i = 0; i < hits.count; ++i)
    if (hits.hit[i].t > tMin && hits.hit[i].t < tMax && hits.hit[i].t < best.t) best = hits.hit[i];
  return best;
}

void intersectCallback(const RTCIntersectFunctionNArguments* args) {
  auto* rayHit = reinterpret_cast<RTCRayHit*>(args->rayhit);
  RTCRay& r = rayHit->ray;
  const Vec3 o(r.org_x, r.org_y, r.org_z), d(r.dir_x, r.dir_y, r.dir_z);
  const LineHits hits = intersectAnalytic(implOf(args->geometryUserPtr), o, d);
  auto* context = reinterpret_cast<Context*>(args->context);
  if (context->list) {
    for (int i = 0; i < hits.count; ++i)
      if (hits.hit[i].t >= r.tnear && hits.hit[i].t <= r.tfar)
        context->list->insert({hits.hit[i].t, args->geomID, hits.hit[i].entering});
    return;
  }
  const LineHit nearest = nearestOf(hits, r.tnear, r.tfar);
  if (nearest.t == kInfinity) return;
  r.tfar = nearest.t;
  rayHit->hit.geomID = args->geomID;
  rayHit->hit.primID = args->primID;
  rayHit->hit.u = rayHit->hit.v = 0;
}

void occludedCallback(const RTCOccludedFunctionNArguments* args) {
  auto* r = reinterpret_cast<RTCRay*>(args->ray);
  const Vec3 o(r->org_x, r->org_y, r->org_z), d(r->dir_x, r->dir_y, r->dir_z);
  if (nearestOf(intersectAnalytic(implOf(args->geometryUserPtr), o, d), r->tnear, r->tfar).t < kInfinity)
    r->tfar = -kInfinity;
}

// Are the barycentric weights of a hit so small that the ray may have missed (or met) the triangle by rounding alone?
bool onEdge(const RTCRay& r, const RTCHit& h) {
  const float reach = std::max({std::fabs(r.org_x), std::fabs(r.org_y), std::fabs(r.org_z)}) + r.tfar;
  const float size = std::sqrt(length(Vec3(h.Ng_x, h.Ng_y, h.Ng_z)));
  return std::min({h.u, h.v, 1 - h.u - h.v}) * size < 1e-6f * reach;
}

// Records a triangle's hit as a crossing and rejects it, so that the traversal goes on to the ray's end.
void recordCrossing(const RTCFilterFunctionNArguments* args) {
  auto* context = reinterpret_cast<Context*>(args->context);
  const auto* r = reinterpret_cast<const RTCRay*>(args->ray);
  const auto* h = reinterpret_cast<const RTCHit*>(args->hit);
  const bool entering = h->Ng_x * r->dir_x + h->Ng_y * r->dir_y + h->Ng_z * r->dir_z < 0;
  context->list->insert({r->tfar, h->geomID, entering, onEdge(*r, *h)});
  args->valid[0] = 0;
}

/// What a search for the nearest shape looks for.
struct ClearanceQuery {
  const std::vector<std::shared_ptr<const RayShape>>& shapes;
  Vec3 p;
  std::span<const Vec3> sides;

  /// Something that reaches so far along a direction, and has coordinates of such a size.
  template <class FarthestAlong>
  bool counts(float size, const FarthestAlong& farthestAlong) const {
    const float error = 1e-5f * std::max(size, maxComponent(abs(p)));
    return sides.empty() ||
           std::any_of(sides.begin(), sides.end(), [&](Vec3 n) { return farthestAlong(n) - dot(n, p) > error; });
  }
};

float distanceOf(const RayShape::Impl& shape, unsigned primitive, const ClearanceQuery& query) {
  if (std::holds_alternative<std::monostate>(shape.analytic)) {
    const auto* positions =
        static_cast<const Vec3*>(rtcGetGeometryBufferData(shape.geometry, RTC_BUFFER_TYPE_VERTEX, 0));
    const auto* t = static_cast<const uint32_t*>(rtcGetGeometryBufferData(shape.geometry, RTC_BUFFER_TYPE_INDEX, 0));
    const Vec3 a = positions[t[3 * primitive]], b = positions[t[3 * primitive + 1]],
               c = positions[t[3 * primitive + 2]];
    const float size = maxComponent(max(abs(a), max(abs(b), abs(c))));
    const bool counts = query.counts(size, [&](Vec3 n) { return std::max(dot(n, a), std::max(dot(n, b), dot(n, c))); });
    return counts ? distanceToTriangle(query.p, a, b, c) : kInfinity;
  }
  return std::visit(
      [&](const auto& s) -> float {
        using Shape = std::decay_t<decltype(s)>;
        if constexpr (std::is_same_v<Shape, std::monostate> || std::is_same_v<Shape, Box>) {
          return lowerDistance(shape.bounds, query.p);
        } else {
          const float size = maxComponent(max(abs(shape.bounds.lo), abs(shape.bounds.hi)));
          const bool counts = query.counts(size, [&](Vec3 n) { return farthestAlong(s, n); });
          return counts ? lowerDistance(s, query.p) : kInfinity;
        }
      },
      shape.analytic);
}

// Shrinks the search to what it has found.
bool clearanceCallback(RTCPointQueryFunctionArguments* args) {
  const auto& query = *static_cast<const ClearanceQuery*>(args->userPtr);
  const float d = distanceOf(query.shapes[args->geomID]->impl(), args->primID, query);
  if (!(d < args->query->radius)) return false;
  args->query->radius = d;
  return true;
}

std::shared_ptr<const RayShape> analyticShape(const Analytic& shape, const Bounds& bounds) {
  auto impl = std::make_unique<RayShape::Impl>();
  std::visit([&](const auto& s) { impl->analytic = s; }, shape);
  impl->bounds = bounds;
  impl->geometry = rtcNewGeometry(device(), RTC_GEOMETRY_TYPE_USER);
  rtcSetGeometryUserPrimitiveCount(impl->geometry, 1);
  rtcSetGeometryUserData(impl->geometry, impl.get());
  rtcSetGeometryBoundsFunction(impl->geometry, boundsCallback, nullptr);
  rtcSetGeometryIntersectFunction(impl->geometry, intersectCallback);
  rtcSetGeometryOccludedFunction(impl->geometry, occludedCallback);
  rtcCommitGeometry(impl->geometry);
  return std::make_shared<const RayShape>(std::move(impl));
}

}  // namespace

RayShape::RayShape(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
RayShape::~RayShape() = default;

std::shared_ptr<const RayShape> RayShape::triangles(std::span<const Vec3> positions,
                                                    std::span<const std::array<uint32_t, 3>> triangles) {
  auto impl = std::make_unique<Impl>();
  impl->geometry = rtcNewGeometry(device(), RTC_GEOMETRY_TYPE_TRIANGLE);
  rtcSetSharedGeometryBuffer(impl->geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, positions.data(), 0,
                             sizeof(Vec3), positions.size());
  rtcSetSharedGeometryBuffer(impl->geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, triangles.data(), 0,
                             sizeof(std::array<uint32_t, 3>), triangles.size());
  rtcCommitGeometry(impl->geometry);
  return std::make_shared<const RayShape>(std::move(impl));
}

std::shared_ptr<const RayShape> RayShape::sphere(Vec3 center, float radius) {
  const Sphere s{center, radius};
  return analyticShape(s, boundsOf(s));
}

std::shared_ptr<const RayShape> RayShape::disk(Vec3 center, Vec3 unitNormal, float radius) {
  const Disk k{center, unitNormal, radius};
  return analyticShape(k, boundsOf(k));
}

std::shared_ptr<const RayShape> RayShape::cylinder(Vec3 end, Vec3 unitAxis, float radius, float length) {
  const Cylinder c{end, unitAxis, radius, length};
  return analyticShape(c, boundsOf(c));
}

std::shared_ptr<const RayShape> RayShape::box(const Matrix4& toWorld) {
  const Affine map(toWorld);
  Bounds bounds;
  for (int i = 0; i < 8; ++i) bounds.extend(map.point(Bounds{Vec3(-1), Vec3(1)}.corner(i)));
  return analyticShape(Box{Affine(toWorld.inverse())}, bounds);
}

struct RayScene::Impl {
  RTCScene scene = rtcNewScene(device());
  /// Few analytic boundaries are quicker asked one by one than through a traversal.
  bool askOneByOne = false;

  ~Impl() { rtcReleaseScene(scene); }
};

RayScene::RayScene(std::vector<std::shared_ptr<const RayShape>> shapes)
    : shapes_(std::move(shapes)), impl_(std::make_unique<Impl>()) {
  constexpr size_t kFew = 4;
  rtcSetSceneFlags(impl_->scene,
                   static_cast<RTCSceneFlags>(RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION));
  impl_->askOneByOne = shapes_.size() <= kFew;
  for (size_t i = 0; i < shapes_.size(); ++i) {
    const RayShape::Impl& shape = shapes_[i]->impl();
    if (std::holds_alternative<std::monostate>(shape.analytic)) impl_->askOneByOne = false;
    rtcAttachGeometryByID(impl_->scene, shape.geometry, static_cast<unsigned>(i));
  }
  rtcCommitScene(impl_->scene);
  requireNoError();
}

RayScene::~RayScene() = default;

RayHit RayScene::nearest(const Ray& ray, float tMin, float tMax) const {
  if (shapes_.empty()) return {};
  Context context;
  rtcInitIntersectContext(&context.embree);
  RTCRayHit q{};
  q.ray = {ray.o.x, ray.o.y, ray.o.z, tMin, ray.d.x, ray.d.y, ray.d.z, 0, tMax, ~0u, 0, 0};
  q.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  q.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(impl_->scene, &context.embree, &q);
  if (q.hit.geomID == RTC_INVALID_GEOMETRY_ID) return {};
  return {q.ray.tfar, q.hit.geomID, q.hit.primID, q.hit.u, q.hit.v};
}

bool RayScene::occluded(const Ray& ray, float tMin, float tMax) const {
  if (shapes_.empty()) return false;
  Context context;
  rtcInitIntersectContext(&context.embree);
  RTCRay q{ray.o.x, ray.o.y, ray.o.z, tMin, ray.d.x, ray.d.y, ray.d.z, 0, tMax, ~0u, 0, 0};
  rtcOccluded1(impl_->scene, &context.embree, &q);
  return q.tfar < 0;
}

float RayScene::clearance(Vec3 p, std::span<const Vec3> sides) const {
  if (shapes_.empty()) return kInfinity;
  ClearanceQuery query{shapes_, p, sides};
  RTCPointQueryContext context;
  rtcInitPointQueryContext(&context);
  RTCPointQuery q{p.x, p.y, p.z, 0, kInfinity};
  rtcPointQuery(impl_->scene, &q, &context, clearanceCallback, &query);
  return q.radius;
}

void RayScene::crossings(const Ray& ray, float tMin, float tMax, CrossingList& list) const {
  if (shapes_.empty()) return;
  if (impl_->askOneByOne) {
    for (size_t i = 0; i < shapes_.size(); ++i)
      gatherAnalytic(shapes_[i]->impl(), static_cast<uint32_t>(i), ray, tMin, tMax, list);
    return;
  }
  Context context;
  rtcInitIntersectContext(&context.embree);
  context.embree.filter = recordCrossing;
  context.list = &list;
  RTCRayHit q{};
  q.ray = {ray.o.x, ray.o.y, ray.o.z, tMin, ray.d.x, ray.d.y, ray.d.z, 0, tMax, ~0u, 0, 0};
  q.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  q.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(impl_->scene, &context.embree, &q);
}

}  // namespace virga
