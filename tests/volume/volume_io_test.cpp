// SPDX-License-Identifier: Apache-2.0
#include "volume/volume_io.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cmath>
#include <cstring>
#include <functional>

#include "core/error.h"
#include "volume/samples.h"

namespace virga {
namespace {

namespace fs = std::filesystem;
using test::Fill;
using test::SampleGrid;

class VolumeIo : public testing::Test {
 protected:
  std::string at(const std::string& name) const { return (folder_ / name).string(); }

  // The whole text of the error that loading gives.
  std::string complaint(const std::string& name, const VolumeRequest& request = {}) const {
    try {
      loadVolume(folder_ / name, request);
    } catch (const Error& e) {
      return e.what();
    }
    return "no error";
  }

  test::TemporaryFolder folder_;
};

DenseVolume ramp(int nx, int ny, int nz) {
  DenseVolume volume{nx, ny, nz, {}, {}, "density"};
  for (int n = 0; n < nx * ny * nz; ++n) volume.values.push_back(0.25f + static_cast<float>(n % 31) / 8);
  volume.indexToWorld = Matrix4::translation(-1, 2, 0.5) * Matrix4::scaling(0.5, 0.25, 1);
  return volume;
}

SampleGrid block(const std::string& name = "density", float value = 1) {
  SampleGrid grid;
  grid.name = name;
  grid.fills.push_back({{0, 0, 0}, {3, 3, 3}, value});
  return grid;
}

TEST_F(VolumeIo, AllFormatsHoldTheSameField) {
  const DenseVolume volume = ramp(11, 9, 7);
  writeVol(folder_ / "a.vol", volume);
  writeVdb(folder_ / "a.vdb", volume);
  writeNvdb(folder_ / "a.nvdb", volume);
  const auto vol = loadVolume(folder_ / "a.vol"), vdb = loadVolume(folder_ / "a.vdb"),
             nvdb = loadVolume(folder_ / "a.nvdb");
  test::Sequence random(1);
  for (int n = 0; n < 5000; ++n) {
    // Between the outermost centres all agree: voxel i's centre is at index i in each.
    const Vec3 p(static_cast<float>(random.next() * 10), static_cast<float>(random.next() * 8),
                 static_cast<float>(random.next() * 6));
    ASSERT_NEAR(vol->view().lookup(p), vdb->view().lookup(p), 5e-6f);
    ASSERT_NEAR(vol->view().lookup(p), nvdb->view().lookup(p), 5e-6f);
  }
  EXPECT_EQ(vdb->indexToWorld(), volume.indexToWorld);
  EXPECT_EQ(nvdb->indexToWorld(), volume.indexToWorld);
  EXPECT_EQ(vol->view().lookup({-0.5f, 0, 0}), volume.values[0]) << "a .vol is clamped to its border";
  EXPECT_FLOAT_EQ(vdb->view().lookup({-0.5f, 0, 0}), volume.values[0] / 2) << "a VDB falls off towards its background";
}

TEST_F(VolumeIo, VolSaysItsBox) {
  writeVol(folder_ / "a.vol", ramp(4, 4, 2));
  // Half a voxel beyond the outermost centres.
  EXPECT_EQ(volBounds(folder_ / "a.vol"), (Bounds{{-1.25f, 1.875f, 0.f}, {0.75f, 2.875f, 2.f}}));
  const GridInfo info = listGrids(folder_ / "a.vol").at(0);
  EXPECT_EQ(info.worldBounds.lo, Vec3(-1.25f, 1.875f, 0));
  EXPECT_EQ(info.format, "vol 3");
  EXPECT_EQ(info.problem, "");
}

TEST_F(VolumeIo, ColoursNeedThreeChannelsOrOne) {
  struct {
    char magic[4] = {'V', 'O', 'L', 3};
    int32_t header[5] = {1, 2, 1, 1, 3};
    float box[6] = {0, 0, 0, 1, 1, 1};
    float values[6] = {0.1f, 0.2f, 0.3f, 0.5f, 0.6f, 0.7f};
  } file;
  std::vector<char> bytes(sizeof(file));
  std::memcpy(bytes.data(), &file, sizeof(file));
  test::writeBytes(folder_ / "rgb.vol", bytes);
  const RgbGrid grid = loadRgbVolume(folder_ / "rgb.vol");
  EXPECT_EQ(grid.view().lookup({1, 0, 0}), Rgb(0.5f, 0.6f, 0.7f));
  EXPECT_EQ(grid.maximum(), 0.7f);
  EXPECT_EQ(complaint("rgb.vol"), at("rgb.vol") + ": error: has 3 channels where one is wanted");
  writeVol(folder_ / "grey.vol", ramp(2, 2, 2));
  EXPECT_EQ(loadRgbVolume(folder_ / "grey.vol").view().lookup({0, 0, 0}), Rgb(0.25f));
}

TEST_F(VolumeIo, ReadsEveryKindOfScalar) {
  for (const auto type : {SampleGrid::Type::floats, SampleGrid::Type::halves, SampleGrid::Type::doubles}) {
    SampleGrid grid = block("density", 0.75f);
    grid.type = type;
    test::writeVdbSample(folder_ / "a.vdb", {grid});
    EXPECT_EQ(loadVolume(folder_ / "a.vdb")->view().lookup({2, 2, 2}), 0.75f);
  }
  EXPECT_EQ(listGrids(folder_ / "a.vdb").at(0).valueType, "double");
}

TEST_F(VolumeIo, ReadsEveryCodecAndMagic) {
  const SampleGrid grid = test::lumpyGrid();
  for (const auto codec : {test::NvdbCodec::none, test::NvdbCodec::zip, test::NvdbCodec::blosc}) {
    test::writeNvdbSample(folder_ / "a.nvdb", grid, codec);
    EXPECT_EQ(loadVolume(folder_ / "a.nvdb")->view().lookup({55, -20, 7}), 2.5f);
  }
  std::vector<char> bytes = test::bytesOf(folder_ / "a.nvdb");
  bytes[7] = '2';
  test::writeBytes(folder_ / "2.nvdb", bytes);
  EXPECT_EQ(loadVolume(folder_ / "2.nvdb")->view().lookup({55, -20, 7}), 2.5f);
  test::writeRawNvdbSample(folder_ / "raw.nvdb", grid);
  EXPECT_EQ(loadVolume(folder_ / "raw.nvdb")->view().lookup({55, -20, 7}), 2.5f);
}

TEST_F(VolumeIo, TellsFormatsByContent) {
  writeVdb(folder_ / "disguised.vol", ramp(3, 3, 3));
  EXPECT_EQ(loadVolume(folder_ / "disguised.vol")->view().supportLo, Vec3(-1));
}

TEST_F(VolumeIo, ChoosesGridsByName) {
  test::writeVdbSample(folder_ / "a.vdb", {block("flame", 1), block("density", 2), block("density", 3)});
  const auto peak = [&](const std::string& name) { return loadVolume(folder_ / "a.vdb", {name})->maximum(); };
  EXPECT_EQ(peak(""), 2);
  EXPECT_EQ(peak("density"), 2);
  EXPECT_EQ(peak("density[1]"), 3);
  EXPECT_EQ(peak("flame"), 1);
  EXPECT_EQ(complaint("a.vdb", {"densty"}), at("a.vdb") +
                                                ": error: no grid \"densty\"; did you mean \"density\"?\n"
                                                "  note: available: flame, density, density[1]");
  test::writeVdbSample(folder_ / "b.vdb", {block("flame"), block("temperature")});
  EXPECT_EQ(complaint("b.vdb"), at("b.vdb") +
                                    ": error: file has 2 grids and none is called \"density\"; say which\n"
                                    "  note: available: flame, temperature");
  test::writeVdbSample(folder_ / "c.vdb", {block("flame")});
  EXPECT_EQ(complaint("c.vdb"), "no error") << "the only one needs no name";
}

TEST_F(VolumeIo, RefusesWhatIsNoDensity) {
  const auto refused = [&](const SampleGrid& grid) {
    test::writeVdbSample(folder_ / "a.vdb", {grid});
    const std::string text = complaint("a.vdb"), prefix = at("a.vdb") + ": error: ";
    return text.starts_with(prefix) ? text.substr(prefix.size()) : text;
  };
  SampleGrid grid = block("v");
  grid.type = SampleGrid::Type::vectors;
  EXPECT_EQ(refused(grid), "grid \"v\" holds values of type vec3s; a density needs float, half or double");
  grid.type = SampleGrid::Type::integers;
  EXPECT_EQ(refused(grid), "grid \"v\" holds values of type int32; a density needs float, half or double");
  grid.type = SampleGrid::Type::booleans;
  EXPECT_EQ(refused(grid), "grid \"v\" holds values of type bool; a density needs float, half or double");
  grid = block("surface");
  grid.levelSet = true;
  EXPECT_EQ(refused(grid),
            "grid \"surface\" is a level set (distances to a surface), not a density; convert it to a fog volume");
  grid = block("view");
  grid.transform = SampleGrid::Transform::frustum;
  EXPECT_EQ(refused(grid), "grid \"view\" has a perspective (frustum) transform; only affine ones are known");
  EXPECT_EQ(refused(SampleGrid{}), "grid has no active voxels");
}

TEST_F(VolumeIo, RefusesBadValues) {
  const auto refused = [&](float value, bool active, float background) {
    SampleGrid grid = block();
    grid.background = background;
    grid.fills.push_back({{9, 8, 7}, {9, 8, 8}, value, active});
    test::writeVdbSample(folder_ / "a.vdb", {grid});
    return complaint("a.vdb");
  };
  const std::string prefix = at("a.vdb") + ": error: grid has ";
  EXPECT_EQ(refused(std::nanf(""), true, 0), prefix + "bad values: 2 NaN; the first is at index (9, 8, 7)");
  EXPECT_EQ(refused(-1, true, 0), prefix + "bad values: 2 negative; the first is at index (9, 8, 7)");
  EXPECT_EQ(refused(std::nanf(""), false, 0), "no error") << "inactive voxels do not count";
  EXPECT_EQ(refused(1, true, -1), prefix + "background -1; it must be finite and not negative");
  EXPECT_EQ(refused(1, true, 0.5f), "no error");
}

TEST_F(VolumeIo, BrokenFilesSayWhatIsWrong) {
  const auto expect = [&](const std::vector<char>& bytes, const std::string& message) {
    test::writeBytes(folder_ / "broken", bytes);
    EXPECT_EQ(complaint("broken"), at("broken") + ": error: " + message);
  };
  const auto cut = [](std::vector<char> bytes, size_t size) { return bytes.resize(size), bytes; };
  const auto set = [](std::vector<char> bytes, size_t offset, auto value) {
    std::memcpy(bytes.data() + offset, &value, sizeof(value));
    return bytes;
  };
  expect({}, "is not a volume: known are .vol, .vdb and .nvdb");
  expect({'h', 'e', 'l', 'l', 'o'}, "is not a volume: known are .vol, .vdb and .nvdb");

  writeVol(folder_ / "a.vol", ramp(4, 3, 2));
  const std::vector<char> vol = test::bytesOf(folder_ / "a.vol");
  expect(cut(vol, 20), "file is truncated or damaged");
  expect(cut(vol, vol.size() - 4), "header says 4 x 3 x 2 voxels of 1 channels, which take 96 bytes, but 92 follow");
  expect(set(vol, 8, int32_t{1 << 30}),
         "header says 1073741824 x 3 x 2 voxels of 1 channels, which take 25769803776 bytes, but 96 follow");
  expect(set(vol, 8, int32_t{-4}), "header says -4 x 3 x 2 voxels of 1 channels");
  expect(set(vol, 3, char{2}), "has version 2 of the .vol format; only 3 is known");
  expect(set(vol, 4, int32_t{2}), "has values of .vol type 2; only 1 (float32) is known");
  expect(set(vol, 48, std::nanf("")), "grid has bad values: 1 NaN; the first is at index (0, 0, 0)");

  test::writeVdbSample(folder_ / "a.vdb", {test::lumpyGrid()});
  const std::vector<char> vdb = test::bytesOf(folder_ / "a.vdb");
  expect(cut(vdb, 30), "file is truncated or damaged");
  expect(cut(vdb, vdb.size() / 2), "file is truncated or damaged");
  expect(cut(vdb, vdb.size() - 10), "file is truncated or damaged");
  expect(set(vdb, 8, uint32_t{999}), "has VDB file version 999; known are 222 to 224");

  test::writeNvdbSample(folder_ / "a.nvdb", block(), test::NvdbCodec::none);
  const std::vector<char> nvdb = test::bytesOf(folder_ / "a.nvdb");
  const size_t grid = nvdb.size() - [&] {
    uint64_t size;
    std::memcpy(&size, nvdb.data() + 16, sizeof(size));
    return size;
  }();
  expect(cut(nvdb, 100), "file is truncated or damaged");
  expect(cut(nvdb, nvdb.size() - 1), "file is truncated or damaged");
  expect(set(nvdb, 8, uint32_t{29u << 21}), "has version 29.0.0 of NanoVDB's format; only 32.x is known");
  expect(set(nvdb, 14, uint16_t{7}), "is compressed by codec 7, which is not known");
  expect(set(nvdb, 16, uint64_t{1} << 60), "grid \"density\" is larger than its data: file is truncated or damaged");
  expect(set(nvdb, grid + 672 + 24, uint64_t{1} << 40),
         "grid \"density\" has its root outside the buffer: file is damaged");
  expect(set(nvdb, grid + 400, char{1}), "grid \"density\" does not match its checksum: file is damaged");
  expect(set(nvdb, nvdb.size() - 40, 12.f), "grid \"density\" does not match its checksum: file is damaged");

  test::writeNvdbSample(folder_ / "zip.nvdb", block(), test::NvdbCodec::zip);
  const std::vector<char> zip = test::bytesOf(folder_ / "zip.nvdb");
  expect(set(zip, zip.size() - 200, uint64_t{0x1234567}), "grid \"density\" cannot be unzipped: file is damaged");
}

TEST_F(VolumeIo, MissingFilesSayWhy) {
  EXPECT_EQ(complaint("none.vdb"), at("none.vdb") + ": error: cannot open the file: No such file or directory");
  fs::create_directory(folder_ / "sub");
  EXPECT_EQ(complaint("sub"), at("sub") + ": error: is not a file");
}

TEST_F(VolumeIo, ListsEveryGrid) {
  SampleGrid vectors = block("v");
  vectors.type = SampleGrid::Type::vectors;
  SampleGrid moved = block("density", 2);
  moved.indexToWorld = Matrix4::translation(10, 0, 0) * Matrix4::scaling(0.5, 0.5, 0.5);
  moved.fills.push_back({{4, 0, 0}, {4, 0, 0}, 6.f});
  test::writeVdbSample(folder_ / "a.vdb", {moved, vectors});
  const std::vector<GridInfo> list = listGrids(folder_ / "a.vdb");
  ASSERT_EQ(list.size(), 2u);
  EXPECT_EQ(list[0].name, "density");
  EXPECT_EQ(list[0].kind, "fog volume");
  EXPECT_EQ(list[0].valueType, "float");
  EXPECT_EQ(list[0].problem, "");
  EXPECT_EQ(list[0].activeVoxels, 65u);
  EXPECT_EQ(list[0].indexHi, (std::array<int64_t, 3>{4, 3, 3}));
  EXPECT_EQ(list[0].minimum, 2);
  EXPECT_EQ(list[0].maximum, 6);
  EXPECT_NEAR(list[0].mean, (128.f + 6) / 65, 1e-5f);
  EXPECT_EQ(list[0].worldBounds.lo, Vec3(9.75f, -0.25f, -0.25f));
  EXPECT_EQ(list[1].valueType, "vec3s");
  EXPECT_NE(list[1].problem, "");
}

TEST_F(VolumeIo, WritersLeaveNothingHalfDone) {
  const auto count = [&] { return std::distance(fs::directory_iterator(folder_.path()), fs::directory_iterator{}); };
  fs::create_directory(folder_ / "taken.vol");
  for (const auto write : {writeVol, writeVdb, writeNvdb}) {
    EXPECT_THROW(write(folder_ / "no/such/folder/a", ramp(2, 2, 2)), Error);
    EXPECT_THROW(write(folder_ / "taken.vol", ramp(2, 2, 2)), Error) << "a folder is in the way";
  }
  EXPECT_EQ(count(), 1) << "no temporary file is left";
  DenseVolume turned = ramp(2, 2, 2);
  turned.indexToWorld = Matrix4::rotation(0, 1, 0, 30);
  EXPECT_THROW(writeVol(folder_ / "a.vol", turned), Error);
  EXPECT_EQ(count(), 1);
}

TEST_F(VolumeIo, RotationsSurvive) {
  DenseVolume turned = ramp(3, 3, 3);
  turned.indexToWorld = Matrix4::translation(1, 2, 3) * Matrix4::rotation(1, 2, 3, 40) * Matrix4::scaling(1, 2, 0.5);
  writeVdb(folder_ / "a.vdb", turned);
  writeNvdb(folder_ / "a.nvdb", turned);
  for (const char* name : {"a.vdb", "a.nvdb"}) {
    const Matrix4 read = loadVolume(folder_ / name)->indexToWorld();
    for (size_t n = 0; n < 16; ++n) EXPECT_NEAR(read.m[n], turned.indexToWorld.m[n], 1e-9) << name;
  }
}

}  // namespace
}  // namespace virga
