// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "loaders/xml_argument.h"
#include "loaders/xml_document.h"

namespace virga {

/// The `$variables` of a scene: given on the command line, or with `<default name="..." value="..."/>`.
class Variables {
 public:
  /// `frame`: of a sequence, the value of $frame; empty: there is none.
  Variables(const std::map<std::string, std::string>& defines, const std::string& frame);

  /// A default holds unless the variable has a value already: the command line wins, then the first default.
  void addDefault(const std::string& name, const std::string& value, const SourcePosition& position);

  /// The attribute's value with each `$name` replaced, by the longest name that fits. Throws Error at an unknown one.
  Argument substituted(const xml::Attribute& attribute);

  /// The number that the variable `frame` has, which is what animations are asked for; nothing where it is not defined.
  /// Throws Error, placed at `user`, where it is no number.
  std::optional<double> frame(const SourcePosition& user);

  /// Throws Error for a value from the command line that no attribute used: it would change nothing.
  void requireAllUsed() const;
  /// Throws Error, placed at `scene`, where frames of a sequence would all be the same.
  void requireFrameUsed(const SourcePosition& scene) const;

  /// The defaults that no attribute used: each as an error that may be shown as a warning.
  std::vector<Error> unusedDefaults() const;

 private:
  struct Variable {
    std::string value;
    std::string origin;         // for a note
    SourcePosition position{};  // of the default, where the value is that
    bool isDefine = false;      // by -D
    bool isFrame = false;       // of a sequence
    bool used = false;
  };

  std::string longestName(std::string_view text) const;
  [[noreturn]] void failUnknown(const SourcePosition& position, std::string_view text) const;

  std::map<std::string, Variable> variables_;
  std::vector<std::string> namesInScene() const;
  std::vector<std::string> defaults_;
};

}  // namespace virga
