// SPDX-License-Identifier: Apache-2.0
#include "loaders/xml_document.h"

#include <fmt/format.h>

#include <pugixml.hpp>

#include "loaders/error_at.h"
#include "scene/read_file.h"

namespace virga::xml {
namespace {

constexpr uintmax_t kMaxFileBytes = uintmax_t{1} << 30;
constexpr std::string_view kBlanks = " \t\r\n";

const char* complaint(pugi::xml_parse_status status) {
  switch (status) {
    case pugi::status_out_of_memory:
      return "not enough memory for this file";
    case pugi::status_bad_pi:
      return "a processing instruction (<? ... ?>) is not closed";
    case pugi::status_bad_comment:
      return "a comment is not closed with -->";
    case pugi::status_bad_cdata:
      return "a CDATA section is not closed with ]]>";
    case pugi::status_bad_doctype:
      return "malformed document type";
    case pugi::status_bad_start_element:
      return "malformed start tag";
    case pugi::status_bad_attribute:
      return "malformed attribute";
    case pugi::status_bad_end_element:
      return "malformed end tag";
    case pugi::status_end_element_mismatch:
      return "this end tag does not match the element that is open here";
    default:
      return "malformed XML";
  }
}

// Turns pugixml's tree into Elements. pugixml keeps the offsets of elements only; those of attributes are found by
// walking the tag again, whose grammar it has accepted.
class Converter {
 public:
  explicit Converter(std::shared_ptr<const SourceFile> file) : file_(std::move(file)) {}

  Element element(const pugi::xml_node& node, int depth) const {
    Element out{.name = node.name(), .position = at(offset(node), std::string_view(node.name()).size())};
    if (depth > kMaxDepth)
      throw errorAt(out.position, fmt::format("more than {} elements inside each other", kMaxDepth));
    convertAttributes(node, out);
    for (const pugi::xml_node& child : node.children()) {
      if (child.type() == pugi::node_element) out.children.push_back(element(child, depth + 1));
      if (isText(child)) refuseText(child);
    }
    return out;
  }

  Element root(const pugi::xml_document& document) const {
    pugi::xml_node root;
    for (const pugi::xml_node& node : document.children()) {
      if (isText(node)) refuseText(node);
      if (node.type() != pugi::node_element) continue;
      if (root)
        throw errorAt(at(offset(node), std::string_view(node.name()).size()), "a second root element",
                      fmt::format("everything belongs into <{}>", root.name()));
      root = node;
    }
    if (!root) throw errorAt(at(0, 1), "there is no element in this file");
    return element(root, 1);
  }

  SourcePosition at(size_t offset, size_t length) const { return {file_, offset, length}; }

 private:
  static size_t offset(const pugi::xml_node& node) { return static_cast<size_t>(node.offset_debug()); }
  static bool isText(const pugi::xml_node& node) {
    return node.type() == pugi::node_pcdata || node.type() == pugi::node_cdata;
  }

  [[noreturn]] void refuseText(const pugi::xml_node& node) const {
    const size_t start = file_->text.find_first_not_of(kBlanks, offset(node));
    const size_t end = file_->text.find_first_of(" \t\r\n<", start);
    throw errorAt(at(start, std::min(end, file_->text.size()) - start), "text between the elements",
                  "values belong into attributes");
  }

  void convertAttributes(const pugi::xml_node& node, Element& out) const {
    const std::string& text = file_->text;
    size_t cursor = out.position.offset + out.name.size();
    for (const pugi::xml_attribute& attribute : node.attributes()) {
      const size_t name = text.find_first_not_of(kBlanks, cursor);
      const size_t nameLength = std::string_view(attribute.name()).size();
      const size_t value = text.find_first_of("\"'", name + nameLength) + 1;
      const size_t end = text.find(text[value - 1], value);
      out.attributes.push_back({attribute.name(), attribute.value(), at(name, nameLength), at(value, end - value)});
      cursor = end + 1;
    }
  }

  std::shared_ptr<const SourceFile> file_;
};

void requireText(const std::shared_ptr<const SourceFile>& file) {
  const std::string& text = file->text;
  const size_t start = text.find_first_not_of(kBlanks);
  if (start == std::string::npos) throw Error(fmt::format("cannot read \"{}\": the file is empty", file->name));
  if (text.find('\0') != std::string::npos) throw Error(fmt::format("cannot read \"{}\": this is a binary file, not XML", file->name));
  if (text[start] != '<')
    throw errorAt({file, start, 1}, "this is not XML", "a scene starts with <scene version=\"3.0.0\">");
}

}  // namespace

std::shared_ptr<const SourceFile> readFile(const std::filesystem::path& file) {
  return virga::readFile(file, kMaxFileBytes);
}

Element parse(const std::shared_ptr<const SourceFile>& given) {
  std::shared_ptr<const SourceFile> file = given;
  if (constexpr std::string_view mark = "\xEF\xBB\xBF"; given->text.starts_with(mark))
    file = std::make_shared<const SourceFile>(SourceFile{given->name, given->text.substr(mark.size())});
  requireText(file);

  pugi::xml_document document;
  const pugi::xml_parse_result result = document.load_buffer(
      file->text.data(), file->text.size(), pugi::parse_default | pugi::parse_fragment, pugi::encoding_utf8);
  const Converter converter(file);
  if (!result) throw errorAt(converter.at(static_cast<size_t>(result.offset), 1), complaint(result.status));
  return converter.root(document);
}

}  // namespace virga::xml
