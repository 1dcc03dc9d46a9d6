// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <limits>

#include "scene/mesh_readers.h"

namespace virga {
namespace {

// Statements that say nothing about surfaces, or only how they look.
constexpr std::array<std::string_view, 18> kIgnored{
    "g",        "o",      "s",      "usemtl",     "mtllib",    "mg", "lod", "bevel", "c_interp",
    "d_interp", "usemap", "maplib", "shadow_obj", "trace_obj", "l",  "p",   "vp",    "call"};

constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();

/// One corner of a face: indices from 0 into the file's lists, kNone where the corner has none.
struct Corner {
  uint32_t position, uv, normal;
};

class ObjReader {
 public:
  explicit ObjReader(std::shared_ptr<const SourceFile> file) : cursor_(std::move(file), 0) {}

  TriangleMesh read() {
    while (!cursor_.atEnd()) {
      readStatement();
      cursor_.skipLine();
    }
    // Empty stays empty: a file that declares normals but uses none has none.
    if (!usesNormals_) mesh_.normals.clear();
    if (!usesUvs_) mesh_.uvs.clear();
    return std::move(mesh_);
  }

 private:
  void readStatement() {
    const std::string_view keyword = cursor_.token();
    if (keyword.empty() || keyword.starts_with('#')) return;
    if (keyword == "v") return readPosition();
    if (keyword == "vn") return readNormal();
    if (keyword == "vt") return readUv();
    if (keyword == "f") return readFace();
    if (std::find(kIgnored.begin(), kIgnored.end(), keyword) != kIgnored.end()) return skipArguments();
    cursor_.fail(keyword, fmt::format("unknown statement \"{}\"", keyword), "meshes are made of v, vt, vn and f");
  }

  // By tokens, because a line may go on after a backslash.
  void skipArguments() {
    while (!cursor_.token().empty()) continue;
  }

  void endStatement() {
    const std::string_view token = cursor_.token();
    if (token.starts_with('#')) return;
    if (!token.empty()) cursor_.fail(token, "more numbers than this statement has");
  }

  Vec3 readVec3() {
    const float x = cursor_.single(cursor_.token()), y = cursor_.single(cursor_.token());
    return {x, y, cursor_.single(cursor_.token())};
  }

  // x y z, then perhaps a weight, a colour, or both.
  void readPosition() {
    positions_.push_back(readVec3());
    std::array<std::string_view, 4> extra;
    size_t count = 0;
    for (std::string_view token = cursor_.token(); !token.empty() && !token.starts_with('#'); token = cursor_.token()) {
      if (count == extra.size()) cursor_.fail(token, "more numbers than this statement has");
      cursor_.number(token);
      extra[count++] = token;
    }
    if ((count == 1 || count == 4) && cursor_.number(extra[0]) != 1)
      cursor_.fail(extra[0], "weights of vertices other than 1 are not supported");
    heads_.push_back(kNone);
  }

  void readNormal() {
    normals_.push_back(readVec3());
    endStatement();
  }

  void readUv() {
    Vec2 uv{.x = cursor_.single(cursor_.token())};
    if (const std::string_view v = cursor_.token(); !v.empty()) {
      uv.y = cursor_.single(v);
      if (const std::string_view w = cursor_.token(); !w.empty()) cursor_.number(w);
    }
    uvs_.push_back(uv);
    endStatement();
  }

  void readFace() {
    std::array<uint32_t, 2> fan{};
    size_t corners = 0;
    for (std::string_view token = cursor_.token(); !token.empty() && !token.starts_with('#'); token = cursor_.token()) {
      const uint32_t vertex = vertexOf(readCorner(token));
      if (corners >= 2) mesh_.triangles.push_back({fan[0], fan[1], vertex});
      fan[std::min<size_t>(corners, 1)] = vertex;
      ++corners;
    }
    if (corners < 3) cursor_.fail({}, fmt::format("a face needs 3 vertices, found {}", corners));
  }

  // "v", "v/vt", "v//vn" or "v/vt/vn".
  Corner readCorner(std::string_view token) {
    const size_t first = token.find('/'), second = first == token.npos ? first : token.find('/', first + 1);
    const std::string_view v = token.substr(0, first);
    const std::string_view vt = first == token.npos ? std::string_view() : token.substr(first + 1, second - first - 1);
    const std::string_view vn = second == token.npos ? std::string_view() : token.substr(second + 1);
    if (v.empty() || token.back() == '/')
      cursor_.fail(token, fmt::format("\"{}\" is not a vertex of a face", token), "as in 1, 1/2, 1//3 or 1/2/3");
    return {index(v, positions_.size(), "vertices"), vt.empty() ? kNone : index(vt, uvs_.size(), "texture coordinates"),
            vn.empty() ? kNone : index(vn, normals_.size(), "normals")};
  }

  // From 1 on, or backwards from the latest with -1.
  uint32_t index(std::string_view token, size_t count, std::string_view what) const {
    int64_t value = 0;
    const auto [end, error] = std::from_chars(token.data(), token.data() + token.size(), value);
    if (error != std::errc() || end != token.data() + token.size())
      cursor_.fail(token, fmt::format("\"{}\" is not an index", token));
    const auto signedCount = static_cast<int64_t>(count);
    const int64_t fromZero = value < 0 ? signedCount + value : value - 1;
    if (fromZero < 0 || fromZero >= signedCount)
      cursor_.fail(token, fmt::format("index {} is out of range: {} {} up to here", value, count, what));
    return static_cast<uint32_t>(fromZero);
  }

  // Corners with the same three indices are one vertex. The vertices of a position form a list, mostly of one.
  uint32_t vertexOf(const Corner& corner) {
    for (uint32_t v = heads_[corner.position]; v != kNone; v = next_[v])
      if (corners_[v].uv == corner.uv && corners_[v].normal == corner.normal) return v;
    const auto vertex = static_cast<uint32_t>(corners_.size());
    if (vertex == kNone) cursor_.fail({}, "more vertices than 32 bits can count");
    corners_.push_back(corner);
    next_.push_back(heads_[corner.position]);
    heads_[corner.position] = vertex;
    mesh_.positions.push_back(positions_[corner.position]);
    mesh_.uvs.push_back(corner.uv == kNone ? Vec2() : uvs_[corner.uv]);
    mesh_.normals.push_back(corner.normal == kNone ? Vec3(0) : normals_[corner.normal]);
    usesUvs_ |= corner.uv != kNone;
    usesNormals_ |= corner.normal != kNone;
    return vertex;
  }

  TextCursor cursor_;
  std::vector<Vec3> positions_, normals_;
  std::vector<Vec2> uvs_;
  TriangleMesh mesh_;
  std::vector<Corner> corners_;  // per vertex of the mesh
  std::vector<uint32_t> next_;   // per vertex: another one at the same position
  std::vector<uint32_t> heads_;  // per position: its latest vertex
  bool usesUvs_ = false, usesNormals_ = false;
};

}  // namespace

TriangleMesh readObj(const std::shared_ptr<const SourceFile>& file) {
  if (file->text.find('\0') != std::string::npos)
    throw Error(fmt::format("cannot read \"{}\": this is a binary file, not an OBJ", file->name));
  return ObjReader(file).read();
}

}  // namespace virga
