// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cstdio>

#include "app/info.h"
#include "app/progress.h"
#include "image/image_io.h"
#include "volume/volume_io.h"

namespace virga::app {
namespace {

std::string pointText(Vec3 p) { return fmt::format("({:g}, {:g}, {:g})", p.x, p.y, p.z); }

std::string boundsText(const Bounds& b) {
  if (b.empty() || !isFinite(b.extent())) return "none";
  return fmt::format("{} to {}", pointText(b.lo), pointText(b.hi));
}

void printGrid(const GridInfo& g) {
  fmt::print("{}: {} of {}, {}\n", g.name.empty() ? "(unnamed)" : g.name, g.kind, g.valueType, g.format);
  if (!g.problem.empty()) fmt::print("  cannot be rendered: {}\n", g.problem);
  const auto size = [&g](size_t axis) { return g.activeVoxels == 0 ? 0 : g.indexHi[axis] - g.indexLo[axis] + 1; };
  fmt::print("  voxels  {} x {} x {} from ({}, {}, {}), {} active\n", size(0), size(1), size(2), g.indexLo[0],
             g.indexLo[1], g.indexLo[2], g.activeVoxels);
  fmt::print("  bounds  {}\n", boundsText(g.worldBounds));
  if (g.valuesKnown)
    fmt::print("  values  {:g} to {:g}, mean {:g}\n", g.minimum, g.maximum, g.mean);
  else
    fmt::print("  values  none that can be told\n");
  fmt::print("  memory  {}\n", bytesText(static_cast<double>(g.bytes)));
}

std::string meanText(const Image& image) {
  double sum[3] = {0, 0, 0}, n = 0;
  for (const Rgb& p : image.pixels) {
    if (!isFinite(p)) continue;
    for (int c = 0; c < 3; ++c) sum[c] += static_cast<double>(p[c]);
    ++n;
  }
  if (n == 0) return "no finite pixel";
  return fmt::format("mean {:.6g} {:.6g} {:.6g}", sum[0] / n, sum[1] / n, sum[2] / n);
}

void printMetadata(const Metadata& metadata) {
  if (metadata.empty()) return;
  fmt::print("metadata:\n");
  for (const auto& [name, value] : metadata)
    std::visit([&name = name](const auto& v) { fmt::print("  {} = {}\n", name, v); }, value);
}

}  // namespace

void printVolume(const std::string& file) {
  const std::vector<GridInfo> grids = listGrids(file);
  fmt::print("{}: {} grid{}\n", file, grids.size(), grids.size() == 1 ? "" : "s");
  for (const GridInfo& g : grids) printGrid(g);
}

void printPicture(const std::string& file) {
  const LayeredImage picture = readLayeredImage(file);
  fmt::print("{}: {} x {} pixels, {}\n", file, picture.beauty.width, picture.beauty.height, meanText(picture.beauty));
  if (const int64_t bad = countNonFinite(picture.beauty)) fmt::print("{} pixels are NaN or infinite\n", bad);
  for (const auto& [name, image] : picture.layers)
    fmt::print("  layer {:20} {}{}\n", name, meanText(image), picture.layerVariance(name) ? ", with variance" : "");
  if (picture.variance) fmt::print("  variance of the beauty: {}\n", meanText(*picture.variance));
  printMetadata(picture.metadata);
}

void printMesh(const std::string& file, MeshFormat format) {
  const TriangleMesh mesh = loadMesh(file, format);
  Bounds bounds;
  for (const Vec3& p : mesh.positions) bounds.extend(p);
  fmt::print("{}: mesh of {} vertices, {} triangles\n", file, mesh.positions.size(), mesh.triangles.size());
  fmt::print("  bounds  {}\n", boundsText(bounds));
  fmt::print("  normals {}, texture coordinates {}\n", mesh.normals.empty() ? "no" : "yes",
             mesh.uvs.empty() ? "no" : "yes");
  if (mesh.degenerateTriangles > 0) fmt::print("  {} triangles have no area\n", mesh.degenerateTriangles);
}

}  // namespace virga::app
