// SPDX-License-Identifier: Apache-2.0
// Numbers in pictures and volumes that no light has: one error each, at the place in the scene that names the file.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <limits>

#include "image/image_io.h"
#include "loaders/loading.h"
#include "scene/scenes.h"
#include "volume/volume_io.h"

namespace virga {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinite = std::numeric_limits<float>::infinity();

class BadValues : public ::testing::Test {
 protected:
  std::string failure(const std::string& elements) const {
    const auto error = loading::errorOf([&] { test::build(elements, folder_.path().string()); });
    return error ? std::string(error->what()) : "builds";
  }
  std::string environment(float value) const {
    Image image(4, 2, Rgb(1.f));
    image.at(1, 1).g = value;
    writeExr(folder_.path() / "sky.exr", image);
    return failure("<emitter type=\"envmap\">\n<string name=\"filename\" value=\"sky.exr\"/></emitter>");
  }
  std::string volume(const std::string& use, float value) const {
    DenseVolume volume;
    volume.nx = volume.ny = volume.nz = 2;
    volume.values.assign(8, 0.5f);
    volume.values[5] = value;
    writeVol(folder_.path() / "box.vol", volume);
    const std::string grid =
        "<volume name=\"" + use + "\" type=\"gridvolume\">\n<string name=\"filename\" value=\"box.vol\"/></volume>";
    const std::string phase =
        "<phase type=\"blendphase\">" + grid + "<phase type=\"isotropic\"/><phase type=\"rayleigh\"/></phase>";
    return failure(
        "<emitter type=\"constant\"/><shape type=\"cube\"><bsdf type=\"null\"/><medium name=\"interior\" "
        "type=\"heterogeneous\">" +
        (use == "weight" ? phase : grid) + "</medium></shape>");
  }
  const loading::TemporaryFolder folder_;
};

TEST_F(BadValues, OfEnvironments) {
  for (const float value : {0.f, 1.f, 1e30f}) EXPECT_EQ(environment(value), "builds") << value;
  for (const float value : {kNan, kInfinite, -1e-6f}) {
    const std::string text = environment(value);
    EXPECT_TRUE(
        text.starts_with("test.xml:3:32: error: the picture has 1 pixels that are negative, infinite or not a "
                         "number, the first at (1, 1)"))
        << text;
  }
}

TEST_F(BadValues, OfVolumes) {
  const struct {
    float value;
    const char* name;
  } kBad[] = {{kNan, " NaN;"}, {kInfinite, " infinite;"}, {-1e-6f, " negative;"}};
  for (const char* use : {"sigma_t", "albedo", "weight"}) {
    for (const float value : {0.f, 1.f}) EXPECT_EQ(volume(use, value), "builds") << use;
    for (const auto& bad : kBad) {
      const std::string text = volume(use, bad.value);
      EXPECT_TRUE(text.starts_with("test.xml:3:32: error: ")) << use << ": " << text;
      EXPECT_NE(text.find(bad.name), std::string::npos) << use << ": " << text;
      EXPECT_NE(text.find("(1, 0, 1)"), std::string::npos) << use << ": " << text;
    }
  }
}

}  // namespace
}  // namespace virga
