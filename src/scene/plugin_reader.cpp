// SPDX-License-Identifier: Apache-2.0
#include "scene/plugin_reader.h"

#include <fmt/format.h>

#include <cmath>

namespace virga {
namespace {

constexpr std::string_view kTypeNames[] = {"boolean",         "integer", "float",     "string",
                                           "point or vector", "rgb",     "transform", "object"};

std::string_view typeName(const Value& value) {
  if (const NodePtr* node = std::get_if<NodePtr>(&value)) return (*node)->tag;
  return kTypeNames[value.index()];
}

std::string rangeText(const PluginReader::Range& r) {
  if (std::isinf(r.hi)) return fmt::format("{} {}", r.openLo ? "greater than" : "at least", r.lo);
  if (std::isinf(r.lo)) return fmt::format("{} {}", r.openHi ? "less than" : "at most", r.hi);
  return fmt::format("in {}{}, {}{}", r.openLo ? '(' : '[', r.lo, r.hi, r.openHi ? ')' : ']');
}

bool inRange(double v, const PluginReader::Range& r) {
  return (r.openLo ? v > r.lo : v >= r.lo) && (r.openHi ? v < r.hi : v <= r.hi);
}

bool isFinite(const Affine& a) { return isFinite(a.x) && isFinite(a.y) && isFinite(a.z) && isFinite(a.translation); }

}  // namespace

void BuildDiagnostics::complain(const Error& error) {
  if (!lenient) throw error;
  warn(error);
}

void BuildDiagnostics::warn(const Error& error) {
  std::string text = error.what();
  if (const size_t at = text.find("error: "); at != std::string::npos) text.replace(at, 5, "warning");
  warnings.push_back(std::move(text));
}

const Property* PluginReader::find(std::string_view name) {
  asked_.emplace(name);
  for (const Property& p : node_.properties)
    if (p.name == name) {
      used_.insert(&p);
      return &p;
    }
  return nullptr;
}

bool PluginReader::has(std::string_view name) { return find(name) != nullptr; }

SourcePosition PluginReader::positionOf(std::string_view parameter) const {
  for (const Property& p : node_.properties)
    if (p.name == parameter) return p.valuePosition.known() ? p.valuePosition : p.position;
  return node_.typePosition.known() ? node_.typePosition : node_.position;
}

void PluginReader::fail(std::string_view parameter, std::string message, std::string hint,
                        std::vector<std::string> notes) {
  throw Error(std::move(message), {positionOf(parameter), std::move(hint), std::move(notes)});
}

void PluginReader::warnIgnored(std::string_view parameter, std::string_view why) {
  diagnostics_.warn(Error(fmt::format("\"{}\" is ignored: {}", parameter, why), {positionOf(parameter), "", {}}));
}

void PluginReader::failHere(std::string message, std::string hint, std::vector<std::string> notes) {
  const SourcePosition position = node_.typePosition.known() ? node_.typePosition : node_.position;
  throw Error(std::move(message), {position, std::move(hint), std::move(notes)});
}

float PluginReader::checkedNumber(std::string_view name, double value, const Range& range) {
  // The range is that of what is kept: 0.99999999 becomes 1 in single precision, 1e-50 becomes 0.
  const auto single = static_cast<float>(value);
  if (!std::isfinite(single)) fail(name, fmt::format("\"{}\" is too large", name));
  if (inRange(static_cast<double>(single), range)) return single;
  const std::string text = static_cast<double>(single) == value ? fmt::format("{}", single)  // the digits as written
                           : inRange(value, range) ? fmt::format("{}, in single precision {}", value, single)
                                                   : fmt::format("{}", value);
  fail(name, fmt::format("\"{}\" is {}; it must be {}", name, text, rangeText(range)));
}

float PluginReader::number(std::string_view name, float fallback, const Range& range) {
  const Property* p = find(name);
  if (!p) return fallback;
  if (const auto* d = std::get_if<double>(&p->value)) return checkedNumber(name, *d, range);
  if (const auto* i = std::get_if<int64_t>(&p->value)) return checkedNumber(name, static_cast<double>(*i), range);
  fail(name, fmt::format("\"{}\" must be a float, not a {}", name, typeName(p->value)));
}

int PluginReader::integer(std::string_view name, int fallback, const Range& range) {
  const Property* p = find(name);
  if (!p) return fallback;
  const auto* i = std::get_if<int64_t>(&p->value);
  if (!i) fail(name, fmt::format("\"{}\" must be an integer, not a {}", name, typeName(p->value)));
  if (*i != static_cast<int>(*i)) fail(name, fmt::format("\"{}\" is too large", name));
  if (!inRange(static_cast<double>(*i), range))
    fail(name, fmt::format("\"{}\" is {}; it must be {}", name, *i, rangeText(range)));
  return static_cast<int>(*i);
}

bool PluginReader::boolean(std::string_view name, bool fallback) {
  const Property* p = find(name);
  if (!p) return fallback;
  if (const auto* b = std::get_if<bool>(&p->value)) return *b;
  fail(name, fmt::format("\"{}\" must be a boolean, not a {}", name, typeName(p->value)));
}

std::string PluginReader::text(std::string_view name, std::string_view fallback) {
  const Property* p = find(name);
  if (!p) return std::string(fallback);
  if (const auto* s = std::get_if<std::string>(&p->value)) return *s;
  fail(name, fmt::format("\"{}\" must be a string, not a {}", name, typeName(p->value)));
}

Vec3 PluginReader::vector(std::string_view name, Vec3 fallback) {
  const Property* p = find(name);
  if (!p) return fallback;
  const auto* v = std::get_if<Vec3>(&p->value);
  if (!v) fail(name, fmt::format("\"{}\" must be a point or vector, not a {}", name, typeName(p->value)));
  if (!isFinite(*v)) fail(name, fmt::format("\"{}\" is too large", name));
  return *v;
}

Rgb PluginReader::color(std::string_view name, Rgb fallback, const Range& range) {
  const Property* p = find(name);
  if (!p) return fallback;
  Rgb result;
  if (const auto* c = std::get_if<Rgb>(&p->value))
    result = *c;
  else if (const auto* d = std::get_if<double>(&p->value))
    result = Rgb(static_cast<float>(*d));
  else if (const auto* n = std::get_if<NodePtr>(&p->value); n && (*n)->tag == "texture")
    fail(name, fmt::format("\"{}\" cannot be a texture", name), "give an rgb value");
  else
    fail(name, fmt::format("\"{}\" must be an rgb value, not a {}", name, typeName(p->value)));
  for (int i = 0; i < 3; ++i) checkedNumber(name, static_cast<double>(result[i]), range);
  return result;
}

Matrix4 PluginReader::transform(std::string_view name) {
  const Property* p = find(name);
  if (!p) return {};
  const auto* m = std::get_if<Matrix4>(&p->value);
  if (!m) fail(name, fmt::format("\"{}\" must be a transform, not a {}", name, typeName(p->value)));
  if (!m->isFinite()) fail(name, fmt::format("the transform \"{}\" is not finite", name));
  if (!isFinite(Affine(*m))) fail(name, fmt::format("the transform \"{}\" is too large", name));
  if (!m->isAffine())
    fail(name, fmt::format("the transform \"{}\" is a projection; its last row must be 0 0 0 1", name));
  if (m->isSingular()) fail(name, fmt::format("the transform \"{}\" is singular: it flattens space", name));
  if (!isFinite(Affine(m->inverse())))
    fail(name, fmt::format("the transform \"{}\" is too small for its place: its inverse overflows", name));
  return *m;
}

size_t PluginReader::oneOf(std::string_view name, std::string_view fallback, std::span<const std::string_view> words) {
  const std::string word = text(name, fallback);
  for (size_t i = 0; i < words.size(); ++i)
    if (words[i] == word) return i;
  const std::vector<std::string> known(words.begin(), words.end());
  fail(name, fmt::format("unknown value \"{}\" of \"{}\"", word, name), didYouMean(word, known),
       {"available: " + joined(known)});
}

NodePtr PluginReader::child(std::string_view tag, std::string_view name) {
  NodePtr found;
  if (!name.empty()) asked_.emplace(name);
  for (const Property& p : node_.properties) {
    const NodePtr* node = std::get_if<NodePtr>(&p.value);
    if (!node || (*node)->tag != tag || (!name.empty() && p.name != name)) continue;
    if (found)
      throw Error(fmt::format("a second <{}> in this {}", tag, node_.tag), {p.position, "only one is allowed", {}});
    used_.insert(&p);
    found = *node;
  }
  return found;
}

std::vector<NodePtr> PluginReader::children(std::string_view tag) {
  std::vector<NodePtr> found;
  for (const Property& p : node_.properties)
    if (const NodePtr* node = std::get_if<NodePtr>(&p.value); node && (*node)->tag == tag) {
      used_.insert(&p);
      found.push_back(*node);
    }
  return found;
}

void PluginReader::finish() {
  const std::vector<std::string> known(asked_.begin(), asked_.end());
  const std::string owner = node_.type.empty() ? node_.tag : fmt::format("{} \"{}\"", node_.tag, node_.type);
  for (const Property& p : node_.properties) {
    if (used_.contains(&p)) continue;
    const std::vector<std::string> notes =
        known.empty() ? std::vector<std::string>{} : std::vector<std::string>{"available: " + joined(known)};
    if (const NodePtr* child = std::get_if<NodePtr>(&p.value); child && (p.name.empty() || !known.empty()))
      diagnostics_.complain(Error(fmt::format("a <{}>{} has no place in {}", (*child)->tag,
                                              p.name.empty() ? "" : fmt::format(" named \"{}\"", p.name), owner),
                                  {p.position, didYouMean(p.name, known), notes}));
    else
      diagnostics_.complain(Error(fmt::format("unknown parameter \"{}\" of {}", p.name, owner),
                                  {p.position, didYouMean(p.name, known), notes}));
  }
}

}  // namespace virga
