// SPDX-License-Identifier: Apache-2.0
#include "volume/value_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "core/error.h"

namespace virga {
namespace {

bool before(const std::array<int64_t, 3>& a, const std::array<int64_t, 3>& b) {
  return std::lexicographical_compare(a.rbegin(), a.rend(), b.rbegin(), b.rend());
}

}  // namespace

void ValueCheck::addBad(float value, std::array<int64_t, 3> where, uint64_t times) {
  if (good() || before(where, first)) first = where;
  (std::isnan(value) ? nan : std::isinf(value) ? infinite : negative) += times;
}

void ValueCheck::require() const {
  if (good()) return;
  std::vector<std::string> kinds;
  if (nan > 0) kinds.push_back(fmt::format("{} NaN", nan));
  if (infinite > 0) kinds.push_back(fmt::format("{} infinite", infinite));
  if (negative > 0) kinds.push_back(fmt::format("{} negative", negative));
  throw Error(fmt::format("grid has bad values: {}; the first is at index ({}, {}, {})", joined(kinds), first[0],
                          first[1], first[2]));
}

ValueCheck combined(const ValueCheck& a, const ValueCheck& b) {
  ValueCheck sum = a;
  if (!b.good() && (a.good() || before(b.first, a.first))) sum.first = b.first;
  sum.nan += b.nan, sum.infinite += b.infinite, sum.negative += b.negative;
  sum.maximum = std::max(a.maximum, b.maximum);
  return sum;
}

}  // namespace virga
