// SPDX-License-Identifier: Apache-2.0
#include <Iex.h>
#include <ImfChannelList.h>
#include <ImfDoubleAttribute.h>
#include <ImfFloatAttribute.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputPart.h>
#include <ImfIntAttribute.h>
#include <ImfMultiPartInputFile.h>
#include <ImfOutputFile.h>
#include <ImfPartType.h>
#include <ImfStringAttribute.h>
#include <ImfThreading.h>
#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <climits>
#include <cstring>
#include <mutex>
#include <set>

#include "core/error.h"
#include "image/formats.h"

namespace virga::formats {
namespace {

constexpr char kMagic[] = {0x76, 0x2f, 0x31, 0x01};
constexpr uint64_t kMaxTilePixels = uint64_t{1} << 24;  // the library allocates a whole tile before it reads one
constexpr const char* kVariance = "variance";

// ---- Files in memory ------------------------------------------------------------------------------------------------

class MemoryInput : public Imf::IStream {
 public:
  MemoryInput(const std::string& name, std::string_view bytes) : Imf::IStream(name.c_str()), bytes_(bytes) {}

  bool read(char* out, int n) override {
    const size_t size = static_cast<size_t>(std::max(n, 0));
    if (position_ > bytes_.size() || size > bytes_.size() - position_) throw Iex::InputExc("its file ends too early");
    std::memcpy(out, bytes_.data() + position_, size);
    position_ += size;
    return position_ < bytes_.size();
  }
  uint64_t tellg() override { return position_; }
  void seekg(uint64_t position) override { position_ = position; }

 private:
  std::string_view bytes_;
  uint64_t position_ = 0;
};

class MemoryOutput : public Imf::OStream {
 public:
  MemoryOutput() : Imf::OStream("memory") {}

  void write(const char* data, int n) override {
    const size_t size = static_cast<size_t>(n), end = position_ + size;
    if (bytes_.size() < end) bytes_.resize(end);
    std::copy(data, data + size, bytes_.begin() + static_cast<std::ptrdiff_t>(position_));
    position_ = end;
  }
  uint64_t tellp() override { return position_; }
  void seekp(uint64_t position) override { position_ = position; }
  std::string take() { return std::move(bytes_); }

 private:
  std::string bytes_;
  uint64_t position_ = 0;
};

// ---- Headers --------------------------------------------------------------------------------------------------------

// A zero-terminated text at `position`, which moves behind it.
std::string_view headerText(const std::string& name, std::string_view bytes, size_t& position) {
  const size_t end = bytes.find('\0', position);
  if (end == std::string_view::npos) broken(name, "the EXR is cut short: its header has no end");
  const std::string_view text = bytes.substr(position, end - position);
  position = end + 1;
  return text;
}

// The library allocates what an attribute claims before it reads it. So here every attribute of the headers is made
// sure to lie within the file: name, type, 32-bit size, value; an empty name ends a header, an empty header those of
// all parts.
void checkAttributesFit(const std::string& name, std::string_view bytes) {
  constexpr size_t kVersionEnd = 8;
  if (bytes.size() < kVersionEnd) broken(name, "the EXR is cut short: its header has no end");
  const bool multiPart = (static_cast<unsigned char>(bytes[5]) & 0x10) != 0;
  size_t position = kVersionEnd;
  bool more = !headerText(name, bytes, position).empty();
  while (more) {
    do {
      headerText(name, bytes, position);
      int32_t size = 0;
      if (bytes.size() - position < sizeof size) broken(name, "the EXR is cut short: its header has no end");
      std::memcpy(&size, bytes.data() + position, sizeof size);
      position += sizeof size;
      if (size < 0 || static_cast<size_t>(size) > bytes.size() - position)
        broken(name, "the EXR is damaged or cut short: an attribute of its header is longer than the file");
      position += static_cast<size_t>(size);
    } while (!headerText(name, bytes, position).empty());
    more = multiPart && !headerText(name, bytes, position).empty();
  }
}

// Attributes that describe the pixels: not metadata of ours.
bool isStandard(const std::string& attribute) {
  static const std::set<std::string> kNames = {
      "channels", "compression", "dataWindow",         "displayWindow",     "lineOrder", "pixelAspectRatio",
      "tiles",    "type",        "screenWindowCenter", "screenWindowWidth", "name",      "view",
      "version",  "chunkCount",  "chromaticities"};
  return kNames.contains(attribute);
}

Metadata metadataOf(const Imf::Header& header) {
  Metadata out;
  for (auto i = header.begin(); i != header.end(); ++i) {
    if (isStandard(i.name())) continue;
    const Imf::Attribute& a = i.attribute();
    if (const auto* s = dynamic_cast<const Imf::StringAttribute*>(&a)) out[i.name()] = s->value();
    if (const auto* f = dynamic_cast<const Imf::FloatAttribute*>(&a)) out[i.name()] = static_cast<double>(f->value());
    if (const auto* d = dynamic_cast<const Imf::DoubleAttribute*>(&a)) out[i.name()] = d->value();
    if (const auto* n = dynamic_cast<const Imf::IntAttribute*>(&a)) out[i.name()] = int64_t{n->value()};
  }
  return out;
}

void insert(Imf::Header& header, const std::string& name, const Metadata::mapped_type& value) {
  VIRGA_ASSERT(!isStandard(name));
  if (const auto* text = std::get_if<std::string>(&value)) header.insert(name, Imf::StringAttribute(*text));
  if (const auto* number = std::get_if<double>(&value)) header.insert(name, Imf::DoubleAttribute(*number));
  if (const auto* integer = std::get_if<int64_t>(&value)) {
    if (*integer >= INT_MIN && *integer <= INT_MAX) {
      header.insert(name, Imf::IntAttribute(static_cast<int>(*integer)));
    } else {
      header.insert(name, Imf::StringAttribute(fmt::format("{}", *integer)));
    }
  }
}

// ---- Channels -------------------------------------------------------------------------------------------------------

// The channels of one picture in the file: R, G, B or three times Y.
struct ColourGroup {
  std::string prefix;  ///< "" of plain channels, "layer" of layer.R
  std::string channel[3];
  Image image = {};
};

bool isVariance(const std::string& prefix) {
  return prefix == kVariance || prefix.starts_with(std::string(kVariance) + ".");
}

std::vector<ColourGroup> colourGroups(const Imf::ChannelList& channels) {
  std::map<std::string, std::set<std::string>> components;  // by prefix, without its dot
  for (auto i = channels.begin(); i != channels.end(); ++i) {
    const std::string channel = i.name();
    const size_t dot = channel.rfind('.');
    const bool plain = dot == std::string::npos;
    components[plain ? "" : channel.substr(0, dot)].insert(plain ? channel : channel.substr(dot + 1));
  }
  std::vector<ColourGroup> groups;
  for (const auto& [prefix, has] : components) {
    const std::string start = prefix.empty() ? "" : prefix + ".";
    if (has.contains("R") && has.contains("G") && has.contains("B")) {
      groups.push_back({prefix, {start + "R", start + "G", start + "B"}});
    } else if (has.contains("Y") && !has.contains("X") && !has.contains("RY")) {  // not a vector, no chroma
      groups.push_back({prefix, {start + "Y", start + "Y", start + "Y"}});
    }
  }
  return groups;
}

std::string channelNames(const Imf::ChannelList& channels) {
  constexpr size_t kShown = 20;
  std::vector<std::string> names;
  size_t count = 0;
  for (auto i = channels.begin(); i != channels.end(); ++i, ++count)
    if (count < kShown) names.emplace_back(i.name());
  if (count > kShown) names.push_back(fmt::format("and {} more", count - kShown));
  return joined(names);
}

// Makes the beauty the group without a prefix: that group, or the only one that is not a variance.
void findBeauty(const std::string& name, const Imf::ChannelList& channels, std::vector<ColourGroup>& groups) {
  const auto plain = std::find_if(groups.begin(), groups.end(), [](const auto& g) { return g.prefix.empty(); });
  if (plain != groups.end()) return;
  const auto isLayer = [](const ColourGroup& g) { return !isVariance(g.prefix); };
  if (std::count_if(groups.begin(), groups.end(), isLayer) == 1) {
    std::find_if(groups.begin(), groups.end(), isLayer)->prefix.clear();
    return;
  }
  broken(name, "the EXR has neither R, G, B nor a plain Y", "its channels: " + channelNames(channels));
}

// ---- Reading --------------------------------------------------------------------------------------------------------

// Pixels are decoded band by band into memory that is reserved but not touched before: a short file that claims a large
// picture fails at its first missing chunk, without having used the memory.
void readPixels(Imf::InputPart& part, const Imath::Box2i& window, std::vector<ColourGroup>& groups) {
  const int width = window.max.x - window.min.x + 1, height = window.max.y - window.min.y + 1;
  Imf::FrameBuffer frame;
  for (ColourGroup& g : groups) {
    g.image.width = width, g.image.height = height;
    g.image.pixels.reserve(static_cast<size_t>(width) * static_cast<size_t>(height));
    float* const base = &g.image.pixels.data()->r;
    const int components = g.channel[0] == g.channel[1] ? 1 : 3;
    for (int c = 0; c < components; ++c)
      frame.insert(g.channel[c], Imf::Slice::Make(Imf::FLOAT, base + c, window, sizeof(Rgb),
                                                  sizeof(Rgb) * static_cast<size_t>(width)));
  }
  part.setFrameBuffer(frame);
  const int band = std::max(1, (1 << 17) / width);
  for (int y = 0; y < height; y += band) {
    const int end = std::min(height, y + band);
    for (ColourGroup& g : groups) g.image.pixels.resize(static_cast<size_t>(width) * static_cast<size_t>(end));
    part.readPixels(window.min.y + y, window.min.y + end - 1);
  }
  for (ColourGroup& g : groups)
    if (g.channel[0] == g.channel[1])
      for (Rgb& pixel : g.image.pixels) pixel = Rgb(pixel.r);
}

void checkReadable(const std::string& name, const Imf::Header& header, const std::vector<ColourGroup>& groups) {
  const Imath::Box2i& window = header.dataWindow();
  checkSize(name, int64_t{window.max.x} - window.min.x + 1, int64_t{window.max.y} - window.min.y + 1);
  if (header.hasTileDescription()) {
    const Imf::TileDescription& tile = header.tileDescription();
    if (uint64_t{tile.xSize} * tile.ySize > kMaxTilePixels)
      broken(name, fmt::format("the EXR is damaged: its tiles have {} x {} pixels", tile.xSize, tile.ySize));
  }
  for (const ColourGroup& g : groups)
    for (const std::string& channel : g.channel) {
      const Imf::Channel& c = header.channels()[channel];
      if (c.xSampling != 1 || c.ySampling != 1)
        broken(name, fmt::format("channel \"{}\" is subsampled", channel), "store it with a sampling of 1");
    }
}

struct Contents {
  std::vector<ColourGroup> groups;
  Metadata metadata;
};

enum class Wanted { beauty, all };

Contents readContents(const std::string& name, std::string_view bytes, Wanted wanted) {
  checkAttributesFit(name, bytes);
  MemoryInput stream(name, bytes);
  Imf::MultiPartInputFile file(stream, 0);
  const Imf::Header& header = file.header(0);
  if (header.hasType() && Imf::isDeepData(header.type()))
    broken(name, "it is a deep EXR", "flat ones, of scan lines or tiles, are read");
  Contents out;
  out.groups = colourGroups(header.channels());
  findBeauty(name, header.channels(), out.groups);
  if (wanted == Wanted::beauty) std::erase_if(out.groups, [](const ColourGroup& g) { return !g.prefix.empty(); });
  checkReadable(name, header, out.groups);
  out.metadata = metadataOf(header);
  Imf::InputPart part(file, 0);
  readPixels(part, header.dataWindow(), out.groups);
  return out;
}

// The library's messages repeat the name of the file, once or twice, before they come to the reason.
std::string reasonOf(const std::string& name, const std::string& message) {
  const std::string quoted = "\"" + name + "\"";
  const size_t at = message.rfind(quoted);
  if (at == std::string::npos) return message;
  const size_t reason = message.find_first_not_of(".: ", at + quoted.size());
  return reason == std::string::npos ? message : message.substr(reason);
}

Contents contents(const std::string& name, std::string_view bytes, Wanted wanted) {
  try {
    return readContents(name, bytes, wanted);
  } catch (const Iex::BaseExc& e) {
    broken(name, fmt::format("the EXR is damaged or cut short ({})", reasonOf(name, e.what())));
  }
}

// ---- Writing --------------------------------------------------------------------------------------------------------

void addImage(Imf::Header& header, Imf::FrameBuffer& frame, const std::string& prefix, const Image& image) {
  // The library takes a writable pointer and only reads through it.
  char* const base = reinterpret_cast<char*>(const_cast<Rgb*>(image.pixels.data()));
  for (size_t c = 0; c < 3; ++c) {
    const std::string channel = (prefix.empty() ? "" : prefix + ".") + "RGB"[c];
    header.channels().insert(channel, Imf::Channel(Imf::FLOAT));
    frame.insert(channel, Imf::Slice(Imf::FLOAT, base + c * sizeof(float), sizeof(Rgb),
                                     sizeof(Rgb) * static_cast<size_t>(image.width)));
  }
}

/// Threads of the library that may help the caller: as many as the caller's arena has, or none if it has but one.
int helpers() {
  static std::mutex mutex;
  const int threads = tbb::this_task_arena::max_concurrency();
  if (threads < 2) return 0;
  const std::lock_guard lock(mutex);
  if (Imf::globalThreadCount() < threads) Imf::setGlobalThreadCount(threads);
  return threads;
}

}  // namespace

bool isExr(std::string_view bytes) { return bytes.starts_with(std::string_view(kMagic, sizeof kMagic)); }

Image decodeExr(const std::string& name, std::string_view bytes) {
  return std::move(contents(name, bytes, Wanted::beauty).groups.front().image);
}

LayeredImage decodeLayeredExr(const std::string& name, std::string_view bytes) {
  Contents read = contents(name, bytes, Wanted::all);
  LayeredImage out;
  out.metadata = std::move(read.metadata);
  const std::string variancePrefix = std::string(kVariance) + ".";
  for (ColourGroup& g : read.groups) {
    if (g.prefix.empty()) {
      out.beauty = std::move(g.image);
    } else if (g.prefix == kVariance) {
      out.variance = std::move(g.image);
    } else if (isVariance(g.prefix)) {
      out.layerVariances.emplace_back(g.prefix.substr(variancePrefix.size()), std::move(g.image));
    } else {
      out.layers.emplace_back(g.prefix, std::move(g.image));
    }
  }
  return out;
}

std::string encodeExr(const LayeredImage& image) {
  const int width = image.beauty.width, height = image.beauty.height;
  VIRGA_ASSERT(width > 0 && height > 0);
  Imf::Header header(width, height);
  header.compression() = Imf::ZIP_COMPRESSION;
  Imf::FrameBuffer frame;
  const auto add = [&](const std::string& prefix, const Image& picture) {
    VIRGA_ASSERT(picture.width == width && picture.height == height);
    addImage(header, frame, prefix, picture);
  };
  add("", image.beauty);
  for (const auto& [name, layer] : image.layers) add(name, layer);
  if (image.variance) add(kVariance, *image.variance);
  for (const auto& [name, variance] : image.layerVariances) add(std::string(kVariance) + "." + name, variance);
  for (const auto& [name, value] : image.metadata) insert(header, name, value);

  MemoryOutput stream;
  {
    Imf::OutputFile file(stream, header, helpers());  // its end writes the table of chunks
    file.setFrameBuffer(frame);
    file.writePixels(height);
  }
  return stream.take();
}

}  // namespace virga::formats
