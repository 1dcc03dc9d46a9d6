// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "scene/build_context.h"
#include "scene/closed_mesh.h"
#include "scene/smooth_normals.h"

namespace virga {
namespace {

constexpr std::string_view kNotYet[] = {"gltf",         "shapegroup",  "instance", "serialized",
                                        "bsplinecurve", "linearcurve", "sdfgrid"};

/// What a shape's surface is for: to be seen, also to hold a medium, or only that. Boundaries need no triangles where
/// an analytic form will do.
enum class Role { surface, vessel, boundary };
constexpr std::string_view kRoleNames[] = {"surface", "vessel", "boundary"};

void measure(BuiltShape& shape) {
  std::vector<float> areas;
  const std::vector<Vec3>& p = shape.mesh.positions;
  for (const auto& t : shape.mesh.triangles)
    areas.push_back(0.5f * length(cross(p[t[1]] - p[t[0]], p[t[2]] - p[t[0]])));
  shape.triangleChoice = Discrete(areas);
  shape.view.triangleChoice = shape.triangleChoice.view();
  shape.view.area = static_cast<float>(shape.triangleChoice.total());
  for (const Vec3& v : p) shape.bounds.extend(v);
}

// Takes a mesh in world space.
void finishMesh(BuiltShape& shape, Role role) {
  TriangleMesh& mesh = shape.mesh;
  // What has no area in single precision has no normal either: no ray and no light shall find it.
  const std::vector<Vec3>& p = mesh.positions;
  std::erase_if(mesh.triangles,
                [&](const auto& t) { return !(lengthSquared(cross(p[t[1]] - p[t[0]], p[t[2]] - p[t[0]])) > 0); });
  if (mesh.triangles.empty()) return;
  if (role != Role::surface) shape.openEdges = openEdges(mesh);
  mesh.positions.reserve(mesh.positions.size() + 2);  // Embree reads 16 bytes at the last vertex
  shape.view.kind = ShapeView::Kind::mesh;
  shape.view.positions = mesh.positions.data();
  shape.view.normals = mesh.normals.empty() ? nullptr : mesh.normals.data();
  shape.view.uvs = mesh.uvs.empty() ? nullptr : mesh.uvs.data();
  shape.view.triangles = mesh.triangles.data();
  shape.rays = RayShape::triangles(mesh.positions, mesh.triangles);
  measure(shape);
}

void toWorldSpace(TriangleMesh& mesh, const Matrix4& toWorld) {
  const Affine map(toWorld), inverse(toWorld.inverse());
  for (Vec3& p : mesh.positions) p = map.point(p);
  for (Vec3& n : mesh.normals) n = inverse.transposed(n);
}

// A mirror image turns triangles over; shapes that know their outside turn them back.
void keepOutside(TriangleMesh& mesh, const Matrix4& toWorld) {
  if (toWorld.determinant3() < 0)
    for (auto& t : mesh.triangles) std::swap(t[1], t[2]);
}

// The inside of a closed boundary is where its volume is, however its triangles are wound: by the sign of that volume.
void turnOutward(TriangleMesh& mesh) {
  double sixfold = 0;
  const Vec3 origin = mesh.positions.front();
  for (const auto& t : mesh.triangles) {
    const Vec3 a = mesh.positions[t[0]] - origin, b = mesh.positions[t[1]] - origin, c = mesh.positions[t[2]] - origin;
    sixfold += static_cast<double>(dot(a, cross(b, c)));
  }
  if (sixfold < 0)
    for (auto& t : mesh.triangles) std::swap(t[1], t[2]);
}

void buildRectangle(BuildContext&, PluginReader& reader, Role role, BuiltShape& shape) {
  const Matrix4 toWorld = reader.transform("to_world");
  shape.mesh.positions = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
  shape.mesh.uvs = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  shape.mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  toWorldSpace(shape.mesh, toWorld);
  keepOutside(shape.mesh, toWorld);
  finishMesh(shape, role);
  const std::vector<Vec3>& p = shape.mesh.positions;
  const bool mirrored = toWorld.determinant3() < 0;  // the normal is along edgeX x edgeY
  RectangleView r{p[0], p[mirrored ? 3 : 1] - p[0], p[mirrored ? 1 : 3] - p[0], {}};
  r.normal = normalize(cross(r.edgeX, r.edgeY));
  if (mirrored) std::swap(r.uvX, r.uvY);
  const bool sheared = std::fabs(dot(r.edgeX, r.edgeY)) > 1e-5f * length(r.edgeX) * length(r.edgeY);
  if (!sheared) shape.rectangle = r;
}

// Texture coordinates on the face of the unit cube with that outward normal, as in Mitsuba 3.
Vec2 cubeUv(Vec3 normal, Vec3 p) {
  const Vec2 uv = normal.x != 0  ? Vec2{p.y, normal.x > 0 ? -p.z : p.z}
                  : normal.y > 0 ? Vec2{-p.x, -p.z}
                  : normal.y < 0 ? Vec2{p.z, p.x}
                                 : Vec2{normal.z > 0 ? p.y : -p.y, p.x};
  return {0.5f * (1 + uv.x), 0.5f * (1 + uv.y)};
}

TriangleMesh unitCube() {
  // Corners of the faces, counterclockwise from outside; bit i of a corner's number is its place along axis i.
  constexpr int kFaces[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
  const Bounds unit{Vec3(-1), Vec3(1)};
  TriangleMesh mesh;
  for (uint32_t face = 0; face < 6; ++face) {
    Vec3 normal;
    normal[static_cast<int>(face / 2)] = face % 2 == 0 ? -1.f : 1.f;
    for (const int corner : kFaces[face]) {
      mesh.positions.push_back(unit.corner(corner));
      mesh.uvs.push_back(cubeUv(normal, mesh.positions.back()));
    }
    mesh.triangles.push_back({4 * face, 4 * face + 1, 4 * face + 2});
    mesh.triangles.push_back({4 * face, 4 * face + 2, 4 * face + 3});
  }
  return mesh;
}

void buildCube(BuildContext&, PluginReader& reader, Role role, BuiltShape& shape) {
  const Matrix4 toWorld = reader.transform("to_world");
  shape.mesh = unitCube();
  toWorldSpace(shape.mesh, toWorld);
  keepOutside(shape.mesh, toWorld);
  finishMesh(shape, role);
  if (role == Role::boundary && shape.view.orientation > 0) shape.rays = RayShape::box(toWorld);
}

// The factor by which a transform scales, if it does so evenly along its first `axes` axes; otherwise an error.
float evenScale(PluginReader& reader, const Affine& map, int axes) {
  const Vec3 columns[] = {map.x, map.y, map.z};
  const float scale = length(map.x);
  for (int i = 0; i < axes; ++i) {
    const bool skewed = i > 0 && std::fabs(dot(columns[i], columns[i - 1])) > 1e-4f * scale * scale;
    if (std::fabs(length(columns[i]) - scale) > 1e-4f * scale || skewed ||
        (i == 2 && std::fabs(dot(columns[2], columns[0])) > 1e-4f * scale * scale))
      reader.fail("to_world", fmt::format("a {}'s transform must scale evenly and not shear", reader.node().type),
                  "use a mesh for an ellipsoid or ellipse");
  }
  return scale;
}

// Where texture coordinates begin.
void placeAxes(ShapeView& view, const Affine& map) {
  view.axisX = normalize(map.x);
  view.axisY = normalize(map.y);
  view.axisZ = normalize(map.z);
}

void buildSphere(BuildContext&, PluginReader& reader, Role, BuiltShape& shape) {
  const Affine map(reader.transform("to_world"));
  const float radius = evenScale(reader, map, 3) * reader.number("radius", 1, reader.positive());
  const Vec3 center = map.point(reader.vector("center", {}));
  shape.view.kind = ShapeView::Kind::sphere;
  shape.view.center = center;
  shape.view.radius = radius;
  placeAxes(shape.view, map);
  shape.rays = RayShape::sphere(center, radius);
  shape.view.area = 4 * kPi * radius * radius;
  shape.bounds = {center - Vec3(radius), center + Vec3(radius)};
}

void buildDisk(BuildContext&, PluginReader& reader, Role, BuiltShape& shape) {
  const Matrix4 toWorld = reader.transform("to_world");
  const Affine map(toWorld);
  const float radius = evenScale(reader, map, 2);
  shape.view.kind = ShapeView::Kind::disk;
  shape.view.center = map.translation;
  shape.view.normal = normalize(Affine(toWorld.inverse()).transposed({0, 0, 1}));
  shape.view.radius = radius;
  placeAxes(shape.view, map);
  shape.rays = RayShape::disk(map.translation, shape.view.normal, radius);
  shape.view.area = kPi * radius * radius;
  shape.openEdges = 1;
  shape.bounds = {map.translation - Vec3(radius), map.translation + Vec3(radius)};
}

// The unit tube along z, radius 1, to the one that the parameters mean.
Matrix4 cylinderToWorld(PluginReader& reader) {
  const Vec3 p0 = reader.vector("p0", {0, 0, 0}), p1 = reader.vector("p1", {0, 0, 1});
  const float radius = reader.number("radius", 1, reader.positive()), length = distance(p0, p1);
  if (!(length > 0)) reader.fail("p1", "\"p0\" and \"p1\" are the same point");
  const Frame frame((p1 - p0) / length);
  const Vec3 columns[] = {frame.s * radius, frame.t * radius, p1 - p0, p0};
  Matrix4 local;
  for (int column = 0; column < 4; ++column)
    for (int row = 0; row < 3; ++row) local(row, column) = static_cast<double>(columns[column][row]);
  return reader.transform("to_world") * local;
}

void buildCylinder(BuildContext&, PluginReader& reader, Role, BuiltShape& shape) {
  const Affine map(cylinderToWorld(reader));
  const float radius = evenScale(reader, map, 2), length = virga::length(map.z);
  if (std::fabs(dot(map.z, map.x)) + std::fabs(dot(map.z, map.y)) > 1e-4f * length * radius)
    reader.fail("to_world", "a cylinder's transform must not shear it", "use a mesh for a slanted tube");
  ShapeView& view = shape.view;
  view.kind = ShapeView::Kind::cylinder;
  view.center = map.translation;
  placeAxes(view, map);
  view.normal = view.axisZ;
  view.radius = radius;
  view.length = length;
  shape.rays = RayShape::cylinder(view.center, view.normal, radius, length);
  shape.view.area = kTwoPi * radius * length;
  shape.openEdges = 2;
  for (const Vec3 end : {view.center, view.center + view.normal * length}) {
    shape.bounds.extend(end - Vec3(radius));
    shape.bounds.extend(end + Vec3(radius));
  }
}

template <MeshFormat format>
void buildMesh(BuildContext& context, PluginReader& reader, Role role, BuiltShape& shape) {
  const std::filesystem::path path = context.file(reader, "filename");
  try {
    shape.mesh = loadMesh(path, format);
  } catch (const Error& error) {
    throw error.at(reader.positionOf("filename"));
  }
  const bool flat = reader.boolean("face_normals", false);
  if (flat) shape.mesh.normals.clear();
  // The pictures of OBJ files begin below, Mitsuba's above.
  if (reader.boolean("flip_tex_coords", format == MeshFormat::obj))
    for (Vec2& uv : shape.mesh.uvs) uv.y = 1 - uv.y;
  toWorldSpace(shape.mesh, reader.transform("to_world"));
  if (role != Role::surface) makeWindingAgree(shape.mesh);
  if (role == Role::boundary) turnOutward(shape.mesh);
  if (!flat && role != Role::boundary && shape.mesh.normals.empty()) makeNormalsSmooth(shape.mesh);
  finishMesh(shape, role);
}

using Build = void (*)(BuildContext&, PluginReader&, Role, BuiltShape&);
constexpr PluginRow<Build> kShapes[] = {{"sphere", buildSphere},
                                        {"rectangle", buildRectangle},
                                        {"cube", buildCube},
                                        {"disk", buildDisk},
                                        {"cylinder", buildCylinder},
                                        {"obj", buildMesh<MeshFormat::obj>},
                                        {"ply", buildMesh<MeshFormat::ply>}};

// Geometry by its parameters: what hangs on the shape (materials, media, lights) may change without building it again.
std::shared_ptr<const BuiltShape> geometry(BuildContext& context, PluginReader& reader, Role role) {
  const Build build = findPlugin(reader.node(), kShapes, kNotYet);
  std::string key = parameterKey(reader.node()) + std::string(kRoleNames[static_cast<size_t>(role)]);
  for (const Property& p : reader.node().properties)
    if (p.name == "filename") key += fileKey(context.file(reader, "filename"));
  // The parameters are read (and checked) in any case, so that unused ones are known.
  auto shape = std::make_shared<BuiltShape>();
  const bool known = context.previous && context.previous->shapes.contains(key);
  if (known) {
    for (const Property& p : reader.node().properties)
      if (!std::holds_alternative<NodePtr>(p.value)) reader.ignore(p.name);
  } else {
    shape->view.orientation = reader.boolean("flip_normals", false) ? -1.f : 1.f;
    build(context, reader, role, *shape);
    if (!(shape->view.area > 0)) reader.failHere("the shape has no area");
  }
  return context.cached<BuiltShape>(&PartCache::shapes, key, [&] { return shape; });
}

MediumTransition mediaOf(BuildContext& context, PluginReader& reader) {
  MediumTransition media;
  if (const NodePtr interior = reader.child("medium", "interior")) media.interior = buildMedium(context, *interior);
  if (const NodePtr exterior = reader.child("medium", "exterior")) media.exterior = buildMedium(context, *exterior);
  return media;
}

// A sheet between two media is well; one medium alone needs a closed shape around it.
void warnIfOpen(PluginReader& reader, const MediumTransition& media, const BuiltShape& shape) {
  if (shape.openEdges == 0 || media.interior == MediumTransition::kNone || media.exterior != MediumTransition::kNone)
    return;
  const Node& node = reader.node();
  reader.diagnostics().warn(
      Error(fmt::format("the {}{} holds a medium and is open: {} of its edges have no neighbour that agrees, and light "
                        "that passes beside it takes the wrong medium along",
                        node.type, node.hasGeneratedId() ? "" : fmt::format(" \"{}\"", node.id), shape.openEdges),
            {node.typePosition.known() ? node.typePosition : node.position, "close it", {}}));
}

// A shape without a bsdf is a grey one; a lamp without one is black (as Mitsuba has it).
int defaultBsdf(BuildContext& context, bool emits) {
  SurfaceBsdf grey;
  grey.front = Bsdf(Diffuse{emits ? Rgb(0.f) : Rgb(0.5f)});
  context.parts.bsdfs.push_back(grey);
  return static_cast<int>(context.parts.bsdfs.size()) - 1;
}

void addBoundary(BuildContext& context, MediumTransition media, std::shared_ptr<const BuiltShape> shape) {
  if (media.interior == MediumTransition::kNone && media.exterior == MediumTransition::kNone) return;  // invisible
  // Only closed shapes can add: of an open one nobody knows whether a point lies in it. Two sheets bound a slab.
  media.closed = shape->openEdges == 0;
  media.replaces = media.exterior != MediumTransition::kNone || !media.closed;
  context.parts.boundaries.push_back(media);
  context.parts.boundaryShapes.push_back(std::move(shape));
}

}  // namespace

void buildShape(BuildContext& context, const Node& node) {
  PluginReader reader(node, context.diagnostics);
  const NodePtr bsdf = reader.child("bsdf"), emitter = reader.child("emitter");
  const bool null = bsdf && isNullBsdf(*bsdf);
  if (null && emitter) reader.failHere("an area emitter on a shape with a null bsdf is not supported yet");
  const bool filled = reader.child("medium", "interior") != nullptr;
  auto shape = geometry(context, reader, null ? Role::boundary : filled ? Role::vessel : Role::surface);
  MediumTransition media = mediaOf(context, reader);
  warnIfOpen(reader, media, *shape);
  reader.finish();
  if (bsdf) buildBsdf(context, *bsdf);
  if (null) return addBoundary(context, media, std::move(shape));

  media.replaces = media.interior != MediumTransition::kNone || media.exterior != MediumTransition::kNone;
  ShapeView view = shape->view;
  view.bsdf = bsdf ? buildBsdf(context, *bsdf) : defaultBsdf(context, emitter != nullptr);
  view.media = media;
  const int index = static_cast<int>(context.parts.surfaces.size());
  context.parts.surfaces.push_back(view);
  context.parts.surfaceShapes.push_back(shape);
  if (emitter) addAreaEmitter(context, *emitter, index, *shape);
}

}  // namespace virga
