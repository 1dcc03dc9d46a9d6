// SPDX-License-Identifier: Apache-2.0
#include "transport/fields.h"

#include <nanovdb/util/GridBuilder.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "core/random.h"
#include "volume/grid_factory.h"

namespace virga::test {
namespace {

using Values = std::function<double(int, int, int)>;

double trilinear(const Values& at, const Triple& p) {
  std::array<int, 3> i{};
  Triple f{};
  for (size_t a = 0; a < 3; ++a) {
    i[a] = static_cast<int>(std::floor(p[a]));
    f[a] = p[a] - i[a];
  }
  double sum = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const int x = corner & 1, y = corner >> 1 & 1, z = corner >> 2;
    const double weight = (x ? f[0] : 1 - f[0]) * (y ? f[1] : 1 - f[1]) * (z ? f[2] : 1 - f[2]);
    if (weight > 0) sum += weight * at(i[0] + x, i[1] + y, i[2] + z);
  }
  return sum;
}

bool within(const Triple& p, const Triple& lo, const Triple& hi) {
  for (size_t a = 0; a < 3; ++a)
    if (p[a] < lo[a] || p[a] > hi[a]) return false;
  return true;
}

void place(Field& field, const Matrix4& indexToWorld, float sigmaT) {
  field.indexToWorld = indexToWorld;
  field.medium.homogeneous = false;
  field.medium.sigmaT = sigmaT;
  field.medium.density = field.grid->view();
  field.medium.worldToDensity = Affine(indexToWorld.inverse());
  field.exactBorders = indexToWorld == Matrix4();
}

Field homogeneousField() {
  Field field;
  field.name = "homogeneous";
  field.medium.sigmaT = 0.7f;
  field.density = [](const Triple&) { return 1.0; };
  field.lo = {0, 0, 0}, field.hi = {4, 4, 4};
  field.exactBorders = true;
  return field;
}

constexpr std::array<int, 3> kSize{16, 12, 9};

// A box whose values end at its border, as a .vol has it.
Field denseField(const std::string& name, const Values& at, const Matrix4& indexToWorld, float sigmaT) {
  Field field;
  field.name = name;
  std::vector<float> values;
  for (int k = 0; k < kSize[2]; ++k)
    for (int j = 0; j < kSize[1]; ++j)
      for (int i = 0; i < kSize[0]; ++i) values.push_back(static_cast<float>(at(i, j, k)));
  field.grid = Grid::dense(kSize[0], kSize[1], kSize[2], values, {.cellSize = 4});
  for (size_t a = 0; a < 3; ++a) field.lo[a] = -0.5, field.hi[a] = kSize[a] - 0.5;
  field.density = [at, lo = field.lo, hi = field.hi](const Triple& p) {
    if (!within(p, lo, hi)) return 0.0;
    const auto clamped = [&](size_t a) { return std::clamp(p[a], 0.0, kSize[a] - 1.0); };
    return trilinear(at, {clamped(0), clamped(1), clamped(2)});
  };
  place(field, indexToWorld, sigmaT);
  return field;
}

// Voxels of a tree: some lumps apart, with holes between them.
double treeValue(int i, int j, int k) {
  if (i < 0 || j < 0 || k < 0 || i > 25 || j > 11 || k > 8) return -1;
  if ((i / 5 + j / 4 + k / 3) % 3 == 1) return -1;
  return static_cast<double>(static_cast<float>(hash32(static_cast<uint32_t>(i + 100 * j + 10000 * k)) >> 8) *
                             0x1p-24f);
}

AlignedBytes treeBytes(float background) {
  nanovdb::GridBuilder<float> builder(background);
  auto accessor = builder.getAccessor();
  for (int i = 0; i <= 25; ++i)
    for (int j = 0; j <= 11; ++j)
      for (int k = 0; k <= 8; ++k)
        if (const double v = treeValue(i, j, k); v >= 0) accessor.setValue({i, j, k}, static_cast<float>(v));
  const auto handle = builder.getHandle<>(1.0, nanovdb::Vec3d(0), "density");
  AlignedBytes bytes(handle.size());
  std::memcpy(bytes.data(), handle.data(), handle.size());
  return bytes;
}

Field treeField(const std::string& name, float background, GridOptions::Storage storage, const Matrix4& indexToWorld) {
  Field field;
  field.name = name;
  field.grid = GridFactory::tree(treeBytes(background), {.cellSize = 5, .storage = storage});
  field.lo = {-1, -1, -1}, field.hi = {26, 12, 9};
  field.density = [background](const Triple& p) {
    const Values at = [background](int i, int j, int k) {
      const double v = treeValue(i, j, k);
      return v < 0 ? static_cast<double>(background) : v;
    };
    return trilinear(at, p);
  };
  place(field, indexToWorld, 0.25f);
  return field;
}

// The majorants as they would be without any slack.
void tighten(Field& field) {
  const CoarseGridView& coarse = field.medium.density.majorant;
  field.majorants.assign(static_cast<size_t>(coarse.nx * coarse.ny * coarse.nz), 1.f);
  field.medium.density.majorant.values = field.majorants.data();
}

Matrix4 turnedAndStretched() {
  return Matrix4::translation(3, -2, 1) * Matrix4::rotation(1, 2, -0.5, 67) * Matrix4::scaling(0.3, 0.05, 0.8) *
         Matrix4::rotation(0, 1, 1, 20);
}

std::vector<Field> makeFields() {
  const Values lumps = [](int i, int j, int k) {
    return static_cast<double>(static_cast<float>(hash32(static_cast<uint32_t>(i + 97 * j + 5003 * k)) >> 8) *
                               0x1p-24f);
  };
  const Values holes = [lumps](int i, int j, int k) { return i / 4 % 2 == 0 || k > 4 ? 0.0 : 3 * lumps(i, j, k); };
  const Values ones = [](int, int, int) { return 1.0; };
  std::vector<Field> all;
  all.push_back(homogeneousField());
  all.push_back(denseField("dense, one value", ones, {}, 0.2f));
  all.push_back(denseField("dense, density equals majorant", ones, {}, 0.2f));
  tighten(all.back());
  all.push_back(denseField("dense, lumps", lumps, {}, 0.3f));
  all.push_back(denseField("dense, holes", holes, {}, 0.3f));
  all.push_back(denseField("dense, turned and stretched", lumps, turnedAndStretched(), 1.5f));
  all.push_back(treeField("sparse", 0, GridOptions::Storage::sparse, {}));
  all.push_back(treeField("sparse, turned and stretched", 0, GridOptions::Storage::sparse, turnedAndStretched()));
  all.push_back(treeField("sparse, background", 0.3f, GridOptions::Storage::sparse, {}));
  all.push_back(treeField("dense box of a tree, background", 0.3f, GridOptions::Storage::dense, turnedAndStretched()));
  return all;
}

Triple mapped(const Matrix4& m, const Triple& v, double w) {
  Triple r{};
  for (int i = 0; i < 3; ++i)
    r[static_cast<size_t>(i)] = m(i, 0) * v[0] + m(i, 1) * v[1] + m(i, 2) * v[2] + m(i, 3) * w;
  return r;
}

Vec3 toVec3(const Triple& v) { return {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])}; }

Triple toTriple(Vec3 v) { return {v.x, v.y, v.z}; }

}  // namespace

const std::vector<Field>& fields() {
  static const std::vector<Field> all = makeFields();
  return all;
}

std::vector<RayPart> raysThrough(const Field& field) {
  const Triple& lo = field.lo;
  const Triple& hi = field.hi;
  const Triple middle{0.5 * (lo[0] + hi[0]), 0.5 * (lo[1] + hi[1]), 0.5 * (lo[2] + hi[2])};
  std::vector<RayPart> parts;
  const auto add = [&](const std::string& name, const Triple& o, const Triple& d, float t0 = 0, float t1 = kInfinity) {
    const Ray ray{toVec3(mapped(field.indexToWorld, o, 1)), normalize(toVec3(mapped(field.indexToWorld, d, 0)))};
    parts.push_back({name, ray, t0, t1});
  };
  // The coarse cells are 4 or 5 voxels wide and start at the support's corner.
  const double cell = field.grid ? static_cast<double>(field.medium.density.majorant.cellSize.x) : 1;
  add("along x", {lo[0] - 5, 3, 4}, {1, 0, 0});
  add("against x, from within", {middle[0], 5.3, 2.2}, {-1, 0, 0});
  add("along a border of cells", {lo[0] - 1, lo[1] + cell, lo[2] + cell}, {1, 0, 0});
  add("against y, in a border of cells", {lo[0] + 2 * cell, hi[1] + 3, 1.25}, {0, -1, 0});
  add("through corners of cells", {lo[0] - 2, lo[1] - 2, lo[2] - 2}, {1, 1, 1});
  add("back through corners of cells", {lo[0] + 2 * cell, lo[1] + 2 * cell, lo[2] + 2 * cell}, {-1, -1, -1});
  add("slanted, from outside", {lo[0] - 3, hi[1] + 1, lo[2] - 2}, {6, -2, 1.7});
  add("slanted, from within", middle, {-0.3, 0.8, 0.2});
  add("nearly along z", {middle[0] + 0.1, middle[1] - 0.2, hi[2] + 7}, {1e-7, -1e-6, -1});
  add("a part", {lo[0] - 3, middle[1], middle[2]}, {5, 0.2, -0.3}, 0.2f, 1.1f);
  add("ends before the support", {lo[0] - 9, middle[1], middle[2]}, {1, 0.01, 0}, 0, 0.01f);
  add("points away", {lo[0] - 0.5, middle[1], middle[2]}, {-1, 0.1, 0.3});
  add("misses", {lo[0] - 3, hi[1] + 2, lo[2]}, {1, 0, 0});
  if (field.exactBorders) {
    add("in a face", {lo[0] - 2, 4, lo[2]}, {1, 0, 0});
    add("in an edge", {lo[0] - 2, hi[1], lo[2]}, {1, 0, 0});
    add("starts on a face", {hi[0], 4, 3}, {-1, 0.25, 0.125});
    add("starts on a face and leaves", {hi[0], 4, 3}, {1, 0.25, 0.125});
    add("touches an edge", {lo[0] - 2, lo[1] + 2, 3}, {1, -1, 0});
  }
  return parts;
}

OpticalDepth::OpticalDepth(const Field& field, const RayPart& part) : field_(&field) {
  const Matrix4 toIndex = field.indexToWorld.inverse();
  o_ = mapped(toIndex, toTriple(part.ray.o), 1);
  d_ = mapped(toIndex, toTriple(part.ray.d), 0);
  knots_ = {part.t0};
  // Beyond the support the density is constant: a last knot well behind it stands for infinity.
  double far = part.t0 + 1;
  for (size_t a = 0; a < 3; ++a) {
    if (d_[a] == 0) continue;
    const auto knot = [&](double x) {
      const double t = (x - o_[a]) / d_[a];
      if (t > part.t0 && t < part.t1) knots_.push_back(t);
      return t;
    };
    far = std::max({far, knot(field.lo[a]) + 1, knot(field.hi[a]) + 1});
    for (double x = std::ceil(field.lo[a]); x <= field.hi[a]; ++x) knot(x);
  }
  last_ = std::min(far, static_cast<double>(part.t1));
  knots_.push_back(last_);
  std::sort(knots_.begin(), knots_.end());
  sums_ = {0.0};
  for (size_t i = 0; i + 1 < knots_.size(); ++i) sums_.push_back(sums_.back() + piece(knots_[i], knots_[i + 1]));
  const double beyond = std::isinf(part.t1) ? densityAt(last_ + 1) : 0;
  total_ = beyond > 0 ? std::numeric_limits<double>::infinity() : sums_.back();
}

double OpticalDepth::densityAt(double t) const {
  return field_->density({o_[0] + t * d_[0], o_[1] + t * d_[1], o_[2] + t * d_[2]});
}

// Gauss-Legendre with three points: exact for polynomials of degree 5.
double OpticalDepth::piece(double a, double b) const {
  const double middle = 0.5 * (a + b), half = 0.5 * (b - a), off = half * std::sqrt(0.6);
  return field_->sigmaT() * half * (5 * densityAt(middle - off) + 8 * densityAt(middle) + 5 * densityAt(middle + off)) /
         9;
}

double OpticalDepth::until(double t) const {
  if (t >= last_) return sums_.back() + (t > last_ ? piece(last_, t) : 0);
  const auto next = std::upper_bound(knots_.begin(), knots_.end(), t);
  const auto i = static_cast<size_t>(std::max<std::ptrdiff_t>(0, next - knots_.begin() - 1));
  return sums_[i] + piece(knots_[i], t);
}

}  // namespace virga::test
