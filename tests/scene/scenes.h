// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "loaders/mitsuba_xml.h"
#include "scene/builder.h"

namespace virga::test {

inline constexpr const char* kSensor =
    "<sensor type=\"perspective\" id=\"camera\"><float name=\"fov\" value=\"40\"/></sensor>";

/// The description of a Mitsuba XML text, the elements inside <scene> alone. Relative files lie in `directory`.
inline SceneDescription describe(const std::string& elements, const std::string& directory = ".") {
  return parseMitsubaXml("<scene version=\"3.0.0\">\n" + elements + "\n</scene>", "test.xml", directory);
}

/// The scene of such a text, with a camera added.
inline SceneSnapshot build(const std::string& elements, const std::string& directory = ".") {
  return buildScene(describe(elements + kSensor, directory));
}

}  // namespace virga::test
