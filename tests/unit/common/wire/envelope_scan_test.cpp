#include "common/wire/envelope_scan.h"

#include <gmock/gmock.h>
#include <google/protobuf/descriptor.h>
#include <gtest/gtest.h>

#include <set>
#include <string>

#include "common/wire/protocol.h"
#include "needlelab/options.pb.h"
#include "tests/support/random.h"

namespace needlelab {
namespace {

using testing::HasSubstr;

/// A bytes field encoded by hand: field number below 16.
std::string field(int number, const std::string& bytes) {
  std::string out(1, static_cast<char>(number << 3 | 2));
  std::size_t size = bytes.size();
  for (; size >= 0x80; size >>= 7) out += static_cast<char>(size | 0x80);
  return out + static_cast<char>(size) + bytes;
}

/// An Envelope with SetReference (136: a two-byte tag) of `ids` empty session ids.
std::string referenceOfNothing(std::size_t ids) {
  std::string call;
  for (std::size_t i = 0; i < ids; ++i) call += std::string("\x12\x00", 2);
  std::string request = field(1, call);
  request.replace(0, 1, "\xc2\x08");  // 136 << 3 | 2
  return field(7, request);
}

TEST(EnvelopeScan, readsTheCallTheIdAndTheBodyFromTheTagsAlone) {
  pb::Envelope envelope;
  envelope.mutable_request()->set_id(77);
  envelope.mutable_request()->mutable_set_reference()->add_session_ids("x");
  const std::string bytes = envelope.SerializeAsString();
  const auto head = scanEnvelope(viewOf(bytes));
  ASSERT_TRUE(head.ok()) << head.error().message;
  EXPECT_EQ(head->body, pb::Envelope::kRequest);
  EXPECT_EQ(head->call, pb::Request::kSetReference);
  EXPECT_EQ(head->request_id, 77u);
  EXPECT_EQ(head->payload, envelope.request().SerializeAsString());
  // The call's content is not read: it need not be a valid message.
  std::string broken = field(1, "\xff\xff\xff");
  broken.replace(0, 1, "\xc2\x08");
  const auto seen = scanEnvelope(viewOf(field(7, broken)));
  ASSERT_TRUE(seen.ok());
  EXPECT_EQ(seen->call, pb::Request::kSetReference);
  EXPECT_FALSE(decodeFrame(viewOf(field(7, broken))).ok());
}

TEST(EnvelopeScan, namesTheSessionOfOneThatIsOpened) {
  pb::Envelope envelope;
  envelope.mutable_open_session()->mutable_description()->set_profile_json(std::string(300'000, 'x'));
  envelope.mutable_open_session()->mutable_description()->set_session_id("0123456789abcdef");
  const std::string bytes = envelope.SerializeAsString();
  EXPECT_EQ(scanEnvelope(viewOf(bytes))->session_id, "0123456789abcdef");
}

TEST(EnvelopeScan, namesTheSessionOfOneThatIsClosed) {
  pb::Envelope envelope;
  envelope.mutable_close_session()->set_hash(std::string(32, 'x'));
  envelope.mutable_close_session()->set_session_id("0123456789abcdef");
  const std::string bytes = envelope.SerializeAsString();
  EXPECT_EQ(scanEnvelope(viewOf(bytes))->session_id, "0123456789abcdef")
      << "a station that is refused must know which close to repeat";
}

TEST(EnvelopeScan, everyBodyAndEveryCallIsRecognised) {
  const auto* bodies = pb::Envelope::descriptor()->FindOneofByName("body");
  for (int i = 0; i < bodies->field_count(); ++i) {
    pb::Envelope envelope;
    (void)envelope.GetReflection()->MutableMessage(&envelope, bodies->field(i));
    EXPECT_EQ(scanEnvelope(viewOf(envelope.SerializeAsString()))->body, envelope.body_case());
  }
  const auto* calls = pb::Request::descriptor()->FindOneofByName("call");
  for (int i = 0; i < calls->field_count(); ++i) {
    pb::Envelope envelope;
    pb::Request& request = *envelope.mutable_request();
    (void)request.GetReflection()->MutableMessage(&request, calls->field(i));
    EXPECT_EQ(scanEnvelope(viewOf(envelope.SerializeAsString()))->call, request.call_case());
  }
}

TEST(EnvelopeScan, aNewerMinorsFieldsArePassedOver) {
  pb::Envelope envelope;
  envelope.mutable_ping()->set_id(1);
  envelope.GetReflection()->MutableUnknownFields(&envelope)->AddVarint(777, 1);
  EXPECT_EQ(scanEnvelope(viewOf(envelope.SerializeAsString()))->body, pb::Envelope::kPing);
  const auto unknown = scanEnvelope(viewOf(std::string("\xfa\x7c\x00", 3)));  // field 1999
  ASSERT_TRUE(unknown.ok());
  EXPECT_EQ(unknown->body, pb::Envelope::BODY_NOT_SET);
}

// Protobuf would merge them and keep the last: a costly call could hide behind an allowed one.
TEST(EnvelopeScan, twoBodiesOrTwoCallsAreRefused) {
  pb::Envelope ping, list;
  ping.mutable_ping()->set_id(1);
  list.mutable_request()->mutable_list_users();
  EXPECT_EQ(scanEnvelope(viewOf(ping.SerializeAsString() + list.SerializeAsString())).error().code,
            ErrorCode::kCorrupt);
  EXPECT_EQ(scanEnvelope(viewOf(list.SerializeAsString() + list.SerializeAsString())).error().code,
            ErrorCode::kCorrupt);
  pb::Request other;
  other.mutable_list_stations();
  const std::string calls = list.request().SerializeAsString() + other.SerializeAsString();
  EXPECT_THAT(scanEnvelope(viewOf(field(7, calls))).error().message, HasSubstr("more than one call"));
}

TEST(EnvelopeScan, aStationsLiveFrameMayCarryTheCountOfItsDroppedOnes) {
  pb::Envelope frame;
  frame.mutable_live_frame()->set_data("data");
  const std::string bytes = frame.SerializeAsString();
  const auto head = scanEnvelope(viewOf(bytes + droppedSuffix(UINT64_MAX)));
  ASSERT_TRUE(head.ok()) << head.error().message;
  EXPECT_EQ(head->body, pb::Envelope::kLiveFrame);
  pb::Envelope large;
  large.mutable_live_frame()->set_data(std::string(17, 'x'));
  EXPECT_EQ(scanEnvelope(viewOf(bytes + large.SerializeAsString())).error().code, ErrorCode::kCorrupt);
}

TEST(EnvelopeScan, readsABoundedNumberOfTagsHoweverLongTheMessageIs) {
  std::string unknown;
  for (std::size_t i = 0; i < kMaxHeadFields; ++i) unknown += std::string("\x78\x01", 2);  // field 15
  EXPECT_TRUE(scanEnvelope(viewOf(unknown)).ok());
  EXPECT_EQ(scanEnvelope(viewOf(unknown + "\x78\x01")).error().code, ErrorCode::kCorrupt);
  pb::Envelope list;
  list.mutable_request()->mutable_list_users();
  const std::string request = list.request().SerializeAsString();
  EXPECT_EQ(scanEnvelope(viewOf(field(7, unknown + request))).error().code, ErrorCode::kCorrupt);
}

TEST(EnvelopeScan, whatProtobufReadsHasTheBodyThatTheScanSaw) {
  test::Random random(7);
  std::size_t parsed = 0;
  pb::Envelope seed;
  seed.mutable_request()->set_id(3);
  seed.mutable_request()->mutable_list_users()->set_page("page");
  const std::string good = seed.SerializeAsString();
  for (int i = 0; i < 20'000; ++i) {
    std::string bytes = good;
    for (int k = 0; k < 2; ++k) bytes[random.below(bytes.size())] = static_cast<char>(random.below(256));
    const auto head = scanEnvelope(viewOf(bytes));
    const auto envelope = decodeFrame(viewOf(bytes));
    if (!head.ok() || !envelope.ok()) continue;
    ++parsed;
    EXPECT_EQ(head->body, envelope->body_case());
    EXPECT_EQ(head->call, envelope->request().call_case());
    EXPECT_EQ(head->request_id, envelope->request().id());
    (void)measurePayload(*head);
  }
  EXPECT_GT(parsed, 1000u);
}

TEST(PayloadCost, aListIsCountedBeforeItIsParsed) {
  for (const std::size_t ids : {10'000u, 10'001u, 524'200u}) {
    const std::string bytes = referenceOfNothing(ids);
    ASSERT_LE(bytes.size(), kMaxFrameBytes);
    const auto head = scanEnvelope(viewOf(bytes));
    ASSERT_TRUE(head.ok()) << head.error().message;
    ASSERT_EQ(head->call, pb::Request::kSetReference);
    const auto cost = measurePayload(*head);
    EXPECT_EQ(cost.ok(), ids <= 10'000u);
    if (cost.ok()) continue;
    EXPECT_EQ(cost.error().code, ErrorCode::kInvalidInput);
    EXPECT_EQ(cost.error().message,
              "request.set_reference.session_ids has more than 10000 items: send fewer at once");
  }
}

TEST(PayloadCost, packedNumbersAreItemsToo) {
  pb::Envelope envelope;
  for (int i = 0; i < 64; ++i)
    envelope.mutable_request()->mutable_set_aids()->add_aids(pb::Exercise::ULTRASOUND);
  EXPECT_TRUE(measurePayload(*scanEnvelope(viewOf(envelope.SerializeAsString()))).ok());
  envelope.mutable_request()->mutable_set_aids()->add_aids(pb::Exercise::ULTRASOUND);
  const std::string bytes = envelope.SerializeAsString();
  EXPECT_THAT(measurePayload(*scanEnvelope(viewOf(bytes))).error().message, HasSubstr("more than 64 items"));
}

TEST(PayloadCost, theFieldCountIsBounded) {
  std::string unknown;
  for (std::size_t i = 0; i < kMaxPayloadFields; ++i) unknown += std::string("\x78\x01", 2);
  const std::string most = field(5, unknown), more = field(5, unknown + "\x78\x01");
  EXPECT_TRUE(measurePayload(*scanEnvelope(viewOf(most))).ok());
  EXPECT_THAT(measurePayload(*scanEnvelope(viewOf(more))).error().message,
              HasSubstr("ping has more than 65536 fields"));
}

TEST(PayloadCost, isNoLessThanTheMemoryOfTheParsedMessage) {
  pb::Envelope reference, session, chunk;
  for (int i = 0; i < 10'000; ++i) reference.mutable_request()->mutable_set_reference()->add_session_ids("");
  auto& description = *session.mutable_open_session()->mutable_description();
  description.set_profile_json(std::string(250'000, 'x'));
  for (int i = 0; i < 7; ++i) description.add_placement(i);
  for (int i = 0; i < 100; ++i) description.add_device_notes("a note of more than fifteen bytes");
  chunk.mutable_chunk()->set_data(std::string(40'000, 'x'));
  for (const pb::Envelope& envelope : {reference, session, chunk}) {
    const std::string bytes = envelope.SerializeAsString();
    const auto cost = measurePayload(*scanEnvelope(viewOf(bytes)));
    ASSERT_TRUE(cost.ok()) << cost.error().message;
    const auto parsed = decodeFrame(viewOf(bytes));
    const auto real = static_cast<std::size_t>(parsed->SpaceUsedLong());
    EXPECT_GE(cost->decoded_bytes, real - sizeof(pb::Envelope));
    EXPECT_LE(cost->decoded_bytes, 3 * real + 4096) << "an estimate, not a bound on everything";
  }
}

TEST(PayloadCost, aChunksBytesAreCopiedWithoutScanning) {
  pb::Envelope chunk;
  chunk.mutable_chunk()->set_session_id("0123456789abcdef");
  chunk.mutable_chunk()->set_data(std::string(500'000, 'x'));
  const auto cost = measurePayload(*scanEnvelope(viewOf(chunk.SerializeAsString())));
  EXPECT_EQ(cost->fields, 2u);
  EXPECT_LT(cost->parsed_bytes, 32u);
}

/// All lists that a peer may send, at any depth.
void lists(const google::protobuf::Descriptor& type, std::set<const google::protobuf::Descriptor*>& seen,
           std::set<std::string>& unbounded) {
  if (!seen.insert(&type).second) return;
  for (int i = 0; i < type.field_count(); ++i) {
    const auto* field = type.field(i);
    if (field->is_repeated() && !field->options().HasExtension(pb::max_items))
      unbounded.insert(field->full_name());
    if (field->message_type() != nullptr) lists(*field->message_type(), seen, unbounded);
  }
}

TEST(PayloadCost, everyListThatAPeerMaySendHasItsBound) {
  std::set<const google::protobuf::Descriptor*> seen;
  std::set<std::string> unbounded;
  for (const auto* type :
       {pb::Request::descriptor(), pb::Hello::descriptor(), pb::Login::descriptor(), pb::Chunk::descriptor(),
        pb::OpenSession::descriptor(), pb::CloseSession::descriptor(), pb::StationStatus::descriptor(),
        pb::LiveFrame::descriptor(), pb::Subscribe::descriptor(), pb::Refusal::descriptor()})
    lists(*type, seen, unbounded);
  EXPECT_THAT(unbounded, testing::IsEmpty());
}

}  // namespace
}  // namespace needlelab
