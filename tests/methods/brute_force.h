// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "image/layers.h"

/// A second opinion on light transport, slow on purpose: double precision, no acceleration structure, no connections to
/// lights (they are only ever met by chance), one majorant for all the world, no Russian roulette; where extinction
/// differs between the channels, each channel is traced by itself. It shares no code with the renderer but the names of
/// the layers, and needs large lights.
namespace virga::testing::brute {

/// A point, direction or colour; operators work component by component.
struct Vector {
  double x = 0, y = 0, z = 0;

  friend Vector operator+(Vector a, Vector b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
  friend Vector operator-(Vector a, Vector b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  friend Vector operator*(Vector a, Vector b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
  friend Vector operator*(Vector a, double s) { return {a.x * s, a.y * s, a.z * s}; }
  friend Vector operator-(Vector a) { return a * -1; }
  friend bool operator==(const Vector&, const Vector&) = default;

  double channel(int c) const { return c == 0 ? x : (c == 1 ? y : z); }
};

/// A second colour for every other square of a rectangle.
struct Board {
  double u = 0, v = 0;  ///< how many pairs of squares there are along x and y; 0: it is all of one colour
  Vector other = {};
};

struct Material {
  enum class Kind { diffuse, phong, mirror, glass, pane, roughMetal, roughGlass };
  enum class Facets { ggx, beckmann };
  Kind kind = Kind::diffuse;
  Vector diffuse{0.5, 0.5, 0.5};
  Board board = {};      ///< of diffuse
  Vector specular = {};  ///< of phong, mirror and rough metal
  double exponent = 20;  ///< phong
  double index = 1.5;    ///< of glass and panes: inside over outside
  Facets facets = Facets::ggx;
  double alpha = 0.3;       ///< of what is rough: root of twice the variance of slopes
  Vector eta = {}, k = {};  ///< of rough metal: complex index
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
  std::vector<Vector> values = {};  ///< x fastest; plain numbers have three equal components
};

enum class Phase { isotropic, henyeyGreenstein, cornetteShanks, rayleigh, schlick, table };

struct Lobe {
  Phase phase = Phase::isotropic;
  double g = 0;                    ///< k of Schlick's
  std::vector<double> table = {};  ///< at even cosines from -1 to 1, in any unit
};

struct Medium {
  double sigmaT = 1;         ///< [1/unit], times the density
  Vector spectrum{1, 1, 1};  ///< the channels of the extinction, times sigmaT
  Vector albedo{0.8, 0.8, 0.8};
  Lobe lobe = {}, other = {};
  double share = 0;      ///< of the other lobe; the grid of shares takes its place
  Vector emission = {};  ///< radiance that a unit of length adds [W/(m^2 sr)], times the grid of emission
  Grid density = {}, albedoGrid = {}, shareGrid = {}, emissionGrid = {};  ///< over the box of the region
};

/// A box or a ball full of a medium, within a boundary that does not scatter. Media of regions that overlap add up, but
/// within an exclusive region there is its medium alone.
struct Region {
  enum class Form { box, ball, glassBall };  ///< a glass ball's medium is enclosed by a sphere of its wall
  Form form = Form::box;
  Vector lo = {}, hi = {};  ///< of the box, or the one around the ball
  Medium medium = {};
  int within = -1;  ///< exclusive: index of the region that it is cut out of; -1: its medium adds to others
  Material wall{.kind = Material::Kind::glass};
};

struct World {
  Vector eye{0, 0, 5}, target;  ///< up is +y
  double fieldOfView = 40;      ///< [degrees] of the square picture
  int size = 32;                ///< [pixels]
  int maxDepth = 12;            ///< segments; panes that light goes straight through do not end one
  Vector sky;                   ///< radiance from everywhere
  std::vector<Sphere> spheres;
  std::vector<Rectangle> rectangles;
  std::vector<Region> regions;  ///< eight at most; of exclusive ones that are nested, the innermost comes first
};

using Layers = std::array<Vector, kLayerCount>;

/// Means over `samples` paths a pixel; pixels from the top left corner, row by row, independent of each other.
std::vector<Layers> render(const World& world, int samples, uint64_t seed);

/// The same world for the renderer: the elements of a scene file. Grids go to files in `directory` that begin with
/// `name`.
std::string sceneElements(const World& world, const std::string& directory, const std::string& name);

}  // namespace virga::testing::brute
