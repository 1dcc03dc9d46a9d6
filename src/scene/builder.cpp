// SPDX-License-Identifier: Apache-2.0
#include "scene/builder.h"

#include <fmt/format.h>

#include <system_error>

#include "scene/build_context.h"
#include "scene/deepest_overlap.h"

namespace virga {
namespace {

using RayScenePtr = std::shared_ptr<const RayScene>;

RayScenePtr raysOf(const std::vector<std::shared_ptr<const BuiltShape>>& shapes, const RayScenePtr& previous) {
  RayScene::Shapes rays;
  for (const auto& s : shapes) rays.push_back(s->rays);
  if (previous && previous->shapes() == rays) return previous;
  return std::make_shared<const RayScene>(std::move(rays), previous.get());
}

void linkShapes(Scene& scene, Scene::Parts& parts, const SceneSnapshot& previous) {
  scene.surfaceRays = raysOf(parts.surfaceShapes, previous ? previous->surfaceRays : nullptr);
  scene.boundaryRays = raysOf(parts.boundaryShapes, previous ? previous->boundaryRays : nullptr);
}

void linkViews(Scene& scene, const Scene::Parts& parts) {
  SceneView& view = scene.view;
  view.surfaces = viewOf(parts.surfaces);
  view.boundaries = viewOf(parts.boundaries);
  view.bsdfs = viewOf(parts.bsdfs);
  view.textures = viewOf(parts.textures);
  view.media = viewOf(parts.media);
  view.emitters = viewOf(parts.emitters);
  view.lamps = viewOf(parts.lamps);
  view.emitterChoice = parts.emitterChoice.view();
  for (const ShapeView& s : parts.surfaces) view.thinGlass |= parts.bsdfs[static_cast<size_t>(s.bsdf)].front.isThin();
  for (const MediumView& m : parts.media) {
    view.chromatic |= !m.grey;
    view.emissive |= m.emits;
  }
}

void measureBounds(Scene& scene, const Scene::Parts& parts) {
  Bounds bounds;
  for (const auto& s : parts.surfaceShapes) bounds.extend(s->bounds);
  for (const auto& s : parts.boundaryShapes) bounds.extend(s->bounds);
  if (bounds.empty()) bounds.extend(scene.camera.toWorld.translation);
  scene.view.bounds = bounds;
  scene.view.scale = std::max(maxComponent(max(abs(bounds.lo), abs(bounds.hi))), 1e-6f);
}

void findMediaOfLights(const Scene& scene, Scene::Parts& parts) {
  for (EmitterView& e : parts.emitters) {
    if (!e.isLocal()) continue;
    const LightPoint on = sampleLightPoint(scene.view, e, {0.5f, 0.5f});
    MediaState media = mediaAt(scene, on.p + on.normal * (4 * kHitError * scene.view.scale));
    if (media.vacuum()) media.setBase(scene.view.cameraMedia.base());  // fog without end is around the camera, too
    if (media.count() == 1) e.medium = media.medium(0);
  }
}

void warnOfOverlaps(BuildContext& context) {
  std::vector<Bounds> boxes;
  for (size_t i = 0; i < context.parts.boundaries.size(); ++i)
    if (!context.parts.boundaries[i].replaces) boxes.push_back(context.parts.boundaryShapes[i]->bounds);
  if (deepestOverlap(std::move(boxes), MediaState::kCapacity + 1) > MediaState::kCapacity)
    context.diagnostics.warnings.push_back(
        fmt::format("warning: more than {0} volumes may overlap; where more than {0} do, the others are left out",
                    MediaState::kCapacity));
}

void warnOfMedia(BuildContext& context) {
  if (context.wantsNoMedia && !context.parts.media.empty())
    context.diagnostics.warnings.push_back(
        "warning: integrator \"path\" is ignored: it renders no media, and the method of --method does");
}

// What makes a picture black, or leaves light out, without being an error.
void warnOfDarkness(BuildContext& context) {
  const Scene::Parts& parts = context.parts;
  if (!(parts.emitterChoice.total() > 0) && !context.scene.view.emissive)
    context.diagnostics.warnings.push_back("warning: nothing in the scene shines: its picture is black");
  const bool points =
      std::any_of(parts.emitters.begin(), parts.emitters.end(), [](const EmitterView& e) { return e.isDelta(); });
  const bool mirrors = std::any_of(parts.surfaces.begin(), parts.surfaces.end(), [&](const ShapeView& s) {
    const SurfaceBsdf& bsdf = parts.bsdfs[static_cast<size_t>(s.bsdf)];
    return bsdf.front.specular() || bsdf.back.specular();
  });
  if (points && mirrors)
    context.diagnostics.warnings.push_back(
        "warning: light of point, spot and directional emitters that smooth conductors, dielectrics and "
        "thindielectrics mirror or refract is missing: in path from the caustic_*, surface_to_* and media_to_* layers, "
        "in ims from caustic_* and in part from the others; give such lamps a small area");
}

// The eye may stand exactly on a boundary. Whether it is inside is asked a little beside it, and each camera ray
// crosses from there to its own start.
void placeCamera(Scene& scene) {
  SceneView& view = scene.view;
  const Vec3 eye = scene.camera.toWorld.translation, aside = normalize(Vec3(0.3217f, -0.6182f, 0.7171f));
  view.cameraMediaPoint = eye + aside * (4 * kHitError * std::max(maxComponent(abs(eye)), 1e-2f * view.scale));
  const int declared = view.cameraMedia.base();
  view.cameraMedia = mediaAt(scene, view.cameraMediaPoint);
  if (declared != MediaState::kNone) view.cameraMedia.setBase(declared);
}

NodePtr onlyChild(PluginReader& reader, std::string_view tag) {
  const std::vector<NodePtr> found = reader.children(tag);
  if (found.size() > 1)
    throw Error(fmt::format("the scene has {} {}s", found.size(), tag), {found[1]->position, "keep one of them", {}});
  return found.empty() ? nullptr : found[0];
}

}  // namespace

std::filesystem::path BuildContext::file(PluginReader& reader, std::string_view parameter) const {
  const std::string name = reader.text(parameter, "");
  if (name.empty()) reader.fail(parameter, fmt::format("\"{}\" is missing", parameter));
  if (const auto found = findFile(description, name)) return *found;
  std::vector<std::string> tried;
  if (!std::filesystem::path(name).is_absolute())
    for (const auto& directory : description.searchPaths) tried.push_back("looked in " + directory.string());
  reader.fail(parameter, fmt::format("file \"{}\" not found", name), "", tried);
}

void failUnknownType(const Node& node, std::span<const std::string_view> available,
                     std::span<const std::string_view> notYet) {
  std::vector<std::string> known(available.begin(), available.end());
  std::sort(known.begin(), known.end());
  const std::vector<std::string> notes{"available: " + joined(known)};
  const SourcePosition position = node.typePosition.known() ? node.typePosition : node.position;
  if (std::find(notYet.begin(), notYet.end(), node.type) != notYet.end())
    throw Error(fmt::format("{} type \"{}\" is not supported yet", node.tag, node.type), {position, "", notes});
  throw Error(fmt::format("unknown {} type \"{}\"", node.tag, node.type),
              {position, didYouMean(node.type, known), notes});
}

std::string parameterKey(const Node& node) {
  Node bare{node.tag, node.type, "_", {}, {}, {}};
  for (const Property& p : node.properties)
    if (!std::holds_alternative<NodePtr>(p.value)) bare.properties.push_back(p);
  return toXml({std::make_shared<const Node>(std::move(bare)), {}});
}

std::string fileKey(const std::filesystem::path& path) {
  std::error_code ignored;
  const auto time = std::filesystem::last_write_time(path, ignored).time_since_epoch().count();
  return fmt::format("{}@{}", path.string(), time);
}

SceneSnapshot buildScene(const SceneDescription& description, const BuildOptions& options,
                         const SceneSnapshot& previous) {
  VIRGA_ASSERT(description.root);
  auto scene = std::make_shared<Scene>();
  auto parts = std::make_shared<Scene::Parts>();
  scene->description = description;
  BuildContext context{description, options, {.lenient = options.lenient, .warnings = {}},
                       *scene,      *parts,  previous ? &previous->parts->cache : nullptr,
                       false,       {},      {}};

  PluginReader reader(*description.root, context.diagnostics);
  if (const NodePtr integrator = onlyChild(reader, "integrator")) buildIntegrator(context, *integrator);
  for (const NodePtr& shape : reader.children("shape")) buildShape(context, *shape);
  for (const NodePtr& emitter : reader.children("emitter")) buildEmitter(context, *emitter);
  // Definitions for others to refer to; checked even where nobody does.
  for (const NodePtr& bsdf : reader.children("bsdf")) buildBsdf(context, *bsdf);
  for (const NodePtr& texture : reader.children("texture")) checkTexture(context, *texture);
  for (const NodePtr& medium : reader.children("medium")) buildMedium(context, *medium);
  for (const char* tag : {"phase", "volume", "film", "rfilter", "sampler"}) reader.ignoreChildren(tag);
  const NodePtr sensor = onlyChild(reader, "sensor");
  if (!sensor) reader.failHere("the scene has no sensor", "add a <sensor type=\"perspective\">");
  buildSensor(context, *sensor);
  reader.finish();

  linkShapes(*scene, *parts, previous);
  measureBounds(*scene, *parts);
  checkLimits(context);
  warnOfOverlaps(context);
  chooseEmittersByPower(context);
  measureLamps(context);
  linkViews(*scene, *parts);
  warnOfDarkness(context);
  placeCamera(*scene);
  findMediaOfLights(*scene, *parts);
  warnOfMedia(context);
  scene->warnings = context.diagnostics.warnings;
  scene->parts = std::move(parts);
  return scene;
}

}  // namespace virga
