#include "db/erasure/erasure.h"
#include "db/people/person_refs.h"
#include "db/service/requests/handlers.h"
#include "tests/unit/db/service/test_service.h"

namespace needlelab {
namespace {

class SessionHandlers : public test::ServiceTest {
 protected:
  void SetUp() override { addStation(); }
  static pb::Request getSession(const Uuid& id) {
    pb::Request request;
    request.mutable_get_session()->set_session_id(test::bytesOfId(id));
    return request;
  }
};

TEST_F(SessionHandlers, aTraineeSeesOwnSessionsOnly) {
  addPerson("anna", pb::TRAINEE);
  const Uuid own = addSession("anna", 1), other = addSession("ben", 1);
  pb::Request list;
  list.mutable_list_sessions();
  EXPECT_EQ(get(instructor, list).sessions().sessions_size(), 2);
  ASSERT_EQ(get(trainee, list).sessions().sessions_size(), 1);
  EXPECT_EQ(get(trainee, list).sessions().sessions(0).description().session_id(), test::bytesOfId(own));
  list.mutable_list_sessions()->set_trainee("ben");
  EXPECT_EQ(refusal(trainee, list), ErrorCode::kDenied);
  get(trainee, getSession(own));
  EXPECT_EQ(refusal(trainee, getSession(other)), ErrorCode::kNotFound);
  pb::Request read;
  read.mutable_read_chunks()->set_session_id(test::bytesOfId(other));
  EXPECT_EQ(refusal(trainee, read), ErrorCode::kNotFound);
  pb::Request notes;
  notes.mutable_list_annotations()->set_session_id(test::bytesOfId(other));
  EXPECT_EQ(refusal(trainee, notes), ErrorCode::kNotFound);
}

TEST_F(SessionHandlers, wrongAndUnknownIdsHaveDifferentReasons) {
  pb::Request request;
  request.mutable_get_session()->set_session_id("short");
  EXPECT_EQ(refusal(instructor, request), ErrorCode::kInvalidInput);
  EXPECT_EQ(refusal(instructor, getSession(makeUuidV7())), ErrorCode::kNotFound);
  pb::Request read;
  read.mutable_read_chunks()->set_session_id(std::string(17, 'x'));
  EXPECT_EQ(refusal(instructor, read), ErrorCode::kInvalidInput);
}

TEST_F(SessionHandlers, chunksComeInPartsUnderOneMebibyte) {
  // 30 chunks of about 60 kB: at least two replies
  const Uuid id = addSession("anna", 30, 20'000);
  pb::Request request;
  auto* read = request.mutable_read_chunks();
  read->set_session_id(test::bytesOfId(id));
  std::uint64_t seq = 0;
  int replies = 0;
  for (bool end = false; !end; ++replies) {
    ASSERT_LT(replies, 40);
    read->set_from_seq(seq);
    const auto reply = get(instructor, request);
    EXPECT_LT(reply.ByteSizeLong(), std::size_t{1} << 20);
    ASSERT_GT(reply.chunks().chunks_size(), 0);
    for (const auto& chunk : reply.chunks().chunks()) {
      EXPECT_EQ(chunk.seq(), seq++);
      EXPECT_EQ(chunk.session_id(), test::bytesOfId(id));
    }
    end = reply.chunks().end();
  }
  EXPECT_EQ(seq, 30u);
  EXPECT_GT(replies, 1);
  read->set_from_seq(30);
  EXPECT_TRUE(get(instructor, request).chunks().end());
  read->set_from_seq(UINT64_MAX);
  EXPECT_TRUE(get(instructor, request).chunks().end());
  read->set_from_seq(0);
  read->set_max_chunks(2);
  EXPECT_EQ(get(instructor, request).chunks().chunks_size(), 2);
  EXPECT_FALSE(get(instructor, request).chunks().end());
}

TEST_F(SessionHandlers, readingAnothersSamplesIsAuditedOncePerHourAndSession) {
  addPerson("anna", pb::TRAINEE);
  const Uuid first = addSession("anna", 2), second = addSession("anna", 1), own = addSession("ina", 1);
  const auto lines = [&] {
    pb::Request list;
    list.mutable_list_audit()->set_action("session export");
    std::vector<std::string> all;
    const auto reply = get(admin, list);
    for (const auto& entry : reply.audit().entries())
      all.insert(all.begin(), entry.who() + "|" + entry.subject() + "|" + entry.detail());
    return all;
  };
  const auto read = [&](const Principal& who, const Uuid& id, std::uint64_t from_seq) {
    pb::Request request;
    request.mutable_read_chunks()->set_session_id(test::bytesOfId(id));
    request.mutable_read_chunks()->set_from_seq(from_seq);
    get(who, request);
  };
  read(trainee, first, 0);
  read(instructor, own, 0);
  EXPECT_TRUE(lines().empty()) << "one's own";
  for (int i = 0; i < 3; ++i)
    for (const std::uint64_t seq : {1u, 0u}) read(instructor, first, seq);
  read(manager, first, 0);
  read(instructor, second, 0);
  const std::string of_anna = "|samples of 'anna'";
  EXPECT_EQ(lines(),
            (std::vector<std::string>{"ina|" + uuidText(first) + of_anna, "mia|" + uuidText(first) + of_anna,
                                      "ina|" + uuidText(second) + of_anna}));
  pb::Request unknown;
  unknown.mutable_read_chunks()->set_session_id(test::bytesOfId(makeUuidV7()));
  EXPECT_EQ(refusal(instructor, unknown), ErrorCode::kNotFound);
  EXPECT_EQ(lines().size(), 3u) << "a refusal shows nothing";
}

TEST_F(SessionHandlers, aStaffLogInIsAuditedOncePerHourAndHost) {
  for (const char* host : {"192.0.2.1", "192.0.2.1", "192.0.2.2"})
    for (const Principal* who : {&trainee, &instructor, &admin})
      ASSERT_OK(store->service().notes().noteLogin(*who, host));
  pb::Request list;
  list.mutable_list_audit()->set_action("log-in");
  std::vector<std::string> all;
  const auto reply = get(admin, list);
  for (const auto& entry : reply.audit().entries())
    all.insert(all.begin(), entry.who() + "|" + entry.detail());
  EXPECT_EQ(all,
            (std::vector<std::string>{"ina|instructor from 192.0.2.1", "ada|administrator from 192.0.2.1",
                                      "ina|instructor from 192.0.2.2", "ada|administrator from 192.0.2.2"}));
}

TEST_F(SessionHandlers, aLongListOfSessionsFitsIntoAReply) {
  ASSERT_OK(change([](Connection& c) -> Status {
    for (int i = 0; i < 1'500; ++i) {
      auto d = test::describe(makeUuidV7());
      d.set_trainee(std::string(64, 'x'));
      d.set_exercise_id(std::string(64, 'x'));
      d.set_profile_id(std::string(64, 'x'));
      d.set_device(std::string(200, 'x'));
      d.set_engine_version(std::string(100, 'x'));
      for (int k = 0; k < 7; ++k) d.add_placement(k < 6 ? 0 : 1), d.add_tool(k < 6 ? 0 : 1);
      if (auto opened = SessionStore(c).open(d, 1); !opened) return opened.error();
    }
    return {};
  }));
  pb::Request list;
  list.mutable_list_sessions();
  const auto reply = get(instructor, list);
  EXPECT_LT(reply.ByteSizeLong(), std::size_t{1} << 20);
  EXPECT_EQ(reply.sessions().sessions_size(), 1'000);
}

TEST_F(SessionHandlers, verifyReportsDamageAsAResult) {
  const Uuid id = addSession("anna", 3);
  pb::Request request;
  request.mutable_verify_session()->set_session_id(test::bytesOfId(id));
  const auto good = get(instructor, request).verified();
  EXPECT_TRUE(good.ok());
  EXPECT_EQ(good.chunks(), 3u);
  EXPECT_EQ(good.hash(), test::closeOf(id, 3).hash());
  ASSERT_OK(change([](Connection& c) { return c.run("UPDATE chunks SET crc = 1 WHERE seq = 1"); }));
  const auto bad = get(instructor, request).verified();
  EXPECT_FALSE(bad.ok());
  EXPECT_NE(bad.text().find("chunk 1"), std::string::npos);
}

TEST_F(SessionHandlers, aLongSessionIsVerifiedInStepsOfBoundedReading) {
  constexpr std::uint64_t kChunks = 20'000;  // with one sample each
  const Uuid id = addSession("anna", kChunks, 1);
  std::uint64_t steps = 1, counted = 0;
  for (std::uint64_t seq = 0; seq < kChunks; ++seq) {
    if (counted >= handlers::kVerifiedBytesAtOnce) {
      ++steps;
      counted = 0;
    }
    counted += test::chunkOf(seq, 1).size() + SessionStore::kHashedChunkBytes;
  }
  ASSERT_GE(steps, 2u);
  pb::Request verify;
  verify.mutable_verify_session()->set_session_id(test::bytesOfId(id));
  RequestUnderWay under_way;
  for (std::uint64_t step = 1; step < steps; ++step) {
    ASSERT_FALSE(store->service().executeStep(instructor, verify, under_way)) << step;
    // the last of the earlier chunks arrives and is compared with the final counters
    if (step == 1)
      ASSERT_OK(change([&](Connection& c) {
        const auto stored = SessionStore(c).append(id, kChunks, test::chunkOf(kChunks, 1));
        return stored ? Status() : Status(stored.error());
      }));
  }
  const auto outcome = store->service().executeStep(instructor, verify, under_way);
  ASSERT_TRUE(outcome.has_value());
  ASSERT_FALSE(outcome->error) << outcome->error->message;
  const auto& verified = outcome->reply.verified();
  EXPECT_TRUE(verified.ok()) << verified.text();
  EXPECT_EQ(verified.chunks(), kChunks + 1);
  EXPECT_EQ(verified.samples(), kChunks + 1);
  EXPECT_EQ(verified.hash(), test::closeOf(id, kChunks + 1, 1).hash());
}

TEST_F(SessionHandlers, aRecordingRemovedBetweenStepsIsVerifiedAsItRemains) {
  const Uuid id = addSession("anna", 20'000, 1);
  pb::Request verify;
  verify.mutable_verify_session()->set_session_id(test::bytesOfId(id));
  RequestUnderWay under_way;
  ASSERT_FALSE(store->service().executeStep(instructor, verify, under_way));
  // retention removes the chunks later
  ASSERT_OK(change([](Connection& c) {
    const auto ref = findPerson(c, "anna", Named::kAccountOrTyped);
    const auto erased = ErasureStore(c).erase(ref->value(), {"ada", "", 1});
    return erased ? Status() : Status(erased.error());
  }));
  const auto outcome = store->service().executeStep(instructor, verify, under_way);
  ASSERT_TRUE(outcome.has_value());
  ASSERT_FALSE(outcome->error) << outcome->error->message;
  EXPECT_TRUE(outcome->reply.verified().ok()) << outcome->reply.verified().text();
  EXPECT_EQ(outcome->reply.verified().chunks(), 0u);
}

TEST_F(SessionHandlers, aRevokedPersonGetsNoFurtherStep) {
  addPerson("ina", pb::INSTRUCTOR);
  const Uuid id = addSession("anna", 20'000, 1);
  pb::Request verify;
  verify.mutable_verify_session()->set_session_id(test::bytesOfId(id));
  const Principal logged_in{"ina", pb::INSTRUCTOR, true};
  RequestUnderWay under_way;
  ASSERT_FALSE(store->service().executeStep(logged_in, verify, under_way));
  pb::Request disable;
  disable.mutable_disable_user()->set_name("ina");
  get(admin, disable);
  const auto outcome = store->service().executeStep(logged_in, verify, under_way);
  ASSERT_TRUE(outcome.has_value());
  ASSERT_TRUE(outcome->error);
  EXPECT_EQ(outcome->error->code, ErrorCode::kDenied);
}

TEST_F(SessionHandlers, aVerificationIsGivenUpWhenTheProgramEnds) {
  const Uuid id = addSession("anna", 300);
  pb::Request verify;
  verify.mutable_verify_session()->set_session_id(test::bytesOfId(id));
  EXPECT_TRUE(get(admin, verify).verified().ok());
  store->service().cancelLongWork();
  EXPECT_TRUE(ask(admin, verify).error.has_value());
}

}  // namespace
}  // namespace needlelab
