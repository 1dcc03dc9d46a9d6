// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "image/layers.h"

namespace virga {

/// Where light was scattered on its way to the eye, as far as the layers need to know. Specular vertices are not
/// recorded, only that there was one between x1 and the light.
class LayerPath {
 public:
  enum class Vertex : uint8_t { none, surface, medium };

  VIRGA_HD void scatter(Vertex v) {
    if (x1_ == Vertex::none) {
      x1_ = v;
      specular_ = false;
    } else if (x2_ == Vertex::none) {
      x2_ = v;
    }
  }
  VIRGA_HD void scatterSpecularly() { specular_ = true; }

  /// The layer of light that is met or connected to now.
  VIRGA_HD Layer layer() const {
    if (x1_ == Vertex::none) return Layer::emission;
    const bool surface = x1_ == Vertex::surface;
    if (x2_ == Vertex::none) {
      if (specular_) return surface ? Layer::causticSurface : Layer::causticMedia;
      return surface ? Layer::directSurface : Layer::directMedia;
    }
    if (x2_ == Vertex::surface) return surface ? Layer::surfaceToSurface : Layer::surfaceToMedia;
    return surface ? Layer::mediaToSurface : Layer::mediaToMedia;
  }

 private:
  Vertex x1_ = Vertex::none, x2_ = Vertex::none;
  bool specular_ = false;
};

}  // namespace virga
