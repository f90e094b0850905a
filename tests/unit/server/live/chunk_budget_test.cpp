#include "server/live/chunk_budget.h"

#include <gtest/gtest.h>

namespace needlelab {
namespace {

TEST(ChunkBudget, isFullByBytesLongBeforeTheNumberOfChunks) {
  ChunkBudget budget({.chunks = 8192, .bytes = 10'000});
  for (int i = 0; i < 9; ++i) {
    budget.add(1000);
    EXPECT_FALSE(budget.full()) << i;
  }
  budget.add(1000);
  EXPECT_TRUE(budget.full());
  EXPECT_EQ(budget.bytes(), 10'000u);
  EXPECT_EQ(budget.chunks(), 10u);
}

TEST(ChunkBudget, isFullByTheNumberOfChunks) {
  ChunkBudget budget({.chunks = 4, .bytes = 1'000'000});
  for (int i = 0; i < 4; ++i) {
    EXPECT_FALSE(budget.full());
    budget.add(1);
  }
  EXPECT_TRUE(budget.full());
}

TEST(ChunkBudget, goesOnAtHalfOfBothLimitsAndWakesOnce) {
  ChunkBudget budget({.chunks = 8, .bytes = 800});
  for (int i = 0; i < 8; ++i) budget.add(100);
  int woken = 0;
  for (int left = 7; left >= 0; --left) {
    woken += budget.remove(100) ? 1 : 0;
    EXPECT_EQ(budget.full(), left > 4) << left;
  }
  EXPECT_EQ(woken, 1);
  EXPECT_EQ(budget.bytes(), 0u);
}

TEST(ChunkBudget, fewLargeChunksKeepItFullUntilTheirBytesAreGone) {
  ChunkBudget budget({.chunks = 100, .bytes = 1000});
  budget.add(900);
  budget.add(100);
  EXPECT_FALSE(budget.remove(100)) << "one chunk of a hundred, but 900 bytes of 1000";
  EXPECT_TRUE(budget.full());
  EXPECT_TRUE(budget.remove(900));
  EXPECT_FALSE(budget.full());
}

TEST(ChunkBudget, nobodyIsWokenWhenItWasNotFull) {
  ChunkBudget budget({.chunks = 8, .bytes = 800});
  budget.add(100);
  EXPECT_FALSE(budget.remove(100));
}

}  // namespace
}  // namespace needlelab
