// SPDX-License-Identifier: Apache-2.0
// What a volume takes while it is loaded and rendered.
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

/// Peak of a render [bytes].
double peak(const Scratch& scratch, const std::string& file) {
  const Ended r =
      virga(scratch, {"render", file, "--size", "16x16", "--passes", "1", "-o", "m.exr", "--stats", "m.json"});
  EXPECT_EQ(r.exitCode, 0) << r.err;
  return nlohmann::json::parse(scratch.read("m.json"))["peak_resident_bytes"].get<double>();
}

/// Of fog of side^3 voxels, all of them different. They are made by another process: what a process is born with counts
/// as its own peak.
double fogPeak(const Scratch& scratch, int side, const std::string& extension) {
  const std::string file = "fog" + extension;
  EXPECT_EQ(virga(scratch, {"make", "fog", "--resolution", std::to_string(side), "-o", file}).exitCode, 0);
  return peak(scratch, file);
}

/// Of a `.vol` of three channels.
double colourPeak(const Scratch& scratch, int side) {
  struct {
    char magic[4] = {'V', 'O', 'L', 3};
    int32_t header[5] = {1, 0, 0, 0, 3};
    float box[6] = {0, 0, 0, 1, 1, 1};
  } head;
  std::fill(head.header + 1, head.header + 4, side);
  {
    std::ofstream out(scratch.path("colours.vol"), std::ios::binary);
    out.write(reinterpret_cast<const char*>(&head), sizeof head);
    const std::vector<float> row(static_cast<size_t>(3 * side), 0.5f);  // a part at a time: see fogPeak
    for (int i = 0; i < side * side; ++i)
      out.write(reinterpret_cast<const char*>(row.data()), static_cast<std::streamsize>(row.size() * sizeof(float)));
  }
  scratch.write("colours.xml", R"(<scene version="3.0.0">
    <sensor type="perspective"><transform name="to_world"><translate z="-5"/></transform></sensor>
    <emitter type="constant"/>
    <shape type="cube"><bsdf type="null"/><medium name="interior" type="heterogeneous">
      <volume name="sigma_t" type="gridvolume"><string name="filename" value="colours.vol"/></volume>
      <rgb name="albedo" value="0.9"/></medium></shape></scene>)");
  return peak(scratch, "colours.xml");
}

// docs/results/memory.md
void expectAtMostTwoAndAHalf(double more, double bytes) {
  EXPECT_LT(more, 2.5 * bytes) << more / bytes;
  EXPECT_GT(more, 0.9 * bytes) << more / bytes << ": it is there";
}

class Memory : public testing::Test {
 protected:
  void SetUp() override {
    if (kSanitized) GTEST_SKIP();
  }
  Scratch scratch_;
};

TEST_F(Memory, LoadingADenseGridTakesAtMostTwoAndAHalfTimesItsBytes) {
  for (const char* extension : {".vol", ".vdb", ".nvdb"}) {
    SCOPED_TRACE(extension);
    expectAtMostTwoAndAHalf(fogPeak(scratch_, kSide, extension) - fogPeak(scratch_, 8, extension), bytesOf(kSide, 1));
  }
}

TEST_F(Memory, SoDoesAGridOfColours) {
  constexpr int kColourSide = 112;
  expectAtMostTwoAndAHalf(colourPeak(scratch_, kColourSide) - colourPeak(scratch_, 8), bytesOf(kColourSide, 3));
}

}  // namespace
}  // namespace virga::app
