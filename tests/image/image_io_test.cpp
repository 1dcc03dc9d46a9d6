// SPDX-License-Identifier: Apache-2.0
#include "image/image_io.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <ImfTiledOutputFile.h>
#include <gtest/gtest.h>
#include <half.h>

#include <cmath>
#include <functional>
#include <random>

#include "core/atomic_write.h"
#include "image/layers.h"
#include "scratch.h"

namespace virga {
namespace {

Image randomImage(int width, int height, unsigned seed) {
  std::mt19937 random(seed);
  std::exponential_distribution<float> value(1);
  Image out(width, height);
  for (Rgb& pixel : out.pixels) pixel = {value(random), 1e4f * value(random), 1e-6f * value(random)};
  return out;
}

TEST(Exr, RoundTripKeepsEverything) {
  const ScratchFolder folder;
  LayeredImage out;
  out.beauty = randomImage(37, 23, 0);
  out.beauty.at(3, 4) = {-1, kInfinity, 1e-42f};
  for (unsigned i = 0; i < kLayerCount; ++i) {
    out.layers.emplace_back(kLayerNames[i], randomImage(37, 23, 1 + i));
    out.layerVariances.emplace_back(kLayerNames[i], randomImage(37, 23, 100 + i));
  }
  out.variance = randomImage(37, 23, 99);
  out.metadata = {{"virga.method", "path"},
                  {"virga.passes", int64_t{12}},
                  {"virga.seed", int64_t{1} << 40},
                  {"virga.aVeryLongNameOfAParameter", 0.1},
                  {"virga.note", ""}};
  writeExr(folder / "all.exr", out);
  const LayeredImage in = readLayeredImage(folder / "all.exr");

  EXPECT_EQ(in.beauty.pixels, out.beauty.pixels);
  ASSERT_EQ(in.layers.size(), out.layers.size());
  ASSERT_EQ(in.layerVariances.size(), out.layerVariances.size());
  for (const auto& [name, image] : out.layers) {
    ASSERT_NE(in.layer(name), nullptr) << name;
    EXPECT_EQ(in.layer(name)->pixels, image.pixels) << name;
  }
  for (const auto& [name, image] : out.layerVariances) {
    ASSERT_NE(in.layerVariance(name), nullptr) << name;
    EXPECT_EQ(in.layerVariance(name)->pixels, image.pixels) << name;
  }
  ASSERT_TRUE(in.variance);
  EXPECT_EQ(in.variance->pixels, out.variance->pixels);
  EXPECT_EQ(in.layer("no_such_layer"), nullptr);
  Metadata expected = out.metadata;
  expected["virga.seed"] = "1099511627776";  // EXR has no integers of 64 bits
  EXPECT_EQ(in.metadata, expected);
  EXPECT_EQ(readImage(folder / "all.exr").pixels, out.beauty.pixels);
  EXPECT_EQ(countNonFinite(in.beauty), 1);
}

TEST(Exr, PlainPictureHasRgbAlone) {
  const ScratchFolder folder;
  writeExr(folder / "plain.exr", randomImage(5, 1, 3));
  const LayeredImage in = readLayeredImage(folder / "plain.exr");
  EXPECT_EQ(in.beauty.pixels, randomImage(5, 1, 3).pixels);
  EXPECT_TRUE(in.layers.empty());
  EXPECT_TRUE(in.layerVariances.empty());
  EXPECT_FALSE(in.variance);
  EXPECT_TRUE(in.metadata.empty());
}

// Files as other programs write them.
struct Foreign {
  Imf::PixelType type = Imf::FLOAT;
  Imf::Compression compression = Imf::ZIP_COMPRESSION;
  std::vector<std::string> channels = {"R", "G", "B"};
  int tile = 0;  ///< 0: scan lines
  int width = 50, height = 41;
  Imath::V2i corner = {0, 0};
};

// All channels hold the same ramp of small integers, which each pixel type can.
float ramp(int x, int y) { return static_cast<float>((x + 3 * y) % 97); }

void writeForeign(const std::filesystem::path& path, const Foreign& f) {
  const Imath::Box2i window(f.corner, f.corner + Imath::V2i(f.width - 1, f.height - 1));
  Imf::Header header(window, window);
  header.compression() = f.compression;
  const size_t pixels = static_cast<size_t>(f.width) * static_cast<size_t>(f.height);
  std::vector<float> floats(pixels);
  std::vector<half> halves(pixels);
  std::vector<unsigned> integers(pixels);
  for (size_t i = 0; i < pixels; ++i) {
    const auto x = static_cast<int>(i) % f.width, y = static_cast<int>(i) / f.width;
    floats[i] = ramp(x, y), halves[i] = ramp(x, y), integers[i] = static_cast<unsigned>(ramp(x, y));
  }
  Imf::FrameBuffer frame;
  for (const std::string& channel : f.channels) {
    header.channels().insert(channel, Imf::Channel(f.type));
    void* data = f.type == Imf::FLOAT  ? static_cast<void*>(floats.data())
                 : f.type == Imf::HALF ? static_cast<void*>(halves.data())
                                       : static_cast<void*>(integers.data());
    const size_t size = f.type == Imf::HALF ? 2 : 4;
    frame.insert(channel, Imf::Slice::Make(f.type, data, window, size, size * static_cast<size_t>(f.width)));
  }
  if (f.tile > 0) {
    header.setTileDescription(Imf::TileDescription(static_cast<unsigned>(f.tile), static_cast<unsigned>(f.tile)));
    Imf::TiledOutputFile file(path.c_str(), header);
    file.setFrameBuffer(frame);
    file.writeTiles(0, file.numXTiles() - 1, 0, file.numYTiles() - 1);
  } else {
    Imf::OutputFile file(path.c_str(), header);
    file.setFrameBuffer(frame);
    file.writePixels(f.height);
  }
}

void expectRamp(const Image& image, const Foreign& f, float tolerance) {
  ASSERT_EQ(image.width, f.width);
  ASSERT_EQ(image.height, f.height);
  for (int y = 0; y < f.height; ++y)
    for (int x = 0; x < f.width; ++x)
      for (int c = 0; c < 3; ++c) ASSERT_NEAR(image.at(x, y)[c], ramp(x, y), tolerance) << x << " " << y;
}

TEST(Exr, ReadsEveryCompressionTypeAndLayout) {
  const ScratchFolder folder;
  for (int compression = 0; compression < Imf::NUM_COMPRESSION_METHODS; ++compression)
    for (const Imf::PixelType type : {Imf::UINT, Imf::HALF, Imf::FLOAT})
      for (const int tile : {0, 16}) {
        const auto method = static_cast<Imf::Compression>(compression);
        const bool lossy = method == Imf::B44_COMPRESSION || method == Imf::B44A_COMPRESSION ||
                           method == Imf::DWAA_COMPRESSION || method == Imf::DWAB_COMPRESSION;
        const Foreign f{.type = type, .compression = method, .tile = tile};
        writeForeign(folder / "foreign.exr", f);
        SCOPED_TRACE(fmt::format("compression {} type {} tile {}", compression, static_cast<int>(type), tile));
        expectRamp(readImage(folder / "foreign.exr"), f, lossy ? 12.f : 0.f);
      }
}

TEST(Exr, ReadsForeignChannelsAndWindows) {
  const ScratchFolder folder;
  const std::vector<Foreign> readable = {
      {.channels = {"Y"}},
      {.channels = {"Y", "A"}},
      {.channels = {"A", "B", "G", "R", "Z"}},
      {.channels = {"color.R", "color.G", "color.B", "N.X", "N.Y", "N.Z", "depth.Z"}},
      {.width = 1, .height = 1},
      {.tile = 8, .corner = {-20, 1000}},
      {.corner = {123456, -7}}};
  for (size_t i = 0; i < readable.size(); ++i) {
    SCOPED_TRACE(i);
    writeForeign(folder / "foreign.exr", readable[i]);
    expectRamp(readImage(folder / "foreign.exr"), readable[i], 0);
  }
  writeForeign(folder / "depth.exr", {.channels = {"Z", "A"}});
  const std::string message = errorOf([&] { readImage(folder / "depth.exr"); });
  EXPECT_NE(message.find("depth.exr"), std::string::npos) << message;
  EXPECT_NE(message.find("A, Z"), std::string::npos) << message;
  writeForeign(folder / "two.exr", {.channels = {"a.R", "a.G", "a.B", "b.R", "b.G", "b.B"}});
  EXPECT_NE(errorOf([&] { readImage(folder / "two.exr"); }).find("a.B, a.G, a.R"), std::string::npos);
}

TEST(Png, RoundTripIsTheToneMap) {
  const ScratchFolder folder;
  Image out(256, 2);
  for (int x = 0; x < 256; ++x) out.at(x, 0) = Rgb(srgbToLinear(static_cast<float>(x) / 255));
  out.at(0, 1) = {2, -1, 0.5f};
  out.at(1, 1) = {std::nanf(""), 0, 0};
  writePng(folder / "a.png", out);
  const Image raw = readImage(folder / "a.png", Encoding::raw), linear = readImage(folder / "a.png");
  for (int x = 0; x < 256; ++x) {
    EXPECT_FLOAT_EQ(raw.at(x, 0).g, static_cast<float>(x) / 255);
    EXPECT_FLOAT_EQ(linear.at(x, 0).b, out.at(x, 0).b);
  }
  EXPECT_EQ(raw.at(0, 1), Rgb(1, 0, 188.f / 255));  // sRGB of 0.5 is 0.7354
  EXPECT_EQ(raw.at(1, 1), Rgb(1, 0, 1)) << "a NaN shows as magenta";
  writePng(folder / "b.png", out, {.exposure = 1});
  EXPECT_NEAR(readImage(folder / "b.png").at(128, 0).r, 2 * out.at(128, 0).r, 0.005f);
}

TEST(ToneMap, CurvesAreInverse) {
  for (float x = 0; x <= 1; x += 1 / 1024.f) EXPECT_NEAR(linearToSrgb(srgbToLinear(x)), x, 2e-6f);
  EXPECT_FLOAT_EQ(linearToSrgb(1), 1);
  EXPECT_EQ(toneMapped(Rgb(kInfinity, 0, 0)), (std::array<uint8_t, 3>{255, 0, 255}));
  EXPECT_EQ(toneMapped(Rgb(1e38f), {.exposure = 20}), (std::array<uint8_t, 3>{255, 255, 255}));
}

// A Radiance picture of flat pixels, the mantissas 128, 64, 0 and the exponent 1 + 128: (1, 0.5, 0).
std::string hdrFile(int width, int height) {
  std::string out = fmt::format("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {} +X {}\n", height, width);
  for (int i = 0; i < width * height; ++i) out += std::string("\x80\x40\x00\x81", 4);
  return out;
}

// True colour, uncompressed, bottom up: blue, green, red.
std::string tgaFile(int width, int height) {
  std::string out(18, '\0');
  out[2] = 2, out[12] = static_cast<char>(width), out[14] = static_cast<char>(height), out[16] = 24;
  for (int i = 0; i < width * height; ++i) out += std::string("\x00\x33\xff", 3);
  return out;
}

TEST(Stb, ReadsHdrAndTga) {
  const ScratchFolder folder;
  putBytes(folder / "a.hdr", hdrFile(5, 3));
  const Image hdr = readImage(folder / "a.hdr");
  ASSERT_EQ(hdr.width, 5);
  ASSERT_EQ(hdr.height, 3);
  for (const Rgb& pixel : hdr.pixels) EXPECT_EQ(pixel, Rgb(1, 0.5f, 0));
  putBytes(folder / "a.TGA", tgaFile(40, 30));
  const Image tga = readImage(folder / "a.TGA", Encoding::raw);
  ASSERT_EQ(tga.pixels.size(), 1200u);
  for (const Rgb& pixel : tga.pixels) EXPECT_EQ(pixel, Rgb(1, 0.2f, 0));
}

struct Broken {
  std::string name, bytes, message;
};

TEST(BrokenFiles, GiveOneErrorThatNamesTheFile) {
  const ScratchFolder folder;
  writeExr(folder / "good.exr", randomImage(64, 64, 1));
  writePng(folder / "good.png", randomImage(64, 64, 1));
  const std::string exr = fileBytes(folder / "good.exr"), png = fileBytes(folder / "good.png");
  const auto half = [](const std::string& bytes) { return bytes.substr(0, bytes.size() / 2); };
  std::string hugeExr = exr;
  const size_t window = exr.find("dataWindow");
  hugeExr.replace(window + 21 + 8, 8, std::string("\xff\xff\xff\x3f\xff\xff\xff\x3f", 8));
  std::string largeExr = exr;
  largeExr.replace(window + 21 + 8, 8, std::string("\x00\x00\x01\x00\x00\x00\x01\x00", 8));
  std::string largeAttribute = exr;
  largeAttribute.replace(window + 17, 4, std::string("\xff\xff\xff\x7f", 4));
  std::string hugePng = png;
  hugePng.replace(16, 8, std::string("\x00\x01\x00\x01\x00\x00\x00\x64", 8));
  std::string bombPng = png;
  bombPng.replace(16, 8, std::string("\x00\x00\x80\x00\x00\x00\x80\x00", 8));
  const std::vector<Broken> corpus = {
      {"empty.exr", "", "empty"},
      {"garbage.exr", "this is no picture", "not a picture"},
      {"garbage.png", std::string(1000, 'x'), "not a picture"},
      {"magic.exr", exr.substr(0, 4), "cut short"},
      {"header.exr", exr.substr(0, 100), "cut short"},
      {"half.exr", half(exr), "cut short"},
      {"last.exr", exr.substr(0, exr.size() - 1), "cut short"},
      {"huge.exr", hugeExr, "cut short (Invalid data window"},
      {"large.exr", largeExr, "too large (65537 x 65537"},
      {"attribute.exr", largeAttribute, "longer than the file"},
      {"half.png", half(png), "cut short"},
      {"huge.png", hugePng, "too large (65537 x 100"},
      {"bomb.png", bombPng, "damaged"},
      {"half.hdr", half(hdrFile(64, 64)), "cut short"},
      {"last.hdr", hdrFile(4, 4).substr(0, hdrFile(4, 4).size() - 1), "cut short"},
      {"lines.hdr", "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 64 +X 64\n\x02\x02" + std::string("\x00\x40\x00", 3),
       "cut short"},
      {"header.hdr", "#?RADIANCE\n", ""},
      {"zero.hdr", "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 0 +X 0\n", "empty"},
      {"huge.hdr", "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 60000 +X 4000\n", "damaged"},
      {"last.tga", tgaFile(40, 30).substr(0, 18 + 3599), "cut short"},
      {"garbage.tga", "this is no picture, whatever its name says", "damaged"},
      {"start.jpg", "\xff\xd8\xff", ""},
  };
  for (const Broken& file : corpus) {
    putBytes(folder / file.name, file.bytes);
    for (const auto& read : std::vector<std::function<void()>>{[&] { readImage(folder / file.name); },
                                                               [&] { readLayeredImage(folder / file.name); }}) {
      SCOPED_TRACE(file.name);
      const std::string message = errorOf(read);
      EXPECT_NE(message.find(file.name), std::string::npos) << message;
      EXPECT_NE(message.find(file.message), std::string::npos) << message;
    }
  }
  EXPECT_NE(errorOf([&] { readImage(folder / "missing.exr"); }).find("no such file"), std::string::npos);
  EXPECT_NE(errorOf([&] { readImage(folder.path()); }).find("folder"), std::string::npos);
}

// Pictures as people have them; the format's own corners are tested above.
TEST(Assets, Pictures) {
  int read = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(VIRGA_ASSETS)) {
    const std::string end = entry.path().extension().string();
    if (end != ".hdr" && end != ".exr" && end != ".png" && end != ".jpg" && end != ".tga") continue;
    SCOPED_TRACE(entry.path().string());
    Image image;
    ASSERT_NO_THROW(image = readImage(entry.path()));
    EXPECT_EQ(countNonFinite(image), 0);
    ++read;
  }
  EXPECT_GT(read, 0) << "VIRGA_ASSETS holds no pictures";
}

}  // namespace
}  // namespace virga
