// The short form of the comparison with cyclictest. Other programs may be running, so its bounds are far
// looser than the goals of README.md, and it ignores the maximum: it finds a broken loop, not a slightly
// slower one.
#include <gtest/gtest.h>

#include <iostream>

#include "tests/bench/loop_report.h"

namespace needlelab::test {
namespace {

TEST(LoopBench, wakesAboutAsWellAsCyclictestInTheSameSeconds) {
  LoopBenchOptions options;
  options.seconds = 5;
  options.slice_s = 1.25;
  const auto result = runLoopBench(options, [](const std::string&) {});
  if (!result.ok() && result.error().code == ErrorCode::kUnavailable) GTEST_SKIP() << result.error().message;
  ASSERT_TRUE(result.ok()) << result.error().message;
  std::cout << loopTable(*result);
  // a machine may lose up to half a tick in the slices of only one side
  constexpr std::int64_t kNoise_ns = 200'000;
  for (const auto& [quantile, ratio] : {std::pair(0.5, 2.0), std::pair(0.99, 3.0)})
    EXPECT_LE(static_cast<double>(result->loop.late.quantile_ns(quantile)),
              ratio * static_cast<double>(result->cyclictest.late.quantile_ns(quantile)) + kNoise_ns)
        << "p" << 100 * quantile;
  EXPECT_LE(result->loop.shareOverT(), 2 * result->cyclictest.shareOverT() + 0.01);
  EXPECT_GT(result->loop.count, 4000u);
  EXPECT_GT(result->cyclictest.count, 4000u);
}

}  // namespace
}  // namespace needlelab::test
