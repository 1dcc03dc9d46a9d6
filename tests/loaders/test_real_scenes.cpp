// SPDX-License-Identifier: Apache-2.0
#include <cstdlib>
#include <iostream>

#include "loading.h"

namespace virga {
namespace {

using namespace loading;

// Scenes that others made are too large for the repository. VIRGA_ASSETS names a folder that has them in scenes/.
std::filesystem::path assets() {
  const char* folder = std::getenv("VIRGA_ASSETS");
  if (!folder)
    std::cerr << "\n*** NOTE: VIRGA_ASSETS is not set, so no real scene is loaded in "
              << testing::UnitTest::GetInstance()->current_test_info()->name() << " ***\n\n";
  return folder ? folder : "";
}

TEST(RealScenes, LoadAndRoundTrip) {
  const std::filesystem::path folder = assets();
  if (folder.empty()) return;
  const char* media = "mitsuba-media-tests/tests/scenes/participating_media/";
  const std::vector<std::pair<std::string, size_t>> scenes{
      {"mitsuba-media-tests/scenes/hello.xml", 5},
      {"mitsuba-media-tests/scenes/cbox/cbox-rgb.xml", 16},
      {"mitsuba-media-tests/scenes/matpreview/matpreview.xml", 10},
      {std::string(media) + "test_hetero_sigmat_volpath.xml", 7},
      {std::string(media) + "test_homo_obj_inside_medium_volpath.xml", 9},
      {"bitterli_living-room/scene.xml", 87}};
  for (const auto& [name, children] : scenes) {
    const SceneDescription d = loadMitsubaXml(folder / "scenes" / name);
    EXPECT_EQ(d.root->properties.size(), children) << name;
    EXPECT_TRUE(equal(d, parse(toXml(d)))) << name;
  }
}

TEST(RealScenes, WhatIsNotSupportedIsSaid) {
  const std::filesystem::path folder = assets();
  if (folder.empty()) return;
  const auto spectral = errorOf([&] { loadMitsubaXml(folder / "scenes/mitsuba-media-tests/scenes/cbox/cbox.xml"); });
  ASSERT_TRUE(spectral);
  EXPECT_EQ(spectral->message(), "spectra as lists of wavelengths are not supported");
  EXPECT_EQ(spectral->details().position.line(), 31);
  const auto mode = errorOf([&] { loadMitsubaXml(folder / "scenes/bitterli_volumetric-caustic/scene.xml"); });
  ASSERT_TRUE(mode);
  EXPECT_EQ(mode->message(), "unknown element <mode>");
}

}  // namespace
}  // namespace virga
