// SPDX-License-Identifier: Apache-2.0
#include "loaders/xml_variables.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "loaders/error_at.h"

namespace virga {
namespace {

struct Dollar {
  size_t offset;  // in the text of the file
  bool variable;  // false for a character reference, which stands for itself
};

std::vector<Dollar> dollars(std::string_view raw) {
  std::vector<Dollar> found;
  for (size_t i = 0; i < raw.size(); ++i) {
    const std::string_view rest = raw.substr(i);
    if (rest.front() == '$') found.push_back({i, true});
    if (rest.starts_with("&#36;") || rest.starts_with("&#x24;")) found.push_back({i, false});
  }
  return found;
}

std::string_view word(std::string_view text) {
  const auto isWord = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_'; };
  const auto end = std::find_if_not(text.begin(), text.end(), isWord);
  return text.substr(0, static_cast<size_t>(end - text.begin()));
}

}  // namespace

Variables::Variables(const std::map<std::string, std::string>& defines, const std::string& frame) {
  for (const auto& [name, value] : defines)
    variables_[name] = {.value = value, .origin = "given on the command line", .isDefine = true};
  if (!frame.empty()) variables_["frame"] = {.value = frame, .origin = "the number of the frame", .isFrame = true};
}

void Variables::addDefault(const std::string& name, const std::string& value, const SourcePosition& position) {
  if (std::find(defaults_.begin(), defaults_.end(), name) == defaults_.end()) defaults_.push_back(name);
  variables_.try_emplace(
      name, Variable{value, fmt::format("the default of {}:{}", position.file->name, position.line()), position});
}

std::string Variables::longestName(std::string_view text) const {
  std::string longest;
  for (const auto& [name, variable] : variables_)
    if (name.size() > longest.size() && text.starts_with(name)) longest = name;
  return longest;
}

void Variables::failUnknown(const SourcePosition& position, std::string_view text) const {
  const std::string name(word(text));
  if (name.empty()) throw errorAt(position, "a \"$\" without the name of a variable", "a plain dollar is &#36;");
  std::vector<std::string> known;
  for (const auto& [other, variable] : variables_) known.push_back(other);
  throw errorAt(position, fmt::format("unknown variable \"${}\"", name), didYouMean(name, known),
                {known.empty() ? "no variable is defined up to here; <default name=\"...\" value=\"...\"/> defines one"
                               : "defined up to here: " + joined(known)});
}

Argument Variables::substituted(const xml::Attribute& attribute) {
  const SourcePosition& place = attribute.valuePosition;
  const std::string_view raw = std::string_view(place.file->text).substr(place.offset, place.length);
  Argument out{.text = {}, .position = place, .notes = {}, .verbatim = raw.size() == attribute.value.size()};
  const std::vector<Dollar> marks = dollars(raw);
  size_t mark = 0;
  const std::string_view text = attribute.value;
  for (size_t i = 0; i < text.size();) {
    if (text[i] != '$' || !marks[mark++].variable) {
      out.text += text[i++];
      continue;
    }
    const std::string_view rest = text.substr(i + 1);
    const std::string name = longestName(rest);
    if (name.empty()) failUnknown({place.file, place.offset + marks[mark - 1].offset, 1 + word(rest).size()}, rest);
    Variable& variable = variables_[name];
    variable.used = true;
    out.text += variable.value;
    out.notes.push_back(fmt::format("${} is \"{}\", {}", name, variable.value, variable.origin));
    out.verbatim = false;
    i += 1 + name.size();
  }
  return out;
}

std::optional<double> Variables::frame(const SourcePosition& user) {
  const auto found = variables_.find("frame");
  if (found == variables_.end()) return std::nullopt;
  Variable& variable = found->second;
  variable.used = true;
  const std::string& text = variable.value;
  double number = 0;
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (code != std::errc() || end != text.data() + text.size() || !std::isfinite(number))
    throw errorAt(user, fmt::format("$frame, the time of animations, is \"{}\": no number", text), "",
                  {fmt::format("$frame is {}", variable.origin)});
  return number;
}

std::vector<std::string> Variables::namesInScene() const {
  std::vector<std::string> names = defaults_;
  for (const auto& [name, variable] : variables_)
    if (variable.used && std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  return names;
}

void Variables::requireAllUsed() const {
  for (const auto& [name, variable] : variables_) {
    if (!variable.isDefine || variable.used) continue;
    const std::vector<std::string> known = namesInScene();
    const bool isDefault = std::find(known.begin(), known.end(), name) != known.end();
    throw Error(fmt::format("-D {}={} changes nothing: the scene never uses ${}", name, variable.value, name),
                {.position = {},
                 .hint = isDefault ? "" : didYouMean(name, known),
                 .notes = {known.empty() ? "the scene has no variables" : "the scene's variables: " + joined(known)}});
  }
}

void Variables::requireFrameUsed(const SourcePosition& scene) const {
  const auto found = variables_.find("frame");
  if (found == variables_.end() || !found->second.isFrame || found->second.used) return;
  throw errorAt(scene, "all frames would be the same picture: nothing in this scene uses $frame", "",
                {"name files by it, as in value=\"smoke.$frame.vol\", or put an <animation> in place of a <transform>",
                 "for a single picture leave out --frames"});
}

std::vector<Error> Variables::unusedDefaults() const {
  std::vector<Error> errors;
  for (const auto& [name, variable] : variables_)
    if (!variable.used && !variable.isDefine)
      errors.push_back(errorAt(variable.position, fmt::format("the default of ${} is never used", name)));
  return errors;
}

}  // namespace virga
