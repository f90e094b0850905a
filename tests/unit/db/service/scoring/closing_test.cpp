#include <gmock/gmock.h>

#include <algorithm>
#include <chrono>
#include <future>
#include <nlohmann/json.hpp>
#include <thread>

#include "common/haptics/engine.h"
#include "common/scoring/measures/syringe_events.h"
#include "db/service/scoring/session_samples.h"
#include "tests/unit/db/service/test_service.h"

namespace needlelab {
namespace {

class Closing : public test::ServiceTest {
 protected:
  void SetUp() override { addStation(); }
  std::string kneeProfile() {
    pb::Request request;
    request.mutable_get_profile()->set_id("knee-adult");
    return get(admin, request).profile().json();
  }
  // a session of one chunk
  void recordChunk(const Uuid& id, const pb::SessionDescription& d, const Bytes& chunk) {
    ASSERT_OK(change([&](Connection& c) -> Status {
      if (auto opened = SessionStore(c).open(d, 1); !opened) return opened.error();
      if (auto appended = SessionStore(c).append(id, 0, chunk); !appended) return appended.error();
      return {};
    }));
  }
  static pb::CloseSession closingOf(const Uuid& id, const Bytes& chunk, std::uint64_t samples) {
    pb::CloseSession close;
    close.set_session_id(test::bytesOfId(id));
    close.set_chunks(1);
    close.set_samples(samples);
    SessionHash hash;
    hash.update(chunk);
    const Digest digest = hash.digest();
    close.set_hash(digest.data(), digest.size());
    return close;
  }
  // of chunks 0 … chunks−1 of addSession()
  static std::uint64_t bytesOf(std::uint64_t chunks) {
    std::uint64_t bytes = 0;
    for (std::uint64_t seq = 0; seq < chunks; ++seq) bytes += test::chunkOf(seq).size();
    return bytes;
  }
  pb::SessionInfo info(const Uuid& id) {
    pb::Request request;
    request.mutable_get_session()->set_session_id(test::bytesOfId(id));
    return get(instructor, request).session();
  }
};

TEST_F(Closing, aCompleteSessionIsClosedAndScored) {
  const Uuid id = addSession("anna", 5, 100, kneeProfile());
  const auto outcome = store->service().scoring().closeSession(test::closeOf(id, 5, 100), "station-1");
  ASSERT_OK(outcome);
  EXPECT_EQ(outcome->closed.kind, Closed::Kind::kClosed) << outcome->closed.text;
  EXPECT_EQ(outcome->score_fault, "");
  const auto score = nlohmann::json::parse(outcome->score_json);
  ASSERT_TRUE(score.is_array());
  double elapsed = -1;
  for (const auto& row : score) {
    if (row.at("measure") == "elapsed_s") elapsed = row.at("value");
  }
  EXPECT_NEAR(elapsed, 0.499, 0.002);  // 500 samples at 1 kHz
  EXPECT_EQ(info(id).score_json(), outcome->score_json);
  EXPECT_EQ(info(id).state(), pb::SESSION_COMPLETE);

  const auto again = store->service().scoring().closeSession(test::closeOf(id, 5, 100), "station-1");
  ASSERT_OK(again);
  EXPECT_EQ(again->closed.kind, Closed::Kind::kRepeated);
  EXPECT_EQ(again->score_json, outcome->score_json);
}

// with several servers: the station has since logged in at another one
TEST_F(Closing, aCloseByAnOlderLogInStoresNothing) {
  const Uuid id = addSession("anna", 2, 100, kneeProfile());
  StationClaim old, now;
  ASSERT_OK(change([&](Connection& c) -> Status {
    ASSIGN_OR_RETURN(old, StationClaims(c).raise("station-1", "first", 1));
    ASSIGN_OR_RETURN(now, StationClaims(c).raise("station-1", "b", 2));
    return {};
  }));
  const auto by = [&](const StationClaim& claim) {
    CloseUnderWay close{test::closeOf(id, 2, 100), "station-1"};
    close.claim = std::make_shared<const StationClaim>(claim);
    return close;
  };
  CloseUnderWay late = by(old);
  EXPECT_EQ(store->service().scoring().closeStep(late).error().code, ErrorCode::kDeposed);
  EXPECT_EQ(info(id).state(), pb::SESSION_OPEN);

  // closed there; its score was still to be computed here
  ASSERT_OK(change([&](Connection& c) -> Status {
    const auto closed = SessionStore(c).close(test::closeOf(id, 2, 100), 3, "station-1");
    return closed ? Status() : Status(closed.error());
  }));
  CloseUnderWay unscored = by(old);
  unscored.unscored.emplace();
  unscored.unscored->closed.kind = Closed::Kind::kClosed;
  EXPECT_EQ(store->service().scoring().closeStep(unscored).error().code, ErrorCode::kDeposed);
  EXPECT_EQ(info(id).score_json(), "");

  CloseUnderWay newest = by(now);
  const auto done = store->service().scoring().closeStep(newest);
  ASSERT_OK(done);
  ASSERT_TRUE(done->has_value());
  EXPECT_EQ((*done)->closed.kind, Closed::Kind::kRepeated);
  EXPECT_EQ(info(id).score_json(), (*done)->score_json);
  EXPECT_NE((*done)->score_json, "");
}

TEST_F(Closing, aScoreThatCannotBeMadeDoesNotKeepASessionOpen) {
  const Uuid id = addSession("anna", 1, 20, "{\"nonsense\":1}");
  const auto outcome = store->service().scoring().closeSession(test::closeOf(id, 1), "station-1");
  ASSERT_OK(outcome);
  EXPECT_TRUE(outcome->closed.taken());
  EXPECT_NE(outcome->score_fault, "");
  EXPECT_EQ(info(id).state(), pb::SESSION_COMPLETE);
}

TEST_F(Closing, aSessionThatLostSamplesIsIncompleteWithOneRemark) {
  const Uuid id = addSession("anna", 3);
  auto request = test::closeOf(id, 3);
  request.set_samples_lost(1234);
  request.set_lost_from_tick(60);
  const auto remarks = [&] {
    pb::Request list;
    list.mutable_list_annotations()->set_session_id(test::bytesOfId(id));
    return get(instructor, list).annotations();
  };
  for (int time = 0; time < 2; ++time) {  // a station that lost the answer asks again
    const auto outcome = store->service().scoring().closeSession(request, "station-1");
    ASSERT_OK(outcome);
    EXPECT_TRUE(outcome->closed.taken());
    EXPECT_EQ(outcome->closed.state, pb::SESSION_INTERRUPTED);
    ASSERT_EQ(remarks().annotations_size(), 1);
  }
  EXPECT_EQ(remarks().annotations(0).tick(), 60u);
  EXPECT_EQ(remarks().annotations(0).author(), "station station-1");
  EXPECT_NE(remarks().annotations(0).text().find("1234 samples"), std::string::npos);
  EXPECT_EQ(info(id).state(), pb::SESSION_INTERRUPTED);
}

TEST_F(Closing, lostChunksReportedByTheStationBecomeARemark) {
  const Uuid id = addSession("anna", 3);
  auto request = test::closeOf(id, 3);
  request.set_interrupted(true);
  request.set_samples_lost(1234);
  request.set_samples_damaged(1000);
  request.set_chunks_damaged(1);
  request.set_lost_from_tick(60);
  ASSERT_OK(store->service().scoring().closeSession(request, "station-1"));
  pb::Request list;
  list.mutable_list_annotations()->set_session_id(test::bytesOfId(id));
  const auto remarks = get(instructor, list).annotations();
  ASSERT_EQ(remarks.annotations_size(), 1);
  EXPECT_NE(remarks.annotations(0).text().find("234 samples from tick 60 on were lost"), std::string::npos);
  EXPECT_NE(remarks.annotations(0).text().find("1000 samples (1 whole chunks)"), std::string::npos);
  EXPECT_EQ(remarks.annotations(0).text().find("hash"), std::string::npos);
  EXPECT_EQ(info(id).state(), pb::SESSION_INTERRUPTED);
}

TEST_F(Closing, aSessionWithoutHashClosesOnlyAsInterruptedWithARemark) {
  const Uuid id = addSession("anna", 3);
  auto request = test::closeOf(id, 3);
  const std::string hash = request.hash();
  request.clear_hash();
  request.set_samples(7);
  auto& service = store->service();
  EXPECT_EQ(service.scoring().closeSession(request, "station-1")->closed.kind, Closed::Kind::kContradiction);
  request.set_interrupted(true);
  const auto outcome = service.scoring().closeSession(request, "station-1");
  ASSERT_OK(outcome);
  EXPECT_EQ(outcome->closed.kind, Closed::Kind::kClosed) << outcome->closed.text;
  EXPECT_EQ(info(id).state(), pb::SESSION_INTERRUPTED);
  EXPECT_EQ(info(id).hash(), hash) << "the server's own, over what it has";
  pb::Request list;
  list.mutable_list_annotations()->set_session_id(test::bytesOfId(id));
  const auto remarks = get(instructor, list).annotations();
  ASSERT_EQ(remarks.annotations_size(), 1);
  EXPECT_NE(remarks.annotations(0).text().find("could not be held against its hash"), std::string::npos);
}

/// 6 s at 1 kHz in the air before the knee: drawn back, then pressed.
Bytes withPlunger() {
  auto samples = test::someSamples(0, 6000);
  for (auto& sample : samples) {
    const double t = 0.001 * static_cast<double>(sample.tick);
    sample.layer = -1;
    sample.plunger = t < 1   ? 0.2
                     : t < 2 ? 0.2 - 0.1 * (t - 1)
                     : t < 3 ? 0.1
                             : std::min(0.9, 0.1 + 0.4 * (t - 3));
  }
  return encodeChunk(Resolution::standard(), samples);
}

class ClosedWithEvents : public Closing {
 protected:
  void SetUp() override {
    Closing::SetUp();
    addPerson("anna", pb::TRAINEE);
    id = makeUuidV7();
    chunk = withPlunger();
    auto d = test::describe(id);
    d.set_trainee("anna");
    d.set_profile_json(kneeProfile());
    recordChunk(id, d, chunk);
  }
  pb::CloseSession closing() const { return closingOf(id, chunk, 6000); }
  pb::Request question() const {
    pb::Request request;
    request.mutable_list_events()->set_session_id(test::bytesOfId(id));
    return request;
  }
  Uuid id;
  Bytes chunk;
};

TEST_F(ClosedWithEvents, theSyringesEventsAreStoredAndListed) {
  EXPECT_EQ(refusal(instructor, question()), ErrorCode::kUnavailable) << "it is open";
  const auto outcome = store->service().scoring().closeSession(closing(), "station-1");
  ASSERT_OK(outcome);
  EXPECT_EQ(outcome->score_fault, "");
  const auto check = [&](const pb::SyringeEvents& list, bool stored) {
    EXPECT_EQ(list.stored(), stored);
    ASSERT_EQ(list.events_size(), 2);
    EXPECT_EQ(list.events(0).kind(), pb::SyringeEvent::ASPIRATION);
    EXPECT_NEAR(list.events(0).begin_s(), 1, 0.03);
    EXPECT_EQ(list.events(1).kind(), pb::SyringeEvent::INJECTION);
    EXPECT_NEAR(list.events(1).end_s(), 5, 0.03);
    EXPECT_FALSE(list.events(1).begin().in_tissue());
    EXPECT_EQ(list.events(1).begin().target(), "suprapatellar recess");
  };
  check(get(instructor, question()).events(), true);
  check(get(trainee, question()).events(), true);
  EXPECT_EQ(refusal({"bob", pb::TRAINEE}, question()), ErrorCode::kNotFound) << "not his";
  ASSERT_OK(store->service().scoring().closeSession(closing(), "station-1"));
  check(get(instructor, question()).events(), true);
  pb::Request remarks;
  remarks.mutable_list_annotations()->set_session_id(test::bytesOfId(id));
  EXPECT_EQ(get(instructor, remarks).annotations().annotations_size(), 0) << "nothing was left out";

  // the session's profile gives the layer's name
  ASSERT_OK(change([](Connection& c) {
    return c.script("UPDATE session_events SET begin_layer = 4, begin_tissue = 'OTHER'");
  }));
  const auto named = get(instructor, question()).events();
  ASSERT_EQ(named.events_size(), 2);
  EXPECT_EQ(named.events(1).begin().tissue(), "OTHER");
  EXPECT_EQ(named.events(1).begin().layer_name(), "suprapatellar recess");
  EXPECT_EQ(named.events(1).end().layer_name(), "") << "outside";

  // As if it had been closed before events were stored: they are recomputed.
  ASSERT_OK(change([](Connection& c) {
    return c.script("DELETE FROM session_events; UPDATE sessions SET events = NULL");
  }));
  check(get(instructor, question()).events(), false);
}

/// A stolen station key: one chunk whose plunger jumps in each sample, within all hazards.
TEST_F(Closing, aRestlessPlungersEventsAreBoundedWithARemark) {
  constexpr std::size_t kSamples = 20'000;
  auto samples = test::someSamples(0, kSamples);
  for (auto& sample : samples) {
    sample.time_ns = static_cast<std::int64_t>(sample.tick) * 10'000'000;
    sample.layer = -1;
    sample.plunger = static_cast<double>(sample.tick % 2);
  }
  const Bytes chunk = encodeChunk(Resolution::standard(), samples);
  auto profile = nlohmann::json::parse(kneeProfile());
  profile["hazards"] = nlohmann::json::array();
  for (int i = 0; i < 64; ++i)
    profile["hazards"].push_back({{"name", std::to_string(100 + i) + std::string(97, 'h')},
                                  {"kind", "NERVE"},
                                  {"center_m", {{"x", 0}, {"y", 0}, {"z", 0}}},
                                  {"radius_m", 0.5}});
  const Uuid id = makeUuidV7();
  auto d = test::describe(id);
  d.set_rate_hz(100);
  d.set_profile_json(profile.dump());
  ASSERT_OK(change([&](Connection& c) -> Status {
    if (auto opened = SessionStore(c).open(d, 1); !opened) return opened.error();
    if (auto appended = SessionStore(c).append(id, 0, chunk); !appended) return appended.error();
    return {};
  }));
  const auto storeBytes = [&] {
    auto reader = store->readers().borrow();
    auto size = (*reader)->query("SELECT page_count * page_size FROM pragma_page_count, pragma_page_size");
    return size.step().ok() ? size.natural(0) : 0;
  };
  const std::uint64_t before = storeBytes();
  pb::CloseSession close;
  close.set_session_id(test::bytesOfId(id));
  close.set_chunks(1);
  close.set_samples(kSamples);
  SessionHash hash;
  hash.update(chunk);
  const Digest digest = hash.digest();
  close.set_hash(digest.data(), digest.size());
  const auto outcome = store->service().scoring().closeSession(close, "station-1");
  ASSERT_OK(outcome);
  EXPECT_EQ(outcome->score_fault, "");

  // 33 numbers of up to 9 bytes; target, hazard and tissue at both ends; the names of hazards, their line
  // ends and the last one: less than half a 4 KiB page, so each page has at least two events
  constexpr std::uint64_t kEventBytes = 33 * 9 + 2 * (100 + 100 + 32) + kMaxEventHazardBytes + 64 + 16;
  static_assert(kEventBytes < 2000);
  EXPECT_GT(before, 0u);
  EXPECT_LT(storeBytes() - before, kMaxSyringeEvents * 2048 + (1u << 20))
      << "unbounded, it was 3.5 kB a sample";
  EXPECT_GT(outcome->event_bytes, kMaxSyringeEvents * kMaxEventHazardBytes * 3 / 4);
  EXPECT_LT(outcome->event_bytes, kMaxSyringeEvents * kEventBytes);

  int aspirations = 0, injections = 0;
  for (const auto& row : nlohmann::json::parse(outcome->score_json)) {
    if (row.at("measure") == "aspirations") aspirations = row.at("value").get<int>();
    if (row.at("measure") == "injections") injections = row.at("value").get<int>();
  }
  EXPECT_EQ(static_cast<std::size_t>(aspirations + injections), kMaxSyringeEvents);
  const auto remarks = [&] {
    pb::Request list;
    list.mutable_list_annotations()->set_session_id(test::bytesOfId(id));
    return get(instructor, list).annotations();
  };
  ASSERT_EQ(remarks().annotations_size(), 1);
  EXPECT_EQ(remarks().annotations(0).tick(), kMaxSyringeEvents) << "the end of the last one";
  EXPECT_NE(remarks().annotations(0).text().find("3600 strokes"), std::string::npos);
  ASSERT_OK(store->service().scoring().closeSession(close, "station-1"));
  EXPECT_EQ(remarks().annotations_size(), 1);
}

// control: the same samples without the flags have no remark
TEST_F(Closing, aSessionInABodyWhosePathsCameLateHasOneRemark) {
  for (const bool is_late : {false, true}) {
    auto samples = test::someSamples(0, 100);
    if (is_late) {
      samples[40].flags |= kFlagKeptPath;
      samples[45].flags |= kFlagKeptPath;
      samples[60].flags |= kFlagSkipped;
    }
    const Bytes chunk = encodeChunk(Resolution::standard(), samples);
    const Uuid id = makeUuidV7();
    auto d = test::describe(id);
    d.set_profile_json(kneeProfile());
    recordChunk(id, d, chunk);
    for (int time = 0; time < 2; ++time)
      ASSERT_OK(store->service().scoring().closeSession(closingOf(id, chunk, 100), "station-1"));
    pb::Request list;
    list.mutable_list_annotations()->set_session_id(test::bytesOfId(id));
    const auto remarks = get(instructor, list).annotations();
    ASSERT_EQ(remarks.annotations_size(), is_late ? 1 : 0);
    if (!is_late) continue;
    EXPECT_EQ(remarks.annotations(0).tick(), 40u);
    EXPECT_THAT(remarks.annotations(0).text(), testing::HasSubstr("too late in 2 ticks, and in 1 "));
  }
}

// the closing client may cut the connection before score and events are stored: then each reader computes
// them
TEST_F(Closing, longEventsThatAreNotStoredAreWorkedOutInSteps) {
  const Uuid id = makeUuidV7();
  addPerson("anna", pb::TRAINEE);
  auto samples = test::someSamples(0, kShortScoreSamples + 300'000);
  for (auto& sample : samples)  // a stroke of 3 s each way, without pause
    sample.plunger = std::abs(static_cast<double>(sample.tick % 6000) - 3000) / 3000;
  std::vector<Bytes> chunks;
  for (std::size_t from = 0; from < samples.size(); from += 50'000)
    chunks.push_back(encodeChunk(Resolution::standard(), std::span(samples).subspan(from, 50'000)));
  auto d = test::describe(id);
  d.set_trainee("anna");
  d.set_profile_json(kneeProfile());
  ASSERT_OK(change([&](Connection& c) -> Status {
    SessionStore sessions(c);
    if (auto opened = sessions.open(d, 1); !opened) return opened.error();
    for (std::uint64_t seq = 0; seq < chunks.size(); ++seq)
      if (auto stored = sessions.append(id, seq, chunks[seq]); !stored) return stored.error();
    return c.script("UPDATE sessions SET state = 2");  // closed, without score and events
  }));
  pb::Request request;
  request.mutable_list_events()->set_session_id(test::bytesOfId(id));
  RequestUnderWay under_way;
  int steps = 0;
  std::optional<Outcome> outcome;
  while (!(outcome = store->service().executeStep(instructor, request, under_way))) {
    ASSERT_TRUE(under_way.is_long) << "it waits for a place";
    ASSERT_LT(++steps, 1000);
  }
  ASSERT_FALSE(outcome->error) << outcome->error->message;
  // read once for the check and once for the strokes, whose samples are read once more
  EXPECT_GE(steps, static_cast<int>(2 * samples.size() / kScoredAtOnce)) << "as much as a step of a score";
  std::vector<std::string> made;
  for (const pb::SyringeEvent& event : outcome->reply.events().events())
    made.push_back(event.SerializeAsString());
  ASSERT_OK(change([&](Connection& c) -> Status {
    ASSIGN_OR_RETURN(const auto whole, samplesOf(c, id));
    std::vector<std::string> wanted;
    for (const pb::SyringeEvent& event : eventsOf(whole)) wanted.push_back(event.SerializeAsString());
    EXPECT_EQ(made, wanted);
    EXPECT_GT(wanted.size(), 100u);
    return {};
  }));
}

TEST_F(Closing, anUnscorableSessionHasAReasonInsteadOfEvents) {
  const Uuid id = addSession("anna", 1, 20, "{\"nonsense\":1}");
  ASSERT_OK(store->service().scoring().closeSession(test::closeOf(id, 1), "station-1"));
  pb::Request request;
  request.mutable_list_events()->set_session_id(test::bytesOfId(id));
  const Outcome outcome = ask(instructor, request);
  ASSERT_TRUE(outcome.error.has_value());
  EXPECT_EQ(outcome.error->code, ErrorCode::kInvalidInput);
  EXPECT_NE(outcome.error->message.find("nonsense"), std::string::npos) << outcome.error->message;
}

TEST_F(Closing, anEmptySessionHasNoScore) {
  const Uuid id = addSession("anna", 0);
  const auto outcome = store->service().scoring().closeSession(test::closeOf(id, 0), "station-1");
  ASSERT_OK(outcome);
  EXPECT_TRUE(outcome->closed.taken());
  EXPECT_EQ(outcome->score_json, "");
  EXPECT_EQ(outcome->score_fault, "");
}

// as a hostile station sends them: each chunk costs a query and a decoding, a dozen times
TEST_F(Closing, aSessionInTinyChunksIsNotScoredBeyondTheirBound) {
  for (const std::uint64_t chunks : {kScoredChunksBesides + 2, kScoredChunksBesides + 3}) {
    const Uuid id = addSession("anna", chunks, 1, kneeProfile());
    const auto outcome = store->service().scoring().closeSession(test::closeOf(id, chunks, 1), "station-1");
    ASSERT_OK(outcome);
    EXPECT_TRUE(outcome->closed.taken()) << outcome->closed.text;
    if (chunks == kScoredChunksBesides + 2)  // 1,002 samples: 1,000 and one per 500
      EXPECT_EQ(outcome->score_fault, "");
    else
      EXPECT_NE(outcome->score_fault.find("has its 1003 samples in 1003 chunks, at most 1002 are scored"),
                std::string::npos)
          << outcome->score_fault;
  }
}

/// As a hostile station declares them: 50 Hz and ticks just under the longest bridge apart, 10 points of the
/// motion per sample.
class ClosedBeyondBounds : public Closing {
 protected:
  void SetUp() override {
    Closing::SetUp();
    auto samples = test::someSamples(0, 36'002);
    for (std::size_t i = 0; i < samples.size(); ++i) samples[i].tick = 5 * i;
    chunk = encodeChunk(Resolution::standard(), samples);
    auto d = test::describe(id);
    d.set_rate_hz(50);
    d.set_profile_json(kneeProfile());
    recordChunk(id, d, chunk);
  }
  pb::CloseSession closing() const { return closingOf(id, chunk, 36'002); }
  pb::Annotations remarks() {
    pb::Request list;
    list.mutable_list_annotations()->set_session_id(test::bytesOfId(id));
    return get(instructor, list).annotations();
  }
  const Uuid id = makeUuidV7();
  Bytes chunk;
};

TEST_F(ClosedBeyondBounds, aMotionBeyondItsBoundsIsNotScoredAndRemarkedOnce) {
  for (int time = 0; time < 2; ++time) {
    const auto outcome = store->service().scoring().closeSession(closing(), "station-1");
    ASSERT_OK(outcome);
    EXPECT_TRUE(outcome->closed.taken()) << outcome->closed.text;
    EXPECT_EQ(outcome->score_json, "");
    EXPECT_NE(outcome->score_fault.find("360011 points at 100 Hz, at most 360000"), std::string::npos)
        << outcome->score_fault;
    ASSERT_EQ(remarks().annotations_size(), 1);
  }
  EXPECT_EQ(remarks().annotations(0).author(), "server");
  EXPECT_EQ(remarks().annotations(0).text().find("cannot be scored: "), 0u)
      << remarks().annotations(0).text();
  EXPECT_EQ(info(id).state(), pb::SESSION_COMPLETE);
}

TEST_F(ClosedBeyondBounds, afterARestartTheStoredRemarkReplacesReading) {
  ASSERT_OK(store->service().scoring().closeSession(closing(), "station-1"));
  // unreadable now: decoding it would report another error
  ASSERT_OK(
      change([](Connection& c) { return c.script("UPDATE chunks SET bytes = zeroblob(length(bytes))"); }));
  store.reset();
  store = test::openStore(folder.path() / "data");
  const auto outcome = store->service().scoring().closeSession(closing(), "station-1");
  ASSERT_OK(outcome);
  EXPECT_NE(outcome->score_fault.find("at most 360000"), std::string::npos) << outcome->score_fault;
  pb::Request events;
  events.mutable_list_events()->set_session_id(test::bytesOfId(id));
  const Outcome listed = ask(instructor, events);
  ASSERT_TRUE(listed.error.has_value());
  EXPECT_EQ(listed.error->code, ErrorCode::kInvalidInput);
  EXPECT_NE(listed.error->message.find("at most 360000"), std::string::npos) << listed.error->message;
}

TEST_F(ClosedBeyondBounds, anOlderProgramsRemarkIsNotRepeated) {
  ASSERT_OK(store->service().scoring().closeSession(closing(), "station-1"));
  ASSERT_OK(change([](Connection& c) { return c.script("DELETE FROM meta WHERE key LIKE 'unscored %'"); }));
  for (int time = 0; time < 2; ++time) {
    store.reset();
    store = test::openStore(folder.path() / "data");
    const auto outcome = store->service().scoring().closeSession(closing(), "station-1");
    ASSERT_OK(outcome);
    EXPECT_NE(outcome->score_fault.find("at most 360000"), std::string::npos) << outcome->score_fault;
    EXPECT_EQ(remarks().annotations_size(), 1);
    // from the second time on nothing is read
    ASSERT_OK(
        change([](Connection& c) { return c.script("UPDATE chunks SET bytes = zeroblob(length(bytes))"); }));
  }
}

TEST_F(Closing, aForgedServerRemarkDoesNotPreventAScore) {
  const Uuid id = addSession("anna", 5, 100, kneeProfile());
  const Principal impostor{"server", pb::INSTRUCTOR};
  pb::Request remark;
  remark.mutable_annotate()->set_session_id(test::bytesOfId(id));
  remark.mutable_annotate()->set_text(
      "cannot be scored: the motion has 999999 points at 100 Hz, at most 360000");
  get(impostor, remark);
  const auto outcome = store->service().scoring().closeSession(test::closeOf(id, 5, 100), "station-1");
  ASSERT_OK(outcome);
  EXPECT_EQ(outcome->score_fault, "");
  EXPECT_FALSE(outcome->score_json.empty());
  EXPECT_EQ(info(id).score_json(), outcome->score_json);
}

TEST_F(Closing, aRepeatedCloseDoesNotTryAgainToScore) {
  const Uuid id = addSession("anna", 1, 20, kneeProfile());
  ASSERT_OK(change([](Connection& c) {
    return c.script(
        "INSERT INTO exercises (id, curriculum_id, position, name, profile_id, json)"
        " VALUES ('knee-1', 'course', 0, 'Knee', 'knee-adult', '{')");
  }));
  const auto first = store->service().scoring().closeSession(test::closeOf(id, 1), "station-1");
  ASSERT_OK(first);
  ASSERT_NE(first->score_fault, "");
  // readable now: decoding and scoring it would report no error
  ASSERT_OK(change([](Connection& c) { return c.script("DELETE FROM exercises"); }));
  const auto again = store->service().scoring().closeSession(test::closeOf(id, 1), "station-1");
  ASSERT_OK(again);
  EXPECT_EQ(again->closed.kind, Closed::Kind::kRepeated);
  EXPECT_EQ(again->score_fault, first->score_fault);
}

/// Runs one step of a close, and stores the session's next chunk between the step's read and the writer's.
Result<std::optional<CloseOutcome>> stepWhileAChunkComes(Store& store, CloseUnderWay& close, const Uuid& id,
                                                         std::uint64_t seq) {
  DbWriter& writer = store.writer();
  std::promise<void> begun, go;
  EXPECT_OK(writer.post(
      [&](Connection&) {
        begun.set_value();
        go.get_future().wait();
        return Status();
      },
      {}));
  begun.get_future().wait();
  EXPECT_OK(writer.post(
      [&](Connection& c) {
        const auto stored = SessionStore(c).append(id, seq, test::chunkOf(seq));
        return stored ? Status() : Status(stored.error());
      },
      {}));
  auto step = std::async(std::launch::async, [&] { return store.service().scoring().closeStep(close); });
  const auto ended = [&] { return step.wait_for(std::chrono::seconds(0)) == std::future_status::ready; };
  while (writer.counters().waiting < 2 && !ended()) std::this_thread::yield();  // the chunk, then the close
  go.set_value();
  return step.get();
}

TEST_F(Closing, theWriterHashesNoChunksEvenForALateOne) {
  const Uuid id = addSession("anna", 2);
  CloseUnderWay close{test::closeOf(id, 3), "station-1"};
  const auto first = stepWhileAChunkComes(*store, close, id, 2);
  ASSERT_OK(first);
  EXPECT_FALSE(first->has_value()) << "there is more to do";
  EXPECT_EQ(store->service().scoring().bytesHashed(), 0u);
  EXPECT_EQ(info(id).state(), pb::SESSION_OPEN);
  const auto second = store->service().scoring().closeStep(close);
  ASSERT_OK(second);
  ASSERT_TRUE(second->has_value());
  EXPECT_EQ((*second)->closed.kind, Closed::Kind::kClosed) << (*second)->closed.text;
  EXPECT_EQ(store->service().scoring().bytesHashed(), bytesOf(3));
}

TEST_F(Closing, onlyALongScoreRunsInSeveralSteps) {
  constexpr std::size_t kEach = 1000;
  const std::uint64_t longest_short = kShortScoreSamples / kEach;
  for (const std::uint64_t chunks : {longest_short, longest_short + 1}) {
    SCOPED_TRACE(chunks);
    const Uuid id = addSession("anna", chunks, kEach, kneeProfile());
    CloseUnderWay close{test::closeOf(id, chunks, kEach), "station-1"};
    auto outcome = store->service().scoring().closeStep(close);
    ASSERT_OK(outcome);
    EXPECT_EQ(close.is_long, chunks > longest_short);
    if (close.is_long) {
      EXPECT_FALSE(outcome->has_value());
      EXPECT_NE(info(id).state(), pb::SESSION_OPEN) << "it is closed";
      // read, its motion's cost counted twice, runs found and filled, measured: 6 passes over the samples
      const std::uint64_t least = 6 * chunks * kEach / kScoredAtOnce;
      std::uint64_t steps = 0;
      for (; outcome.ok() && !outcome->has_value() && steps < 100 * least; ++steps) {
        EXPECT_EQ(info(id).score_json(), "") << "there is more to do";
        outcome = store->service().scoring().closeStep(close);
      }
      ASSERT_OK(outcome);
      EXPECT_GE(steps, least);
      EXPECT_LE(steps, 3 * least) << "each does its work";
    }
    ASSERT_TRUE(outcome->has_value());
    EXPECT_EQ((*outcome)->score_fault, "");
    EXPECT_EQ((*outcome)->score_json, info(id).score_json());
    EXPECT_NE((*outcome)->score_json, "");
  }
}

TEST_F(Closing, aCloseThatLooksAgainAndAgainIsToBeTriedLater) {
  const Uuid id = addSession("anna", 2);
  CloseUnderWay close{test::closeOf(id, 3), "station-1", 2};
  const auto refused = stepWhileAChunkComes(*store, close, id, 2);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(refused.error().message, testing::HasSubstr("close it again"));
  EXPECT_EQ(store->service().scoring().closeSession(test::closeOf(id, 3), "station-1")->closed.kind,
            Closed::Kind::kClosed);
}

TEST_F(Closing, retryingAWrongHashReadsNoChunkAgain) {
  const Uuid id = addSession("anna", 4);
  auto& service = store->service();
  const auto tryWrong = [&](std::uint64_t chunks) {
    auto wrong = test::closeOf(id, chunks);
    (*wrong.mutable_hash())[0] ^= 1;
    EXPECT_EQ(service.scoring().closeSession(wrong, "station-1")->closed.kind, Closed::Kind::kContradiction);
  };
  for (int n = 0; n < 5; ++n) tryWrong(4);
  EXPECT_EQ(service.scoring().bytesHashed(), bytesOf(4));
  ASSERT_OK(change([&](Connection& c) {
    const auto stored = SessionStore(c).append(id, 4, test::chunkOf(4));
    return stored ? Status() : Status(stored.error());
  }));
  for (int n = 0; n < 5; ++n) tryWrong(5);
  EXPECT_EQ(service.scoring().bytesHashed(), bytesOf(5)) << "the new one only";
  for (const auto kind : {Closed::Kind::kClosed, Closed::Kind::kRepeated})
    EXPECT_EQ(service.scoring().closeSession(test::closeOf(id, 5), "station-1")->closed.kind, kind);
  EXPECT_EQ(service.scoring().bytesHashed(), bytesOf(5));
}

TEST_F(Closing, nothingIsHashedForACloseThatIsRefusedWithoutIt) {
  const Uuid id = addSession("anna", 2);
  auto& service = store->service();
  auto samples = test::closeOf(id, 2);
  samples.set_samples(41);
  EXPECT_EQ(service.scoring().closeSession(samples, "station-1")->closed.kind, Closed::Kind::kContradiction);
  EXPECT_EQ(service.scoring().closeSession(test::closeOf(id, 2), "station-2")->closed.kind,
            Closed::Kind::kUnknownSession);
  EXPECT_EQ(service.scoring().bytesHashed(), 0u);
}

TEST_F(Closing, refusalsComeThrough) {
  const Uuid id = addSession("anna", 2);
  auto& service = store->service();
  EXPECT_EQ(service.scoring().closeSession(test::closeOf(id, 3), "station-1")->closed.kind,
            Closed::Kind::kIncomplete);
  EXPECT_FALSE(service.scoring().closeSession({}, "station-1").ok());
  EXPECT_EQ(info(id).state(), pb::SESSION_OPEN);
}

}  // namespace
}  // namespace needlelab
