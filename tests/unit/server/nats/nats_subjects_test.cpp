#include "server/nats/nats_address.h"

#include <gtest/gtest.h>

#include <optional>
#include <string>

#include "server/nats/drop_queue.h"

namespace needlelab {
namespace {

TEST(NatsSubjects, haveATokenForAnyName) {
  EXPECT_EQ(subjectToken("bench-1_B"), "bench-1_B");
  EXPECT_EQ(subjectToken("a b.c*>="), "a=20b=2ec=2a=3e=3d");
  std::string all;
  for (int c = 0; c < 256; ++c) all += static_cast<char>(c);
  EXPECT_EQ(nameOfToken(subjectToken(all)), all);
  for (const char* const none : {"", "a.b", "a b", "*", ">", "=", "=2", "=2g", "=41", "=2E", "ä"})
    EXPECT_EQ(nameOfToken(none), std::nullopt) << none;
}

TEST(NatsSubjects, areReadAsTheyAreWritten) {
  for (const LivePlane plane :
       {LivePlane::kPresence, LivePlane::kWatch, LivePlane::kLive, LivePlane::kAsk, LivePlane::kAnswer}) {
    const auto parts = partsOfSubject("lab 1", subjectOf("lab 1", plane, "room.2"));
    ASSERT_TRUE(parts);
    EXPECT_EQ(parts->plane, plane);
    EXPECT_EQ(parts->name, "room.2");
  }
  EXPECT_EQ(subjectOf("l", LivePlane::kPresence, std::nullopt), "nl.l.presence.*");
  EXPECT_EQ(subjectOf("l", LivePlane::kLive, "bench-1"), "nl.l.live.bench-1");
  for (const char* const none : {"", "nl", "nl.l", "nl.l.live", "nl.l.live.", "nl.m.live.a", "nl.l.other.a",
                                 "nl.l.live.a.b", "xx.l.live.a", "nl.l.live.*"})
    EXPECT_FALSE(partsOfSubject("l", none)) << none;
}

struct Item {
  std::string text;
  [[nodiscard]] std::size_t bytes() const { return text.size(); }
};

TEST(DropQueue, dropsTheOldestByNumberAndByBytes) {
  DropQueue<Item> queue(3, 10);
  for (const char* const text : {"a", "b", "c"}) EXPECT_EQ(queue.push({text}), 0u);
  EXPECT_EQ(queue.push({"d"}), 1u);
  EXPECT_EQ(queue.pop()->text, "b");
  EXPECT_EQ(queue.push({"123456789"}), 1u) << "two letters and nine are too many";
  EXPECT_EQ(queue.bytes(), 10u);
  EXPECT_EQ(queue.push({"longer than the bound"}), 2u) << "the newest stays";
  EXPECT_EQ(queue.size(), 1u);
  EXPECT_EQ(queue.pop()->text, "longer than the bound");
  EXPECT_FALSE(queue.pop());
  EXPECT_EQ(queue.bytes(), 0u);
  EXPECT_EQ(queue.push({"x"}), 0u);
  EXPECT_EQ(queue.clear(), 1u);
  EXPECT_TRUE(queue.empty());
}

TEST(BackOff, doublesUpToABoundAndVaries) {
  BackOff off;
  EXPECT_EQ(off.next(1).count(), 100);
  EXPECT_EQ(off.next(0).count(), 100);
  EXPECT_EQ(off.next(0.5).count(), 300);
  for (int i = 0; i < 20; ++i) (void)off.next(0);
  EXPECT_EQ(off.next(0).count(), 1000);
  EXPECT_EQ(off.next(1), BackOff::kLast);
  off.reset();
  EXPECT_EQ(off.next(0).count(), 50);
}

}  // namespace
}  // namespace needlelab
