// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "loaders/mitsuba_xml.h"
#include "scene/scene.h"

namespace virga {
namespace {

namespace fs = std::filesystem;

constexpr const char* kScene = R"(<scene version="3.0.0">
  <default name="file" value="a.vol"/>
  <medium type="heterogeneous" id="m"><volume name="sigma_t" type="gridvolume">
    <string name="filename" value="$file"/></volume></medium>
</scene>)";

class ContentHash : public testing::Test {
 protected:
  void SetUp() override {
    for (const char* folder : {"one", "two"}) {
      fs::create_directories(root_ / folder);
      write(fs::path(folder) / "s.xml", kScene);
      write(fs::path(folder) / "a.vol", std::string(3'000'000, 'v'));
    }
  }
  void TearDown() override { fs::remove_all(root_); }
  void write(const fs::path& name, const std::string& text) const { std::ofstream(root_ / name) << text; }
  uint64_t hash(const fs::path& name, const std::map<std::string, std::string>& defines = {}) const {
    return contentHash(loadMitsubaXml(root_ / name, {.defines = defines}));
  }

  fs::path root_ = fs::temp_directory_path() / ("virga-hash-" + std::to_string(::getpid()));
};

TEST_F(ContentHash, IsAboutContentsNotPlaces) {
  const uint64_t before = hash("one/s.xml");
  EXPECT_EQ(before, hash("two/s.xml"));
  write("two/b.vol", std::string(3'000'000, 'v'));
  EXPECT_EQ(before, hash("two/s.xml", {{"file", "b.vol"}}));
  std::string changed(3'000'000, 'v');
  changed[2'999'999] = 'w';
  write("two/a.vol", changed);
  EXPECT_NE(before, hash("two/s.xml"));
  write("two/a.vol", std::string(3'000'001, 'v'));
  EXPECT_NE(before, hash("two/s.xml"));
  fs::remove(root_ / "two/a.vol");
  EXPECT_NE(before, hash("two/s.xml"));
}

}  // namespace
}  // namespace virga
