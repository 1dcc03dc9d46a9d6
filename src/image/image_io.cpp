// SPDX-License-Identifier: Apache-2.0
#include "image/image_io.h"

#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <memory>
#include <system_error>

#include "core/atomic_write.h"
#include "core/error.h"
#include "core/parallel.h"
#include "image/formats.h"

namespace virga {
namespace fs = std::filesystem;

namespace formats {

void broken(const std::string& name, const std::string& message, const std::string& hint) {
  SourcePosition position;
  position.file = std::make_shared<const SourceFile>(SourceFile{name, ""});
  throw Error(message, {.position = position, .hint = hint, .notes = {}});
}

void checkSize(const std::string& name, int64_t width, int64_t height) {
  if (width <= 0 || height <= 0) broken(name, fmt::format("the picture is empty ({} x {} pixels)", width, height));
  if (width > kMaxImageSide || height > kMaxImageSide || width * height > kMaxImagePixels)
    broken(name, fmt::format("the picture is too large ({} x {} pixels)", width, height),
           fmt::format("up to {} pixels a side and {} in all are read", kMaxImageSide, kMaxImagePixels));
}

}  // namespace formats

namespace {

constexpr uintmax_t kMaxFileBytes = uintmax_t{16} << 30;

std::string readBytes(const fs::path& path) {
  const std::string name = path.string();
  std::error_code failure;
  const fs::file_status status = fs::status(path, failure);
  if (!fs::exists(status)) formats::broken(name, "there is no such file");
  if (fs::is_directory(status)) formats::broken(name, "it is a folder, not a picture");
  const uintmax_t size = fs::file_size(path, failure);
  if (failure) formats::broken(name, "cannot read the file: " + failure.message());
  if (size == 0) formats::broken(name, "the file is empty");
  if (size > kMaxFileBytes) formats::broken(name, "the file is too large for a picture");

  std::ifstream stream(path, std::ios::binary);
  if (!stream) formats::broken(name, fmt::format("cannot read the file: {}", std::strerror(errno)));
  std::string bytes(size, '\0');
  stream.read(bytes.data(), static_cast<std::streamsize>(size));
  if (static_cast<uintmax_t>(stream.gcount()) != size) formats::broken(name, "cannot read the file to its end");
  return bytes;
}

const Image* find(const LayeredImage::Named& images, const std::string& name) {
  for (const auto& [candidate, image] : images)
    if (candidate == name) return &image;
  return nullptr;
}

// The libraries below throw their own kinds; a caller shall have to know only Error.
template <class Decode>
auto decoded(const fs::path& path, const Decode& decode) {
  const std::string name = path.string();
  try {
    const std::string bytes = readBytes(path);
    return decode(name, bytes);
  } catch (const std::bad_alloc&) {
    formats::broken(name, "not enough memory for this picture");
  } catch (const std::length_error&) {
    formats::broken(name, "not enough memory for this picture");
  }
}

}  // namespace

const Image* LayeredImage::layer(const std::string& name) const { return find(layers, name); }
const Image* LayeredImage::layerVariance(const std::string& name) const { return find(layerVariances, name); }

Image readImage(const fs::path& path, Encoding encoding) {
  return decoded(path, [encoding](const std::string& name, const std::string& bytes) {
    return formats::isExr(bytes) ? formats::decodeExr(name, bytes) : formats::decodeStb(name, bytes, encoding);
  });
}

LayeredImage readLayeredImage(const fs::path& path) {
  return decoded(path, [](const std::string& name, const std::string& bytes) {
    if (formats::isExr(bytes)) return formats::decodeLayeredExr(name, bytes);
    LayeredImage out;
    out.beauty = formats::decodeStb(name, bytes, Encoding::sRgb);
    return out;
  });
}

void writeExr(const fs::path& path, const LayeredImage& image) { writeAtomically(path, formats::encodeExr(image)); }

void writeExr(const fs::path& path, const Image& image) {
  LayeredImage layered;
  layered.beauty = image;
  writeExr(path, layered);
}

void writePng(const fs::path& path, const Image& image, const ToneMap& map) {
  writeAtomically(path, formats::encodePng(image, map));
}

int64_t countNonFinite(const Image& image) {
  return deterministicReduce<int64_t>(
      static_cast<int64_t>(image.pixels.size()), 0,
      [&](int64_t i) { return isFinite(image.pixels[static_cast<size_t>(i)]) ? int64_t{0} : int64_t{1}; },
      [](int64_t a, int64_t b) { return a + b; });
}

}  // namespace virga
