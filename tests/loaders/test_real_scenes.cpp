// SPDX-License-Identifier: Apache-2.0
#include "loading.h"

namespace virga {
namespace {

using namespace loading;

// Scenes that others made are too large for the repository.
const std::filesystem::path kScenes = std::filesystem::path(VIRGA_ASSETS) / "scenes";

TEST(AssetsScenes, LoadAndRoundTrip) {
  const char* media = "mitsuba-media-tests/tests/scenes/participating_media/";
  const std::vector<std::pair<std::string, size_t>> scenes{
      {"mitsuba-media-tests/scenes/hello.xml", 5},
      {"mitsuba-media-tests/scenes/cbox/cbox-rgb.xml", 16},
      {"mitsuba-media-tests/scenes/matpreview/matpreview.xml", 10},
      {std::string(media) + "test_hetero_sigmat_volpath.xml", 7},
      {std::string(media) + "test_homo_obj_inside_medium_volpath.xml", 9},
      {"bitterli_living-room/scene.xml", 87}};
  for (const auto& [name, children] : scenes) {
    const SceneDescription d = loadMitsubaXml(kScenes / name);
    EXPECT_EQ(d.root->properties.size(), children) << name;
    EXPECT_TRUE(equal(d, parse(toXml(d)))) << name;
  }
}

TEST(AssetsScenes, WhatIsNotSupportedIsSaid) {
  const auto spectral = errorOf([&] { loadMitsubaXml(kScenes / "mitsuba-media-tests/scenes/cbox/cbox.xml"); });
  ASSERT_TRUE(spectral);
  EXPECT_EQ(spectral->message(), "spectra as lists of wavelengths are not supported");
  EXPECT_EQ(spectral->details().position.line(), 31);
  const auto mode = errorOf([&] { loadMitsubaXml(kScenes / "bitterli_volumetric-caustic/scene.xml"); });
  ASSERT_TRUE(mode);
  EXPECT_EQ(mode->message(), "unknown element <mode>");
}

}  // namespace
}  // namespace virga
