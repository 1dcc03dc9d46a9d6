// SPDX-License-Identifier: Apache-2.0
#include "rays/ray_scene.h"

#include <embree3/rtcore.h>
#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <variant>

#include "core/error.h"
#include "rays/analytic.h"

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
  analytic::Shape analytic;
  Bounds bounds;                    ///< of an analytic shape
  std::span<const Vec3> positions;  ///< of triangles, as the next
  std::span<const std::array<uint32_t, 3>> triangles;

  std::array<Vec3, 3> triangle(size_t i) const {
    const auto& [a, b, c] = triangles[i];
    return {positions[a], positions[b], positions[c]};
  }

  ~Impl() { rtcReleaseGeometry(geometry); }
};

namespace {

/// The numbers of a scene's shapes, by where they are sorted: the standing ones, and each that moved.
struct ShapeNumbers {
  std::vector<uint32_t> standing, moved;

  /// Those that stand are instance 0 of the top or, without a top, of none.
  uint32_t of(uint32_t instance, uint32_t geometry) const {
    const bool stands = instance == RTC_INVALID_GEOMETRY_ID || instance == 0;
    return stands ? standing[geometry] : moved[instance - 1];
  }
};

/// Extends Embree's context: where `list` is set, every hit goes there and none ends the ray.
struct Context {
  RTCIntersectContext embree;
  const ShapeNumbers* numbers = nullptr;
  CrossingList* list = nullptr;

  /// The number of the shape that is being asked.
  uint32_t shape(uint32_t geometry) const { return numbers->of(embree.instID[0], geometry); }
};

analytic::LineHits intersectAnalytic(const RayShape::Impl& shape, Vec3 o, Vec3 d) {
  return std::visit(
      [&](const auto& s) -> analytic::LineHits {
        if constexpr (std::is_same_v<std::decay_t<decltype(s)>, std::monostate>)
          return {};
        else
          return intersect(s, o, d);
      },
      shape.analytic);
}

void gatherAnalytic(const RayShape::Impl& shape, uint32_t index, const Ray& ray, float tMin, float tMax,
                    CrossingList& list) {
  const analytic::LineHits hits = intersectAnalytic(shape, ray.o, ray.d);
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
analytic::LineHit nearestOf(const analytic::LineHits& hits, float tMin, float tMax) {
  analytic::LineHit best{kInfinity, false};
  for (int i = 0; i < hits.count; ++i)
    if (hits.hit[i].t > tMin && hits.hit[i].t < tMax && hits.hit[i].t < best.t) best = hits.hit[i];
  return best;
}

Ray rayOf(RTCRayN* r, unsigned n, unsigned i) {
  return {{RTCRayN_org_x(r, n, i), RTCRayN_org_y(r, n, i), RTCRayN_org_z(r, n, i)},
          {RTCRayN_dir_x(r, n, i), RTCRayN_dir_y(r, n, i), RTCRayN_dir_z(r, n, i)}};
}

void intersectCallback(const RTCIntersectFunctionNArguments* args) {
  const unsigned n = args->N;
  RTCRayN* r = RTCRayHitN_RayN(args->rayhit, n);
  RTCHitN* h = RTCRayHitN_HitN(args->rayhit, n);
  auto* context = reinterpret_cast<Context*>(args->context);
  for (unsigned i = 0; i < n; ++i) {
    if (!args->valid[i]) continue;
    const Ray ray = rayOf(r, n, i);
    const float tMin = RTCRayN_tnear(r, n, i), tMax = RTCRayN_tfar(r, n, i);
    const analytic::LineHits hits = intersectAnalytic(implOf(args->geometryUserPtr), ray.o, ray.d);
    if (context->list) {
      for (int k = 0; k < hits.count; ++k)
        if (hits.hit[k].t >= tMin && hits.hit[k].t <= tMax)
          context->list->insert({hits.hit[k].t, context->shape(args->geomID), hits.hit[k].entering});
      continue;
    }
    const analytic::LineHit nearest = nearestOf(hits, tMin, tMax);
    if (nearest.t == kInfinity) continue;
    RTCRayN_tfar(r, n, i) = nearest.t;
    RTCHitN_geomID(h, n, i) = args->geomID;
    RTCHitN_instID(h, n, i, 0) = args->context->instID[0];
    RTCHitN_primID(h, n, i) = args->primID;
    RTCHitN_u(h, n, i) = RTCHitN_v(h, n, i) = 0;
  }
}

void occludedCallback(const RTCOccludedFunctionNArguments* args) {
  RTCRayN* r = args->ray;
  for (unsigned i = 0; i < args->N; ++i) {
    if (!args->valid[i]) continue;
    const Ray ray = rayOf(r, args->N, i);
    const analytic::LineHits hits = intersectAnalytic(implOf(args->geometryUserPtr), ray.o, ray.d);
    float& tMax = RTCRayN_tfar(r, args->N, i);
    if (nearestOf(hits, RTCRayN_tnear(r, args->N, i), tMax).t < kInfinity) tMax = -kInfinity;
  }
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
  context->list->insert({r->tfar, context->shape(h->geomID), entering, onEdge(*r, *h)});
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
    const auto [a, b, c] = shape.triangle(primitive);
    const float size = maxComponent(max(abs(a), max(abs(b), abs(c))));
    const bool counts = query.counts(size, [&](Vec3 n) { return std::max(dot(n, a), std::max(dot(n, b), dot(n, c))); });
    return counts ? analytic::distanceToTriangle(query.p, a, b, c) : kInfinity;
  }
  return std::visit(
      [&](const auto& s) -> float {
        using Shape = std::decay_t<decltype(s)>;
        if constexpr (std::is_same_v<Shape, std::monostate> || std::is_same_v<Shape, analytic::Box>) {
          return analytic::lowerDistance(shape.bounds, query.p);
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

std::shared_ptr<const RayShape> analyticShape(const analytic::Shape& shape, const Bounds& bounds) {
  auto impl = std::make_unique<RayShape::Impl>();
  impl->analytic = shape;
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

bool RayShape::mayMeet(const Bounds& box) const {
  if (!std::holds_alternative<std::monostate>(impl_->analytic)) return overlap(box, impl_->bounds);
  for (size_t i = 0; i < impl_->triangles.size(); ++i) {
    Bounds bounds;
    for (const Vec3 corner : impl_->triangle(i)) bounds.extend(corner);
    if (overlap(box, bounds)) return true;
  }
  return false;
}

std::shared_ptr<const RayShape> RayShape::triangles(std::span<const Vec3> positions,
                                                    std::span<const std::array<uint32_t, 3>> triangles) {
  auto impl = std::make_unique<Impl>();
  impl->positions = positions, impl->triangles = triangles;
  impl->geometry = rtcNewGeometry(device(), RTC_GEOMETRY_TYPE_TRIANGLE);
  rtcSetSharedGeometryBuffer(impl->geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, positions.data(), 0,
                             sizeof(Vec3), positions.size());
  rtcSetSharedGeometryBuffer(impl->geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, triangles.data(), 0,
                             sizeof(std::array<uint32_t, 3>), triangles.size());
  rtcCommitGeometry(impl->geometry);
  return std::make_shared<const RayShape>(std::move(impl));
}

std::shared_ptr<const RayShape> RayShape::sphere(Vec3 center, float radius) {
  const analytic::Sphere s{center, radius};
  return analyticShape(s, boundsOf(s));
}

std::shared_ptr<const RayShape> RayShape::disk(Vec3 center, Vec3 unitNormal, float radius) {
  const analytic::Disk k{center, unitNormal, radius};
  return analyticShape(k, boundsOf(k));
}

std::shared_ptr<const RayShape> RayShape::cylinder(Vec3 end, Vec3 unitAxis, float radius, float length) {
  const analytic::Cylinder c{end, unitAxis, radius, length};
  return analyticShape(c, boundsOf(c));
}

std::shared_ptr<const RayShape> RayShape::box(const Matrix4& toWorld) {
  const Affine map(toWorld);
  Bounds bounds;
  for (int i = 0; i < 8; ++i) bounds.extend(map.point(Bounds{Vec3(-1), Vec3(1)}.corner(i)));
  return analyticShape(analytic::Box{Affine(toWorld.inverse())}, bounds);
}

namespace {

RTCScene newScene() {
  const RTCScene scene = rtcNewScene(device());
  rtcSetSceneFlags(scene, static_cast<RTCSceneFlags>(RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION));
  return scene;
}

/// Shapes that are sorted together. Immutable, shared between scenes.
struct Group {
  RayScene::Shapes shapes;
  RTCScene scene = newScene();

  explicit Group(RayScene::Shapes of) : shapes(std::move(of)) {
    for (size_t i = 0; i < shapes.size(); ++i)
      rtcAttachGeometryByID(scene, shapes[i]->impl().geometry, static_cast<unsigned>(i));
    rtcCommitScene(scene);
  }
  Group(const Group&) = delete;
  Group& operator=(const Group&) = delete;
  ~Group() { rtcReleaseScene(scene); }
};
using GroupPtr = std::shared_ptr<const Group>;

constexpr uint32_t kGone = ~0u;

// For each member of a group the number that it has among `shapes`, kGone if it is not there; marks those found. One
// shape may be there several times.
std::vector<uint32_t> findMembers(const Group& group, const RayScene::Shapes& shapes, std::vector<bool>& found) {
  std::multimap<const RayShape*, uint32_t> numbers;
  for (size_t i = shapes.size(); i-- > 0;) numbers.emplace(shapes[i].get(), static_cast<uint32_t>(i));
  std::vector<uint32_t> result;
  for (const auto& member : group.shapes) {
    const auto number = numbers.find(member.get());
    result.push_back(number == numbers.end() ? kGone : number->second);
    if (number == numbers.end()) continue;
    found[number->second] = true;
    numbers.erase(number);
  }
  return result;
}

}  // namespace

struct RayScene::Impl {
  GroupPtr standing;
  std::vector<GroupPtr> moved;  ///< one shape each
  ShapeNumbers numbers;
  RTCScene top = nullptr;  ///< over all groups, if any shape moved
  /// Few analytic boundaries are quicker asked one by one than through a traversal.
  bool askOneByOne = false;

  ~Impl() { rtcReleaseScene(top); }

  RTCScene scene() const { return top ? top : standing->scene; }

  void standAll(const Shapes& shapes) {
    numbers.standing.clear();
    standing = std::make_shared<const Group>(shapes);
    for (size_t i = 0; i < shapes.size(); ++i) numbers.standing.push_back(static_cast<uint32_t>(i));
  }

  void takeFrom(const Impl& previous, const Shapes& shapes) {
    std::vector<bool> stands(shapes.size());
    numbers.standing = findMembers(*previous.standing, shapes, stands);
    if (std::find(stands.begin(), stands.end(), true) == stands.end()) return standAll(shapes);
    standing = previous.standing;
    if (std::erase(numbers.standing, kGone) > 0) {
      Shapes still;
      for (const uint32_t number : numbers.standing) still.push_back(shapes[number]);
      standing = std::make_shared<const Group>(std::move(still));
    }
    for (size_t i = 0; i < shapes.size(); ++i) {
      if (stands[i]) continue;
      numbers.moved.push_back(static_cast<uint32_t>(i));
      const auto known = std::find_if(previous.moved.begin(), previous.moved.end(),
                                      [&](const GroupPtr& g) { return g->shapes.front() == shapes[i]; });
      moved.push_back(known == previous.moved.end() ? std::make_shared<const Group>(Shapes{shapes[i]}) : *known);
    }
    if (!moved.empty()) raiseTop();
  }

  void raiseTop() {
    top = newScene();
    addInstance(*standing, 0);
    for (size_t i = 0; i < moved.size(); ++i) addInstance(*moved[i], 1 + static_cast<uint32_t>(i));
    rtcCommitScene(top);
  }

  void addInstance(const Group& group, uint32_t id) const {
    const RTCGeometry instance = rtcNewGeometry(device(), RTC_GEOMETRY_TYPE_INSTANCE);
    rtcSetGeometryInstancedScene(instance, group.scene);
    rtcCommitGeometry(instance);
    rtcAttachGeometryByID(top, instance, id);
    rtcReleaseGeometry(instance);
  }
};

RayScene::RayScene(Shapes shapes, const RayScene* previous)
    : shapes_(std::move(shapes)), impl_(std::make_unique<Impl>()) {
  constexpr size_t kFew = 4;
  impl_->askOneByOne = shapes_.size() <= kFew;
  for (const auto& shape : shapes_)
    if (std::holds_alternative<std::monostate>(shape->impl().analytic)) impl_->askOneByOne = false;
  if (previous)
    impl_->takeFrom(*previous->impl_, shapes_);
  else
    impl_->standAll(shapes_);
  requireNoError();
}

int RayScene::movedShapes() const { return static_cast<int>(impl_->moved.size()); }

Bounds RayScene::bounds() const {
  if (shapes_.empty()) return {};
  RTCBounds b;
  rtcGetSceneBounds(impl_->scene(), &b);
  return {{b.lower_x, b.lower_y, b.lower_z}, {b.upper_x, b.upper_y, b.upper_z}};
}

bool RayScene::sharesStandingShapes(const RayScene& other) const { return impl_->standing == other.impl_->standing; }

RayScene::~RayScene() = default;

RayHit RayScene::nearest(const Ray& ray, float tMin, float tMax) const {
  if (shapes_.empty()) return {};
  Context context;
  rtcInitIntersectContext(&context.embree);
  RTCRayHit q{};
  q.ray = {ray.o.x, ray.o.y, ray.o.z, tMin, ray.d.x, ray.d.y, ray.d.z, 0, tMax, ~0u, 0, 0};
  q.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  q.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(impl_->scene(), &context.embree, &q);
  if (q.hit.geomID == RTC_INVALID_GEOMETRY_ID) return {};
  return {q.ray.tfar, impl_->numbers.of(q.hit.instID[0], q.hit.geomID), q.hit.primID, q.hit.u, q.hit.v};
}

bool RayScene::occluded(const Ray& ray, float tMin, float tMax) const {
  if (shapes_.empty()) return false;
  Context context;
  rtcInitIntersectContext(&context.embree);
  RTCRay q{ray.o.x, ray.o.y, ray.o.z, tMin, ray.d.x, ray.d.y, ray.d.z, 0, tMax, ~0u, 0, 0};
  rtcOccluded1(impl_->scene(), &context.embree, &q);
  return q.tfar < 0;
}

namespace {

RTCIntersectContext coherentContext() {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  return context;
}

/// Which rays take part, as Embree takes it.
struct alignas(64) Partakers {
  int valid[RayPacket::kSize];
  bool any = false;

  explicit Partakers(const RayPacket& rays) {
    for (int i = 0; i < RayPacket::kSize; ++i) valid[i] = rays.tMax[i] > 0 ? -1 : 0, any |= rays.tMax[i] > 0;
  }
};

void fill(const RayPacket& rays, RTCRay16& r) {
  constexpr size_t kBytes = sizeof(rays.ox);
  std::memcpy(r.org_x, rays.ox, kBytes), std::memcpy(r.org_y, rays.oy, kBytes), std::memcpy(r.org_z, rays.oz, kBytes);
  std::memcpy(r.dir_x, rays.dx, kBytes), std::memcpy(r.dir_y, rays.dy, kBytes), std::memcpy(r.dir_z, rays.dz, kBytes);
  std::memcpy(r.tfar, rays.tMax, kBytes);
  std::memset(r.tnear, 0, kBytes), std::memset(r.time, 0, kBytes);
  std::memset(r.mask, 0xff, kBytes), std::memset(r.id, 0, kBytes), std::memset(r.flags, 0, kBytes);
}

}  // namespace

PacketHits RayScene::nearest(const RayPacket& rays) const {
  PacketHits found;
  const Partakers partakers(rays);
  if (shapes_.empty() || !partakers.any) return found;
  if (impl_->top) {  // packets among instances may never return (Embree 3.13.5)
    for (int i = 0; i < RayPacket::kSize; ++i)
      if (partakers.valid[i]) found[static_cast<size_t>(i)] = nearest(rays.ray(i), 0, rays.tMax[i]);
    return found;
  }
  Context context;
  context.embree = coherentContext();
  RTCRayHit16 q;
  fill(rays, q.ray);
  std::memset(q.hit.geomID, 0xff, sizeof(q.hit.geomID));  // RTC_INVALID_GEOMETRY_ID
  std::memset(q.hit.instID, 0xff, sizeof(q.hit.instID));
  rtcIntersect16(partakers.valid, impl_->scene(), &context.embree, &q);
  for (size_t i = 0; i < found.size(); ++i)
    if (partakers.valid[i] && q.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID)
      found[i] = {q.ray.tfar[i], impl_->numbers.of(q.hit.instID[0][i], q.hit.geomID[i]), q.hit.primID[i], q.hit.u[i],
                  q.hit.v[i]};
  return found;
}

uint32_t RayScene::occluded(const RayPacket& rays) const {
  const Partakers partakers(rays);
  if (shapes_.empty() || !partakers.any) return 0;
  uint32_t met = 0;
  if (impl_->top) {
    for (int i = 0; i < RayPacket::kSize; ++i)
      if (partakers.valid[i] && occluded(rays.ray(i), 0, rays.tMax[i])) met |= 1u << i;
    return met;
  }
  Context context;
  context.embree = coherentContext();
  RTCRay16 q;
  fill(rays, q);
  rtcOccluded16(partakers.valid, impl_->scene(), &context.embree, &q);
  for (int i = 0; i < RayPacket::kSize; ++i)
    if (partakers.valid[i] && q.tfar[i] < 0) met |= 1u << i;
  return met;
}

float RayScene::clearance(Vec3 p, std::span<const Vec3> sides) const {
  if (shapes_.empty()) return kInfinity;
  RTCPointQuery q{p.x, p.y, p.z, 0, kInfinity};
  const auto search = [&](const Group& group) {
    ClearanceQuery query{group.shapes, p, sides};
    RTCPointQueryContext context;
    rtcInitPointQueryContext(&context);
    rtcPointQuery(group.scene, &q, &context, clearanceCallback, &query);
  };
  search(*impl_->standing);
  for (const GroupPtr& group : impl_->moved) search(*group);
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
  context.numbers = &impl_->numbers;
  RTCRayHit q{};
  q.ray = {ray.o.x, ray.o.y, ray.o.z, tMin, ray.d.x, ray.d.y, ray.d.z, 0, tMax, ~0u, 0, 0};
  q.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  q.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(impl_->scene(), &context.embree, &q);
}

}  // namespace virga
