// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "core/vec.h"

namespace virga {

/// Indexed triangles. All indices are in range and all numbers finite.
struct TriangleMesh {
  std::vector<Vec3> positions;
  std::vector<Vec3> normals;  ///< empty, or one unit normal per position
  std::vector<Vec2> uvs;      ///< empty, or one per position; v as the file has it
  std::vector<std::array<uint32_t, 3>> triangles;
  size_t degenerateTriangles = 0;  ///< how many of `triangles` have no area
};

enum class MeshFormat { obj, ply };

/// Reads a mesh; all objects and groups of the file become one.
///
/// Polygons are split into fans. Normals are those of the file and never made up for a file without any; where only
/// some are missing or zero, the mean of the adjacent triangles stands in. Vertex colours, materials, points and lines
/// are left out. Throws Error, with a position in text files: what is malformed, not finite, out of range, or missing.
TriangleMesh loadMesh(const std::filesystem::path& file, MeshFormat format);

}  // namespace virga
