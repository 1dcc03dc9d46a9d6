// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "scene/mesh.h"

namespace virga {

/// Normals at the vertices of a mesh that has none: means over the adjacent triangles, by the angle that each has there
/// (Thuermer and Wuethrich 1998). Vertices of the same place are apart if their indices are.
void makeNormalsSmooth(TriangleMesh& mesh);

}  // namespace virga
