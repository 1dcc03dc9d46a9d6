// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/sampler.h"
#include "image/layers.h"
#include "methods/path/flight_light.h"
#include "transport/equiangular.h"
#include "transport/lamp_guide.h"
#include "transport/vertex.h"

namespace virga {

struct PathOptions {
  /// What light is looked for. Lamps: all but media that glow.
  enum class Sources { all, lamps, glow };

  int maxDepth = -1;  ///< segments; -1: no limit
  int rrDepth = 5;    ///< scattering events before Russian roulette
  int equiangularDepth =
      1;  ///< segments on which technique B aims at all lights; at small ones and those in thin fog it always does
  Sources sources = Sources::all;
  View<TabledLamp> tabled =
      {};  ///< lamps whose light is looked up (FlightLight); none where virtual lights are gathered
};

/// A path from the eye as far as PathTracer has followed it: a ray, and what it needs to know of the vertices before.
struct EyePath {
  /// How the last vertex chose the ray's direction: what multiple importance sampling needs when the ray meets a light.
  struct LastVertex {
    Vec3 p;
    Vec3 lampsFor;           ///< the place for whose light one of the lights was chosen
    float pdf = 0;           ///< [1/sr]
    bool connected = false;  ///< it sampled the lights too; not so the camera and specular vertices
    float t = 0;             ///< its place on `segment`, if that is active: it could have been found by technique B
    EquiangularSegment segment;
  };
  /// A light chosen before a flight, for a place on it.
  struct AheadChoice {
    EmitterChoice light;
    Vec3 lampsFor;
  };

  /// A vertex, and what the path had carried to it.
  struct Record {
    Vertex vertex;
    Rgb throughput;
  };
  /// The last vertex, if the light of virtual lights was gathered there (`ims`): then only what their clamping took of
  /// the light from the next vertex is still to be found.
  struct Link {
    bool active = false;
    Vec3 p;
    Vec3 normal;  ///< 0 in a medium
  };

  MediaRay at;
  float tMax = kInfinity;
  Rgb throughput{1, 1, 1};
  float etaScale = 1;  ///< product of squared relative indices: keeps the radiance scaling out of Russian roulette
  int depth = 0;       ///< scattering events so far
  LastVertex last;
  LayerPath layers;
  LayerRadiance radiance;
  LayerRadiance* met = nullptr;  ///< where light of lamps that the path meets goes instead, if anywhere
  Record* record = nullptr;      ///< where to write down vertices that virtual lights can light; null: nowhere
  float bound = 0;               ///< of the virtual lights' geometry terms [1/unit^2]; 0: there are no virtual lights
  Link link;
  bool lightsX1 = true;           ///< lamps are connected at x1, too; no: somebody else finds their light there
  AheadChoice ahead;              ///< of the light at the next vertex in a medium, where it is made before the flight
  LampGuide lamp;                 ///< of the last vertex, for technique B on the next segment
  float promise = 1, before = 1;  ///< LampGuide::promise of the last direction and of the one before

  VIRGA_HD void add(const LayerPath& where, Rgb light) { radiance.add(where.layer(), throughput * light); }
  VIRGA_HD void addMet(Rgb light) { (met ? *met : radiance).add(layers.layer(), throughput * light); }

  /// Bounces for which low-discrepancy numbers are spent; later ones take independent ones.
  static constexpr int kStratifiedBounces = 4;
  VIRGA_HD Vec2 pair(Sampler& sampler) const {
    return depth < kStratifiedBounces ? sampler.next2D() : sampler.random2D();
  }
  VIRGA_HD float one(Sampler& sampler) const {
    return depth < kStratifiedBounces ? sampler.next1D() : sampler.random();
  }

  // --- what virtual lights have left (ims) ---

  /// The share of the light from x, with `normal` (0 in a medium), that the clamping of virtual lights took at the last
  /// vertex: max(0, G - b) / G; all of it where none were gathered.
  VIRGA_HD float clampedShare(Vec3 x, Vec3 normal) const {
    return link.active ? clampedShareOf(geometryTerm(link.p, link.normal, x, normal), bound) : 1;
  }
  VIRGA_HD bool survivesClamping(Vec3 x, Vec3 normal, Sampler& sampler) const {
    const float q = clampedShare(x, normal);
    return q == 1 || (q > 0 && sampler.random() < q);
  }
  /// After a vertex that is written down the path is linked to virtual lights.
  VIRGA_HD void writeDown(const Vertex& vertex) {
    *record = {vertex, throughput};
    link = {true, vertex.p, vertex.normal()};
  }
};

}  // namespace virga
