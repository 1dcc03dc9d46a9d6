// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <chrono>
#include <functional>
#include <random>

#include "image/formats.h"
#include "image/image_io.h"
#include "scratch.h"

namespace virga {
namespace {

Image smallImage() {
  Image out(40, 24);
  std::mt19937 random(9);
  std::uniform_real_distribution<float> value(0, 1);
  for (Rgb& pixel : out.pixels) pixel = {value(random), value(random) < 0.5f ? 0.f : 1.f, 0.25f};
  return out;
}

// Run-length coded scan lines, as Radiance writes them: four planes a line, each of one run of 40.
std::string hdrWithRuns() {
  std::string out = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 24 +X 40\n";
  for (int y = 0; y < 24; ++y) {
    out += std::string("\x02\x02\x00\x28", 4);
    for (const char value : {'\x80', '\x40', '\x20', '\x81'}) out += {static_cast<char>(128 + 40), value};
  }
  return out;
}

std::string mutated(std::string bytes, std::mt19937& random) {
  const auto below = [&](size_t n) { return std::uniform_int_distribution<size_t>(0, n - 1)(random); };
  // Headers are small beside the pixels and decide more: half of the flips go there.
  const auto place = [&] { return below(2) == 0 ? below(bytes.size()) : below(std::min<size_t>(bytes.size(), 400)); };
  const size_t kind = below(5);
  if (kind == 0) return bytes.substr(0, 1 + below(bytes.size()));
  if (kind == 1) {
    const size_t at = place();
    return bytes.erase(at, 1 + below(8));
  }
  if (kind == 2) {
    const size_t at = place();
    return bytes.insert(at, 1 + below(8), static_cast<char>(below(256)));
  }
  constexpr char kTelling[] = {'\x00', '\x01', '\x7f', '\x80', '\xff'};
  for (size_t i = 0, n = 1 + below(6); i < n; ++i)
    bytes[place()] = kind == 3 ? kTelling[below(5)] : static_cast<char>(below(256));
  return bytes;
}

// Whatever the bytes are: a picture or an Error, in bounded time and memory; the sanitizers watch.
// In memory, because files would take most of the time.
void fuzz(const std::string& original, int rounds, const std::function<Image(const std::string&)>& decode) {
  std::mt19937 random(1);
  int read = 0, refused = 0;
  const auto start = std::chrono::steady_clock::now();
  for (int i = 0; i < rounds; ++i) {
    try {
      const Image image = decode(mutated(original, random));
      EXPECT_EQ(image.pixels.size(), static_cast<size_t>(image.width) * static_cast<size_t>(image.height));
      ++read;
    } catch (const Error& e) {
      EXPECT_NE(std::string(e.what()).find("the file's name"), std::string::npos) << e.what();
      ++refused;
    }
  }
  EXPECT_GT(refused, rounds / 20) << "the mutations do not reach anything";
  EXPECT_GT(read, 0) << "the mutations let nothing through";
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(60));
}

Image decodeStb(const std::string& bytes) { return formats::decodeStb("the file's name", bytes, Encoding::sRgb); }

TEST(Fuzz, Exr) {
  const ScratchFolder folder;
  LayeredImage image;
  image.beauty = smallImage();
  image.layers = {{"emission", smallImage()}};
  image.variance = smallImage();
  image.metadata = {{"virga.method", "path"}, {"virga.seconds", 1.5}, {"virga.passes", int64_t{3}}};
  writeExr(folder / "a.exr", image);
  fuzz(fileBytes(folder / "a.exr"), 3000,
       [](const std::string& bytes) { return formats::decodeLayeredExr("the file's name", bytes).beauty; });
}

TEST(Fuzz, Png) {
  const ScratchFolder folder;
  writePng(folder / "a.png", smallImage());
  fuzz(fileBytes(folder / "a.png"), 3000, decodeStb);
}

TEST(Fuzz, Hdr) { fuzz(hdrWithRuns(), 3000, decodeStb); }

}  // namespace
}  // namespace virga
