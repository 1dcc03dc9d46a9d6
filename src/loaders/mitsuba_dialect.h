// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "loaders/xml_argument.h"
#include "loaders/xml_document.h"

namespace virga {

/// How names are written, by the version that a scene declares.
enum class Dialect { camelCase, snakeCase };

/// The dialect of a scene with this version: camelCase before 2.0. Throws Error for what is no version, or too new a
/// one.
Dialect dialectOf(const Argument& version);

/// "toWorld" -> "to_world", "intIOR" -> "int_ior".
std::string snakeCase(std::string_view camelCase);

/// Rewrites the names of elements and parameters below `element` as version 3 has them; positions stay.
void modernise(xml::Element& element);

}  // namespace virga
