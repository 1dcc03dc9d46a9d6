// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "loaders/xml_argument.h"
#include "loaders/xml_document.h"
#include "loaders/xml_variables.h"

namespace virga {

/// What is not known but could be left out: an error, or a warning where the user asked for leniency.
class Complaints {
 public:
  Complaints(bool lenient, std::vector<std::string>* warnings) : lenient_(lenient), warnings_(warnings) {}

  void unknown(const Error& error) const;  ///< throws, or warns
  void warn(const Error& error) const;

 private:
  bool lenient_;
  std::vector<std::string>* warnings_;
};

/// The attributes of one element with their variables replaced. Refuses unknown and repeated ones.
class Attributes {
 public:
  Attributes(const xml::Element& element, const std::vector<std::string>& known, Variables& variables,
             const Complaints& complaints);

  const Argument* find(std::string_view name) const;
  const Argument& required(std::string_view name) const;  ///< throws Error where it is missing

 private:
  const xml::Element* element_;
  std::vector<std::pair<std::string_view, Argument>> arguments_;
};

/// `<float>`, for messages.
std::string tagOf(const xml::Element& element);

/// Refuses children below an element that holds a value.
void requireNoChildren(const xml::Element& element);

}  // namespace virga
