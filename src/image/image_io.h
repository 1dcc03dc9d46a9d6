// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "image/image.h"
#include "image/tone_map.h"

namespace virga {

/// Value of a metadata attribute of an EXR. Integers beyond 32 bits, which EXR lacks, are written as decimal strings.
using Metadata = std::map<std::string, std::variant<std::string, double, int64_t>>;

/// What an EXR of ours holds. Channels: R, G, B of the beauty; `<layer>.R`...; `variance.R`...; `variance.<layer>.R`...
/// All images have one size.
struct LayeredImage {
  using Named = std::vector<std::pair<std::string, Image>>;

  Image beauty;
  Named layers;
  std::optional<Image> variance;  ///< of the beauty
  Named layerVariances;
  Metadata metadata;

  const Image* layer(const std::string& name) const;          ///< nullptr where there is none
  const Image* layerVariance(const std::string& name) const;  ///< likewise
};

/// What the numbers of an 8- or 16-bit file mean. Float files (EXR, HDR) are linear anyway.
enum class Encoding {
  sRgb,  ///< colour: through the sRGB curve to linear
  raw,   ///< data: v / 255 or v / 65535
};

/// Largest picture that is read: a file that claims more is broken or hostile.
inline constexpr int kMaxImageSide = 1 << 16;
inline constexpr int64_t kMaxImagePixels = int64_t{1} << 28;

/// Reads EXR (scan lines or tiles, every compression, half, float or uint; of several parts the first), Radiance HDR,
/// PNG, JPEG or TGA: by what the file is, not by its name (but for TGA, which has no mark of its own). Grey becomes
/// RGB, alpha is dropped. An EXR with a single layer and no R, G, B reads as that layer. The pixels are those of the
/// data window.
///
/// Throws Error naming the file where it is missing, cut short, damaged, of another kind or larger than
/// kMaxImagePixels. A NaN or an infinity in the file is none of these: see countNonFinite().
Image readImage(const std::filesystem::path& path, Encoding encoding = Encoding::sRgb);

/// Like readImage(), with all layers, variances and metadata of an EXR. Other formats have a beauty alone.
LayeredImage readLayeredImage(const std::filesystem::path& path);

/// 32-bit float, ZIP. Throws Error where the file cannot be written; see writeAtomically().
void writeExr(const std::filesystem::path& path, const LayeredImage& image);
void writeExr(const std::filesystem::path& path, const Image& image);

/// 8-bit, tone mapped.
void writePng(const std::filesystem::path& path, const Image& image, const ToneMap& map = {});

/// Pixels with a NaN or an infinity.
int64_t countNonFinite(const Image& image);

}  // namespace virga
