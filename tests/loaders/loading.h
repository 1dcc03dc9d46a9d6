// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <optional>
#include <string>

#include "loaders/mitsuba_xml.h"

namespace virga::loading {

inline SceneDescription parse(const std::string& text, const LoadOptions& options = {}) {
  return parseMitsubaXml(text, "scene.xml", std::filesystem::temp_directory_path(), options);
}

/// A scene of version 3 around `body`.
inline std::string scene(const std::string& body) { return "<scene version=\"3.0.0\">\n" + body + "\n</scene>\n"; }

inline std::optional<Error> errorOf(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& error) {
    return error;
  }
  return std::nullopt;
}

/// A text in which `[[` and `]]` mark where a complaint must point.
struct Marked {
  std::string text;
  size_t offset, length;

  explicit Marked(std::string marked) : text(std::move(marked)) {
    offset = text.find("[[");
    text.erase(offset, 2);
    const size_t end = text.find("]]");
    text.erase(end, 2);
    length = end - offset;
  }
};

/// Loading the text must fail at the mark, with a full message that has `expected` in it.
inline void expectError(const std::string& markedText, const std::string& expected, const LoadOptions& options = {}) {
  const Marked marked(markedText);
  const std::optional<Error> error = errorOf([&] { parse(marked.text, options); });
  ASSERT_TRUE(error) << "loads: " << markedText;
  EXPECT_NE(std::string(error->what()).find(expected), std::string::npos) << error->what();
  ASSERT_TRUE(error->details().position.known()) << error->what();
  EXPECT_EQ(error->details().position.offset, marked.offset) << error->what();
  EXPECT_EQ(error->details().position.length, marked.length) << error->what();
}

template <class T>
T valueOf(const Node& node, std::string_view name) {
  for (const Property& property : node.properties)
    if (property.name == name) return std::get<T>(property.value);
  ADD_FAILURE() << "no property " << name;
  return T();
}

/// The value of the scene's own property `x`.
template <class T>
T parsed(const std::string& element) {
  return valueOf<T>(*parse(scene(element)).root, "x");
}

/// A folder of its own for one test, gone at the end.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    const testing::TestInfo* test = testing::UnitTest::GetInstance()->current_test_info();
    path_ = std::filesystem::temp_directory_path() /
            (std::string("virga_") + test->test_suite_name() + "_" + test->name() + "_" + std::to_string(getpid()));
    std::filesystem::remove_all(path_);
    std::filesystem::create_directories(path_);
  }
  ~TemporaryFolder() { std::filesystem::remove_all(path_); }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path write(const std::filesystem::path& name, const std::string& text) const {
    std::filesystem::create_directories((path_ / name).parent_path());
    std::ofstream(path_ / name, std::ios::binary) << text;
    return path_ / name;
  }

 private:
  std::filesystem::path path_;
};

}  // namespace virga::loading
