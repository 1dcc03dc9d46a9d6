// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "scene/description.h"

namespace virga {

struct LoadOptions {
  std::map<std::string, std::string> defines{};  ///< `-D name=value`: the value of $name, before any default
  std::string frame{};                           ///< of a sequence: the value of $frame; empty: a picture by itself
  bool lenient = false;                          ///< unknown elements and attributes become warnings
  std::vector<std::string>* warnings = nullptr;  ///< where warnings go, each a full text to show; may be null
};

/// Reads a scene in the syntax of Mitsuba 3, or of 0.5 and 0.6 (`version` below 2: camelCase names become snake_case).
/// The types of plugins and their parameters are not checked here but by the builder of scenes. Throws Error.
SceneDescription loadMitsubaXml(const std::filesystem::path& file, const LoadOptions& options = {});

/// The same from text; `name` stands in messages, relative file names start at `directory`.
SceneDescription parseMitsubaXml(std::string text, std::string name, const std::filesystem::path& directory,
                                 const LoadOptions& options = {});

}  // namespace virga
