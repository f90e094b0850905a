#include "common/base/latest_value.h"

#include <gtest/gtest.h>

#include <thread>

namespace needlelab {
namespace {

TEST(LatestValue, givesTheNewestOnceAndNothingBeforeTheFirst) {
  LatestValue<int> value;
  int got = -1;
  EXPECT_FALSE(value.fetch(got));
  for (int i = 1; i <= 5; ++i) value.publish(i);
  ASSERT_TRUE(value.fetch(got));
  EXPECT_EQ(got, 5);
  EXPECT_FALSE(value.fetch(got));
  EXPECT_EQ(got, 5) << "nothing new leaves the value alone";
  value.publish(6);
  ASSERT_TRUE(value.fetch(got));
  EXPECT_EQ(got, 6);
}

TEST(LatestValue, twoThreadsNeverSeeATornOrOlderValueAndDoSeeTheLast) {
  struct Wide {
    std::uint64_t number = 0;
    std::array<std::uint64_t, 30> copies{};
  };
  constexpr std::uint64_t kValues = 100'000;
  LatestValue<Wide> shared;
  std::thread writer([&] {
    Wide wide;
    for (std::uint64_t i = 1; i <= kValues; ++i) {
      wide.number = i;
      wide.copies.fill(i);
      shared.publish(wide);
    }
  });
  std::uint64_t last = 0, torn = 0, older = 0;
  while (last < kValues) {
    Wide got;
    if (!shared.fetch(got)) {
      std::this_thread::yield();
      continue;
    }
    for (const auto copy : got.copies) torn += copy != got.number;
    older += got.number <= last;
    last = got.number;
  }
  writer.join();
  EXPECT_EQ(torn, 0u);
  EXPECT_EQ(older, 0u);
}

}  // namespace
}  // namespace needlelab
