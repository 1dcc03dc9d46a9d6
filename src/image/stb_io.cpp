// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <climits>
#include <cstring>
#include <memory>

#include "core/error.h"
#include "core/parallel.h"
#include "image/formats.h"

// The only place where stb is compiled; its warnings are its own business.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wsign-conversion"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wextra"
#pragma GCC diagnostic ignored "-Wunused-function"
#define STB_IMAGE_STATIC
#define STB_IMAGE_IMPLEMENTATION
#define STBI_ONLY_PNG
#define STBI_ONLY_JPEG
#define STBI_ONLY_TGA
#define STBI_ONLY_HDR
#define STBI_NO_STDIO
#define STBI_ASSERT(x)  // it guards against itself only, and a library never ends the process
#include <stb/stb_image.h>
#define STB_IMAGE_WRITE_STATIC
#define STB_IMAGE_WRITE_IMPLEMENTATION
#define STBI_WRITE_NO_STDIO
#include <stb/stb_image_write.h>
#pragma GCC diagnostic pop

namespace virga::formats {
namespace {

// stb takes the end of the data for zeros: a picture that was cut short would come out grey or black without a word
// (and a cut HDR would keep it busy for ever). So it reads through this, which notes when it asks for more than there
// is.
class Source {
 public:
  explicit Source(std::string_view bytes) : bytes_(bytes) {}

  bool overrun() const { return overrun_; }

  // stb fills its own small buffer (the one it fills first) ahead of need: a short answer there is no overrun yet.
  // Where it comes back for more, line feeds follow the end. Every decoder halts on them or makes progress: an empty
  // line ends an HDR's header, as a count ten is no standstill in its pixels; no chunk of a PNG and no marker of a JPEG
  // begins so.
  int read(char* data, size_t size) {
    if (ownBuffer_ == nullptr) ownBuffer_ = data;
    const size_t there = std::min(size, bytes_.size() - position_);
    std::memcpy(data, bytes_.data() + position_, there);
    position_ += there;
    const bool ahead = data == ownBuffer_;
    overrun_ |= there < size && (there == 0 || !ahead);
    if (there > 0 || !ahead) return static_cast<int>(there);
    std::memset(data, '\n', size);
    return static_cast<int>(size);
  }

  void skip(int n) {
    const size_t wanted = n > 0 ? static_cast<size_t>(n) : 0;
    const size_t there = std::min(wanted, bytes_.size() - position_);
    position_ += there;
    overrun_ |= there < wanted;
  }

  bool atEnd() const { return position_ == bytes_.size(); }

 private:
  std::string_view bytes_;
  size_t position_ = 0;
  const char* ownBuffer_ = nullptr;
  bool overrun_ = false;
};

constexpr stbi_io_callbacks kCallbacks = {[](void* source, char* data, int size) {
                                            return static_cast<Source*>(source)->read(data, static_cast<size_t>(size));
                                          },
                                          [](void* source, int n) { static_cast<Source*>(source)->skip(n); },
                                          [](void* source) { return static_cast<Source*>(source)->atEnd() ? 1 : 0; }};

struct FreeStb {
  void operator()(void* p) const { stbi_image_free(p); }
};
template <class T>
using Decoded = std::unique_ptr<T[], FreeStb>;

enum class Kind { hdr, png, jpeg, tga };

bool endsInTga(const std::string& name) {
  std::string end = name.size() < 4 ? "" : name.substr(name.size() - 4);
  for (char& c : end) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return end == ".tga";
}

Kind kindOf(const std::string& name, std::string_view bytes) {
  if (bytes.starts_with("#?RADIANCE\n") || bytes.starts_with("#?RGBE\n")) return Kind::hdr;
  if (bytes.starts_with("\x89PNG\r\n\x1a\n")) return Kind::png;
  if (bytes.starts_with("\xff\xd8")) return Kind::jpeg;
  if (endsInTga(name)) return Kind::tga;
  broken(name, "not a picture that Virga reads", "EXR, HDR, PNG, JPEG and TGA are read");
}

[[noreturn]] void damaged(const std::string& name, const Source& source) {
  if (source.overrun()) broken(name, "the picture is cut short: its file ends too early");
  const char* reason = stbi_failure_reason();
  broken(name, fmt::format("the picture is damaged ({})", reason ? reason : "for an unknown reason"));
}

// Before anything is allocated. No format here packs more than some 8000 pixels into a byte (a PNG of one bit a pixel
// and one colour): a small file that claims many pixels is damaged.
void checkHeader(const std::string& name, std::string_view bytes) {
  constexpr int64_t kMaxPixelsPerByte = 16384;
  int width = 0, height = 0, channels = 0;
  Source source(bytes);
  if (!stbi_info_from_callbacks(&kCallbacks, &source, &width, &height, &channels)) damaged(name, source);
  checkSize(name, width, height);
  const int64_t pixels = int64_t{width} * height;
  if (pixels / kMaxPixelsPerByte > static_cast<int64_t>(bytes.size()))
    broken(name, fmt::format("the picture is damaged or cut short ({} x {} pixels in {} bytes)", width, height,
                             bytes.size()));
  if (pixels > INT_MAX / 16)
    broken(name, fmt::format("{} x {} pixels are too many for this format", width, height), "store it as EXR");
}

template <class T>
struct Loaded {
  Decoded<T> values;
  int width = 0, height = 0;
};

template <class T, class Load>
Loaded<T> load(const std::string& name, std::string_view bytes, const Load& loadWith) {
  Source source(bytes);
  Loaded<T> out;
  int channels = 0;
  out.values.reset(loadWith(&kCallbacks, &source, &out.width, &out.height, &channels, 3));
  if (!out.values || source.overrun()) damaged(name, source);
  return out;
}

template <class T, class Convert>
Image toImage(const Loaded<T>& loaded, const Convert& convert) {
  Image out(loaded.width, loaded.height);
  for (size_t i = 0; i < out.pixels.size(); ++i) {
    const T* p = loaded.values.get() + 3 * i;
    out.pixels[i] = {convert(p[0]), convert(p[1]), convert(p[2])};
  }
  return out;
}

template <class T>
Image fromIntegers(const Loaded<T>& loaded, Encoding encoding) {
  constexpr size_t kLevels = size_t{1} << (8 * sizeof(T));
  std::vector<float> level(kLevels);
  for (size_t v = 0; v < kLevels; ++v) {
    const float x = static_cast<float>(v) / static_cast<float>(kLevels - 1);
    level[v] = encoding == Encoding::sRgb ? srgbToLinear(x) : x;
  }
  return toImage(loaded, [&](T v) { return level[v]; });
}

bool is16Bit(std::string_view bytes) {
  Source source(bytes);
  return stbi_is_16_bit_from_callbacks(&kCallbacks, &source) != 0;
}

void append(void* out, void* data, int size) {
  static_cast<std::string*>(out)->append(static_cast<const char*>(data), static_cast<size_t>(size));
}

}  // namespace

Image decodeStb(const std::string& name, std::string_view bytes, Encoding encoding) {
  const Kind kind = kindOf(name, bytes);
  checkHeader(name, bytes);
  if (kind == Kind::hdr) return toImage(load<float>(name, bytes, stbi_loadf_from_callbacks), [](float v) { return v; });
  if (kind == Kind::png && is16Bit(bytes))
    return fromIntegers(load<stbi_us>(name, bytes, stbi_load_16_from_callbacks), encoding);
  return fromIntegers(load<stbi_uc>(name, bytes, stbi_load_from_callbacks), encoding);
}

std::string encodePng(const Image& image, const ToneMap& map) {
  VIRGA_ASSERT(image.width > 0 && image.height > 0);
  if (static_cast<int64_t>(image.pixels.size()) > INT_MAX / 8)
    throw Error(fmt::format("{} x {} pixels are too many for a PNG", image.width, image.height),
                {.position = {}, .hint = "write an EXR", .notes = {}});
  std::vector<uint8_t> display(3 * image.pixels.size());
  parallelFor(static_cast<int64_t>(image.pixels.size()), 4096, [&](int64_t i) {
    const std::array<uint8_t, 3> rgb = toneMapped(image.pixels[static_cast<size_t>(i)], map);
    std::copy(rgb.begin(), rgb.end(), display.begin() + 3 * i);
  });
  std::string out;
  if (!stbi_write_png_to_func(append, &out, image.width, image.height, 3, display.data(), 3 * image.width))
    throw std::bad_alloc();
  return out;
}

}  // namespace virga::formats
