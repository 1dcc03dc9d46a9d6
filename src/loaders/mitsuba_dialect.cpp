// SPDX-License-Identifier: Apache-2.0
#include "loaders/mitsuba_dialect.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>

namespace virga {
namespace {

constexpr int kNewestMajor = 3;

bool isLower(char c) { return std::islower(static_cast<unsigned char>(c)) != 0; }
bool isUpper(char c) { return std::isupper(static_cast<unsigned char>(c)) != 0; }

xml::Attribute* attribute(xml::Element& element, std::string_view name) {
  for (xml::Attribute& a : element.attributes)
    if (a.name == name) return &a;
  return nullptr;
}

void renameParameter(xml::Element& element, const std::string& parentType) {
  xml::Attribute* name = attribute(element, "name");
  if (!name || element.name == "default") return;  // variables keep their names: $maxDepth
  name->value = snakeCase(name->value);
  if (parentType == "diffuse" && name->value == "diffuse_reflectance") name->value = "reflectance";
}

}  // namespace

Dialect dialectOf(const Argument& version) {
  const char* end = version.text.data() + version.text.size();
  int numbers[3] = {};
  const char* at = version.text.data();
  for (int& number : numbers) {
    const auto [stop, error] = std::from_chars(at, end, number);
    if (error != std::errc() || number < 0 || (stop != end && *stop != '.'))
      version.fail(fmt::format("\"{}\" is not a version", version.text), "as in \"3.0.0\"");
    at = stop == end ? end : stop + 1;
    if (stop == end) break;
  }
  if (at != end) version.fail(fmt::format("\"{}\" is not a version", version.text), "as in \"3.0.0\"");
  if (numbers[0] > kNewestMajor)
    version.fail(fmt::format("scenes of version {} are not known", version.text),
                 fmt::format("the newest is {}", kNewestMajor));
  return numbers[0] < 2 ? Dialect::camelCase : Dialect::snakeCase;
}

std::string snakeCase(std::string_view camelCase) {
  std::string out;
  for (size_t i = 0; i < camelCase.size(); ++i) {
    const char c = camelCase[i];
    if (i > 0 && isLower(camelCase[i - 1]) && isUpper(c)) out += '_';
    out += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return out;
}

void modernise(xml::Element& element) {
  const xml::Attribute* type = attribute(element, "type");
  for (xml::Element& child : element.children) {
    if (child.name == "lookAt") child.name = "lookat";
    renameParameter(child, type ? type->value : "");
    modernise(child);
  }
}

}  // namespace virga
