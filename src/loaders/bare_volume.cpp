// SPDX-License-Identifier: Apache-2.0
#include "loaders/bare_volume.h"

#include <fmt/format.h>

#include <array>
#include <cmath>

#include "volume/volume_io.h"

namespace virga {
namespace {

constexpr float kFieldOfView = 35;   // [degrees], both ways: the film is square
constexpr float kFrameFill = 0.92f;  // of the frame's half width
constexpr float kMinAspect = 1e-3f;  // thinner boxes are padded
constexpr int64_t kFilmSize = 512;   // [pixels]

NodePtr node(std::string tag, std::string type, std::string id, std::vector<Property> properties) {
  return std::make_shared<const Node>(
      Node{.tag = std::move(tag), .type = std::move(type), .id = std::move(id), .properties = std::move(properties)});
}

Property child(NodePtr node, std::string name = "") { return {.name = std::move(name), .value = std::move(node)}; }

std::array<double, 3> doubles(Vec3 v) { return {v.x, v.y, v.z}; }

Matrix4 translation(Vec3 v) { return Matrix4::translation(v.x, v.y, v.z); }
Matrix4 scaling(Vec3 v) { return Matrix4::scaling(v.x, v.y, v.z); }

// The camera looks down a little, from the front right. Y is up.
struct View {
  Vec3 forward = normalize(Vec3(-0.45f, -0.22f, -1));
  Vec3 left = normalize(cross(Vec3(0, 1, 0), forward));
  Vec3 up = cross(forward, left);
};

// Every corner c of the box, seen from its centre, must fit: |c.left| <= (distance + c.forward) tan(fov / 2) fill.
float fittingDistance(const View& view, const Bounds& box) {
  const float slope = std::tan(kFieldOfView / 2 * kPi / 180) * kFrameFill;
  float distance = 0;
  for (int i = 0; i < 8; ++i) {
    const Vec3 c = box.corner(i) - box.center();
    const float sideways = std::max(std::fabs(dot(c, view.left)), std::fabs(dot(c, view.up)));
    distance = std::max(distance, sideways / slope - dot(c, view.forward));
  }
  return distance;
}

NodePtr film() {
  return node("film", "hdrfilm", "film",
              {{.name = "width", .value = kFilmSize},
               {.name = "height", .value = kFilmSize},
               child(node("rfilter", "box", "filter", {}))});
}

NodePtr camera(const View& view, const Bounds& box) {
  const float distance = fittingDistance(view, box);
  const Vec3 origin = box.center() - view.forward * distance;
  const double size = maxComponent(box.extent());
  return node("sensor", "perspective", "camera",
              {{.name = "fov", .value = double{kFieldOfView}},
               {.name = "near_clip", .value = 1e-3 * distance},
               {.name = "far_clip", .value = distance + 100 * size},
               {.name = "to_world", .value = Matrix4::lookAt(doubles(origin), doubles(box.center()), {0, 1, 0})},
               child(film())});
}

NodePtr keyLight(const View& view) {
  const Vec3 towardsLight = normalize(view.left + view.up * 0.9f - view.forward * 0.3f);
  return node("emitter", "directional", "key",
              {{.name = "direction", .value = -towardsLight}, {.name = "irradiance", .value = Rgb(4, 3.8f, 3.5f)}});
}

NodePtr sky() { return node("emitter", "constant", "sky", {{.name = "radiance", .value = Rgb(0.12f, 0.14f, 0.18f)}}); }

NodePtr ground(const Bounds& box) {
  const float size = maxComponent(box.extent());
  const Vec3 centre(box.center().x, box.lo.y - 0.02f * size, box.center().z);
  const Matrix4 toWorld = translation(centre) * Matrix4::rotation(1, 0, 0, -90) * scaling(Vec3(30 * size));
  return node("shape", "rectangle", "ground",
              {{.name = "to_world", .value = toWorld},
               child(node("bsdf", "diffuse", "grey", {{.name = "reflectance", .value = Rgb(0.3f)}}))});
}

NodePtr density(const BareVolume& volume, const Bounds& box) {
  std::vector<Property> properties{{.name = "filename", .value = std::filesystem::absolute(volume.file).string()}};
  if (volumeFormat(volume.file) == VolumeFormat::vol) {
    properties.push_back({.name = "to_world", .value = translation(box.lo) * scaling(box.extent())});
    return node("volume", "gridvolume", "density", std::move(properties));
  }
  if (!volume.grid.empty()) properties.push_back({.name = "grid", .value = volume.grid});
  return node("volume", "vdb", "density", std::move(properties));
}

NodePtr medium(const BareVolume& volume, const Bounds& box) {
  const double typical = volume.meanDensity > 0 ? volume.meanDensity : volume.maximumDensity;
  const Vec3 extent = box.extent();
  const double across = (double{extent.x} + extent.y + extent.z) / 3;
  return node("medium", "heterogeneous", "medium",
              {child(density(volume, box), "sigma_t"),
               {.name = "scale", .value = volume.thickness / (typical * across)},
               {.name = "albedo", .value = Rgb(0.95f)},
               child(node("phase", "isotropic", "phase", {}))});
}

NodePtr mediumBox(const BareVolume& volume, const Bounds& box) {
  return node("shape", "cube", "box",
              {{.name = "to_world", .value = translation(box.center()) * scaling(box.extent() * 0.5f)},
               child(node("bsdf", "null", "boundary", {})),
               child(medium(volume, box), "interior")});
}

// What there is to see, with some thickness in every direction.
Bounds visibleBox(const BareVolume& volume) {
  const auto fail = [&](std::string_view why) -> Error {
    return Error(fmt::format("nothing to see in \"{}\": {}", volume.file.string(), why));
  };
  Bounds box = volume.worldBounds;
  if (!(volume.maximumDensity > 0)) throw fail("all its values are 0");
  if (!std::isfinite(volume.maximumDensity) || !std::isfinite(volume.meanDensity))
    throw fail("its values are not finite");
  if (box.empty() || !isFinite(box.extent()) || maxComponent(box.extent()) == 0) throw fail("it has no extent");
  const float least = kMinAspect * maxComponent(box.extent());
  for (int i = 0; i < 3; ++i) {
    const float missing = std::max(0.f, least - box.extent()[i]);
    box.lo[i] -= missing / 2, box.hi[i] += missing / 2;
  }
  return box;
}

}  // namespace

SceneDescription describeBareVolume(const BareVolume& volume) {
  const Bounds box = visibleBox(volume);
  const View view;
  const NodePtr root = node("scene", "", "scene",
                            {child(camera(view, box)), child(keyLight(view)), child(sky()), child(ground(box)),
                             child(mediumBox(volume, box))});
  return {root, {std::filesystem::absolute(volume.file).parent_path()}};
}

}  // namespace virga
