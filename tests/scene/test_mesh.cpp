// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <fstream>
#include <functional>
#include <limits>
#include <string>

#include "core/error.h"
#include "scene/mesh.h"

namespace virga {
namespace {

using Triangle = std::array<uint32_t, 3>;

class MeshFile {
 public:
  MeshFile(const std::string& text, MeshFormat format)
      : path_(std::filesystem::temp_directory_path() /
              fmt::format("virga_mesh_{}.{}", getpid(), format == MeshFormat::obj ? "obj" : "ply")),
        format_(format) {
    std::ofstream(path_, std::ios::binary) << text;
  }
  ~MeshFile() { std::filesystem::remove(path_); }
  MeshFile(const MeshFile&) = delete;
  MeshFile& operator=(const MeshFile&) = delete;

  TriangleMesh load() const { return loadMesh(path_, format_); }

 private:
  std::filesystem::path path_;
  MeshFormat format_;
};

TriangleMesh obj(const std::string& text) { return MeshFile(text, MeshFormat::obj).load(); }
TriangleMesh ply(const std::string& text) { return MeshFile(text, MeshFormat::ply).load(); }

// "line:column message", or the message alone where the file has no text to point at.
std::string complaint(const std::function<void()>& load) {
  try {
    load();
  } catch (const Error& error) {
    const SourcePosition& at = error.details().position;
    if (!at.known()) return error.message();
    return fmt::format("{}:{} {}", at.line(), at.column(), error.message());
  }
  return "loads";
}
std::string objError(const std::string& text) {
  return complaint([&] { obj(text); });
}
std::string plyError(const std::string& text) {
  return complaint([&] { ply(text); });
}

void expectEnds(const std::string& text, const std::string& end) { EXPECT_TRUE(text.ends_with(end)) << text; }

const std::string kCorners = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

TEST(Obj, TrianglesAndPolygons) {
  const TriangleMesh mesh = obj(kCorners + "f 1 2 3\nf 1 2 3 4\n");
  EXPECT_EQ(mesh.positions.size(), 4u) << "shared corners are one vertex";
  EXPECT_EQ(mesh.triangles, (std::vector<Triangle>{{0, 1, 2}, {0, 1, 2}, {0, 2, 3}}));
  EXPECT_TRUE(mesh.normals.empty());
  EXPECT_TRUE(mesh.uvs.empty());
  EXPECT_EQ(mesh.positions[2], Vec3(1, 1, 0));
  EXPECT_EQ(obj(kCorners + "v 0.5 2 0\nf 1 2 3 5 4").triangles.size(), 3u);
}

TEST(Obj, NegativeIndicesCountBackwards) {
  const TriangleMesh mesh = obj(kCorners + "f -4 -3 -1\nv 7 7 7\nf -1 1 2\n");
  EXPECT_EQ(mesh.positions[2], Vec3(0, 1, 0));
  EXPECT_EQ(mesh.positions[mesh.triangles[1][0]], Vec3(7, 7, 7));
}

TEST(Obj, AllFormsOfCorners) {
  const std::string attributes = kCorners + "vt 0.25 0.75\nvt 1 0 0\nvn 0 0 2\nvn 0 3 0\n";
  const TriangleMesh full = obj(attributes + "f 1/1/1 2/2/1 3/1/2\n");
  ASSERT_EQ(full.uvs.size(), 3u);
  ASSERT_EQ(full.normals.size(), 3u);
  EXPECT_EQ(full.uvs[0], (Vec2{0.25f, 0.75f}));
  EXPECT_EQ(full.uvs[1], (Vec2{1, 0}));
  EXPECT_EQ(full.normals[0], Vec3(0, 0, 1)) << "unit length";
  EXPECT_EQ(full.normals[2], Vec3(0, 1, 0));
  const TriangleMesh normalsOnly = obj(attributes + "f 1//1 2//1 3//2\n"),
                     uvsOnly = obj(attributes + "f 1/1 2/2 3/-2\n");
  EXPECT_TRUE(normalsOnly.uvs.empty());
  EXPECT_EQ(normalsOnly.normals.size(), 3u);
  EXPECT_TRUE(uvsOnly.normals.empty());
  EXPECT_EQ(uvsOnly.uvs[2], (Vec2{0.25f, 0.75f}));
}

TEST(Obj, CornersThatDifferSplitTheVertex) {
  const TriangleMesh mesh = obj(kCorners + "vn 0 0 1\nvn 0 1 0\nf 1//1 2//1 3//1\nf 1//2 3//1 4//1\n");
  EXPECT_EQ(mesh.positions.size(), 5u);
  EXPECT_NE(mesh.triangles[0][0], mesh.triangles[1][0]);
  EXPECT_EQ(mesh.triangles[0][2], mesh.triangles[1][1]);
  EXPECT_EQ(mesh.positions[mesh.triangles[0][0]], mesh.positions[mesh.triangles[1][0]]);
}

TEST(Obj, MissingNormalsComeFromTheTriangles) {
  const TriangleMesh mesh = obj(kCorners + "vn 1 0 0\nvn 0 0 0\nf 1//1 2 3//2\n");
  EXPECT_EQ(mesh.normals, (std::vector<Vec3>{Vec3(1, 0, 0), Vec3(0, 0, 1), Vec3(0, 0, 1)}));
}

TEST(Obj, WhatIsNotSurfaceIsLeftOut) {
  const TriangleMesh mesh =
      obj("# made by hand\r\nmtllib a b.mtl\r\no one\r\ng left right\r\ns 1\r\nusemtl red\r\n"
          "v 0 0 0 1\r\nv 1 0 0 0.1 0.2 0.3\r\nv 0 1 0 1 0.1 0.2 0.3 # colours\r\n\r\nl 1 2\r\n"
          "g other\r\nf 1 \\\r\n 2 3   \r\n");
  EXPECT_EQ(mesh.triangles, (std::vector<Triangle>{{0, 1, 2}}));
}

TEST(Obj, DegenerateTrianglesStayAndAreCounted) {
  const TriangleMesh mesh = obj(kCorners + "v 2 0 0\nf 1 2 3\nf 1 1 2\nf 1 2 5\n");
  EXPECT_EQ(mesh.triangles.size(), 3u);
  EXPECT_EQ(mesh.degenerateTriangles, 2u);
  // An area of 1e-40 is one nevertheless.
  EXPECT_EQ(obj("v 0 0 0\nv 1e-20 0 0\nv 0 1e-20 0\nf 1 2 3\n").degenerateTriangles, 0u);
}

TEST(Obj, Errors) {
  EXPECT_EQ(objError(kCorners + "f 1 2 9\n"), "5:7 index 9 is out of range: 4 vertices up to here");
  EXPECT_EQ(objError(kCorners + "f 1 2 -5\n"), "5:7 index -5 is out of range: 4 vertices up to here");
  EXPECT_EQ(objError(kCorners + "f 0 1 2\n"), "5:3 index 0 is out of range: 4 vertices up to here");
  EXPECT_EQ(objError(kCorners + "f 1/1 2 3\n"), "5:5 index 1 is out of range: 0 texture coordinates up to here");
  EXPECT_EQ(objError(kCorners + "f 1//7 2 3\n"), "5:6 index 7 is out of range: 0 normals up to here");
  EXPECT_EQ(objError(kCorners + "f 1 2\n"), "5:6 a face needs 3 vertices, found 2");
  EXPECT_EQ(objError(kCorners + "f 1 2 3x\n"), "5:7 \"3x\" is not an index");
  EXPECT_EQ(objError(kCorners + "f 1/ 2 3\n"), "5:3 \"1/\" is not a vertex of a face");
  EXPECT_EQ(objError(kCorners + "f /1 2 3\n"), "5:3 \"/1\" is not a vertex of a face");
  EXPECT_EQ(objError(kCorners + "f 99999999999999999999 2 3\n"), "5:3 \"99999999999999999999\" is not an index");
  EXPECT_EQ(objError("v 0 nan 0\n"), "1:5 \"nan\" is not a finite number");
  EXPECT_EQ(objError("v 0 1e39 0\n"), "1:5 \"1e39\" does not fit single precision");
  EXPECT_EQ(objError("v 0 1,5 0\n"), "1:5 \"1,5\" is not a number");
  EXPECT_EQ(objError("v 0 1\n"), "1:6 a number is missing");
  EXPECT_EQ(objError("v 0 1 2 0.5\n"), "1:9 weights of vertices other than 1 are not supported");
  EXPECT_EQ(objError("v 0 1 2 1 2 3 4 5\n"), "1:17 more numbers than this statement has");
  EXPECT_EQ(objError("vn 0 0 1 0\n"), "1:10 more numbers than this statement has");
  EXPECT_EQ(objError("hello\n"), "1:1 unknown statement \"hello\"");
  EXPECT_EQ(objError("v 0 0 0\n\x01 1\n"), "2:1 unknown statement \"\x01\"");
  expectEnds(objError(kCorners), ".obj\": the mesh has no faces");
  expectEnds(objError(""), ".obj\": the file is empty");
  expectEnds(objError(std::string("v 0\0 0", 6)), ".obj\": this is a binary file, not an OBJ");
  expectEnds(objError(kCorners + "f 1 1 2\n"), ".obj\": none of its 1 triangles has an area");
  EXPECT_EQ(complaint([] { loadMesh("no/such.obj", MeshFormat::obj); }), "cannot read \"no/such.obj\": no such file");
}

std::string plyHeader(const std::string& format, const std::string& vertexProperties, int vertices, int faces,
                      const std::string& faceProperty = "list uchar int vertex_indices") {
  return fmt::format(
      "ply\nformat {} 1.0\ncomment made by hand\nelement vertex {}\n{}element face {}\nproperty {}\nend_header\n",
      format, vertices, vertexProperties, faces, faceProperty);
}

const std::string kXyz = "property float x\nproperty float y\nproperty float z\n";

TEST(Ply, Ascii) {
  const TriangleMesh mesh = ply(plyHeader("ascii", kXyz, 4, 2) + "0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n4 0 1 2 3\n");
  EXPECT_EQ(mesh.positions, (std::vector<Vec3>{Vec3(0), Vec3(1, 0, 0), Vec3(1, 1, 0), Vec3(0, 1, 0)}));
  EXPECT_EQ(mesh.triangles, (std::vector<Triangle>{{0, 1, 2}, {0, 1, 2}, {0, 2, 3}}));
}

TEST(Ply, NormalsTextureCoordinatesAndOthersInAnyOrder) {
  const std::string properties =
      "property uchar red\nproperty double nz\nproperty double ny\nproperty double nx\nproperty float t\nproperty "
      "float s\n"
      "property list uchar float weights\nproperty float z\nproperty float y\nproperty float x\n";
  const TriangleMesh mesh = ply(plyHeader("ascii", properties, 3, 1, "list uint8 uint32 vertex_index") +
                                "255 2 0 0 0.75 0.25 2 9 9 3 2 1\n0 1 0 0 0 0 0 0 0 1\n0 1 0 0 0 0 0 0 1 0\n3 2 1 0\n");
  EXPECT_EQ(mesh.positions[0], Vec3(1, 2, 3));
  EXPECT_EQ(mesh.normals[0], Vec3(0, 0, 1));
  EXPECT_EQ(mesh.uvs[0], (Vec2{0.25f, 0.75f}));
  EXPECT_EQ(mesh.triangles[0], (Triangle{2, 1, 0}));
}

template <class T>
void append(std::string& out, T value, std::endian order) {
  char bytes[sizeof(T)];
  std::memcpy(bytes, &value, sizeof(T));
  if (order != std::endian::native) std::reverse(std::begin(bytes), std::end(bytes));
  out.append(bytes, sizeof(T));
}

// One triangle with doubles, shorts, an unknown element and faces before the vertices.
std::string binaryPly(std::endian order) {
  std::string out = fmt::format(
      "ply\nformat binary_{}_endian 1.0\nelement face 1\nproperty uchar flags\nproperty list ushort short "
      "vertex_indices\n"
      "element edge 1\nproperty int32 a\nproperty list char int16 b\n"
      "element vertex 3\nproperty double x\nproperty float32 y\nproperty int8 z\nend_header\n",
      order == std::endian::little ? "little" : "big");
  append<uint8_t>(out, 10, order);
  append<uint16_t>(out, 3, order);
  for (int16_t i = 0; i < 3; ++i) append<int16_t>(out, i, order);
  append<int32_t>(out, -1, order);
  append<int8_t>(out, 1, order);
  append<int16_t>(out, 772, order);
  for (const Vec3 p : {Vec3(0.5f, 0, 4), Vec3(1.5f, 1, -3), Vec3(0.5f, 2, 4)}) {
    append<double>(out, p.x, order);
    append<float>(out, p.y, order);
    append<int8_t>(out, static_cast<int8_t>(p.z), order);
  }
  return out;
}

TEST(Ply, BinaryOfBothByteOrders) {
  for (const std::endian order : {std::endian::little, std::endian::big}) {
    const std::string text = binaryPly(order);
    const TriangleMesh mesh = ply(text);
    EXPECT_EQ(mesh.positions, (std::vector<Vec3>{Vec3(0.5f, 0, 4), Vec3(1.5f, 1, -3), Vec3(0.5f, 2, 4)}));
    EXPECT_EQ(mesh.triangles, (std::vector<Triangle>{{0, 1, 2}}));
    EXPECT_EQ(ply(text + "\r\n").triangles.size(), 1u);
    expectEnds(plyError(text + "x"), "there is more in this file than its header says");
    for (size_t n = text.find("end_header\n") + 11; n < text.size(); ++n)
      EXPECT_NE(plyError(text.substr(0, n)), "loads") << "cut after " << n << " bytes";
  }
}

TEST(Ply, AsciiErrors) {
  const std::string header = plyHeader("ascii", kXyz, 3, 1), points = "0 0 0\n1 0 0\n0 1 0\n";
  EXPECT_EQ(plyError(header + points + "3 0 1 3\n"), "14:7 index 3 of a face is out of range: there are 3 vertices");
  EXPECT_EQ(plyError(header + points + "3 0 -1 2\n"), "14:5 index -1 of a face is out of range: there are 3 vertices");
  EXPECT_EQ(plyError(header + points + "3 0 1.5 2\n"), "14:5 \"1.5\" is not an integer");
  EXPECT_EQ(plyError(header + points + "2 0 1\n"), "14:1 a face needs 3 vertices, found 2");
  EXPECT_EQ(plyError(header + "0 0 0\n1 inf 0\n0 1 0\n3 0 1 2\n"), "12:3 \"inf\" is not a finite number");
  EXPECT_EQ(plyError(header + "0 0 0\n1 x 0\n0 1 0\n3 0 1 2\n"), "12:3 \"x\" is not a number");
  EXPECT_EQ(plyError(header + "0 0 0\n1 1e39 0\n0 1 0\n3 0 1 2\n"), "12:3 a number does not fit single precision");
  EXPECT_EQ(plyError(header + points + "3 0 1 2\n7\n"), "15:1 there is more in this file than its header says");
  expectEnds(plyError(header + points + "3 0 1\n"), "the file ends before its last element");
  expectEnds(plyError(header + points + "99 0 1 2\n"), "a list is longer than the file");
}

TEST(Ply, HeaderErrors) {
  EXPECT_EQ(plyError("solid\n"), "1:1 this is not a PLY file");
  EXPECT_EQ(plyError("ply\nformat ascii 2.0\n"), "2:14 unknown version \"2.0\" of PLY");
  EXPECT_EQ(plyError("ply\nformat text 1.0\n"), "2:8 unknown format \"text\"");
  EXPECT_EQ(plyError("ply\nelement vertex -3\n"), "2:16 \"-3\" is not a count");
  EXPECT_EQ(plyError("ply\nelement vertex 1e99\n"), "2:16 \"1e99\" is not a count");
  EXPECT_EQ(plyError("ply\nproperty float x\n"), "2:9 a property before the first element");
  EXPECT_EQ(plyError("ply\nelement vertex 3\nproperty half x\n"), "3:10 unknown type \"half\"");
  EXPECT_EQ(plyError("ply\nelement vertex 3\nproperty float x\nproperty int x\n"),
            "4:14 property \"x\" is declared twice");
  EXPECT_EQ(plyError("ply\nelement a 3\nelement a 3\n"), "3:9 element \"a\" is declared twice");
  EXPECT_EQ(plyError("ply\nelement a 3\nproperty list float int x\n"), "3:15 the length of a list must be an integer");
  EXPECT_EQ(plyError("ply\nnonsense\n"), "2:1 unknown word \"nonsense\" in the header");
  expectEnds(plyError("ply\nformat ascii 1.0\n"), "the file ends within its header");
  expectEnds(plyError("ply\nend_header\n"), "the header does not say its format");
  const std::string huge = plyHeader("binary_little_endian", kXyz, 2'000'000'000, 1);
  expectEnds(plyError(huge),
             "the header promises 2000000000 of the element \"vertex\", the file is too short for them");
  expectEnds(plyError("ply\nformat ascii 1.0\nelement x 99999999\nend_header\n"),
             "the element \"x\" has no properties");
  expectEnds(plyError(plyHeader("ascii", "property float x\n", 1, 0) + "0\n"), "its vertices have no x, y and z");
  expectEnds(plyError(plyHeader("ascii", kXyz, 1, 1, "list uchar int corners") + "0 0 0\n3 0 0 0\n"),
             "its faces have no list \"vertex_indices\"");
  expectEnds(plyError(plyHeader("ascii", kXyz, 1, 1, "list uchar float vertex_indices") + "0 0 0\n3 0 0 0\n"),
             "the indices of its faces are not integers");
  expectEnds(plyError(plyHeader("ascii", kXyz, 1, 0) + "0 0 0\n"), ".ply\": the mesh has no faces");
}

TEST(Ply, NumbersThatAreNotFiniteInBinary) {
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    std::string text = plyHeader("binary_little_endian", kXyz, 3, 1);
    for (int i = 0; i < 9; ++i) append(text, i == 4 ? bad : static_cast<float>(i), std::endian::little);
    append<uint8_t>(text, 3, std::endian::little);
    for (const int32_t i : {0, 1, 2}) append(text, i, std::endian::little);
    EXPECT_NE(plyError(text).find("it holds a number that is not finite"), std::string::npos) << plyError(text);
  }
}

// Damaged files load or are refused: no crash, no foreign exception, no index out of range.
TEST(Meshes, DamagedFilesAreRefusedCleanly) {
  const std::string objText = kCorners + "vt 0 1\nvn 0 0 1\nf 1/1/1 2/1/1 3/1/1 4//1\nf -1 -2 -3 # end\n";
  const std::string asciiText = plyHeader("ascii", kXyz, 4, 2) + "0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n4 0 1 2 3\n";
  std::string binaryText = binaryPly(std::endian::little);
  uint32_t state = 7;
  const auto random = [&](size_t n) {
    state = state * 1664525u + 1013904223u;
    return (state >> 8) % n;
  };
  const auto attempt = [](const std::string& text, MeshFormat format) {
    try {
      const TriangleMesh mesh = MeshFile(text, format).load();
      for (const Triangle& t : mesh.triangles)
        for (const uint32_t v : t) ASSERT_LT(v, mesh.positions.size());
      for (const Vec3 p : mesh.positions) ASSERT_TRUE(isFinite(p));
      for (const Vec3 n : mesh.normals) ASSERT_NEAR(length(n), 1, 1e-5);
    } catch (const Error&) {
    }
  };
  for (int i = 0; i < 3000; ++i) {
    for (const auto& [good, format] : {std::pair{objText, MeshFormat::obj}, std::pair{asciiText, MeshFormat::ply},
                                       std::pair{binaryText, MeshFormat::ply}}) {
      std::string text = good.substr(0, random(4) == 0 ? random(good.size()) : good.size());
      for (size_t k = 0; k < 3 && !text.empty(); ++k)
        text[random(text.size())] =
            random(2) == 0 ? "0123456789-./ \nvft#e\\"[random(21)] : static_cast<char>(random(256));
      attempt(text, format);
    }
  }
}

TEST(Obj, AHundredThousandTrianglesLoadQuickly) {
  std::string text;
  const int n = 225;
  for (int y = 0; y < n; ++y)
    for (int x = 0; x < n; ++x)
      text += "v " + std::to_string(x * 0.37) + " " + std::to_string(y * 0.11) + " 0.123456\n";
  for (int y = 0; y + 1 < n; ++y)
    for (int x = 0; x + 1 < n; ++x) {
      const int a = 1 + y * n + x, b = a + 1, c = a + n + 1, d = a + n;
      text += fmt::format("f {} {} {}\nf {} {} {}\n", a, b, c, a, c, d);
    }
  const MeshFile file(text, MeshFormat::obj);
  EXPECT_EQ(file.load().triangles.size(), 100'352u);
}

TEST(Assets, Meshes) {
  const std::filesystem::path assets(VIRGA_ASSETS);
  const TriangleMesh dragon = loadMesh(assets / "meshes/stanford_dragon_100k.obj", MeshFormat::obj);
  EXPECT_EQ(dragon.positions.size(), 50'000u);
  EXPECT_EQ(dragon.triangles.size(), 100'000u);
  const TriangleMesh bunny = loadMesh(assets / "scenes/mitsuba-media-tests/common/meshes/bunny.ply", MeshFormat::ply);
  EXPECT_EQ(bunny.positions.size(), 35'947u);
  EXPECT_EQ(bunny.triangles.size(), 69'451u);
  const TriangleMesh car = loadMesh(assets / "meshes/legocar.obj", MeshFormat::obj);
  EXPECT_EQ(car.triangles.size(), 10'992u);
  EXPECT_EQ(car.normals.size(), car.positions.size());
}

}  // namespace
}  // namespace virga
