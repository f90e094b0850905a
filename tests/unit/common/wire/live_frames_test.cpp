#include <gtest/gtest.h>

#include <limits>
#include <memory>
#include <random>
#include <string>

#include "common/wire/live_frames.h"
#include "tests/support/run_form.h"

namespace needlelab {
namespace {

std::uint64_t seed() {
  return test::seedOr(std::random_device{}());
}

std::uint64_t anyNumber(std::mt19937_64& random) {
  return random() >> (random() % 65 == 64 ? 63 : random() % 64);
}

std::string anyBytes(std::mt19937_64& random, std::size_t most) {
  std::string bytes(random() % (most + 1), '\0');
  for (char& byte : bytes) byte = static_cast<char>(random());
  return bytes;
}

pb::LiveFrame anyFrame(std::mt19937_64& random) {
  pb::LiveFrame frame;
  if (random() % 8 != 0) frame.set_session_id(anyBytes(random, 20));
  if (random() % 8 != 0) frame.set_frame_seq(anyNumber(random));
  if (random() % 8 != 0) frame.set_data(anyBytes(random, random() % 4 == 0 ? 20'000 : 200));
  if (random() % 8 != 0) frame.set_due_steady_ns(static_cast<std::int64_t>(anyNumber(random)));
  if (random() % 8 != 0) frame.set_capture_unix_ns(-static_cast<std::int64_t>(anyNumber(random) >> 1));
  if (random() % 4 == 0) frame.set_cut_memory(anyBytes(random, 1000));
  if (random() % 4 == 0) frame.set_paths(anyBytes(random, 2000));
  return frame;
}

/// The reference: parses, fills in and serialises again, as the server did before it spliced bytes.
std::string rewritten(pb::LiveFrame frame, const std::string& station) {
  frame.set_station(station);
  frame.clear_dropped_for_you();
  pb::Envelope envelope;
  *envelope.mutable_live_frame() = std::move(frame);
  return envelope.SerializeAsString();
}

std::string envelopeOf(const pb::LiveFrame& frame) {
  pb::Envelope envelope;
  *envelope.mutable_live_frame() = frame;
  return envelope.SerializeAsString();
}

TEST(LiveFrames, aSplicedFrameIsTheOneThatProtobufWouldWrite) {
  std::mt19937_64 random(seed());
  for (int i = 0; i < 20'000; ++i) {
    const pb::LiveFrame frame = anyFrame(random);
    const std::string bytes = envelopeOf(frame), station = "bench-" + std::to_string(random() % 2000);
    const auto view = viewLiveFrame(viewOf(bytes));
    ASSERT_TRUE(view) << frame.ShortDebugString();
    ASSERT_EQ(*encodeLiveFrame(*view, station), rewritten(frame, station)) << frame.ShortDebugString();
    ASSERT_EQ(*encodeLiveFrame(viewOf(frame), station), rewritten(frame, station));
  }
}

TEST(LiveFrames, splicedFramesMatchProtobufForAnyBytes) {
  std::mt19937_64 random(seed());
  int taken = 0;
  for (int i = 0; i < 100'000; ++i) {
    std::string bytes = envelopeOf(anyFrame(random));
    // hostile: bytes changed, cut off, inserted, appended
    for (std::uint64_t n = 1 + random() % 3; n > 0 && !bytes.empty(); --n) {
      const std::size_t at =
          random() % std::min<std::size_t>(bytes.size(), random() % 2 == 0 ? 40 : bytes.size());
      switch (random() % 4) {
        case 0:
          bytes[at] = static_cast<char>(random());
          break;
        case 1:
          bytes.resize(at);
          break;
        case 2:
          bytes.insert(at, 1, static_cast<char>(random()));
          break;
        default:
          bytes += anyBytes(random, 5);
      }
    }
    const auto view = viewLiveFrame(viewOf(bytes));
    if (!view) continue;
    ++taken;
    const auto parsed = decodeFrame(viewOf(bytes));
    ASSERT_TRUE(parsed.ok()) << "spliced, although Protobuf refuses it";
    ASSERT_TRUE(parsed->has_live_frame());
    ASSERT_EQ(*encodeLiveFrame(*view, "s"), rewritten(parsed->live_frame(), "s"));
  }
  EXPECT_GT(taken, 1000) << "the test has hardly met a frame that is taken";
}

TEST(LiveFrames, whatIsNotPlainIsLeftToTheParser) {
  pb::LiveFrame frame;
  frame.set_data("abc");
  const std::string plain = envelopeOf(frame);
  ASSERT_TRUE(viewLiveFrame(viewOf(plain)));
  pb::LiveFrame liar = frame;
  liar.set_station("somebody else");
  EXPECT_FALSE(viewLiveFrame(viewOf(envelopeOf(liar))));
  pb::LiveFrame dropped = frame;
  dropped.set_dropped_for_you(1);
  EXPECT_FALSE(viewLiveFrame(viewOf(envelopeOf(dropped))));
  EXPECT_FALSE(viewLiveFrame(viewOf(plain + plain))) << "two bodies: Protobuf merges them";
  EXPECT_FALSE(viewLiveFrame(viewOf(droppedSuffix(3))));
  pb::Envelope ping;
  ping.mutable_ping()->set_id(1);
  EXPECT_FALSE(viewLiveFrame(viewOf(ping.SerializeAsString())));
  EXPECT_FALSE(viewLiveFrame({}));
  for (std::size_t length = 0; length < plain.size(); ++length)
    EXPECT_FALSE(viewLiveFrame(viewOf(plain.substr(0, length)))) << "cut after " << length;
}

TEST(LiveFrames, anOversizedFrameIsDropped) {
  const std::string data(kMaxFrameBytes, 'x');
  LiveFrameView frame;
  frame.data = data;
  EXPECT_EQ(encodeLiveFrame(frame, "s"), nullptr);
}

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
  // 50 frames per second for one second, without a reader
  for (int i = 0; i < 50; ++i) queue.push(frameOf(std::to_string(i)), true, i * 20 * kMs);
  // at the last push (980 ms) those since 880 ms remain: 44 … 49
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
