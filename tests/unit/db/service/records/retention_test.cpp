// Retention runs: which data are thinned, deleted and kept.
#include "db/service/records/retention.h"

#include <latch>

#include "common/base/time/clock.h"
#include "db/backup/check.h"
#include "db/sessions/seen_time.h"
#include "db/sessions/session_results.h"
#include "db/sessions/session_rows.h"
#include "tests/support/time/fake_time.h"
#include "tests/unit/db/service/records/retention_fixture.h"

namespace needlelab {
namespace {

using namespace std::chrono_literals;
using test::chunkOf;
using test::closeOf;
using test::expectedThinned;
using test::expectSame;
using test::kClosedChunks;
using test::kSamplesEach;
using test::samplesIn;
using RetentionTest = test::RetentionTest;

TEST_F(RetentionTest, thinsToWhatTheThinnerPredictsAndKeepsScoreEventsAndRemarks) {
  pb::Request profile;
  profile.mutable_get_profile()->set_id("knee-adult");
  const Uuid id = addClosed(kClosedChunks, true, get(admin, profile).profile().json());
  pb::Request note;
  note.mutable_annotate()->set_session_id(test::bytesOfId(id));
  note.mutable_annotate()->set_text("well done");
  (void)get(instructor, note);
  const auto before = info(id);
  (void)get(manager, policy(0, 100, -1));

  // As if it had been closed before scores and events were stored: they are computed while the samples still
  // exist.
  const auto events = [&] {
    auto reader = store->readers().borrow();
    return EventStore(**reader).list(id);
  };
  ASSERT_TRUE(events()->has_value());
  ASSERT_OK(change([](Connection& c) {
    return c.script("UPDATE sessions SET events = NULL, score_json = NULL; DELETE FROM session_events");
  }));

  const auto dry = runNow(true);
  EXPECT_EQ(dry.thinned(), 1u);
  EXPECT_FALSE(info(id).has_removed_original()) << "a dry run changes nothing";
  const auto report = runNow();
  EXPECT_EQ(report.thinned(), 1u);
  ASSERT_EQ(report.steps_size(), 1);
  EXPECT_EQ(report.steps(0).action(), pb::RetentionStep::THIN) << report.steps(0).text();
  EXPECT_EQ(report.bytes_before(), before.stored_bytes());

  const auto after = info(id);
  EXPECT_EQ(report.bytes_after(), after.stored_bytes());
  EXPECT_LT(after.stored_bytes(), before.stored_bytes() / 3);
  EXPECT_EQ(after.score_json(), before.score_json());
  EXPECT_EQ(after.state(), before.state());
  EXPECT_EQ(after.removed_original().hash(), before.hash());
  EXPECT_EQ(after.removed_original().samples(), before.samples());
  auto reader = store->readers().borrow();
  expectSame(samplesIn(**reader, id), expectedThinned(kClosedChunks, 100));
  EXPECT_TRUE(events()->has_value());
  EXPECT_TRUE(sound());
  EXPECT_EQ(runNow().steps_size(), 0) << "once";

  // The log names the user and the action.
  pb::Request audit;
  audit.mutable_list_audit();
  std::string actions;
  const auto entries = get(admin, audit).audit();
  for (const auto& entry : entries.entries()) actions += entry.action() + " by " + entry.who() + "; ";
  EXPECT_NE(actions.find("retention thin by mia"), std::string::npos) << actions;
  EXPECT_NE(actions.find("retention set by mia"), std::string::npos) << actions;

  // A reader that started with the original gets an error; no scores are computed from the remaining samples.
  pb::Request read;
  read.mutable_read_chunks()->set_session_id(test::bytesOfId(id));
  read.mutable_read_chunks()->set_hash(before.hash());
  EXPECT_EQ(refusal(instructor, read), ErrorCode::kUnavailable);
  EXPECT_FALSE(store->service().scoring().scoreSession(**reader, id).ok());
  const auto again =
      store->service().scoring().closeSession(closeOf(id, kClosedChunks, kSamplesEach), "station-1");
  ASSERT_OK(again);
  EXPECT_EQ(again->closed.kind, Closed::Kind::kRepeated);
  EXPECT_EQ(again->score_json, before.score_json());
}

TEST_F(RetentionTest, deletesAndTheSpaceIsUsedAgain) {
  std::vector<Uuid> old;
  for (int i = 0; i < 6; ++i) old.push_back(addClosed());
  const auto where = [&] {
    pb::Request request;
    request.mutable_list_retention();
    return get(manager, request).retention();
  };
  const auto full = where();
  (void)get(manager, policy(-1, 0, 0));
  const auto report = runNow();
  EXPECT_EQ(report.deleted(), 6u);
  EXPECT_EQ(report.bytes_after(), 0u);
  const auto emptied = where();
  EXPECT_EQ(emptied.deleted_sessions(), 6u);
  EXPECT_GT(emptied.free_bytes(), full.free_bytes() + 6 * kClosedChunks * 150);
  EXPECT_GT(emptied.last_run_unix_ns(), 0);
  for (const Uuid& id : old) {
    EXPECT_EQ(info(id).removed_original().fate(), pb::RemovedOriginal::DELETED);
    pb::Request read;
    read.mutable_read_chunks()->set_session_id(test::bytesOfId(id));
    EXPECT_EQ(refusal(instructor, read), ErrorCode::kNotFound);
  }
  (void)get(manager, policy(-1, 0, -1));
  for (int i = 0; i < 5; ++i) addClosed();
  const auto refilled = where();
  EXPECT_LT(refilled.free_bytes(), emptied.free_bytes() / 2);
  EXPECT_LE(refilled.database_bytes(), emptied.database_bytes() + (64u << 10)) << "the file did not grow";
  EXPECT_TRUE(sound());
}

TEST_F(RetentionTest, openUnsafeAndDamagedSessionsAreLeftAlone) {
  const Uuid open = addSession("anna", 5, kSamplesEach), unsafe = addClosed(5, false), crc = addClosed(),
             hash = addClosed();
  ASSERT_OK(change([&](Connection& c) {
    return c.script(
        "UPDATE chunks SET crc = 0 WHERE seq = 40 AND session = 3;"
        "UPDATE sessions SET hash = zeroblob(32) WHERE number = 4");
  }));
  (void)get(manager, policy(0, 50, -1));
  const auto report = runNow();
  EXPECT_EQ(report.thinned(), 0u);
  EXPECT_EQ(report.waiting_for_backup(), 1u);
  EXPECT_EQ(report.left_alone(), 2u);
  for (const auto& step : report.steps()) {
    if (step.action() != pb::RetentionStep::LEFT_ALONE) continue;
    EXPECT_NE(step.text().find("session "), std::string::npos) << step.text();
  }
  for (const Uuid& id : {open, unsafe, crc, hash}) EXPECT_FALSE(info(id).has_removed_original());
  auto reader = store->readers().borrow();
  EXPECT_TRUE(RetentionStore(**reader).leftovers()->empty()) << "the unfinished part is removed";
  // Deletion also checks first.
  (void)get(manager, policy(-1, 0, 0));
  EXPECT_EQ(runNow().deleted(), 0u);
  EXPECT_FALSE(info(hash).has_removed_original()) << "its chunks are sound, but not those it was closed with";
  EXPECT_FALSE(info(crc).has_removed_original());
  EXPECT_FALSE(info(open).has_removed_original());
}

TEST_F(RetentionTest, anOriginalStaysWhileItsScoreCanStillBeMade) {
  pb::Request profile;
  profile.mutable_get_profile()->set_id("knee-adult");
  const Uuid passing = addClosed(kClosedChunks, true, get(admin, profile).profile().json()),
             final = addClosed(kClosedChunks, true, "{\"nonsense\":1}");
  const std::string score = info(passing).score_json();
  ASSERT_FALSE(score.empty());
  // an exercise that is unreadable now, e.g. after a faulty import
  ASSERT_OK(change([](Connection& c) {
    return c.script(
        "UPDATE sessions SET events = NULL, score_json = NULL; DELETE FROM session_events;"
        "DELETE FROM exercises WHERE id = 'knee-1'; INSERT INTO exercises (id, curriculum_id, position, "
        "name, profile_id, json)"
        " VALUES ('knee-1', 'c', 0, 'n', 'knee-adult', '{\"broken')");
  }));
  for (const auto& what : {policy(0, 100, -1), policy(-1, 0, 0)}) {
    (void)get(manager, what);
    const auto report = runNow();
    EXPECT_EQ(report.left_alone(), 1u);
    ASSERT_FALSE(info(passing).has_removed_original());
    for (const auto& step : report.steps()) {
      if (step.action() != pb::RetentionStep::LEFT_ALONE) continue;
      EXPECT_NE(step.text().find(uuidText(passing)), std::string::npos) << step.text();
      EXPECT_NE(step.text().find("no score yet"), std::string::npos) << step.text();
    }
  }
  EXPECT_TRUE(info(final).has_removed_original()) << "no waiting helps it";
  ASSERT_OK(change([](Connection& c) { return c.script("DELETE FROM exercises WHERE id = 'knee-1'"); }));
  EXPECT_EQ(runNow().deleted(), 1u);
  EXPECT_FALSE(info(passing).score_json().empty());
}

TEST_F(RetentionTest, pausesAfterEachPieceAndLooksAgainWhileOthersNeedTheDisk) {
  class NotedSleeps : public test::FakeTime {
   public:
    void sleepUntilNs(std::int64_t due_ns) noexcept override {
      slept_ms.push_back((due_ns - nowNs()) / 1'000'000);
      FakeTime::sleepUntilNs(due_ns);
    }
    std::vector<std::int64_t> slept_ms;
  };
  (void)addClosed();
  (void)get(manager, policy(0, 100, -1));
  NotedSleeps time;
  const auto slept = [&](RetentionPace pace) {
    time.slept_ms.clear();
    pace.time = &time;
    const std::atomic<bool> stop = false;
    // the disk is busy for its first three checks, which come before each piece
    int looks = 0;
    const RetentionTools tools{store->writer(),
                               store->readers(),
                               [](const Uuid&) { return Status(); },
                               [&] { return ++looks % 4 != 0; },
                               stop,
                               pace};
    const auto commits = store->writer().counters().commits;
    const auto report = runRetention(tools, {"test"}, wallNowNs(), false);
    EXPECT_OK(report);
    return store->writer().counters().commits - commits;
  };
  const auto commits = slept({.rows = 8, .bytes = 64, .pause = 11ms, .look = 7ms});
  const std::vector<std::int64_t> each = {7, 7, 7, 11};
  ASSERT_GE(time.slept_ms.size(), 2 * each.size());
  ASSERT_EQ(time.slept_ms.size() % each.size(), 0u);
  for (std::size_t i = 0; i < time.slept_ms.size(); ++i) ASSERT_EQ(time.slept_ms[i], each[i % 4]) << i;
  EXPECT_GE(commits, time.slept_ms.size() / each.size()) << "each piece is a commit of its own";
}

// Stations have priority: a run does not even queue a piece behind a full queue.
TEST_F(RetentionTest, waitsWhileStationsFillTheWritersQueue) {
  class Looks : public test::FakeTime {
   public:
    void sleepUntilNs(std::int64_t due_ns) noexcept override {
      FakeTime::sleepUntilNs(due_ns);
      look();
    }
    std::function<void()> look;
  } time;
  (void)addClosed();
  (void)get(manager, policy(0, 100, -1));
  std::latch blocked(1), go_on(1);
  const auto block = [&](Connection&) { return blocked.count_down(), go_on.wait(), Status(); };
  ASSERT_OK(store->writer().post(block, {}));
  blocked.wait();
  for (int i = 0; i < 3; ++i) ASSERT_OK(store->writer().post([](Connection&) { return Status(); }, {}));
  int looks = 0;
  time.look = [&] {
    if (++looks > 3) return;
    EXPECT_EQ(store->writer().counters().waiting, 3u) << "the stations' items alone";
    if (looks == 3) go_on.count_down();
  };
  const std::atomic<bool> stop = false;
  const RetentionTools tools{store->writer(),
                             store->readers(),
                             [](const Uuid&) { return Status(); },
                             [] { return false; },
                             stop,
                             {.queue = 2, .time = &time}};
  const auto report = runRetention(tools, {"test"}, wallNowNs(), false);
  ASSERT_OK(report);
  EXPECT_GT(looks, 3);
  EXPECT_EQ(report->thinned(), 1u);
}

TEST_F(RetentionTest, onlyADryRunWorksDuringARun) {
  // holds the daily run in its first pause
  class Gate : public test::FakeTime {
   public:
    void sleepUntilNs(std::int64_t) noexcept override {
      if (reached.try_wait()) return;
      reached.count_down();
      opened.wait();
    }
    std::latch reached{1}, opened{1};
  };
  Gate gate;
  (void)addClosed();
  (void)get(manager, policy(0, 100, -1));
  store->service().setRetentionPace({.rows = 1, .bytes = 64, .pause = 50ms, .time = &gate});
  std::thread daily([&] { EXPECT_OK(store->service().retention().daily()); });
  gate.reached.wait();
  pb::Request run;
  run.mutable_run_retention();
  const Outcome refused = ask(manager, run);
  ASSERT_TRUE(refused.error.has_value());
  EXPECT_EQ(refused.error->code, ErrorCode::kUnavailable);
  EXPECT_NE(refused.error->message.find("under way since 20"), std::string::npos) << refused.error->message;
  EXPECT_NE(refused.error->message.find("by retention"), std::string::npos) << refused.error->message;
  run.mutable_run_retention()->set_dry_run(true);
  EXPECT_TRUE(get(manager, run).retention_report().dry_run());
  store->service().stopRetention();
  gate.opened.count_down();
  daily.join();
  EXPECT_TRUE(sound());
}

TEST_F(RetentionTest, aThinnedRecordingIsReadBeforeItIsDeleted) {
  const Uuid damaged = addClosed(), sound_one = addClosed();
  (void)get(manager, policy(0, 100, -1));
  ASSERT_EQ(runNow().thinned(), 2u);
  ASSERT_OK(change([](Connection& c) {
    return c.script("UPDATE derived_chunks SET bytes = zeroblob(length(bytes)) WHERE session = 1");
  }));
  (void)get(manager, policy(-1, 0, 0));
  const auto report = runNow();
  EXPECT_EQ(report.deleted(), 1u);
  EXPECT_EQ(report.left_alone(), 1u);
  EXPECT_EQ(info(damaged).removed_original().fate(), pb::RemovedOriginal::THINNED);
  EXPECT_EQ(info(sound_one).removed_original().fate(), pb::RemovedOriginal::DELETED);
}

TEST_F(RetentionTest, damagedLeftoversAreNamedAndTheRunGoesOn) {
  const Uuid damaged = addClosed(), second = addClosed(), third = addClosed();
  (void)get(manager, policy(0, 100, -1));
  ASSERT_EQ(runNow().thinned(), 3u);
  // As after a crash after the switch: the first chunks of two originals still exist, one is damaged.
  ASSERT_OK(change([](Connection& c) -> Status {
    for (const std::int64_t session : {1, 2}) {
      for (std::uint64_t seq = 0; seq < 20; ++seq) {
        const Bytes chunk = chunkOf(seq, kSamplesEach);
        if (auto put = c.run("INSERT INTO chunks (session, seq, samples, crc, bytes) VALUES (?,?,?,?,?)",
                             session, seq, kSamplesEach, stationCrcOf(chunk), ByteView(chunk));
            !put)
          return put;
      }
    }
    return c.script(
        "UPDATE removed_originals SET leftover = 1 WHERE session IN (1, 2);"
        "UPDATE chunks SET bytes = zeroblob(length(bytes)) WHERE session = 1 AND seq = 7");
  }));
  (void)get(manager, policy(-1, 0, 0));
  const auto report = runNow();
  EXPECT_EQ(report.left_alone(), 1u);
  EXPECT_EQ(report.deleted(), 2u);
  ASSERT_GT(report.steps_size(), 0);
  EXPECT_NE(report.steps(0).text().find(uuidText(damaged)), std::string::npos) << report.steps(0).text();
  EXPECT_NE(report.steps(0).text().find("chunk 7"), std::string::npos) << report.steps(0).text();
  EXPECT_EQ(info(damaged).removed_original().fate(), pb::RemovedOriginal::THINNED);
  EXPECT_EQ(info(second).removed_original().fate(), pb::RemovedOriginal::DELETED);
  EXPECT_EQ(info(third).removed_original().fate(), pb::RemovedOriginal::DELETED);
  auto reader = store->readers().borrow();
  auto left = (*reader)->prepare("SELECT count(*), max(session) FROM chunks");
  ASSERT_OK(left.step());
  EXPECT_EQ(left.integer(0), 20) << "none of the damaged one's rows is touched";
  EXPECT_EQ(left.integer(1), 1);
}

TEST_F(RetentionTest, aRunThatIsStoppedIsFinishedByTheNext) {
  const Uuid id = addClosed();
  (void)get(manager, policy(0, 100, -1));
  store->service().stopRetention();
  const auto stopped = runNow();
  EXPECT_TRUE(stopped.stopped());
  EXPECT_FALSE(info(id).has_removed_original());
  EXPECT_TRUE(sound());
  // after every possible piece, counted by the writer's commits
  bool finished = false;
  for (int pieces = 1; pieces < 200 && !finished; ++pieces) {
    std::atomic<bool> stop = false, over = false;
    int left = pieces;
    const RetentionTools tools{store->writer(),
                               store->readers(),
                               [](const Uuid&) { return Status(); },
                               [] { return false; },
                               stop,
                               {.rows = 8, .bytes = 4 << 10, .pause = 0ms}};
    std::thread stopper([&] {
      const auto until = store->writer().counters().commits + static_cast<std::uint64_t>(left);
      while (store->writer().counters().commits < until && !over) std::this_thread::yield();
      stop = true;
    });
    const auto report = runRetention(tools, {"test"}, wallNowNs(), false);
    over = true;
    finished = report.ok() && !report->stopped();
    stopper.join();
    ASSERT_OK(report);
    ASSERT_TRUE(sound()) << pieces;
    auto reader = store->readers().borrow();
    if (info(id).has_removed_original()) {
      expectSame(samplesIn(**reader, id), expectedThinned(kClosedChunks, 100));
    } else {
      EXPECT_EQ(samplesIn(**reader, id).size(), kClosedChunks * kSamplesEach);
    }
  }
  EXPECT_TRUE(finished);
  EXPECT_TRUE(info(id).has_removed_original());
  auto reader = store->readers().borrow();
  EXPECT_TRUE(RetentionStore(**reader).leftovers()->empty());
}

TEST_F(RetentionTest, aClockThatJumpedDeletesNothingByItself) {
  const Uuid id = addClosed();
  (void)get(manager, policy(-1, 0, 0));
  const std::int64_t months = 90LL * 86'400 * 1'000'000'000;
  for (const std::int64_t last : {wallNowNs() - months, wallNowNs() + months}) {
    ASSERT_OK(
        change([&](Connection& c) { return MetaStore(c).set("retention_unix_ns", std::to_string(last)); }));
    EXPECT_EQ(store->service().retention().daily().error().code, ErrorCode::kUnavailable);
    EXPECT_FALSE(info(id).has_removed_original());
  }
  // A run requested by a person trusts the clock.
  EXPECT_EQ(runNow().deleted(), 1u);
  EXPECT_OK(store->service().retention().daily());
}

// no run was ever recorded: the server or its first policy is new
TEST_F(RetentionTest, aFirstRunWithAFastClockDeletesNothingUntilConfirmed) {
  const Uuid id = addClosed();
  (void)get(manager, policy(-1, 0, 0));
  // as if the clock had jumped, while the server runs and across restarts
  ASSERT_OK(
      change([&](Connection& c) { return SeenTimeStore(c).confirm(wallNowNs() - 400 * test::kDay_ns); }));
  pb::Request check;
  check.mutable_check();
  for (int start = 0; start < 3; ++start) {
    const auto daily = store->service().retention().daily();
    ASSERT_FALSE(daily.ok());
    EXPECT_EQ(daily.error().code, ErrorCode::kUnavailable);
    EXPECT_NE(daily.error().message.find("400 days after"), std::string::npos) << daily.error().message;
    EXPECT_FALSE(info(id).has_removed_original());
    const auto report = get(admin, check).check_report();
    EXPECT_FALSE(report.ok());
    ASSERT_EQ(report.faults_size(), 1);
    EXPECT_NE(report.faults(0).find("needlelab-admin retention run"), std::string::npos);
    addClosed();  // closing a session does not make the clock trusted
    (void)runNow(true);
    store.reset();
    store = test::openStore(folder.path() / "data");
    EXPECT_NE(store->clockAhead(), "");
  }
  store->service().setRetentionPace({.pause = 0ms});
  EXPECT_EQ(runNow().deleted(), 4u);
  EXPECT_TRUE(get(admin, check).check_report().ok());
  EXPECT_OK(store->service().retention().daily());
  store.reset();
  store = test::openStore(folder.path() / "data");
  EXPECT_EQ(store->clockAhead(), "");
}

TEST_F(RetentionTest, theDailyRunRecordsTheTimeOfAnIdleLab) {
  const std::int64_t day_30 = wallNowNs() - 30 * test::kDay_ns;
  ASSERT_OK(change([&](Connection& c) { return SeenTimeStore(c).confirm(day_30); }));
  EXPECT_OK(store->service().retention().daily());
  auto reader = store->readers().borrow();
  EXPECT_GE(test::TestDb::must(SeenTimeStore(**reader).latest()), day_30 + 30 * test::kDay_ns);
}

// the server's clock was 400 days behind when they arrived, and is right again; they arrived after the
// database was created
TEST_F(RetentionTest, sessionsClosedByASlowClockAreKeptAndReported) {
  const Uuid id = addClosed();
  ASSERT_OK(change([&](Connection& c) {
    return c.run("UPDATE sessions SET closed_unix_ns = closed_unix_ns - ?", 400 * test::kDay_ns);
  }));
  (void)get(manager, policy(-1, 0, 365));
  const auto report = runNow();
  EXPECT_EQ(report.deleted(), 0u);
  EXPECT_EQ(report.left_alone(), 1u);
  ASSERT_EQ(report.steps_size(), 1);
  EXPECT_EQ(report.steps(0).action(), pb::RetentionStep::LEFT_ALONE);
  EXPECT_EQ(report.steps(0).bytes_after(), report.steps(0).bytes_before());
  EXPECT_NE(report.steps(0).text().find("was behind"), std::string::npos) << report.steps(0).text();
  EXPECT_FALSE(info(id).has_removed_original());
}

TEST_F(RetentionTest, aSlowClocksSessionsAgeFromTheLatestSeenTime) {
  const std::int64_t latest = wallNowNs() + 400 * test::kDay_ns;
  ASSERT_OK(change([&](Connection& c) { return SeenTimeStore(c).confirm(latest); }));
  addClosed();
  (void)get(manager, policy(-1, 0, 365));
  auto reader = store->readers().borrow();
  const auto actionAfter = [&](std::int64_t days) {
    const auto due = RetentionStore(**reader).due(latest + days * test::kDay_ns);
    EXPECT_OK(due);
    if (!due || due->size() != 1) return std::string("nothing is due");
    return std::string(due->front().clock_was_behind ? "left alone" : "deleted");
  };
  EXPECT_EQ(actionAfter(0), "left alone");
  EXPECT_EQ(actionAfter(364), "left alone");
  EXPECT_EQ(actionAfter(365), "deleted");
}

TEST_F(RetentionTest, aSlowClockIsReportedAtEachStartUntilARun) {
  EXPECT_EQ(store->clockBehind(), "");
  const auto startAgain = [&] {
    store.reset();
    store = test::openStore(folder.path() / "data");
    return store->clockBehind();
  };
  EXPECT_EQ(startAgain(), "");
  ASSERT_OK(
      change([&](Connection& c) { return SeenTimeStore(c).confirm(wallNowNs() + 400 * test::kDay_ns); }));
  for (int i = 0; i < 2; ++i) {
    const std::string text = startAgain();
    EXPECT_NE(text.find("needlelab-admin retention run"), std::string::npos) << text;
  }
  (void)runNow(true);
  EXPECT_NE(startAgain(), "") << "a dry run says nothing of the clock";
  (void)runNow();
  EXPECT_EQ(startAgain(), "");
}

}  // namespace
}  // namespace needlelab
