// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "scene/mesh.h"

namespace virga {

// A mesh encloses a space where its triangles meet edge to edge. Vertices at one place count as one.

/// Edges that are passed more often in one direction than in the other: 0 for a closed mesh whose triangles agree about
/// its outside. Parts may touch along edges.
size_t openEdges(const TriangleMesh& mesh);

/// Turns triangles over until neighbours agree about the outside, where that is possible; in each connected part the
/// majority stays as it is.
void makeWindingAgree(TriangleMesh& mesh);

}  // namespace virga
