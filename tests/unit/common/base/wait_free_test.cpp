#include <gtest/gtest.h>

#include <thread>

#include "common/base/wait_free.h"

namespace needlelab {
namespace {

TEST(WaitFree, theRingKeepsOrderAndRefusesWhenFull) {
  SpscRing<int, 4> ring;
  for (int i = 0; i < 4; ++i) EXPECT_TRUE(ring.push(i));
  EXPECT_FALSE(ring.push(99));
  EXPECT_FALSE(ring.push(99));
  EXPECT_EQ(ring.dropped(), 2u);
  int item = -1;
  for (int i = 0; i < 4; ++i) {
    ASSERT_TRUE(ring.pop(item));
    EXPECT_EQ(item, i);
  }
  EXPECT_FALSE(ring.pop(item));
  EXPECT_EQ(item, 3) << "an empty ring leaves the item alone";
}

TEST(WaitFree, everyCapacityOfTheRingIsUsedAlsoAfterWrapping) {
  SpscRing<int, 8> ring;
  int item = 0;
  for (int start = 0; start < 20; ++start) {
    for (int i = 0; i < 8; ++i) ASSERT_TRUE(ring.push(start * 100 + i)) << start;
    ASSERT_FALSE(ring.push(0));
    for (int i = 0; i < 8; ++i) {
      ASSERT_TRUE(ring.pop(item));
      ASSERT_EQ(item, start * 100 + i);
    }
    ASSERT_TRUE(ring.push(7));  // shift the start by one
    ASSERT_TRUE(ring.pop(item));
  }
}

TEST(WaitFree, twoThreadsSeeEachItemOfTheRingOnceWholeAndInOrder) {
  struct Item {
    std::uint64_t number, square, inverse;
  };
  constexpr std::uint64_t kItems = 200'000;
  SpscRing<Item, 64> ring;
  std::thread producer([&] {
    for (std::uint64_t i = 0; i < kItems; ++i)
      while (!ring.push({i, i * i, ~i})) std::this_thread::yield();
  });
  std::uint64_t next = 0, torn = 0, out_of_order = 0;
  while (next < kItems) {
    Item item{};
    if (!ring.pop(item)) {
      std::this_thread::yield();
      continue;
    }
    if (item.number != next) ++out_of_order;
    if (item.square != item.number * item.number || item.inverse != ~item.number) ++torn;
    ++next;
  }
  producer.join();
  EXPECT_EQ(out_of_order, 0u);
  EXPECT_EQ(torn, 0u);
}

TEST(WaitFree, theRingsAcceptedAndDroppedAddUpToOffered) {
  constexpr std::uint64_t kItems = 50'000;
  SpscRing<std::uint64_t, 16> ring;
  std::atomic<bool> done{false};
  std::thread producer([&] {
    for (std::uint64_t i = 0; i < kItems; ++i) ring.push(i);  // never waits, so it drops
    done.store(true, std::memory_order_release);
  });
  std::uint64_t got = 0, last = 0, item = 0;
  bool rising = true;
  for (;;) {
    const bool finished = done.load(std::memory_order_acquire);
    while (ring.pop(item)) {
      rising = rising && (got == 0 || item > last);
      last = item;
      ++got;
    }
    if (finished) break;
  }
  producer.join();
  EXPECT_TRUE(rising);
  EXPECT_EQ(got + ring.dropped(), kItems);
}

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

TEST(LatestValue, readersSeeNoTornOrOlderValueAndSeeTheLast) {
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
