// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>

#include "scene/mesh_readers.h"

namespace virga {
namespace {

enum class Scalar { int8, uint8, int16, uint16, int32, uint32, float32, float64 };
enum class Encoding { ascii, littleEndian, bigEndian };

struct PlyProperty {
  std::string name;
  Scalar type = Scalar::float32;
  std::optional<Scalar> listCount{};  // the type of a list's length
};

struct PlyElement {
  std::string name;
  size_t count = 0;
  std::vector<PlyProperty> properties{};
};

struct PlyHeader {
  Encoding encoding = Encoding::ascii;
  std::vector<PlyElement> elements{};
};

size_t sizeOf(Scalar type) {
  constexpr std::array<size_t, 8> kSizes{1, 1, 2, 2, 4, 4, 4, 8};
  return kSizes[static_cast<size_t>(type)];
}

bool isReal(Scalar type) { return type == Scalar::float32 || type == Scalar::float64; }

class HeaderReader {
 public:
  explicit HeaderReader(TextCursor& cursor) : cursor_(cursor) {}

  PlyHeader read() {
    const std::string_view magic = cursor_.token();
    if (magic != "ply") cursor_.fail(magic.substr(0, 16), "this is not a PLY file", "it should start with \"ply\"");
    endLine();
    while (readLine()) continue;
    if (!encoding_) cursor_.fail({}, "the header does not say its format");
    header_.encoding = *encoding_;
    return std::move(header_);
  }

 private:
  bool readLine() {
    const std::string_view keyword = cursor_.token();
    if (keyword.empty() && cursor_.atEnd()) cursor_.fail({}, "the file ends within its header");
    if (keyword.empty() || keyword == "comment" || keyword == "obj_info") {
      cursor_.skipLine();
      return true;
    }
    if (keyword == "format")
      readFormat();
    else if (keyword == "element")
      readElement();
    else if (keyword == "property")
      readProperty();
    else if (keyword != "end_header")
      cursor_.fail(keyword, fmt::format("unknown word \"{}\" in the header", keyword));
    const bool more = keyword != "end_header";
    endLine();
    return more;
  }

  void endLine() {
    if (const std::string_view token = cursor_.token(); !token.empty())
      cursor_.fail(token, "more words than this line of the header has");
    cursor_.skipLine();
  }

  void readFormat() {
    const std::string_view name = cursor_.token(), version = cursor_.token();
    if (name == "ascii")
      encoding_ = Encoding::ascii;
    else if (name == "binary_little_endian")
      encoding_ = Encoding::littleEndian;
    else if (name == "binary_big_endian")
      encoding_ = Encoding::bigEndian;
    else
      cursor_.fail(name, fmt::format("unknown format \"{}\"", name));
    if (version != "1.0") cursor_.fail(version, fmt::format("unknown version \"{}\" of PLY", version));
  }

  void readElement() {
    const std::string_view name = cursor_.token(), token = cursor_.token();
    const double count = cursor_.integer(token);
    if (count < 0 || count > 1e15) cursor_.fail(token, fmt::format("\"{}\" is not a count", token));
    for (const PlyElement& other : header_.elements)
      if (other.name == name) cursor_.fail(name, fmt::format("element \"{}\" is declared twice", name));
    header_.elements.push_back({.name = std::string(name), .count = static_cast<size_t>(count)});
  }

  void readProperty() {
    if (header_.elements.empty()) cursor_.fail({}, "a property before the first element");
    PlyProperty property;
    std::string_view type = cursor_.token();
    if (type == "list") {
      const std::string_view countType = cursor_.token();
      property.listCount = scalar(countType);
      if (isReal(*property.listCount)) cursor_.fail(countType, "the length of a list must be an integer");
      type = cursor_.token();
    }
    property.type = scalar(type);
    const std::string_view name = cursor_.token();
    if (name.empty()) cursor_.fail({}, "the property has no name");
    property.name = name;
    for (const PlyProperty& other : header_.elements.back().properties)
      if (other.name == name) cursor_.fail(name, fmt::format("property \"{}\" is declared twice", name));
    header_.elements.back().properties.push_back(std::move(property));
  }

  Scalar scalar(std::string_view name) const {
    constexpr std::array<std::array<std::string_view, 2>, 8> kNames{{{"char", "int8"},
                                                                     {"uchar", "uint8"},
                                                                     {"short", "int16"},
                                                                     {"ushort", "uint16"},
                                                                     {"int", "int32"},
                                                                     {"uint", "uint32"},
                                                                     {"float", "float32"},
                                                                     {"double", "float64"}}};
    for (size_t i = 0; i < kNames.size(); ++i)
      if (name == kNames[i][0] || name == kNames[i][1]) return static_cast<Scalar>(i);
    cursor_.fail(name, fmt::format("unknown type \"{}\"", name));
  }

  TextCursor& cursor_;
  std::optional<Encoding> encoding_;
  PlyHeader header_;
};

/// Values of an ascii body. `fail` places its complaint at the latest value.
class AsciiValues {
 public:
  explicit AsciiValues(TextCursor cursor) : cursor_(std::move(cursor)) {}

  size_t minimumSize(const PlyProperty&) const { return 1; }
  size_t remaining() const { return cursor_.remaining(); }
  double next(Scalar type) {
    latest_ = cursor_.tokenOnAnyLine();
    if (latest_.empty()) cursor_.fail({}, "the file ends before its last element");
    return isReal(type) ? cursor_.number(latest_) : cursor_.integer(latest_);
  }
  void requireEnd() {
    latest_ = cursor_.tokenOnAnyLine();
    if (!latest_.empty()) fail("there is more in this file than its header says");
  }
  [[noreturn]] void fail(std::string message) const { cursor_.fail(latest_, std::move(message)); }

 private:
  TextCursor cursor_;
  std::string_view latest_;
};

class BinaryValues {
 public:
  BinaryValues(const SourceFile& file, size_t offset, Encoding encoding)
      : name_(file.name),
        at_(file.text.data() + offset),
        end_(file.text.data() + file.text.size()),
        swap_((encoding == Encoding::bigEndian) != (std::endian::native == std::endian::big)) {}

  size_t minimumSize(const PlyProperty& property) const { return sizeOf(property.listCount.value_or(property.type)); }
  size_t remaining() const { return static_cast<size_t>(end_ - at_); }
  double next(Scalar type) {
    switch (type) {
      case Scalar::int8:
        return read<int8_t>();
      case Scalar::uint8:
        return read<uint8_t>();
      case Scalar::int16:
        return read<int16_t>();
      case Scalar::uint16:
        return read<uint16_t>();
      case Scalar::int32:
        return read<int32_t>();
      case Scalar::uint32:
        return read<uint32_t>();
      case Scalar::float32:
        return finite(static_cast<double>(read<float>()));
      case Scalar::float64:
        return finite(read<double>());
    }
    return 0;
  }
  void requireEnd() const {
    const auto isBlank = [](char c) { return c == '\n' || c == '\r' || c == ' '; };
    if (!std::all_of(at_, end_, isBlank)) fail("there is more in this file than its header says");
  }
  [[noreturn]] void fail(std::string message) const {
    throw Error(fmt::format("cannot read \"{}\": {}", name_, message));
  }

 private:
  template <class T>
  T read() {
    if (remaining() < sizeof(T)) fail("the file ends before its last element");
    std::array<char, sizeof(T)> bytes;
    std::memcpy(bytes.data(), at_, sizeof(T));
    at_ += sizeof(T);
    if (swap_) std::reverse(bytes.begin(), bytes.end());
    return std::bit_cast<T>(bytes);
  }

  double finite(double value) const {
    if (!std::isfinite(value)) fail(fmt::format("it holds a number that is not finite ({})", value));
    return value;
  }

  std::string name_;
  const char* at_;
  const char* end_;
  bool swap_;
};

template <class Values>
class BodyReader {
 public:
  explicit BodyReader(Values values) : values_(std::move(values)) {}

  TriangleMesh read(const PlyHeader& header) {
    for (const PlyElement& element : header.elements)
      if (element.name == "vertex") vertices_ = element.count;
    for (const PlyElement& element : header.elements) {
      requireRoom(element);
      if (element.name == "vertex")
        readVertices(element);
      else if (element.name == "face")
        readFaces(element);
      else
        skip(element);
    }
    values_.requireEnd();
    return std::move(mesh_);
  }

 private:
  // x y z nx ny nz u v
  using Row = std::array<float, 8>;
  static constexpr size_t kIgnore = 8;

  // Before anything of that size is allocated: a broken count must not ask for all memory.
  void requireRoom(const PlyElement& element) const {
    if (element.count == 0) return;
    size_t row = 0;
    for (const PlyProperty& property : element.properties) row += values_.minimumSize(property);
    if (row == 0) values_.fail(fmt::format("the element \"{}\" has no properties", element.name));
    if (element.count > values_.remaining() / row)
      values_.fail(fmt::format("the header promises {} of the element \"{}\", the file is too short for them",
                               element.count, element.name));
  }

  static size_t slotOf(std::string_view name) {
    constexpr std::array<std::string_view, kIgnore> kNames{"x", "y", "z", "nx", "ny", "nz", "u", "v"};
    if (name == "s" || name == "texture_u") name = "u";
    if (name == "t" || name == "texture_v") name = "v";
    return static_cast<size_t>(std::find(kNames.begin(), kNames.end(), name) - kNames.begin());
  }

  void readVertices(const PlyElement& element) {
    std::array<bool, kIgnore + 1> has{};
    for (const PlyProperty& property : element.properties)
      if (!property.listCount) has[slotOf(property.name)] = true;
    if (!has[0] || !has[1] || !has[2]) values_.fail("its vertices have no x, y and z");
    if (element.count > std::numeric_limits<uint32_t>::max()) values_.fail("more vertices than 32 bits can count");
    const bool normals = has[3] && has[4] && has[5], uvs = has[6] && has[7];
    mesh_.positions.reserve(element.count);
    for (size_t i = 0; i < element.count; ++i) {
      const Row row = readRow(element);
      mesh_.positions.push_back({row[0], row[1], row[2]});
      if (normals) mesh_.normals.push_back({row[3], row[4], row[5]});
      if (uvs) mesh_.uvs.push_back({row[6], row[7]});
    }
  }

  Row readRow(const PlyElement& element) {
    Row row{};
    for (const PlyProperty& property : element.properties) {
      const size_t slot = property.listCount ? kIgnore : slotOf(property.name);
      if (slot == kIgnore) {
        skip(property);
        continue;
      }
      row[slot] = static_cast<float>(values_.next(property.type));
      if (!std::isfinite(row[slot])) values_.fail("a number does not fit single precision");
    }
    return row;
  }

  static bool isIndexList(const PlyProperty& property) {
    return property.listCount && (property.name == "vertex_indices" || property.name == "vertex_index");
  }

  void readFaces(const PlyElement& element) {
    const auto indices = std::find_if(element.properties.begin(), element.properties.end(), isIndexList);
    if (indices == element.properties.end()) values_.fail("its faces have no list \"vertex_indices\"");
    if (isReal(indices->type)) values_.fail("the indices of its faces are not integers");
    mesh_.triangles.reserve(element.count);
    for (size_t i = 0; i < element.count; ++i)
      for (const PlyProperty& property : element.properties)
        if (&property == &*indices)
          readPolygon(property);
        else
          skip(property);
  }

  void readPolygon(const PlyProperty& property) {
    const size_t corners = listLength(property);
    if (corners < 3) values_.fail(fmt::format("a face needs 3 vertices, found {}", corners));
    std::array<uint32_t, 3> triangle{readIndex(property.type), readIndex(property.type), readIndex(property.type)};
    mesh_.triangles.push_back(triangle);
    for (size_t i = 3; i < corners; ++i) {
      triangle = {triangle[0], triangle[2], readIndex(property.type)};
      mesh_.triangles.push_back(triangle);
    }
  }

  uint32_t readIndex(Scalar type) {
    const double value = values_.next(type);
    if (value < 0 || value >= static_cast<double>(vertices_))
      values_.fail(fmt::format("index {} of a face is out of range: there are {} vertices", value, vertices_));
    return static_cast<uint32_t>(value);
  }

  size_t listLength(const PlyProperty& property) {
    const double length = values_.next(*property.listCount);
    if (length < 0) values_.fail("a list has a negative length");
    if (length > static_cast<double>(values_.remaining())) values_.fail("a list is longer than the file");
    return static_cast<size_t>(length);
  }

  void skip(const PlyProperty& property) {
    const size_t count = property.listCount ? listLength(property) : 1;
    for (size_t i = 0; i < count; ++i) values_.next(property.type);
  }

  void skip(const PlyElement& element) {
    if (element.name == "tristrips" && element.count > 0) values_.fail("triangle strips are not supported");
    for (size_t i = 0; i < element.count; ++i)
      for (const PlyProperty& property : element.properties) skip(property);
  }

  Values values_;
  size_t vertices_ = 0;  // from the header: faces may stand before the vertices
  TriangleMesh mesh_;
};

}  // namespace

TriangleMesh readPly(const std::shared_ptr<const SourceFile>& file) {
  // A binary body would make no readable excerpt, so only the header's own text is shown.
  constexpr std::string_view kEnd = "\nend_header";
  const size_t end = file->text.find(kEnd);
  const size_t headerSize =
      end == std::string::npos ? std::min<size_t>(file->text.size(), 4096) : end + kEnd.size() + 2;
  const auto head = std::make_shared<const SourceFile>(SourceFile{file->name, file->text.substr(0, headerSize)});
  TextCursor cursor(head, 0);
  const PlyHeader header = HeaderReader(cursor).read();
  const size_t body = head->text.size() - cursor.remaining();
  if (header.encoding == Encoding::ascii) return BodyReader(AsciiValues(TextCursor(file, body))).read(header);
  return BodyReader(BinaryValues(*file, body, header.encoding)).read(header);
}

}  // namespace virga
