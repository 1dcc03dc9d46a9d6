// SPDX-License-Identifier: Apache-2.0
#include "rays/ray_scene.h"

#include <embree3/rtcore.h>
#include <fmt/format.h>

#include <variant>

#include "core/error.h"

namespace virga {
namespace {

struct Sphere {
  Vec3 center;
  float radius;
};
struct Disk {
  Vec3 center, normal;
  float radius;
};
struct Cylinder {
  Vec3 end, axis;
  float radius, length;
};
struct Box {
  Affine toLocal;
};
using Analytic = std::variant<Sphere, Disk, Cylinder, Box>;

/// One point where a line meets an analytic shape.
struct LineHit {
  float t;
  bool entering;
};
struct LineHits {
  LineHit hit[2];
  int count = 0;
};

// In double precision: far away, the discriminant of a small sphere cancels in float.
LineHits intersect(const Sphere& s, Vec3 o, Vec3 d) {
  const double ox = double{o.x} - double{s.center.x}, oy = double{o.y} - double{s.center.y},
               oz = double{o.z} - double{s.center.z};
  const double dx = d.x, dy = d.y, dz = d.z;
  const double a = dx * dx + dy * dy + dz * dz;
  const double b = ox * dx + oy * dy + oz * dz;
  // Squared distance from the centre to the line, without the cancellation of b^2 - a c.
  const double px = ox - b / a * dx, py = oy - b / a * dy, pz = oz - b / a * dz;
  const double r2 = double{s.radius} * double{s.radius};
  const double discriminant = a * (r2 - (px * px + py * py + pz * pz));
  if (!(discriminant > 0)) return {};
  const double root = std::sqrt(discriminant);
  return {{{static_cast<float>((-b - root) / a), true}, {static_cast<float>((-b + root) / a), false}}, 2};
}

LineHits intersect(const Disk& k, Vec3 o, Vec3 d) {
  const float along = dot(k.normal, d);
  if (along == 0) return {};
  const float t = dot(k.normal, k.center - o) / along;
  if (!(lengthSquared(o + d * t - k.center) <= k.radius * k.radius)) return {};
  return {{{t, along < 0}, {}}, 1};
}

// In double precision, for the same reason as the sphere: in the plane across the axis, a circle.
LineHits intersect(const Cylinder& c, Vec3 o, Vec3 d) {
  const double axis[] = {double{c.axis.x}, double{c.axis.y}, double{c.axis.z}};
  const double from[] = {double{o.x} - double{c.end.x}, double{o.y} - double{c.end.y}, double{o.z} - double{c.end.z}};
  const double to[] = {double{d.x}, double{d.y}, double{d.z}};
  const auto inner = [](const double* a, const double* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; };
  const double unit = inner(axis, axis), height = inner(from, axis) / unit, climb = inner(to, axis) / unit;
  double p[3], q[3];
  for (int i = 0; i < 3; ++i) p[i] = from[i] - height * axis[i], q[i] = to[i] - climb * axis[i];
  const double a = inner(q, q), b = inner(p, q);
  if (!(a > 0)) return {};
  double nearest[3];
  for (int i = 0; i < 3; ++i) nearest[i] = p[i] - b / a * q[i];
  const double discriminant = a * (double{c.radius} * double{c.radius} - inner(nearest, nearest));
  if (!(discriminant > 0)) return {};
  const double root = std::sqrt(discriminant);
  LineHits hits;
  for (const double side : {-1.0, 1.0}) {
    const double t = (-b + side * root) / a, z = height + t * climb;
    if (z >= 0 && z <= double{c.length}) hits.hit[hits.count++] = {static_cast<float>(t), side < 0};
  }
  return hits;
}

LineHits intersect(const Box& box, Vec3 o, Vec3 d) {
  const Vec3 lo = box.toLocal.point(o), ld = box.toLocal.vector(d);
  float tEnter = -kInfinity, tLeave = kInfinity;
  for (int axis = 0; axis < 3; ++axis) {
    const float inverse = 1 / ld[axis];
    const float t0 = (-1 - lo[axis]) * inverse, t1 = (1 - lo[axis]) * inverse;
    if (ld[axis] == 0) {
      if (std::fabs(lo[axis]) >= 1) return {};
      continue;
    }
    tEnter = std::max(tEnter, std::min(t0, t1));
    tLeave = std::min(tLeave, std::max(t0, t1));
  }
  if (!(tEnter < tLeave)) return {};
  return {{{tEnter, true}, {tLeave, false}}, 2};
}

Bounds boundsOf(const Sphere& s) { return {s.center - Vec3(s.radius), s.center + Vec3(s.radius)}; }

Bounds boundsOf(const Disk& k) {
  const auto half = [&](float n) { return k.radius * std::sqrt(std::max(0.f, 1 - n * n)); };
  const Vec3 h(half(k.normal.x), half(k.normal.y), half(k.normal.z));
  return {k.center - h, k.center + h};
}

Bounds boundsOf(const Cylinder& c) {
  Bounds b = boundsOf(Disk{c.end, c.axis, c.radius});
  b.extend(boundsOf(Disk{c.end + c.axis * c.length, c.axis, c.radius}));
  return b;
}

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
