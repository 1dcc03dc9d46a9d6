// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "image/layers.h"

/// A second opinion on light transport, slow on purpose: double precision, no acceleration structure, no connections to
/// lights (they are only ever met by chance), one majorant for all the world, no Russian roulette. It shares no code
/// with the renderer but the names of the layers, and needs large lights.
namespace virga::testing::brute {

/// A point, direction or colour; operators work component by component.
struct Vector {
  double x = 0, y = 0, z = 0;

  friend Vector operator+(Vector a, Vector b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
  friend Vector operator-(Vector a, Vector b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  friend Vector operator*(Vector a, Vector b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
  friend Vector operator*(Vector a, double s) { return {a.x * s, a.y * s, a.z * s}; }
  friend Vector operator-(Vector a) { return a * -1; }
};

struct Material {
  enum class Kind { diffuse, phong, mirror, glass };
  Kind kind = Kind::diffuse;
  Vector diffuse{0.5, 0.5, 0.5};
  Vector specular = {};  ///< of phong and mirror
  double exponent = 20;  ///< phong
  double index = 1.5;    ///< glass: inside over outside
  bool twoSided = false;
  Vector emission = {};  ///< radiance of the side of the normal [W/(m^2 sr)]; a light is black
};

struct Sphere {
  Vector center;
  double radius = 1;
  Material material;
};

/// The points center + a x + b y with a, b in [-1, 1]; x and y at a right angle; the normal is along x cross y.
struct Rectangle {
  Vector center, x, y;
  Material material;
};

/// Values at the centres of the voxels of a box, trilinear between them, constant beyond the outermost.
struct Grid {
  int n = 0;                        ///< in each direction; 0: there is none
  std::vector<Vector> values = {};  ///< x fastest; densities have three equal components
};

struct Medium {
  enum class Phase { isotropic, henyeyGreenstein, cornetteShanks };
  double sigmaT = 1;  ///< [1/unit], times the density
  Vector albedo{0.8, 0.8, 0.8};
  Phase phase = Phase::isotropic;
  double g = 0;
  Grid density = {}, albedoGrid = {};  ///< over the box of the region
};

/// A box or a ball full of a medium, within a boundary that does not scatter. Media of regions that overlap add up, but
/// within an exclusive region there is its medium alone.
struct Region {
  enum class Form { box, ball, glassBall };  ///< a glass ball's medium is enclosed by a sphere of glass, and exclusive
  Form form = Form::box;
  Vector lo = {}, hi = {};  ///< of the box, or the one around the ball
  Medium medium = {};
  int within = -1;  ///< exclusive: index of the region that it is cut out of; -1: its medium adds to others
};

struct World {
  Vector eye{0, 0, 5}, target;  ///< up is +y
  double fieldOfView = 40;      ///< [degrees] of the square picture
  int size = 32;                ///< [pixels]
  int maxDepth = 12;            ///< segments
  Vector sky;                   ///< radiance from everywhere
  std::vector<Sphere> spheres;
  std::vector<Rectangle> rectangles;
  std::vector<Region> regions;  ///< eight at most; no two exclusive ones overlap
};

using Layers = std::array<Vector, kLayerCount>;

/// Means over `samples` paths a pixel; pixels from the top left corner, row by row, independent of each other.
std::vector<Layers> render(const World& world, int samples, uint64_t seed);

/// The same world for the renderer: the elements of a scene file. Grids go to files in `directory` that begin with
/// `name`.
std::string sceneElements(const World& world, const std::string& directory, const std::string& name);

}  // namespace virga::testing::brute
