// SPDX-License-Identifier: Apache-2.0
#include "scene/mesh.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

#include "scene/mesh_readers.h"
#include "scene/read_file.h"

namespace virga {
namespace {

constexpr uintmax_t kMaxMeshBytes = uintmax_t{16} << 30;

// Twice the area times the normal, in double precision: small triangles of large scenes must not vanish.
std::array<double, 3> areaNormal(const TriangleMesh& mesh, const std::array<uint32_t, 3>& triangle) {
  const auto edge = [&](size_t to, size_t axis) {
    const int i = static_cast<int>(axis);
    return static_cast<double>(mesh.positions[triangle[to]][i]) - mesh.positions[triangle[0]][i];
  };
  std::array<double, 3> n{};
  for (size_t i = 0; i < 3; ++i) {
    const size_t j = (i + 1) % 3, k = (i + 2) % 3;
    n[i] = edge(1, j) * edge(2, k) - edge(1, k) * edge(2, j);
  }
  return n;
}

Vec3 unit(const std::array<double, 3>& v) {
  const double length = std::hypot(v[0], v[1], v[2]);
  if (!(length > 0)) return Vec3(0);
  return {static_cast<float>(v[0] / length), static_cast<float>(v[1] / length), static_cast<float>(v[2] / length)};
}

size_t countDegenerate(const TriangleMesh& mesh) {
  size_t count = 0;
  for (const auto& triangle : mesh.triangles) count += unit(areaNormal(mesh, triangle)) == Vec3(0) ? 1 : 0;
  return count;
}

void completeNormals(TriangleMesh& mesh) {
  bool complete = true;
  for (Vec3& n : mesh.normals) {
    n = unit({n.x, n.y, n.z});
    complete &= n != Vec3(0);
  }
  if (complete) return;
  std::vector<std::array<double, 3>> sums(mesh.positions.size());
  for (const auto& triangle : mesh.triangles)
    for (const uint32_t vertex : triangle)
      for (size_t i = 0; i < 3; ++i) sums[vertex][i] += areaNormal(mesh, triangle)[i];
  for (size_t v = 0; v < sums.size(); ++v) {
    if (mesh.normals[v] == Vec3(0)) mesh.normals[v] = unit(sums[v]);
    // Only vertices without any area around them are left; no light will ask for their normal.
    if (mesh.normals[v] == Vec3(0)) mesh.normals[v] = Vec3(0, 0, 1);
  }
}

}  // namespace

std::string_view TextCursor::token() {
  const auto isLineEnd = [](char c) { return c == '\n' || c == '\r'; };
  while (at_ != end_) {
    if (*at_ == '\\' && at_ + 1 != end_ && isLineEnd(at_[1]))
      at_ += at_ + 2 != end_ && at_[1] == '\r' && at_[2] == '\n' ? 3 : 2;
    else if (*at_ == ' ' || *at_ == '\t')
      ++at_;
    else
      break;
  }
  const char* start = at_;
  while (at_ != end_ && static_cast<unsigned char>(*at_) > ' ') ++at_;
  // Other control characters are no blanks: they must not end the line without a word.
  if (at_ == start && at_ != end_ && !isLineEnd(*at_)) ++at_;
  return {start, static_cast<size_t>(at_ - start)};
}

std::string_view TextCursor::tokenOnAnyLine() {
  while (at_ != end_ && (*at_ == ' ' || (*at_ >= '\t' && *at_ <= '\r'))) ++at_;
  return token();
}

void TextCursor::skipLine() {
  while (at_ != end_ && *at_ != '\n' && *at_ != '\r') ++at_;
  if (at_ != end_ && *at_ == '\r') ++at_;
  if (at_ != end_ && *at_ == '\n') ++at_;
}

double TextCursor::number(std::string_view token) const {
  std::string_view digits = token;
  if (digits.starts_with('+') && !digits.starts_with("+-")) digits.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (error != std::errc() || end != digits.data() + digits.size())
    fail(token, token.empty() ? "a number is missing" : fmt::format("\"{}\" is not a number", token));
  if (!std::isfinite(value)) fail(token, fmt::format("\"{}\" is not a finite number", token));
  return value;
}

double TextCursor::integer(std::string_view token) const {
  const double value = number(token);
  if (value != std::floor(value)) fail(token, fmt::format("\"{}\" is not an integer", token));
  return value;
}

float TextCursor::single(std::string_view token) const {
  const auto value = static_cast<float>(number(token));
  if (!std::isfinite(value)) fail(token, fmt::format("\"{}\" does not fit single precision", token));
  return value;
}

void TextCursor::fail(std::string_view token, std::string message, std::string hint) const {
  const char* start = token.empty() ? at_ : token.data();
  const SourcePosition position{file_, static_cast<size_t>(start - file_->text.data()), token.size()};
  throw Error(std::move(message), {.position = position, .hint = std::move(hint), .notes = {}});
}

TriangleMesh loadMesh(const std::filesystem::path& path, MeshFormat format) {
  const std::shared_ptr<const SourceFile> file = readFile(path, kMaxMeshBytes);
  const auto fail = [&](std::string_view why) -> Error {
    return Error(fmt::format("cannot read \"{}\": {}", path.string(), why));
  };
  if (file->text.empty()) throw fail("the file is empty");
  TriangleMesh mesh = format == MeshFormat::obj ? readObj(file) : readPly(file);
  if (mesh.triangles.empty()) throw fail("the mesh has no faces");
  mesh.degenerateTriangles = countDegenerate(mesh);
  if (mesh.degenerateTriangles == mesh.triangles.size())
    throw fail(fmt::format("none of its {} triangles has an area", mesh.triangles.size()));
  completeNormals(mesh);
  return mesh;
}

}  // namespace virga
