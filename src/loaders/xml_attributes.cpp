// SPDX-License-Identifier: Apache-2.0
#include "loaders/xml_attributes.h"

#include <fmt/format.h>

#include <algorithm>

#include "loaders/error_at.h"

namespace virga {

void Complaints::unknown(const Error& error) const {
  if (!lenient_) throw error;
  warn(error);
}

void Complaints::warn(const Error& error) const {
  if (!warnings_) return;
  std::string text = error.what();
  constexpr std::string_view word = "error: ";
  if (const size_t at = text.find(word); at != std::string::npos) text.replace(at, word.size(), "warning: ");
  warnings_->push_back(std::move(text));
}

Attributes::Attributes(const xml::Element& element, const std::vector<std::string>& known, Variables& variables,
                       const Complaints& complaints)
    : element_(&element) {
  for (const xml::Attribute& attribute : element.attributes) {
    if (find(attribute.name))
      throw errorAt(attribute.namePosition, fmt::format("attribute \"{}\" is given twice", attribute.name));
    if (std::find(known.begin(), known.end(), attribute.name) == known.end())
      complaints.unknown(errorAt(attribute.namePosition,
                                 fmt::format("{} has no attribute \"{}\"", tagOf(element), attribute.name),
                                 didYouMean(attribute.name, known), {"available: " + joined(known)}));
    else
      arguments_.emplace_back(attribute.name, variables.substituted(attribute));
  }
}

const Argument* Attributes::find(std::string_view name) const {
  for (const auto& [key, argument] : arguments_)
    if (key == name) return &argument;
  return nullptr;
}

const Argument& Attributes::required(std::string_view name) const {
  if (const Argument* argument = find(name)) return *argument;
  throw errorAt(element_->position, fmt::format("{} needs the attribute \"{}\"", tagOf(*element_), name));
}

std::string tagOf(const xml::Element& element) { return fmt::format("<{}>", element.name); }

void requireNoChildren(const xml::Element& element) {
  if (element.children.empty()) return;
  throw errorAt(element.children.front().position,
                fmt::format("{} holds a value and no other elements", tagOf(element)));
}

}  // namespace virga
