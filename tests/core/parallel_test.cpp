// SPDX-License-Identifier: Apache-2.0
#include "core/parallel.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <atomic>
#include <cmath>
#include <string>

#include "core/random.h"

namespace virga {
namespace {

// Terms of very different size: in another order, the sum in single precision is another.
float term(int64_t i) { return std::exp2(static_cast<float>(hash32(static_cast<uint32_t>(i)) % 40) - 20.f); }

float sum(int64_t n) {
  return deterministicReduce(n, 0.f, term, [](float a, float b) { return a + b; });
}

TEST(ParallelFor, VisitsEachIndexOnce) {
  for (int64_t n : {0, 1, 7, 10'000}) {
    std::vector<std::atomic<int>> visits(static_cast<size_t>(n));
    parallelFor(n, 16, [&](int64_t i) { ++visits[static_cast<size_t>(i)]; });
    for (const auto& v : visits) ASSERT_EQ(v, 1);
  }
}

TEST(DeterministicReduce, DoesNotDependOnTheThreads) {
  constexpr int64_t kCount = 300'001;
  float backwards = 0;
  for (int64_t i = kCount; i-- > 0;) backwards += term(i);
  const float reference = sum(kCount);
  EXPECT_NE(reference, backwards) << "the order of these terms does not matter: the test cannot fail";
  // More threads than cores, too.
  const tbb::global_control allowed(tbb::global_control::max_allowed_parallelism, 8);
  for (int threads : {1, 2, 3, 8}) {
    tbb::task_arena arena(threads);
    for (int repeat = 0; repeat < 10; ++repeat)
      EXPECT_EQ(arena.execute([] { return sum(kCount); }), reference) << threads;
  }
}

TEST(DeterministicReduce, CombinesInOrder) {
  const auto text = deterministicReduce(
      10'000, std::string(), [](int64_t i) { return std::to_string(i % 10); },
      [](const std::string& a, const std::string& b) { return a + b; });
  ASSERT_EQ(text.size(), 10'000u);
  for (size_t i = 0; i < text.size(); ++i) ASSERT_EQ(text[i], static_cast<char>('0' + i % 10));
}

TEST(DeterministicReduce, OfNothingIsTheIdentity) {
  EXPECT_EQ(sum(0), 0);
  EXPECT_EQ(deterministicReduce(
                int64_t{0}, 7, [](int64_t) { return 1; }, [](int a, int b) { return a * b; }),
            7);
}

}  // namespace
}  // namespace virga
