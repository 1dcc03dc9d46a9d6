// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "scene/build_context.h"

namespace virga {
namespace {

constexpr std::string_view kNotYet[] = {"cylinder",   "gltf",         "shapegroup",  "instance",
                                        "serialized", "bsplinecurve", "linearcurve", "sdfgrid"};

/// What a shape's surface is for: boundaries need no triangles where an analytic form will do.
enum class Role { surface, boundary };

void measure(BuiltShape& shape) {
  std::vector<float> areas;
  const std::vector<Vec3>& p = shape.mesh.positions;
  for (const auto& t : shape.mesh.triangles)
    areas.push_back(0.5f * length(cross(p[t[1]] - p[t[0]], p[t[2]] - p[t[0]])));
  shape.triangleChoice = Discrete(areas);
  shape.area = static_cast<float>(shape.triangleChoice.total());
  for (const Vec3& v : p) shape.bounds.extend(v);
}

// Takes a mesh in world space.
void finishMesh(BuiltShape& shape) {
  TriangleMesh& mesh = shape.mesh;
  mesh.positions.reserve(mesh.positions.size() + 2);  // Embree reads 16 bytes at the last vertex
  shape.view.kind = ShapeView::Kind::mesh;
  shape.view.positions = mesh.positions.data();
  shape.view.normals = mesh.normals.empty() ? nullptr : mesh.normals.data();
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

void buildRectangle(BuildContext&, PluginReader& reader, Role, BuiltShape& shape) {
  const Matrix4 toWorld = reader.transform("to_world");
  shape.mesh.positions = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
  shape.mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  toWorldSpace(shape.mesh, toWorld);
  keepOutside(shape.mesh, toWorld);
  finishMesh(shape);
  const std::vector<Vec3>& p = shape.mesh.positions;
  const bool mirrored = toWorld.determinant3() < 0;  // the normal is along edgeX x edgeY
  const RectangleView r{p[0], p[mirrored ? 3 : 1] - p[0], p[mirrored ? 1 : 3] - p[0]};
  const bool sheared = std::fabs(dot(r.edgeX, r.edgeY)) > 1e-5f * length(r.edgeX) * length(r.edgeY);
  if (!sheared) shape.rectangle = r;
}

void buildCube(BuildContext&, PluginReader& reader, Role role, BuiltShape& shape) {
  const Matrix4 toWorld = reader.transform("to_world");
  const Bounds unit{Vec3(-1), Vec3(1)};
  for (int i = 0; i < 8; ++i) shape.mesh.positions.push_back(unit.corner(i));
  shape.mesh.triangles = {{0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}, {0, 1, 5}, {0, 5, 4},
                          {2, 6, 7}, {2, 7, 3}, {0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}};
  toWorldSpace(shape.mesh, toWorld);
  keepOutside(shape.mesh, toWorld);
  finishMesh(shape);
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

void buildSphere(BuildContext&, PluginReader& reader, Role, BuiltShape& shape) {
  const Affine map(reader.transform("to_world"));
  const float radius = evenScale(reader, map, 3) * reader.number("radius", 1, reader.positive());
  const Vec3 center = map.point(reader.vector("center", {}));
  shape.view.kind = ShapeView::Kind::sphere;
  shape.view.center = center;
  shape.view.radius = radius;
  shape.rays = RayShape::sphere(center, radius);
  shape.area = 4 * kPi * radius * radius;
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
  shape.rays = RayShape::disk(map.translation, shape.view.normal, radius);
  shape.area = kPi * radius * radius;
  shape.bounds = {map.translation - Vec3(radius), map.translation + Vec3(radius)};
}

template <MeshFormat format>
void buildMesh(BuildContext& context, PluginReader& reader, Role role, BuiltShape& shape) {
  const std::filesystem::path path = context.file(reader, "filename");
  try {
    shape.mesh = loadMesh(path, format);
  } catch (const Error& error) {
    throw error.at(reader.positionOf("filename"));
  }
  if (reader.boolean("face_normals", false)) shape.mesh.normals.clear();
  reader.ignore("flip_tex_coords");
  toWorldSpace(shape.mesh, reader.transform("to_world"));
  if (role == Role::boundary) turnOutward(shape.mesh);
  finishMesh(shape);
}

using Build = void (*)(BuildContext&, PluginReader&, Role, BuiltShape&);
constexpr PluginRow<Build> kShapes[] = {
    {"sphere", buildSphere}, {"rectangle", buildRectangle},       {"cube", buildCube},
    {"disk", buildDisk},     {"obj", buildMesh<MeshFormat::obj>}, {"ply", buildMesh<MeshFormat::ply>}};

// Geometry by its parameters: what hangs on the shape (materials, media, lights) may change without building it again.
std::shared_ptr<const BuiltShape> geometry(BuildContext& context, PluginReader& reader, Role role) {
  const Build build = findPlugin(reader.node(), kShapes, kNotYet);
  std::string key = parameterKey(reader.node()) + (role == Role::boundary ? "boundary" : "surface");
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
    if (!(shape->area > 0)) reader.failHere("the shape has no area");
  }
  return context.cached<BuiltShape>(&PartCache::shapes, key, [&] { return shape; });
}

MediumTransition mediaOf(BuildContext& context, PluginReader& reader) {
  MediumTransition media;
  if (const NodePtr interior = reader.child("medium", "interior")) media.interior = buildMedium(context, *interior);
  if (const NodePtr exterior = reader.child("medium", "exterior")) media.exterior = buildMedium(context, *exterior);
  return media;
}

// A shape without a bsdf is a grey one; a lamp without one is black (as Mitsuba has it).
int defaultBsdf(BuildContext& context, bool emits) {
  context.parts.bsdfs.push_back({Bsdf(Diffuse{emits ? Rgb(0.f) : Rgb(0.5f)}), Bsdf(), false});
  return static_cast<int>(context.parts.bsdfs.size()) - 1;
}

void addBoundary(BuildContext& context, MediumTransition media, std::shared_ptr<const BuiltShape> shape) {
  media.replaces = media.exterior != MediumTransition::kNone;
  if (!media.declared()) return;  // nothing on either side: the shape is invisible
  context.parts.boundaries.push_back(media);
  context.parts.boundaryShapes.push_back(std::move(shape));
}

}  // namespace

void buildShape(BuildContext& context, const Node& node) {
  PluginReader reader(node, context.diagnostics);
  const NodePtr bsdf = reader.child("bsdf"), emitter = reader.child("emitter");
  const bool null = bsdf && isNullBsdf(*bsdf);
  if (null && emitter) reader.failHere("an area emitter on a shape with a null bsdf is not supported yet");
  auto shape = geometry(context, reader, null ? Role::boundary : Role::surface);
  MediumTransition media = mediaOf(context, reader);
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
