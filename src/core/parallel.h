// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <cstddef>
#include <cstdint>
#include <vector>

namespace virga {

/// Calls body(i) for i in [0, n), in any order, on all threads that the caller's arena has. `grain` items go to one
/// task.
template <class Body>
void parallelFor(int64_t n, int64_t grain, const Body& body) {
  tbb::parallel_for(tbb::blocked_range<int64_t>(0, n, grain), [&](const tbb::blocked_range<int64_t>& range) {
    for (int64_t i = range.begin(); i != range.end(); ++i) body(i);
  });
}

/// Sum (or any fold) of value(i) over [0, n): the same result for every number of threads, because the blocks are fixed
/// and are combined in order. `combine(a, b)` need not commute.
template <class T, class Value, class Combine>
T deterministicReduce(int64_t n, T identity, const Value& value, const Combine& combine) {
  constexpr int64_t kBlock = 4096;
  const int64_t blocks = (n + kBlock - 1) / kBlock;
  std::vector<T> partial(static_cast<size_t>(blocks), identity);
  parallelFor(blocks, 1, [&](int64_t block) {
    T sum = identity;
    const int64_t end = std::min(n, (block + 1) * kBlock);
    for (int64_t i = block * kBlock; i < end; ++i) sum = combine(sum, value(i));
    partial[static_cast<size_t>(block)] = sum;
  });
  T total = identity;
  for (const T& p : partial) total = combine(total, p);
  return total;
}

}  // namespace virga
