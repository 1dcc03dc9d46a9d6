// SPDX-License-Identifier: Apache-2.0
// What a volume takes while it is loaded, and then.
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>

#include "app/program.h"

namespace virga::app {
namespace {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kSanitized = true;  // every byte has others beside it
#else
constexpr bool kSanitized = false;
#endif

constexpr int kSide = 128;

double bytesOf(int side, int channels) { return 4. * channels * side * side * side; }

/// What a render takes [bytes].
struct Taken {
  double resident = 0;  ///< when it is done: the scene, the film and the program
  double peak = 0;      ///< while the volume is loaded
};

Taken taken(const Scratch& scratch, const std::string& file) {
  const Ended r =
      virga(scratch, {"render", file, "--size", "16x16", "--passes", "1", "-o", "m.exr", "--stats", "m.json"});
  EXPECT_EQ(r.exitCode, 0) << r.err;
  const auto stats = nlohmann::json::parse(scratch.read("m.json"));
  return {stats["resident_bytes"], stats["peak_resident_bytes"]};
}

/// By fog of side^3 voxels, all of them different. They are made by another process: what a process is born with counts
/// as its own peak.
Taken byFog(const Scratch& scratch, int side, const std::string& extension) {
  const std::string file = "fog" + extension;
  EXPECT_EQ(virga(scratch, {"make", "fog", "--resolution", std::to_string(side), "-o", file}).exitCode, 0);
  return taken(scratch, file);
}

/// By a `.vol` of three channels.
Taken byColours(const Scratch& scratch, int side) {
  struct {
    char magic[4] = {'V', 'O', 'L', 3};
    int32_t header[5] = {1, 0, 0, 0, 3};
    float box[6] = {0, 0, 0, 1, 1, 1};
  } head;
  std::fill(head.header + 1, head.header + 4, side);
  {
    std::ofstream out(scratch.path("colours.vol"), std::ios::binary);
    out.write(reinterpret_cast<const char*>(&head), sizeof head);
    const std::vector<float> row(static_cast<size_t>(3 * side), 0.5f);  // a part at a time: see byFog
    for (int i = 0; i < side * side; ++i)
      out.write(reinterpret_cast<const char*>(row.data()), static_cast<std::streamsize>(row.size() * sizeof(float)));
  }
  scratch.write("colours.xml", R"(<scene version="3.0.0">
    <sensor type="perspective"><transform name="to_world"><translate z="-5"/></transform></sensor>
    <emitter type="constant"/>
    <shape type="cube"><bsdf type="null"/><medium name="interior" type="heterogeneous">
      <volume name="sigma_t" type="gridvolume"><string name="filename" value="colours.vol"/></volume>
      <rgb name="albedo" value="0.9"/></medium></shape></scene>)");
  return taken(scratch, "colours.xml");
}

// docs/results/memory.md. The film is the same in both.
void expectBounds(const Taken& large, const Taken& small, double bytes) {
  const double resident = (large.resident - small.resident) / bytes, peak = (large.peak - small.peak) / bytes;
  EXPECT_LT(resident, 1.5);
  EXPECT_LT(peak, 2.5);
  EXPECT_GT(resident, 0.9) << "it is there";
}

class Memory : public testing::Test {
 protected:
  void SetUp() override {
    if (kSanitized) GTEST_SKIP();
  }
  Scratch scratch_;
};

TEST_F(Memory, OfADenseGridIsOneAndAHalfTimesItsBytesTwoAndAHalfWhileItIsLoaded) {
  for (const char* extension : {".vol", ".vdb", ".nvdb"}) {
    SCOPED_TRACE(extension);
    expectBounds(byFog(scratch_, kSide, extension), byFog(scratch_, 8, extension), bytesOf(kSide, 1));
  }
}

TEST_F(Memory, SoItIsOfAGridOfColours) {
  constexpr int kColourSide = 112;
  expectBounds(byColours(scratch_, kColourSide), byColours(scratch_, 8), bytesOf(kColourSide, 3));
}

}  // namespace
}  // namespace virga::app
