// SPDX-License-Identifier: Apache-2.0
#include "scene/smooth_normals.h"

namespace virga {
namespace {

float angleBetween(Vec3 a, Vec3 b) { return std::atan2(length(cross(a, b)), dot(a, b)); }

}  // namespace

void makeNormalsSmooth(TriangleMesh& mesh) {
  mesh.normals.assign(mesh.positions.size(), Vec3(0.f));
  for (const auto& t : mesh.triangles) {
    const Vec3 corner[3] = {mesh.positions[t[0]], mesh.positions[t[1]], mesh.positions[t[2]]};
    const Vec3 n = cross(corner[1] - corner[0], corner[2] - corner[0]);
    if (!(lengthSquared(n) > 0)) continue;
    for (size_t i = 0; i < 3; ++i) {
      const Vec3 a = corner[(i + 1) % 3] - corner[i], b = corner[(i + 2) % 3] - corner[i];
      mesh.normals[t[i]] += normalize(n) * angleBetween(a, b);
    }
  }
  for (Vec3& n : mesh.normals) n = lengthSquared(n) > 0 ? normalize(n) : Vec3(0, 0, 1);
}

}  // namespace virga
