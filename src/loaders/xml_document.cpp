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

// Behind the start tag whose name is at `at`, where a '>' within quotes does not end it.
size_t tagEnd(std::string_view text, size_t at) {
  while (at < text.size() && text[at] != '>') {
    if (text[at] == '"' || text[at] == '\'') at = std::min(text.find(text[at], at + 1), text.size() - 1);
    ++at;
  }
  return at;
}

// The elements that are open at the end of `text`, as offsets of their names. pugixml has accepted the text so far.
std::vector<size_t> openElements(std::string_view text) {
  std::vector<size_t> open;
  size_t at = text.find('<');
  while (at < text.size()) {
    const std::string_view rest = text.substr(at);
    std::string_view end = ">";
    if (rest.starts_with("<!--")) {
      end = "-->";
    } else if (rest.starts_with("<![CDATA[")) {
      end = "]]>";
    } else if (rest.starts_with("<?")) {
      end = "?>";
    } else if (rest.starts_with("</")) {
      if (rest.find('>') != rest.npos && !open.empty()) open.pop_back();
    } else if (!rest.starts_with("<!")) {
      const size_t close = tagEnd(text, at + 1);
      if (text[close - 1] != '/') open.push_back(at + 1);
      at = close;
    }
    at = text.find(end, at);
    if (at != text.npos) at = text.find('<', at + 1);
  }
  return open;
}

std::string_view nameAt(std::string_view text, size_t offset) {
  return text.substr(offset, text.find_first_of(" \t\r\n/>", offset) - offset);
}

Error mismatch(const std::shared_ptr<const SourceFile>& file, size_t offset) {
  const std::string_view text = file->text;
  const std::vector<size_t> open = openElements(text.substr(0, offset));
  std::string inner;
  if (!open.empty()) {
    const SourcePosition start{file, open.back(), 1};
    inner = fmt::format("<{}> of line {}", nameAt(text, open.back()), start.line());
  }
  if (!text.substr(0, offset).ends_with("</"))
    return errorAt({file, text.size() - 1, 1}, "the file ends inside " + inner);
  const std::string_view name = nameAt(text, offset);
  std::string message = fmt::format("</{}> closes nothing", name);
  if (!inner.empty()) message += fmt::format(": {} is open", inner);
  return errorAt({file, offset, name.size()}, std::move(message));
}

void requireText(const std::shared_ptr<const SourceFile>& file) {
  const std::string& text = file->text;
  const size_t start = text.find_first_not_of(kBlanks);
  if (start == std::string::npos) throw Error(fmt::format("cannot read \"{}\": the file is empty", file->name));
  if (text.find('\0') != std::string::npos)
    throw Error(fmt::format("cannot read \"{}\": this is a binary file, not XML", file->name));
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
  const auto offset = static_cast<size_t>(result.offset);
  if (result.status == pugi::status_end_element_mismatch) throw mismatch(file, offset);
  if (!result) throw errorAt(converter.at(offset, 1), complaint(result.status));
  return converter.root(document);
}

}  // namespace virga::xml
