#include "common/wire/live_queue.h"

#include <gtest/gtest.h>

#include <memory>
#include <string>

namespace needlelab {
namespace {

constexpr std::int64_t kMs = 1'000'000;

Frame frameOf(const std::string& text) {
  return std::make_shared<const std::string>(text);
}

TEST(LiveQueue, framesComeInOrder) {
  LiveQueue queue(100 * kMs, 1000);
  queue.push(frameOf("a"), true, 0);
  queue.push(frameOf("b"), true, 1);
  EXPECT_EQ(*queue.pop(2)->frame, "a");
  EXPECT_EQ(*queue.pop(2)->frame, "b");
  EXPECT_FALSE(queue.pop(2).has_value());
  EXPECT_EQ(queue.dropped(), 0u);
}

TEST(LiveQueue, ageDropsTheOldestAndCountsThem) {
  LiveQueue queue(100 * kMs, 1'000'000);
  // 50 frames a second for a second, nobody reads
  for (int i = 0; i < 50; ++i) queue.push(frameOf(std::to_string(i)), true, i * 20 * kMs);
  // at the last push (980 ms) those since 880 ms are left: 44 … 49
  const auto first = queue.pop(980 * kMs);
  ASSERT_TRUE(first.has_value());
  EXPECT_EQ(*first->frame, "44");
  EXPECT_EQ(queue.dropped(), 44u);
}

TEST(LiveQueue, whatIsExactlyAsOldAsTheLimitStays) {
  LiveQueue queue(100 * kMs, 1000);
  queue.push(frameOf("a"), true, 0);
  EXPECT_TRUE(queue.pop(100 * kMs).has_value());
  queue.push(frameOf("b"), true, 0);
  EXPECT_FALSE(queue.pop(100 * kMs + 1).has_value());
  EXPECT_EQ(queue.dropped(), 1u);
}

TEST(LiveQueue, bytesAreBoundedButTheNewestStays) {
  LiveQueue queue(100 * kMs, 10);
  for (const char* text : {"aaaa", "bbbb", "cccc"}) queue.push(frameOf(text), true, 0);
  EXPECT_EQ(queue.bytes(), 8u);
  EXPECT_EQ(queue.dropped(), 1u);
  EXPECT_EQ(*queue.pop(0)->frame, "bbbb");
  queue.push(frameOf(std::string(50, 'x')), true, 0);
  EXPECT_EQ(queue.bytes(), 50u);
  EXPECT_EQ(queue.pop(0)->frame->size(), 50u);
}

TEST(LiveQueue, statusLinesAreCountedApart) {
  LiveQueue queue(100 * kMs, 1000);
  queue.push(frameOf("status"), false, 0);
  queue.push(frameOf("frame"), true, 0);
  EXPECT_FALSE(queue.pop(101 * kMs).has_value());
  EXPECT_EQ(queue.dropped(), 1u);
  EXPECT_EQ(queue.droppedStatus(), 1u);
}

}  // namespace
}  // namespace needlelab
