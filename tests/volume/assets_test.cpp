// SPDX-License-Identifier: Apache-2.0
// Files that other programs wrote. They are not part of the repository: the tests are registered where VIRGA_ASSETS (a
// CMake option, or an environment variable when CMake runs) names the folder that has volumes/.
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "core/error.h"
#include "volume/samples.h"
#include "volume/volume_io.h"

namespace virga {
namespace {

namespace fs = std::filesystem;

class Assets : public testing::Test {
 protected:
  std::string complaint(const std::string& name) const {
    try {
      loadVolume(volumes_ / name);
    } catch (const Error& e) {
      return e.message();
    }
    return "no error";
  }

  fs::path volumes_ = fs::path(VIRGA_ASSETS) / "volumes";
};

TEST_F(Assets, OldFileVersionOfHalves) {
  const GridInfo info = listGrids(volumes_ / "openvdb_smoke1.vdb").at(0);
  EXPECT_EQ(info.format, "vdb 222");
  EXPECT_EQ(info.valueType, "half");
  EXPECT_EQ(info.activeVoxels, 1049275u);
  EXPECT_EQ(info.indexLo, (std::array<int64_t, 3>{1, 2, 1}));
  EXPECT_EQ(info.indexHi, (std::array<int64_t, 3>{111, 223, 112}));
  EXPECT_NEAR(loadVolume(volumes_ / "openvdb_smoke1.vdb")->maximum(), 5.7148438f, 1e-6f);
}

TEST_F(Assets, Doubles) {
  EXPECT_EQ(listGrids(volumes_ / "daichi_smoke.vdb").at(0).valueType, "double");
  EXPECT_EQ(loadVolume(volumes_ / "daichi_smoke.vdb")->maximum(), 1);
}

TEST_F(Assets, ThreeGridsOfOneName) {
  const fs::path path = volumes_ / "arnold_test2315_grids.vdb";
  EXPECT_EQ(listGrids(path).size(), 3u);
  EXPECT_EQ(loadVolume(path)->view().supportHi.x, 6);
  EXPECT_EQ(loadVolume(path, {"density[1]"})->view().supportHi.x, 10);
  EXPECT_THROW(loadVolume(path, {"density[3]"}), Error);
}

TEST_F(Assets, OtherPrograms) {
  EXPECT_NEAR(loadVolume(volumes_ / "arnold_torus01.vdb")->maximum(), 100, 1e-3f);
  EXPECT_EQ(loadVolume(volumes_ / "sergeneren_dragon.vdb")->maximum(), 1);
  EXPECT_EQ(loadVolume(volumes_ / "sergeneren_dragon_with_xform.vdb")->maximum(), 1);
}

TEST_F(Assets, NanoVdbOfAnotherVersion) {
  const GridInfo info = listGrids(volumes_ / "teapot_cloud.nvdb").at(0);
  EXPECT_EQ(info.format, "nvdb 32.3.3, zip");
  EXPECT_EQ(info.activeVoxels, 1963736u);
  EXPECT_EQ(loadVolume(volumes_ / "teapot_cloud.nvdb")->maximum(), 50);
}

TEST_F(Assets, StorageDoesNotChangeTheField) {
  using Storage = GridOptions::Storage;
  for (const char* name : {"openvdb_smoke1.vdb", "teapot_cloud.nvdb", "sergeneren_dragon.vdb"}) {
    const auto dense = loadVolume(volumes_ / name, {}, {.storage = Storage::dense});
    const auto sparse = loadVolume(volumes_ / name, {}, {.storage = Storage::sparse});
    const GridView &a = dense->view(), &b = sparse->view();
    test::Sequence random(2);
    for (int n = 0; n < 20000; ++n) {
      const Vec3 u(static_cast<float>(random.next()), static_cast<float>(random.next()),
                   static_cast<float>(random.next()));
      const Vec3 p = a.supportLo + (a.supportHi - a.supportLo) * u;
      ASSERT_NEAR(a.lookup(p), b.lookup(p), 1e-4f * dense->maximum()) << name;
    }
    for (int k = 0; k < a.mean.nz; ++k)
      for (int j = 0; j < a.mean.ny; ++j)
        for (int i = 0; i < a.mean.nx; ++i) {
          ASSERT_EQ(a.majorant.cell(i, j, k), b.majorant.cell(i, j, k)) << name;
          ASSERT_NEAR(a.mean.cell(i, j, k), b.mean.cell(i, j, k), 1e-5f * dense->maximum()) << name;
        }
  }
}

TEST_F(Assets, WhatIsNoDensityIsRefused) {
  EXPECT_EQ(complaint("tomhepz_grid0.vdb"),
            "grid has bad values: 1 NaN, 265260 negative; the first is at index (-39, -40, -40)");
  EXPECT_EQ(complaint("cortex_sphere.vdb"),
            "grid \"ls_sphere\" is a level set (distances to a surface), not a density; convert it to a fog volume");
}

TEST_F(Assets, ASequence) {
  int frames = 0;
  for (const auto& entry : fs::directory_iterator(volumes_ / "stormscape_seq")) {
    if (entry.path().extension() != ".vdb") continue;
    EXPECT_GT(loadVolume(entry.path())->maximum(), 0) << entry.path();
    ++frames;
  }
  EXPECT_EQ(frames, 20);
}

}  // namespace
}  // namespace virga
