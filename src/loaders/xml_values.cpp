// SPDX-License-Identifier: Apache-2.0
#include "loaders/xml_values.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <optional>

namespace virga {
namespace {

constexpr std::string_view kSeparators = " \t\r\n,";

struct Token {
  std::string_view text;
  SourcePosition position;
};

std::vector<Token> tokens(const Argument& argument) {
  std::vector<Token> out;
  const std::string_view text = argument.text;
  size_t start = text.find_first_not_of(kSeparators);
  while (start != std::string_view::npos) {
    const size_t end = std::min(text.find_first_of(kSeparators, start), text.size());
    out.push_back({text.substr(start, end - start), argument.part(start, end - start)});
    start = text.find_first_not_of(kSeparators, end);
  }
  return out;
}

Token singleToken(const Argument& argument, std::string_view what) {
  const std::vector<Token> all = tokens(argument);
  // A comma is no part of one number, although it separates several.
  if (all.size() != 1 || argument.text.find(',') != std::string::npos)
    argument.fail(fmt::format("\"{}\" is not {}", argument.text, what));
  return all.front();
}

// The whole text as a T; from_chars takes no '+', which people write.
template <class T>
std::errc convert(std::string_view text, T& value) {
  if (text.starts_with('+') && !text.starts_with("+-")) text.remove_prefix(1);
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc()) return error;
  return end == text.data() + text.size() ? std::errc() : std::errc::invalid_argument;
}

double number(const Argument& argument, const Token& token) {
  double value = 0;
  const std::errc error = convert(token.text, value);
  if (error == std::errc::result_out_of_range)
    argument.failAt(token.position, fmt::format("\"{}\" does not fit a number", token.text));
  if (error != std::errc()) argument.failAt(token.position, fmt::format("\"{}\" is not a number", token.text));
  if (!std::isfinite(value)) argument.failAt(token.position, fmt::format("\"{}\" is not a finite number", token.text));
  return value;
}

float singlePrecision(const Argument& argument, double value) {
  const auto single = static_cast<float>(value);
  if (!std::isfinite(single)) argument.fail(fmt::format("{} does not fit single precision", value));
  return single;
}

// IEC 61966-2-1.
float linearFromSrgb(int byte) {
  const double v = byte / 255.0;
  return static_cast<float>(v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4));
}

Rgb parseHexColour(const Argument& argument, std::string_view text) {
  unsigned int bits = 0;
  const auto [end, error] = std::from_chars(text.data() + 1, text.data() + text.size(), bits, 16);
  if (text.size() != 7 || error != std::errc() || end != text.data() + text.size())
    argument.fail(fmt::format("\"{}\" is not a colour", text), "hexadecimal colours are #rrggbb");
  const auto channel = [&](int shift) { return linearFromSrgb(static_cast<int>((bits >> shift) & 255U)); };
  return {channel(16), channel(8), channel(0)};
}

}  // namespace

double parseNumber(const Argument& argument) { return number(argument, singleToken(argument, "a number")); }

int64_t parseInteger(const Argument& argument) {
  const Token token = singleToken(argument, "an integer");
  int64_t value = 0;
  const std::errc error = convert(token.text, value);
  if (error == std::errc::result_out_of_range)
    argument.failAt(token.position, fmt::format("\"{}\" does not fit an integer of 64 bits", token.text));
  if (error != std::errc()) argument.failAt(token.position, fmt::format("\"{}\" is not an integer", token.text));
  return value;
}

bool parseBoolean(const Argument& argument) {
  std::string lower(singleToken(argument, "a boolean").text);
  for (char& c : lower) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  if (lower != "true" && lower != "false")
    argument.fail(fmt::format("\"{}\" is not a boolean", argument.text), "write true or false");
  return lower == "true";
}

std::vector<double> parseNumbers(const Argument& argument) {
  std::vector<double> out;
  for (const Token& token : tokens(argument)) out.push_back(number(argument, token));
  return out;
}

std::array<double, 3> parseTriple(const Argument& argument) {
  const std::vector<double> numbers = parseNumbers(argument);
  if (numbers.size() == 1) return {numbers[0], numbers[0], numbers[0]};
  if (numbers.size() != 3) argument.fail(fmt::format("expected 3 numbers, found {}", numbers.size()));
  return {numbers[0], numbers[1], numbers[2]};
}

Vec3 toVec3(const std::array<double, 3>& triple, const Argument& argument) {
  return {singlePrecision(argument, triple[0]), singlePrecision(argument, triple[1]),
          singlePrecision(argument, triple[2])};
}

Rgb parseRgb(const Argument& argument) {
  const size_t start = argument.text.find_first_not_of(" \t\r\n");
  if (start != std::string::npos && argument.text[start] == '#')
    return parseHexColour(argument, singleToken(argument, "a colour").text);
  const std::vector<double> numbers = parseNumbers(argument);
  if (numbers.size() != 1 && numbers.size() != 3)
    argument.fail(fmt::format("expected 1 or 3 numbers, found {}", numbers.size()));
  const Vec3 v = toVec3({numbers.front(), numbers[numbers.size() / 2], numbers.back()}, argument);
  return {v.x, v.y, v.z};
}

Rgb parseSpectrum(const Argument& argument) {
  if (argument.text.find(':') != std::string::npos)
    argument.fail("spectra as lists of wavelengths are not supported", "write <rgb name=\"...\" value=\"r, g, b\"/>");
  const std::vector<double> numbers = parseNumbers(argument);
  if (numbers.size() == 3)
    argument.fail("a spectrum is one number, found 3", "write <rgb name=\"...\" value=\"r, g, b\"/>");
  if (numbers.size() != 1) argument.fail(fmt::format("a spectrum is one number, found {}", numbers.size()));
  return Rgb(singlePrecision(argument, numbers.front()));
}

}  // namespace virga
