// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "scattering/bsdf.h"
#include "scene/camera.h"
#include "scene/emitter.h"
#include "scene/medium.h"
#include "scene/shape.h"
#include "scene/texture.h"

namespace virga {

/// Length and pointer, as kernels take them.
template <class T>
struct View {
  const T* data = nullptr;
  int size = 0;

  VIRGA_HD const T& operator[](int i) const { return data[i]; }
  VIRGA_HD const T& operator[](uint32_t i) const { return data[i]; }
  VIRGA_HD const T* begin() const { return data; }
  VIRGA_HD const T* end() const { return data + size; }
};
/// Of a vector or the like, which must outlive it.
template <class Container>
View<typename Container::value_type> viewOf(const Container& c) {
  return {c.data(), static_cast<int>(c.size())};
}

/// Which of a bsdf's colours are textures: their indices in the scene, in the order of the bsdf's colours; -1: none.
struct BsdfTextures {
  static constexpr int kCapacity = 3;
  int index[kCapacity] = {-1, -1, -1};

  VIRGA_HD bool any() const { return index[0] >= 0 || index[1] >= 0 || index[2] >= 0; }
};

/// A surface's scattering, with a side each.
struct SurfaceBsdf {
  Bsdf front, back;
  bool twoSided = false;     ///< `back` is for the inside, in a frame turned over
  bool textured = false;     ///< some colour is a texture: see bsdfAt()
  bool anisotropic = false;  ///< the frame's tangent matters
  BsdfTextures frontTextures{}, backTextures{};
};

/// Everything a kernel needs to know of a scene, besides its rays. Plain data; the Scene owns what it points to.
struct SceneView {
  View<ShapeView> surfaces;           ///< in the order of the surfaces' RayScene
  View<MediumTransition> boundaries;  ///< in the order of the boundaries' RayScene
  View<SurfaceBsdf> bsdfs;
  View<TextureView> textures;
  View<MediumView> media;
  View<EmitterView> emitters;
  View<LampStrength> lamps;    ///< one for each emitter
  DiscreteView emitterChoice;  ///< by power
  bool chromatic = false;      ///< some medium's extinction differs between the channels
  bool thinGlass = false;      ///< some surface lets light straight through (Bsdf::isThin)
  bool emissive = false;       ///< some medium emits light
  int environment = -1;        ///< index of the constant or environment emitter, if any
  MediaState cameraMedia;      ///< at the point below, from where camera rays cross boundaries to their own starts
  Vec3 cameraMediaPoint;       ///< a little beside the eye
  Bounds bounds;               ///< of all shapes
  float scale = 1;             ///< [unit] largest coordinate of the bounds

  /// Has any emitter power? Media that glow do not count.
  VIRGA_HD bool hasLamps() const { return emitters.size > 0 && emitterChoice.cdf[emitters.size] > 0; }
};

/// A bsdf with the colours that its textures have at uv.
VIRGA_HD inline Bsdf bsdfAt(const SceneView& scene, Bsdf bsdf, const BsdfTextures& textures, Vec2 uv) {
  for (int i = 0; i < BsdfTextures::kCapacity; ++i)
    if (textures.index[i] >= 0) bsdf.setColor(i, scene.textures[textures.index[i]].lookup(uv));
  return bsdf;
}

/// Samples an emitter as seen from x; pdf counts directions, not the choice of the emitter.
VIRGA_HD inline LightSample sampleLight(const SceneView& scene, const EmitterView& emitter, Vec3 x, Vec2 u) {
  switch (emitter.kind) {
    case EmitterView::Kind::point:
    case EmitterView::Kind::spot:
      return towardPoint(emitter, x, {emitter.position, {}, 1, true});
    case EmitterView::Kind::directional:
      return {-emitter.direction, kInfinity, emitter.value, 1, true};
    case EmitterView::Kind::area: {
      const ShapeView& shape = scene.surfaces[emitter.shape];
      if (shape.kind == ShapeView::Kind::sphere) return sampleSphereLight(shape, emitter, x, u);
      if (emitter.isRectangle) return sampleRectangleLight(shape, emitter, x, u);
      return towardPoint(emitter, x, uniformPointOnShape(shape, emitter, u));
    }
    case EmitterView::Kind::constant:
      return {uniformSphere(u), kInfinity, emitter.value, kInv4Pi, false};
    case EmitterView::Kind::environment: {
      const auto s = emitter.environment.sample(u);
      return {s.w, kInfinity, emitter.environment.radiance(s.w), s.pdf, false};
    }
  }
  return {};
}

/// Radiance of the surroundings from direction w.
VIRGA_HD inline Rgb environmentRadiance(const EmitterView& emitter, Vec3 w) {
  return emitter.kind == EmitterView::Kind::constant ? emitter.value : emitter.environment.radiance(w);
}

/// Density [1/sr] with which sampleLight picks direction w of the surroundings.
VIRGA_HD inline float environmentPdf(const EmitterView& emitter, Vec3 w) {
  return emitter.kind == EmitterView::Kind::constant ? kInv4Pi : emitter.environment.pdf(w);
}

/// A point on an emitter at a finite distance, chosen independently of any receiver.
VIRGA_HD inline LightPoint sampleLightPoint(const SceneView& scene, const EmitterView& emitter, Vec2 u) {
  if (emitter.kind == EmitterView::Kind::area) return uniformPointOnShape(scene.surfaces[emitter.shape], emitter, u);
  return {emitter.position, {}, 1, true};
}

}  // namespace virga
