// SPDX-License-Identifier: Apache-2.0
// Damages small valid files in many ways, the same ways each time. Whatever comes out is a grid that can be looked up
// or an Error; the sanitizers watch the rest.
#include <gtest/gtest.h>

#include <cstring>

#include "core/error.h"
#include "volume/procedural.h"
#include "volume/samples.h"
#include "volume/volume_io.h"

// OpenVDB forgets the nodes it has made so far when reading a tree's topology fails; it holds them in bare pointers.
extern "C" const char* __lsan_default_suppressions() { return "leak:::readTopology(\nleak:libopenvdb"; }

namespace virga {
namespace {

class Damage : public testing::Test {
 protected:
  void load(const std::vector<char>& bytes) {
    test::writeBytes(folder_ / "damaged", bytes);
    try {
      const auto grid = loadVolume(folder_ / "damaged");
      use(grid->view());
      ++loaded_;
    } catch (const Error& e) {
      EXPECT_NE(std::string(e.what()).find("damaged: error: "), std::string::npos) << e.what();
      ++refused_;
    }
    try {
      listGrids(folder_ / "damaged");
    } catch (const Error&) {
    }
  }

  static void use(const GridView& view) {
    test::Sequence random(1);
    for (int n = 0; n < 50; ++n) {
      const Vec3 u(static_cast<float>(random.next()), static_cast<float>(random.next()),
                   static_cast<float>(random.next()));
      const float value = view.lookup(view.supportLo + (view.supportHi - view.supportLo) * u);
      EXPECT_GE(value, 0);
    }
  }

  // `head` bytes hold the structure and get half of the flips.
  void damage(const std::vector<char>& whole, size_t head, int rounds) {
    test::Sequence random(static_cast<unsigned>(whole.size()));
    for (int n = 0; n < rounds / 4; ++n) {
      const double share = random.next();
      load({whole.begin(),
            whole.begin() + static_cast<std::ptrdiff_t>(static_cast<double>(whole.size()) * share * share)});
    }
    for (int n = 0; n < rounds; ++n) {
      std::vector<char> bytes = whole;
      for (int flips = 1 + random.below(3); flips > 0; --flips) {
        const size_t range = random.below(2) == 0 ? std::min(head, bytes.size()) : bytes.size();
        bytes[static_cast<size_t>(random.below(static_cast<int>(range)))] ^= static_cast<char>(1 << random.below(8));
      }
      load(bytes);
    }
    EXPECT_GT(refused_, rounds / 4);
  }

  test::TemporaryFolder folder_;
  int loaded_ = 0, refused_ = 0;
};

test::SampleGrid smallGrid() {
  test::SampleGrid grid;
  grid.fills.push_back({{0, 0, 0}, {15, 7, 7}, 0.5f});
  for (int n = 0; n < 40; ++n) grid.fills.push_back({{n, n % 7, n % 5}, {n, n % 7, n % 5}, static_cast<float>(n) / 10});
  return grid;
}

TEST_F(Damage, Vol) {
  writeVol(folder_ / "a", makeProcedural(ProceduralKind::fog, {.resolution = 6}));
  damage(test::bytesOf(folder_ / "a"), 48, 400);
}

TEST_F(Damage, Vdb) {
  test::writeVdbSample(folder_ / "a", {smallGrid()});
  const std::vector<char> bytes = test::bytesOf(folder_ / "a");
  damage(bytes, 1200, 400);
}

TEST_F(Damage, VdbOfHalves) {
  test::SampleGrid grid = smallGrid();
  grid.type = test::SampleGrid::Type::halves;
  test::writeVdbSample(folder_ / "a", {grid, grid});
  damage(test::bytesOf(folder_ / "a"), 1200, 200);
}

TEST_F(Damage, VdbOfDoubles) {
  test::SampleGrid grid = smallGrid();
  grid.type = test::SampleGrid::Type::doubles;
  test::writeVdbSample(folder_ / "a", {grid});
  damage(test::bytesOf(folder_ / "a"), 1200, 200);
}

// Without a checksum the walk of the tree has to find the damage.
TEST_F(Damage, Nvdb) {
  test::writeNvdbSample(folder_ / "a", smallGrid(), test::NvdbCodec::none, test::NvdbChecksum::none);
  damage(test::bytesOf(folder_ / "a"), 1300, 300);
}

// The tables of children, where a flip makes a wild pointer.
TEST_F(Damage, NvdbPointers) {
  test::writeNvdbSample(folder_ / "a", smallGrid(), test::NvdbCodec::none, test::NvdbChecksum::none);
  const std::vector<char> whole = test::bytesOf(folder_ / "a");
  std::vector<size_t> occupied;
  for (size_t at = 0; at < whole.size(); ++at)
    if (whole[at] != 0) occupied.push_back(at);
  test::Sequence random(9);
  for (int n = 0; n < 300; ++n) {
    std::vector<char> bytes = whole;
    bytes[occupied[static_cast<size_t>(random.below(static_cast<int>(occupied.size())))]] =
        static_cast<char>(random.below(256));
    load(bytes);
  }
  EXPECT_GT(refused_, 10);
  EXPECT_GT(loaded_, 10);
}

TEST_F(Damage, NvdbZip) {
  test::writeNvdbSample(folder_ / "a", smallGrid(), test::NvdbCodec::zip);
  damage(test::bytesOf(folder_ / "a"), 300, 200);
}

TEST_F(Damage, NvdbBlosc) {
  test::writeNvdbSample(folder_ / "a", smallGrid(), test::NvdbCodec::blosc, test::NvdbChecksum::none);
  damage(test::bytesOf(folder_ / "a"), 300, 300);
}

TEST_F(Damage, Garbage) {
  test::Sequence random(4);
  for (const char* magic : {"VOL\3", " BDV\0\0\0\0", "NanoVDB0", "NanoVDB1", "NanoVDB2", ""})
    for (int n = 0; n < 40; ++n) {
      std::vector<char> bytes(magic, magic + (magic[0] == ' ' ? 8 : std::strlen(magic)));
      for (int size = random.below(3000); size > 0; --size) bytes.push_back(static_cast<char>(random.bits()));
      load(bytes);
    }
  EXPECT_EQ(loaded_, 0);
}

}  // namespace
}  // namespace virga
