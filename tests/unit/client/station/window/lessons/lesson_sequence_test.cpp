// Runs lesson after lesson as requested by a window, with the simulated device in real time, without a server
// or with one that asks for codes.
#include <gmock/gmock.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <filesystem>
#include <fstream>
#include <functional>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>

#include "client/device/hand/hand_options.h"
#include "client/station/window/lessons/lesson_sequence.h"
#include "common/base/files/files.h"
#include "common/base/program.h"
#include "tests/support/patience.h"
#include "tests/support/temp_folder.h"
#include "tests/support/time/fake_time.h"
#include "tests/unit/client/net/uplink/fake_server.h"
#include "tests/unit/client/station/window/lessons/taken_samples.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

// The machine's time plus an offset set by the test.
class LaterTime : public MachineTime {
 public:
  [[nodiscard]] std::int64_t nowNs() noexcept override { return MachineTime::nowNs() + later_ns_; }
  void sleepUntilNs(std::int64_t due_ns) noexcept override { MachineTime::sleepUntilNs(due_ns - later_ns_); }
  void waitUntilNs(std::condition_variable& changed, std::unique_lock<std::mutex>& lock,
                   std::int64_t due_ns) override {
    MachineTime::waitUntilNs(changed, lock, due_ns - later_ns_);
  }
  using MachineTime::waitUntilNs;
  void advance(std::chrono::seconds by) { later_ns_ += std::chrono::nanoseconds(by).count(); }

 private:
  std::atomic<std::int64_t> later_ns_{0};
};

class LessonSequenceTest : public testing::Test {
 protected:
  LessonSequenceTest() {
    sigemptyset(&signals_);
    options_.profile_file = NEEDLELAB_SAMPLES "/shoulder-adult.json";
    options_.spool = folder_.path() / "spool";
    options_.json = true;
    options_.json_file = folder_.path() / "out.json";
    options_.seconds = 0.4;
    options_.hand.plan = "rest";
    options_.hand.repeat = 0;
  }
  void start(bool begins = false, bool alone = false) {
    sequence_ = std::make_unique<LessonSequence>(options_, signals_, board_, alone, begins, time_);
    thread_ = std::thread([this] { code_ = sequence_->run(); });
  }
  ~LessonSequenceTest() override {
    if (thread_.joinable()) quit();
  }
  int quit() {
    board_.ask({BoardRequest::Kind::kQuit, {}});
    if (sequence_) sequence_->requests().stop({});
    thread_.join();
    return code_;
  }
  // Returns false if the condition never held.
  bool until(const std::function<bool(const BoardState&)>& condition) {
    return eventually([&] {
      board_.look(state_, seen_);
      return condition(state_);
    });
  }
  bool until(Stage stage) {
    return until([stage](const BoardState& state) { return state.stage == stage; });
  }
  [[nodiscard]] nlohmann::json summary() const {
    std::ifstream file(options_.json_file);
    return nlohmann::json::parse(file, nullptr, false);
  }

  TempFolder folder_;
  sigset_t signals_{};
  StationOptions options_;
  LaterTime time_;
  LessonBoard board_;
  std::unique_ptr<LessonSequence> sequence_;
  std::thread thread_;
  int code_ = -1;
  BoardState state_;
  std::uint64_t seen_ = 0;
};

TEST_F(LessonSequenceTest, showsWhatCanBePractisedAndHowTheDeviceIs) {
  start();
  ASSERT_TRUE(
      until([](const BoardState& state) { return state.stage == Stage::kStart && state.device.is_checked; }));
  EXPECT_EQ(state_.lists.profile_file, options_.profile_file);
  EXPECT_TRUE(state_.device.ready);
  EXPECT_TRUE(state_.choice.by_profile);
  EXPECT_EQ(quit(), kExitDone) << "looking and leaving is no error";
}

TEST_F(LessonSequenceTest, oneLessonAfterAnotherEachIsRecordedAndScored) {
  start();
  ASSERT_TRUE(until(Stage::kStart));
  std::string first;
  for (std::uint64_t lesson = 1; lesson <= 2; ++lesson) {
    board_.ask({BoardRequest::Kind::kBegin, {"tom", "", true}});
    ASSERT_TRUE(until([&](const BoardState& state) {
      return state.stage == Stage::kEnd && state.lesson == lesson;
    })) << state_.trouble;
    ASSERT_TRUE(state_.outcome);
    EXPECT_EQ(state_.outcome->summary.trainee, "tom");
    EXPECT_TRUE(state_.outcome->stored.ok());
    EXPECT_FALSE(state_.outcome->summary.score_json.empty());
    EXPECT_FALSE(state_.outcome->curve.empty());
    EXPECT_NE(state_.outcome->summary.session_id, first);
    first = state_.outcome->summary.session_id;
    std::vector<GestureSample> samples;
    const std::uint64_t dropped = takeSamples(board_, lesson, samples);
    EXPECT_EQ(samples.size() + dropped, state_.outcome->summary.servo.samples);
  }
  EXPECT_EQ(quit(), kExitDone);
  const auto out = summary();
  ASSERT_EQ(out["rows"].size(), 2u);
  EXPECT_EQ(out["rows"][1]["session_id"], first);
  EXPECT_EQ(out["session_id"], first);
}

TEST_F(LessonSequenceTest, aPersonEndsALessonAndIsNamed) {
  options_.seconds = 0;
  start(true);
  ASSERT_TRUE(until(
      [](const BoardState& state) { return state.stage == Stage::kLesson && state.status.time_s > 0; }));
  sequence_->requests().stop({"ines", "wrong side"});
  ASSERT_TRUE(until(Stage::kEnd));
  ASSERT_TRUE(state_.outcome->summary.stopped);
  EXPECT_EQ(state_.outcome->summary.stopped->by, "ines");
  EXPECT_EQ(quit(), kExitDone);
  EXPECT_EQ(summary()["stopped_by"], "ines");
  EXPECT_EQ(summary()["stop_reason"], "wrong side");
}

TEST_F(LessonSequenceTest, whoQuitsInALessonKeepsIt) {
  options_.seconds = 0;
  start(true);
  ASSERT_TRUE(until(
      [](const BoardState& state) { return state.stage == Stage::kLesson && state.status.time_s > 0.2; }));
  EXPECT_EQ(quit(), kExitDone);
  EXPECT_GT(summary()["samples"], 100);
}

TEST_F(LessonSequenceTest, aLessonThatCannotBeginIsReportedAtTheStart) {
  start();
  ASSERT_TRUE(until(Stage::kStart));
  board_.ask({BoardRequest::Kind::kBegin, {"tom", "never-fetched", false}});
  ASSERT_TRUE(
      until([](const BoardState& state) { return state.stage == Stage::kStart && !state.trouble.empty(); }));
  EXPECT_TRUE(
      state_.trouble.starts_with("This station has no server. These lessons are stored here: \"Shoulder: "))
      << state_.trouble;
  // A lesson that can start is not delayed by it.
  board_.ask({BoardRequest::Kind::kBegin, {"tom", "", true}});
  ASSERT_TRUE(until(Stage::kEnd));
  EXPECT_TRUE(state_.trouble.empty());
  EXPECT_EQ(quit(), kExitDone);
}

TEST_F(LessonSequenceTest, cancellingDuringPreparationReturnsToTheStart) {
  // The lesson's own thread requests the stop as soon as the first step is reported.
  struct CallsOff : LessonObserver {
    LessonRequests* requests = nullptr;
    void preparing(const std::string&) override { requests->stop({}); }
  } observer;
  StationHome home(options_, observer);
  observer.requests = &home.requests();
  ASSERT_TRUE(home.openSpool().ok());
  ASSERT_TRUE(home.connect().ok());
  StationRun run(home, options_, signals_);
  const Status prepared = run.prepare();
  ASSERT_FALSE(prepared.ok());
  EXPECT_THAT(prepared.error().message, HasSubstr("cancelled"));
  EXPECT_TRUE(home.spool().unfinished().empty()) << "nothing was begun";
}

TEST_F(LessonSequenceTest, aloneAWrongExerciseIsTheExitCode) {
  options_.profile_file.clear();
  options_.exercise = "never-fetched";
  start(true, true);
  ASSERT_TRUE(until([](const BoardState& state) { return !state.trouble.empty(); }));
  EXPECT_EQ(quit(), kExitInvalid);
}

TEST_F(LessonSequenceTest, anUnopenableSpoolIsReportedAndSetsTheExitCode) {
  std::ofstream(folder_.path() / "file") << "x";
  options_.spool = folder_.path() / "file" / "spool";
  start();
  ASSERT_TRUE(until(Stage::kFailed));
  EXPECT_NE(state_.trouble, "");
  EXPECT_NE(quit(), kExitDone);
}

TEST_F(LessonSequenceTest, theNextExerciseIsPreselectedOnce) {
  start();
  ASSERT_TRUE(until(Stage::kStart));
  board_.nextExercise("ines", "knee-recess");
  board_.ask({BoardRequest::Kind::kStart, {}});
  ASSERT_TRUE(until([](const BoardState& state) { return state.choice.exercise == "knee-recess"; }));
  EXPECT_FALSE(state_.choice.by_profile);
  ASSERT_TRUE(state_.next);
  board_.ask({BoardRequest::Kind::kBegin, {"tom", "knee-recess", false}});
  ASSERT_TRUE(until([](const BoardState& state) { return !state.trouble.empty(); }))
      << "it is not in the cache";
  EXPECT_FALSE(state_.next);
}

// Between lessons, on one thread and a simulated clock: each turn waits up to 100 ms for a request, checks
// server and spool every 500 ms, and a missing device every 5 s.
TEST_F(LessonSequenceTest, theTurnsBetweenLessonsComeAtTheirTimes) {
  class Turns : public FakeTime {
   public:
    void sleepUntilNs(std::int64_t due_ns) noexcept override {
      const std::int64_t turn_ms = (nowNs() - began_ns_) / 1'000'000;
      EXPECT_EQ(due_ns, nowNs() + 100'000'000);
      FakeTime::sleepUntilNs(due_ns);
      turn(turn_ms);
    }
    std::function<void(std::int64_t turn_ms)> turn;

   private:
    std::int64_t began_ns_ = nowNs();
  } time;
  LessonBoard board(500, time);
  const auto file = folder_.path() / "stroke.csv";
  options_.device = "recording:" + file.string();
  std::vector<std::int64_t> changes_ms, expected_ms;
  std::int64_t ready_ms = -1;
  BoardState state;
  std::uint64_t seen = 0;
  time.turn = [&](std::int64_t turn_ms) {
    if (board.look(state, seen)) changes_ms.push_back(turn_ms);
    if (ready_ms < 0 && state.device.ready) ready_ms = turn_ms;
    if (turn_ms == 600) std::ofstream(file) << "x";
    if (turn_ms == 7900) board.ask({BoardRequest::Kind::kQuit, {}});
  };
  LessonSequence sequence(options_, signals_, board, false, false, time);
  EXPECT_EQ(sequence.run(), kExitDone);
  for (std::int64_t ms = 0; ms < 8000; ms += 500) expected_ms.push_back(ms);
  EXPECT_EQ(changes_ms, expected_ms);
  EXPECT_EQ(ready_ms, 5000);
  EXPECT_EQ(time.sleeps(), 80u);
}

TEST_F(LessonSequenceTest, aSteeredHandGoesWhereItIsWished) {
  options_.hand.plan = kPointerPlan;
  options_.hand.tremor_m = 0;
  options_.seconds = 0;
  start(true);
  ASSERT_TRUE(until(
      [](const BoardState& state) { return state.stage == Stage::kLesson && state.status.time_s > 0; }));
  const auto beginning = state_.beginning;
  ASSERT_TRUE(beginning->steering);
  const Pose start = steeredStart(beginning->way).start().X_WT;
  beginning->steering->setTarget({{start.p + Vec3{0, -0.005, 0}, start.q}, 0.5});
  std::vector<GestureSample> samples;
  EXPECT_TRUE(eventually([&] {
    takeSamples(board_, 1, samples);
    return !samples.empty() && std::abs(samples.back().p_WT_m[1] - (start.p.y - 0.005)) < 2e-4 &&
           std::abs(samples.back().plunger - 0.5) < 0.01;
  }));
  EXPECT_EQ(quit(), kExitDone);
}

// --- a server that asks for codes

class LessonSequenceCodesTest : public LessonSequenceTest {
 protected:
  LessonSequenceCodesTest() {
    options_.profile_file.clear();
    options_.station = "station-1";
    options_.servers = {{"127.0.0.1", server_->port()}};
    options_.ca_file = FakeServer::caFile();
    options_.key_file = folder_.write("station.key", "station-1:" + std::string(64, '0') + "\n");
    std::filesystem::permissions(options_.key_file, std::filesystem::perms::owner_read);
    options_.drain_s = 0.2;
    pb::Lesson lesson;
    lesson.set_exercise_json(R"({"id": "ball", "name": "Ball", "profile_id": "phantom-ball"})");
    lesson.set_profile_json(*readWholeFile(NEEDLELAB_SAMPLES "/phantom-ball.json"));
    lesson.set_profile_revision(1);
    server_->setLesson(lesson);
    server_->setCode("tom", "4711");
  }
  void begin(const std::string& trainee, const std::string& code = {}) {
    board_.ask({BoardRequest::Kind::kBegin, {trainee, "ball", false}, code});
  }
  bool untilAsked(std::uint64_t number) {
    return until([number](const BoardState& state) {
      return state.stage == Stage::kStart && state.code_question && state.code_question->number == number;
    });
  }
  bool untilEndOf(std::uint64_t lesson) {
    return until(
        [lesson](const BoardState& state) { return state.stage == Stage::kEnd && state.lesson == lesson; });
  }
  // tom's first lesson, to its end
  void practiseAsTom() {
    begin("tom");
    ASSERT_TRUE(untilAsked(1)) << state_.trouble;
    begin("tom", "4711");
    ASSERT_TRUE(untilEndOf(1)) << state_.trouble;
  }

  std::unique_ptr<FakeServer> server_ = std::make_unique<FakeServer>();
};

TEST_F(LessonSequenceCodesTest, anExamBeginsWhenItsTraineeSaysSoAndEndsWithItsResultDateOnly) {
  options_.seconds = 0;
  pb::Lesson exam = server_->lesson();
  exam.set_assigned_only(true);
  exam.set_exercise_json(R"({"id": "b", "name": "B", "profile_id": "phantom-ball", "time_limit_s": 300})");
  exam.set_exam(true);
  exam.set_attempts_left(1);
  exam.set_results_from_unix_ns(9'000'000'000'000'000'000);
  server_->setLesson(exam);
  start();
  ASSERT_TRUE(until(Stage::kStart));
  const auto waits = [](const BoardState& state) { return !state.exam_terms.empty(); };
  begin("tom", "4711");
  ASSERT_TRUE(until(waits)) << state_.trouble;
  EXPECT_EQ(state_.exam_terms, "1 attempt left, 5 min, counts");
  sequence_->requests().stop({});  // not now
  ASSERT_TRUE(until(Stage::kStart));
  EXPECT_EQ(state_.lesson, 0u) << "no attempt was begun";
  begin("tom", "4711");
  ASSERT_TRUE(until(waits)) << state_.trouble;
  sequence_->requests().beginExam();
  ASSERT_TRUE(until(Stage::kLesson));
  sequence_->requests().stop({});
  ASSERT_TRUE(untilEndOf(1)) << state_.trouble;
  const auto nothingOfIt = [&] {
    const StationSummary& seen = state_.outcome->summary;
    return seen.score_json.empty() && seen.syringe_json.empty() && state_.outcome->curve.empty();
  };
  EXPECT_EQ(state_.outcome->summary.results_from_unix_ns, 9'000'000'000'000'000'000);
  EXPECT_TRUE(nothingOfIt());
  ASSERT_TRUE(until([](const BoardState& state) { return state.outcome->summary.state == "COMPLETE"; }));
  EXPECT_TRUE(nothingOfIt()) << "whatever the server says";
  EXPECT_EQ(quit(), kExitDone);
  EXPECT_TRUE(summary()["score"].is_null());
}

TEST_F(LessonSequenceCodesTest, aRefusalIsToldInWordsForATrainee) {
  start();
  ASSERT_TRUE(until(Stage::kStart));
  board_.ask({BoardRequest::Kind::kBegin, {"mia", "unknown", false}});
  ASSERT_TRUE(until([](const BoardState& state) { return !state.trouble.empty(); }));
  EXPECT_EQ(state_.trouble, "no such exercise");
}

TEST_F(LessonSequenceCodesTest, aCodeIsAskedForOnceAndReused) {
  start();
  ASSERT_TRUE(until(Stage::kStart));
  begin("tom");
  ASSERT_TRUE(untilAsked(1)) << state_.trouble;
  EXPECT_EQ(state_.code_question->trainee, "tom");
  EXPECT_EQ(state_.code_question->text, "tom has a code: type the PIN or hold the badge to the reader");
  EXPECT_FALSE(state_.code_question->wrong);
  EXPECT_EQ(state_.trouble, "") << "nothing is wrong yet";
  begin("tom", "0000");
  ASSERT_TRUE(untilAsked(2)) << state_.trouble;
  EXPECT_EQ(state_.code_question->text, "this is not the code of tom; 4 tries left");
  EXPECT_TRUE(state_.code_question->wrong);
  begin("tom", "4711");
  ASSERT_TRUE(untilEndOf(1)) << state_.trouble;
  EXPECT_FALSE(state_.code_question);
  EXPECT_FALSE(state_.outcome->code_unchecked);
  begin("tom");
  ASSERT_TRUE(untilEndOf(2)) << state_.trouble;
  EXPECT_EQ(server_->givenCodes(), (std::vector<std::string>{"", "0000", "4711", "4711"}));
  ASSERT_TRUE(until([&](const BoardState&) { return server_->sessions().size() == 2; }));
  for (const auto& [id, session] : server_->sessions()) EXPECT_TRUE(session.description.code_checked());
  EXPECT_EQ(quit(), kExitDone);
}

TEST_F(LessonSequenceCodesTest, theStartScreenForgetsTheCode) {
  start();
  ASSERT_TRUE(until(Stage::kStart));
  practiseAsTom();
  board_.ask({BoardRequest::Kind::kStart, {}});
  ASSERT_TRUE(until(Stage::kStart));
  EXPECT_FALSE(state_.code_question) << "no one has asked yet";
  begin("tom");
  ASSERT_TRUE(untilAsked(2)) << state_.trouble;
  EXPECT_FALSE(state_.code_question->wrong);
  EXPECT_EQ(server_->givenCodes(), (std::vector<std::string>{"", "4711", ""}));
  EXPECT_EQ(quit(), kExitDone) << "leaving at the question is not an error";
}

TEST_F(LessonSequenceCodesTest, twoMinutesAfterTheLessonTheCodeIsForgotten) {
  start();
  ASSERT_TRUE(until(Stage::kStart));
  practiseAsTom();
  time_.advance(110s);
  begin("tom");
  ASSERT_TRUE(untilEndOf(2)) << state_.trouble;
  EXPECT_EQ(server_->givenCodes(), (std::vector<std::string>{"", "4711", "4711"}))
      << "counted from each lesson's end";
  time_.advance(121s);
  begin("tom");
  ASSERT_TRUE(untilAsked(2)) << state_.trouble;
  EXPECT_EQ(server_->givenCodes().back(), "");
  EXPECT_FALSE(state_.code_question->wrong);
}

TEST_F(LessonSequenceCodesTest, aChangedCodeIsNotThePersonsMistake) {
  start();
  ASSERT_TRUE(until(Stage::kStart));
  practiseAsTom();
  server_->setCode("tom", "1174");
  begin("tom");
  ASSERT_TRUE(untilAsked(2)) << state_.trouble;
  EXPECT_EQ(state_.code_question->text,
            "tom's code from the last lesson no longer works; type the current one. "
            "this is not the code of tom; 4 tries left");
  EXPECT_FALSE(state_.code_question->wrong);
  begin("tom", "1174");
  ASSERT_TRUE(untilEndOf(2)) << state_.trouble;
}

TEST_F(LessonSequenceCodesTest, somebodyElsesLessonForgetsTheCode) {
  start();
  ASSERT_TRUE(until(Stage::kStart));
  practiseAsTom();
  begin("zoe");
  ASSERT_TRUE(untilEndOf(2)) << state_.trouble;
  begin("tom");
  ASSERT_TRUE(untilAsked(2)) << state_.trouble;
  EXPECT_EQ(server_->givenCodes(), (std::vector<std::string>{"", "4711", "", ""}))
      << "zoe is not asked, and tom's code is not sent for zoe";
  EXPECT_EQ(quit(), kExitDone);
}

TEST_F(LessonSequenceCodesTest, withoutTheServerTheLessonBeginsUnchecked) {
  start();
  ASSERT_TRUE(until(Stage::kStart));
  practiseAsTom();
  server_.reset();
  begin("tom");
  ASSERT_TRUE(untilEndOf(2)) << state_.trouble;
  EXPECT_TRUE(state_.beginning->code_unchecked);
  EXPECT_TRUE(state_.outcome->code_unchecked);
  EXPECT_EQ(quit(), kExitDone);
}

TEST_F(LessonSequenceCodesTest, withoutAServerNoCodeIsAskedFor) {
  options_.trainee = "tom";
  options_.exercise = "ball";
  start(true, true);
  ASSERT_TRUE(until([](const BoardState& state) { return !state.trouble.empty(); }));
  EXPECT_THAT(state_.trouble, HasSubstr("tom has a code"));
  EXPECT_EQ(quit(), kExitFailed);
}

}  // namespace
}  // namespace needlelab::test
