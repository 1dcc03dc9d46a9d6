// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "image/image_io.h"

namespace virga::formats {

/// Encoders and decoders work on whole files in memory: files are read and written in one place. `name` is for errors.
bool isExr(std::string_view bytes);
Image decodeExr(const std::string& name, std::string_view bytes);
LayeredImage decodeLayeredExr(const std::string& name, std::string_view bytes);
std::string encodeExr(const LayeredImage& image);

/// HDR, PNG, JPEG; TGA where the name ends in .tga.
Image decodeStb(const std::string& name, std::string_view bytes, Encoding encoding);
std::string encodePng(const Image& image, const ToneMap& map);

/// Error that names the file.
[[noreturn]] void broken(const std::string& name, const std::string& message, const std::string& hint = "");
/// Refuses sizes that are not positive or exceed the limits of image_io.h.
void checkSize(const std::string& name, int64_t width, int64_t height);

}  // namespace virga::formats
