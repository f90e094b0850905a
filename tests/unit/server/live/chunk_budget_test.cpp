#include "server/live/chunk_budget.h"

#include <gtest/gtest.h>

namespace needlelab {
namespace {

TEST(ChunkBudget, isFullByBytesLongBeforeTheNumberOfChunks) {
  ChunkBudget budget({.chunks = 8192, .bytes = 10'000});
  for (int i = 0; i < 9; ++i) {
    budget.add("bench-1", 1000);
    EXPECT_FALSE(budget.full()) << i;
  }
  budget.add("bench-1", 1000);
  EXPECT_TRUE(budget.full());
  EXPECT_EQ(budget.bytes(), 10'000u);
  EXPECT_EQ(budget.chunks(), 10u);
}

TEST(ChunkBudget, isFullByTheNumberOfChunks) {
  ChunkBudget budget({.chunks = 4, .bytes = 1'000'000});
  for (int i = 0; i < 4; ++i) {
    EXPECT_FALSE(budget.full());
    budget.add("bench-1", 1);
  }
  EXPECT_TRUE(budget.full());
}

TEST(ChunkBudget, goesOnAtHalfOfBothLimitsAndWakesOnce) {
  ChunkBudget budget({.chunks = 8, .bytes = 800});
  for (int i = 0; i < 8; ++i) budget.add("bench-1", 100);
  int woken = 0;
  for (int left = 7; left >= 0; --left) {
    woken += budget.remove("bench-1", 100) ? 1 : 0;
    EXPECT_EQ(budget.full(), left > 4) << left;
  }
  EXPECT_EQ(woken, 1);
  EXPECT_EQ(budget.bytes(), 0u);
}

TEST(ChunkBudget, fewLargeChunksKeepItFullUntilTheirBytesAreGone) {
  ChunkBudget budget({.chunks = 100, .bytes = 1000});
  budget.add("bench-1", 900);
  budget.add("bench-1", 100);
  EXPECT_FALSE(budget.remove("bench-1", 100)) << "one chunk of a hundred, but 900 bytes of 1000";
  EXPECT_TRUE(budget.full());
  EXPECT_TRUE(budget.remove("bench-1", 900));
  EXPECT_FALSE(budget.full());
}

TEST(ChunkBudget, nobodyIsWokenWhenItWasNotFull) {
  ChunkBudget budget({.chunks = 8, .bytes = 800});
  budget.add("bench-1", 100);
  EXPECT_FALSE(budget.remove("bench-1", 100));
}

TEST(ChunkBudget, knowsWhatEachStationHasAndForgetsWhoHasNothing) {
  ChunkBudget budget({.chunks = 100, .bytes = 1000});
  budget.add("bench-1", 10);
  budget.add("bench-1", 20);
  budget.add("bench-2", 5);
  EXPECT_EQ(budget.of("bench-1").chunks, 2u);
  EXPECT_EQ(budget.of("bench-1").bytes, 30u);
  EXPECT_EQ(budget.of("bench-2").bytes, 5u);
  EXPECT_EQ(budget.of("bench-3").chunks, 0u);
  EXPECT_FALSE(budget.remove("bench-1", 10));
  EXPECT_EQ(budget.of("bench-1").chunks, 1u);
  EXPECT_FALSE(budget.remove("bench-1", 20));
  EXPECT_EQ(budget.of("bench-1").bytes, 0u);
  EXPECT_EQ(budget.bytes(), 5u);
}

}  // namespace
}  // namespace needlelab
