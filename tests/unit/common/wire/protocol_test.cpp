#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <string>
#include <vector>

#include "common/base/text/text.h"
#include "common/wire/protocol.h"

namespace needlelab {
namespace {

std::string framed(const std::string& body) {
  std::string out;
  appendFrameHeader(out, body.size());
  return out + body;
}

/// Passes `bytes` to the splitter in pieces of `step` and appends the frames to `frames`. Returns false if
/// the splitter refuses.
bool feed(FrameSplitter& splitter, const std::string& bytes, std::size_t step,
          std::vector<std::string>& frames) {
  for (std::size_t at = 0; at < bytes.size();) {
    const auto room = splitter.writable();
    const std::size_t count = std::min({step, room.size(), bytes.size() - at});
    std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(at), count, room.begin());
    splitter.wrote(count);
    at += count;
    for (;;) {
      const auto frame = splitter.next();
      if (!frame.ok()) return false;
      if (!frame->has_value()) break;
      frames.emplace_back(textOf(**frame));
    }
  }
  return true;
}

pb::Envelope chunkOf(std::size_t bytes) {
  pb::Envelope envelope;
  envelope.mutable_chunk()->set_data(std::string(bytes, 'x'));
  return envelope;
}

TEST(Framing, lengthIsFourBytesBigEndian) {
  std::string out;
  appendFrameHeader(out, 0x00012345);
  EXPECT_EQ(out, std::string("\x00\x01\x23\x45", 4));
}

TEST(Framing, anEnvelopeSurvivesARoundTrip) {
  pb::Envelope envelope;
  envelope.mutable_ack()->set_committed_seqs(1234567890123);
  envelope.set_refused_request(7);
  const auto frame = encodeFrame(envelope);
  ASSERT_TRUE(frame.ok());
  const auto back = decodeFrame(viewOf(**frame));
  ASSERT_TRUE(back.ok());
  EXPECT_EQ(back->SerializeAsString(), envelope.SerializeAsString());
}

TEST(Framing, invalidUtf8IsRefusedWithoutOutputOnStderr) {
  // a program name that we do not use
  pb::Envelope envelope;
  envelope.mutable_hello()->set_program("needlelab");
  std::string bytes = envelope.SerializeAsString();
  const std::size_t at = bytes.find("needlelab");
  ASSERT_NE(at, std::string::npos);
  bytes[at] = static_cast<char>(0xff);
  keepProtobufQuiet();
  testing::internal::CaptureStderr();
  EXPECT_FALSE(decodeFrame(viewOf(bytes)).ok());
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

TEST(Framing, everyStepWidthGivesTheSameFrames) {
  const std::vector<std::string> bodies = {"a", std::string(3, 'b'), std::string(40'000, 'c'), "d"};
  std::string bytes;
  for (const auto& body : bodies) bytes += framed(body);
  for (const std::size_t step : {1u, 2u, 3u, 5u, 1000u, 16384u, 100000u}) {
    FrameSplitter splitter(kMaxFrameBytes);
    std::vector<std::string> frames;
    ASSERT_TRUE(feed(splitter, bytes, step, frames)) << step;
    EXPECT_EQ(frames, bodies) << "in pieces of " << step;
    EXPECT_EQ(splitter.pending(), 0u);
  }
}

TEST(Framing, everyTruncationWaitsForMoreAndGivesNothing) {
  const std::string bytes = framed(chunkOf(300).SerializeAsString());
  for (std::size_t length = 0; length < bytes.size(); ++length) {
    FrameSplitter splitter(kMaxFrameBytes);
    std::vector<std::string> frames;
    ASSERT_TRUE(feed(splitter, bytes.substr(0, length), 64, frames));
    EXPECT_TRUE(frames.empty()) << "cut after " << length;
    EXPECT_EQ(splitter.pending(), length);
  }
}

TEST(Framing, lengthZeroIsRefused) {
  FrameSplitter splitter(kMaxFrameBytes);
  std::vector<std::string> frames;
  EXPECT_FALSE(feed(splitter, std::string(4, '\0'), 4, frames));
}

TEST(Framing, anOversizedLengthIsRefusedBeforeAllocation) {
  for (const std::size_t limit : {kMaxFrameBytesBeforeLogin, kMaxFrameBytes}) {
    for (const std::size_t length : {limit + 1, std::size_t{0x7fffffff}, std::size_t{0xffffffff}}) {
      FrameSplitter splitter(limit);
      std::string header;
      for (const int shift : {24, 16, 8, 0}) header.push_back(static_cast<char>((length >> shift) & 0xff));
      std::vector<std::string> frames;
      EXPECT_FALSE(feed(splitter, header, 4, frames)) << length;
      EXPECT_LE(splitter.capacity(), 16u << 10);
    }
  }
}

TEST(Framing, theOtherPortIsNamedWhereHttpIsSpoken) {
  const auto told = [](const std::string& bytes) {
    FrameSplitter splitter(kMaxFrameBytesBeforeLogin);
    const auto room = splitter.writable();
    std::copy(bytes.begin(), bytes.end(), room.begin());
    splitter.wrote(bytes.size());
    const auto next = splitter.next();
    return next.ok() ? "it was taken" : next.error().message;
  };
  EXPECT_THAT(told("HTTP/1.1 400 Bad Request\r\n"), testing::HasSubstr("usually 7750"));
  for (const char* const request :
       {"GET / HTTP/1.1\r\n", "POST /api/v1/session HTTP/1.1\r\n", "HEAD / HTTP/1.0\r\n"})
    EXPECT_THAT(told(request), testing::HasSubstr("usually 7751")) << request;
  EXPECT_THAT(told("GETX"), testing::HasSubstr("a frame of")) << "no method";
}

TEST(Framing, aFrameOfExactlyTheLimitPasses) {
  FrameSplitter splitter(kMaxFrameBytesBeforeLogin);
  std::vector<std::string> frames;
  ASSERT_TRUE(feed(splitter, framed(std::string(kMaxFrameBytesBeforeLogin, 'x')), 999, frames));
  ASSERT_EQ(frames.size(), 1u);
  EXPECT_EQ(frames[0].size(), kMaxFrameBytesBeforeLogin);
}

TEST(Framing, memoryGrowsWithWhatArrivedAndIsGivenBack) {
  FrameSplitter splitter(kMaxFrameBytes);
  std::vector<std::string> frames;
  // a mebibyte is announced, 20 bytes arrive
  ASSERT_TRUE(feed(splitter, framed(std::string(kMaxFrameBytes, 'x')).substr(0, 24), 24, frames));
  EXPECT_LE(splitter.capacity(), 16u << 10);
  // the rest arrives
  ASSERT_TRUE(feed(splitter, std::string(kMaxFrameBytes - 20, 'x'), 16384, frames));
  ASSERT_EQ(frames.size(), 1u);
  EXPECT_LE(splitter.capacity(), FrameSplitter::kMostBytes);
  (void)splitter.writable();
  EXPECT_LE(splitter.capacity(), 64u << 10);
}

TEST(Framing, anEnvelopeThatIsTooLargeOrEmptyIsNotSent) {
  EXPECT_EQ(encodeFrame(chunkOf(kMaxFrameBytes)).error().code, ErrorCode::kInvalidInput);
  EXPECT_EQ(encodeFrame(pb::Envelope{}).error().code, ErrorCode::kInvalidInput);
  EXPECT_TRUE(encodeFrame(chunkOf(kMaxFrameBytes - 100)).ok());
}

TEST(Framing, randomBytesNeverGiveMoreThanRefusalOrEnvelope) {
  std::mt19937_64 random(20261101);
  int refused = 0;
  for (int i = 0; i < 20'000; ++i) {
    std::string bytes(random() % 64 + 1, '\0');
    for (char& c : bytes) c = static_cast<char>(random());
    const auto envelope = decodeFrame(viewOf(bytes));
    if (!envelope.ok()) {
      ++refused;
      EXPECT_EQ(envelope.error().code, ErrorCode::kCorrupt);
    }
  }
  EXPECT_GT(refused, 10'000);
}

TEST(Framing, everyTruncationOfAnEnvelopeIsRefusedOrAnEnvelope) {
  pb::Envelope envelope;
  auto& description = *envelope.mutable_open_session()->mutable_description();
  description.set_session_id(std::string(16, 's'));
  description.set_profile_json(R"({"id":"x"})");
  const std::string bytes = envelope.SerializeAsString();
  // inside the only length-delimited body every cut is an error
  for (std::size_t length = 1; length < bytes.size(); ++length) {
    EXPECT_FALSE(decodeFrame(viewOf(std::string_view(bytes).substr(0, length))).ok()) << length;
  }
}

TEST(Framing, anUnknownBodyOfANewerMinorIsNoError) {
  pb::Envelope envelope;
  envelope.GetReflection()->MutableUnknownFields(&envelope)->AddLengthDelimited(999, "something new");
  const auto back = decodeFrame(viewOf(envelope.SerializeAsString()));
  ASSERT_TRUE(back.ok());
  EXPECT_EQ(back->body_case(), pb::Envelope::BODY_NOT_SET);
}

TEST(Framing, theDroppedSuffixChangesOnlyThatFieldOfASharedFrame) {
  pb::Envelope envelope;
  pb::LiveFrame& live = *envelope.mutable_live_frame();
  live.set_station("bench-1");
  live.set_frame_seq(41);
  live.set_data("samples");
  live.set_capture_unix_ns(-5);
  live.set_dropped_for_you(3);
  const std::string shared = envelope.SerializeAsString();
  for (const std::uint64_t dropped : {1ull, 300ull, 18'446'744'073'709'551'615ull}) {
    const auto back = decodeFrame(viewOf(shared + droppedSuffix(dropped)));
    ASSERT_TRUE(back.ok());
    pb::Envelope expected = envelope;
    expected.mutable_live_frame()->set_dropped_for_you(dropped);
    EXPECT_EQ(back->SerializeAsString(), expected.SerializeAsString());
  }
}

pb::Version version(std::uint32_t major, std::uint32_t minor) {
  pb::Version v;
  v.set_major(major);
  v.set_minor(minor);
  return v;
}

TEST(Protocol, equalMajorVersionsAreCompatible) {
  EXPECT_TRUE(checkVersion(version(1, 0), version(1, 7)).ok());
  EXPECT_TRUE(checkVersion(version(1, 7), version(1, 0)).ok());
}

TEST(Protocol, anotherMajorIsRefusedAndBothAreNamed) {
  const auto status = checkVersion(version(1, 3), version(2, 5));
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kVersion);
  EXPECT_THAT(status.error().message, testing::AllOf(testing::HasSubstr("1.3"), testing::HasSubstr("2.5")));
}

TEST(Protocol, noVersionIsMajorZeroAndRefused) {
  EXPECT_FALSE(checkVersion(ourVersion(), pb::Version{}).ok());
}

TEST(Refusal, theReasonDecidesWhetherTryingAgainMayHelp) {
  EXPECT_EQ(errorOf(makeRefusal(pb::Refusal::SHUTTING_DOWN, "")).code, ErrorCode::kUnavailable);
  EXPECT_EQ(errorOf(makeRefusal(pb::Refusal::RATE_LIMITED, "")).code, ErrorCode::kUnavailable);
  EXPECT_EQ(errorOf(makeRefusal(pb::Refusal::LOGIN, "")).code, ErrorCode::kDenied);
  EXPECT_EQ(errorOf(makeRefusal(pb::Refusal::VERSION, "")).code, ErrorCode::kVersion);
}

TEST(Refusal, aLongTextIsCutBetweenCharacters) {
  std::string text = "there is no profile '";
  for (int i = 0; i < 100'000; ++i) text += "\xc3\xa4";
  const pb::Refusal refusal = makeRefusal(pb::Refusal::NOT_FOUND, text);
  EXPECT_LT(refusal.text().size(), kMaxRefusalBytes + 20);
  EXPECT_TRUE(isUtf8(refusal.text()));
  EXPECT_THAT(refusal.text(), testing::StartsWith("there is no profile"));
  EXPECT_EQ(makeRefusal(pb::Refusal::NOT_FOUND, std::string(kMaxRefusalBytes, 'x')).text().size(),
            kMaxRefusalBytes);
}

TEST(Refusal, aSessionIsNamedByAnIdOfSixteenBytesOnly) {
  for (const std::size_t bytes : {0u, 15u, 17u, 1'000'000u}) {
    pb::Refusal refusal = makeRefusal(pb::Refusal::INVALID, "no");
    nameSession(refusal, std::string(bytes, 'x'));
    EXPECT_EQ(refusal.session_id(), "") << bytes;
  }
  pb::Refusal refusal = makeRefusal(pb::Refusal::GAP, "no");
  nameSession(refusal, "0123456789abcdef");
  EXPECT_EQ(refusal.session_id(), "0123456789abcdef");
}

TEST(Refusal, aMissingOrWrongCodeHasItsOwnReason) {
  EXPECT_EQ(refusalOf(Error{ErrorCode::kCode, "no"}).reason(), pb::Refusal::CODE);
  const Error error = errorOf(makeRefusal(pb::Refusal::CODE, "tom has a code: type it"));
  EXPECT_EQ(error.code, ErrorCode::kCode);
  EXPECT_EQ(error.message, "tom has a code: type it") << "as the trainee reads it";
  EXPECT_EQ(refusalOf(Error{ErrorCode::kNoRoom, "no"}).reason(), pb::Refusal::NO_ROOM);
  EXPECT_EQ(errorOf(makeRefusal(pb::Refusal::NO_ROOM, "no")).code, ErrorCode::kNoRoom);
}

TEST(Refusal, aVersionRefusalNamesBothVersions) {
  auto refusal = makeRefusal(pb::Refusal::VERSION, "no", true);
  refusal.mutable_ours()->set_major(2);
  refusal.mutable_ours()->set_minor(4);
  refusal.mutable_theirs()->set_major(1);
  EXPECT_THAT(errorOf(refusal).message, testing::AllOf(testing::HasSubstr("2.4"), testing::HasSubstr("1.0")));
}

TEST(Refusal, aReasonOfANewerPeerHasANumberForAName) {
  EXPECT_EQ(reasonName(static_cast<pb::Refusal::Reason>(99)), "reason 99");
  EXPECT_EQ(reasonName(pb::Refusal::GAP), "GAP");
}

}  // namespace

}  // namespace needlelab
