// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "image/layers.h"

namespace virga {

enum class VertexKind : uint8_t { none, surface, medium };

/// Where light was scattered on its way to the eye, as far as the layers need to know. Specular vertices are not
/// recorded, only that there was one between x1 and the light.
class LayerPath {
 public:
  VIRGA_HD void scatter(VertexKind v) {
    if (x1_ == VertexKind::none) {
      x1_ = v;
      specular_ = false;
    } else if (x2_ == VertexKind::none) {
      x2_ = v;
    }
  }
  VIRGA_HD bool hasX1() const { return x1_ != VertexKind::none; }
  VIRGA_HD bool hasX2() const { return x2_ != VertexKind::none; }
  VIRGA_HD void scatterSpecularly() { specular_ = true; }

  /// The layer of light that is met or connected to now.
  VIRGA_HD Layer layer() const {
    if (x1_ == VertexKind::none) return Layer::emission;
    const bool surface = x1_ == VertexKind::surface;
    if (x2_ == VertexKind::none) {
      if (specular_) return surface ? Layer::causticSurface : Layer::causticMedia;
      return surface ? Layer::directSurface : Layer::directMedia;
    }
    if (x2_ == VertexKind::surface) return surface ? Layer::surfaceToSurface : Layer::surfaceToMedia;
    return surface ? Layer::mediaToSurface : Layer::mediaToMedia;
  }

 private:
  VertexKind x1_ = VertexKind::none, x2_ = VertexKind::none;
  bool specular_ = false;
};

}  // namespace virga
