#include "client/instructor/model/stored/stored_gesture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "client/instructor/model/stored/report.h"
#include "common/base/time/clock.h"
#include "common/gesture/chunk.h"
#include "common/haptics/cut_snapshot.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"
#include "tests/support/scenes/stored_sample.h"
#include "tests/support/time_zone.h"
#include "tests/unit/client/instructor/model/change_course.h"
#include "tests/unit/client/instructor/model/lesson_gestures.h"
#include "tests/unit/client/instructor/model/upload_lesson.h"
#include "tests/unit/server/live/running_server.h"

namespace needlelab {
namespace {

using namespace test;
using testing::HasSubstr;

/// A server with one lesson of tina, as a station sends it.
class StoredGestureTest : public testing::Test {
 protected:
  RunningServer server_;
  std::string key_ = server_.addStation("bench-1");
  std::string profile_ = sampleProfile("shoulder-adult");
  pb::SessionInfo info_ = lessonInfo(profile_);
  std::vector<GestureSample> samples_ = lessonSamples(profile_, {.depth_m = 0.02, .seconds = 1});
  std::optional<BlockingClient> instructor_;

  void SetUp() override {
    server_.addUser("anna", pb::INSTRUCTOR, "correct horse battery");
    server_.addUser("mia", pb::CURRICULUM_MANAGER, "battery horse correct");
    ASSERT_NO_FATAL_FAILURE(uploadLesson(server_, key_, info_, samples_));
    auto instructor = server_.connect(personLogin("anna", "correct horse battery"));
    ASSERT_TRUE(instructor.ok());
    instructor_.emplace(std::move(*instructor));
  }
  LabCall call() {
    return [this](const pb::Request& request) { return instructor_->call(request); };
  }
  /// A `call` to a server that reports this chunk as damaged and changes the others.
  LabCall damagedCall(std::uint64_t seq, std::function<void(pb::Chunk&)> change = {}) {
    return [this, seq, change](const pb::Request& request) -> Result<pb::Reply> {
      auto reply = instructor_->call(request);
      if (!reply.ok() || !reply->has_chunks()) return reply;
      const pb::Chunks read = reply->chunks();
      reply->mutable_chunks()->clear_chunks();
      for (const pb::Chunk& chunk : read.chunks()) {
        if (chunk.seq() == seq) {
          reply->mutable_chunks()->add_damaged()->set_seq(seq);
          continue;
        }
        pb::Chunk& kept = *reply->mutable_chunks()->add_chunks();
        kept = chunk;
        if (change) change(kept);
      }
      reply->mutable_chunks()->set_next_seq(read.next_seq());
      return reply;
    };
  }
  /// Changes the lesson's exercise in the course that contains it.
  void changeExercise(const std::function<void(pb::Exercise&)>& change) {
    auto manager = server_.connect(personLogin("mia", "battery horse correct"));
    ASSERT_TRUE(manager.ok());
    test::changeExercise(*manager, info_.description().exercise_id(), change);
  }
};

TEST(StoredGesture, isTitledByTheLocalTimeOfItsBeginning) {
  const WithZone zone(kStJohns);
  StoredGesture gesture;
  auto& d = *gesture.info.mutable_description();
  d.set_trainee("tina");
  d.set_exercise_id("knee");
  d.set_started_unix_ns((20'635 * 86'400LL + 3600) * 1'000'000'000);  // 2026-07-01 01:00 UTC
  EXPECT_EQ(gesture.title(), "tina, knee, 2026-06-30 22:30") << "an exercise that is not there any more";
  gesture.exercise_name = "Knee: suprapatellar recess";
  EXPECT_EQ(gesture.title(), "tina, Knee: suprapatellar recess, 2026-06-30 22:30");
}

TEST(StoredGesture, aThinnedRecordingIsCompleteAtEveryPolicyRate) {
  const std::string profile = sampleProfile("shoulder-adult");
  for (const double left_hz : {0.1, 10.0, 50.0, 800.0, 10'000.0}) {
    pb::SessionInfo info = lessonInfo(profile);
    info.mutable_removed_original()->set_fate(pb::RemovedOriginal::THINNED);
    info.mutable_removed_original()->set_thinned_rate_hz(left_hz);
    const double step_ticks = std::max(1.0, 1000 / left_hz);
    std::vector<GestureSample> samples;
    for (int i = 0; i < 100; ++i) {
      GestureSample sample;
      sample.tick = static_cast<std::uint64_t>(std::ceil(i * step_ticks));
      sample.q_WT[3] = 1;
      sample.p_WT_m[2] = 0.1;
      sample.layer = -1;
      samples.push_back(sample);
    }
    const double last_s = 1e-3 * static_cast<double>(samples.back().tick);
    const auto gesture = gestureOf(std::move(info), std::move(samples));
    EXPECT_TRUE(gesture->scene.model) << left_hz << ": " << gesture->scene.why;
    EXPECT_TRUE(gesture->trace.gaps().empty()) << left_hz;
    EXPECT_TRUE(gesture->trace.events().empty()) << left_hz;
    EXPECT_DOUBLE_EQ(gesture->first_s(), 0) << left_hz << ": nothing is forgotten";
    EXPECT_DOUBLE_EQ(gesture->last_s(), last_s) << left_hz;
    EXPECT_EQ(gesture->trace.between(0, last_s).front().time_s, 0) << left_hz;
  }
}

/// A line straight down through the origin of the sample shoulder's frame.
pb::Exercise straightDown() {
  pb::Exercise exercise;
  exercise.set_profile_id("shoulder-adult");
  auto& plan = *exercise.mutable_plan();
  plan.set_frame(pb::Exercise::Plan::LIMB);
  auto& entry = *plan.mutable_entry_m();
  auto& direction = *plan.mutable_direction();
  for (auto* const vector : {&entry, &direction}) {
    vector->set_x(0);
    vector->set_y(0);
    vector->set_z(0);
  }
  direction.set_z(-1);
  return exercise;
}

TEST(StoredGesture, hasAPlanOnlyWhereTheLimbsPlaceIsKnown) {
  const pb::Exercise exercise = straightDown();
  pb::SessionInfo info = lessonInfo(sampleProfile("shoulder-adult"));
  for (const double v : {0.1, 0.2, 0.3, 0.0, 0.0, 0.0, 1.0}) info.mutable_description()->add_placement(v);
  const auto placed = gestureOf(info, {}, {}, &exercise);
  ASSERT_TRUE(placed->plan_W);
  EXPECT_EQ(placed->plan_W->entry_m, (Vec3{0.1, 0.2, 0.3}));
  ASSERT_TRUE(placed->planView());
  EXPECT_EQ(placed->planView()->entry_W_m, (Vec3{0.1, 0.2, 0.3}));
  pb::Exercise other_patient = exercise;
  other_patient.set_profile_id("knee-adult");
  const auto without = gestureOf(info, {}, {}, &other_patient);
  EXPECT_FALSE(without->plan_W) << "the line would lie in another limb";
  EXPECT_FALSE(without->planView());
  pb::SessionInfo unreadable = info;
  unreadable.mutable_description()->set_profile_json("{}");
  EXPECT_FALSE(gestureOf(unreadable, {}, {}, &exercise)->plan_W);
  info.mutable_description()->mutable_placement()->RemoveLast();
  EXPECT_FALSE(gestureOf(info, {}, {}, &exercise)->plan_W) << "six numbers are not a pose";
}

TEST_F(StoredGestureTest, isReadWholeWithItsRemarks) {
  pb::Request remark;
  remark.mutable_annotate()->set_session_id(info_.description().session_id());
  remark.mutable_annotate()->set_tick(750);
  remark.mutable_annotate()->set_text("slower here");
  ASSERT_TRUE(instructor_->call(remark).ok());
  LoadProgress progress;
  const auto gesture = loadGesture(call(), info_.description().session_id(), {}, &progress);
  ASSERT_TRUE(gesture.ok()) << gesture.error().message;
  ASSERT_EQ((*gesture)->samples.size(), samples_.size());
  EXPECT_EQ(progress.chunks_read, progress.chunks);
  EXPECT_TRUE((*gesture)->notes.empty()) << (*gesture)->notes[0];
  EXPECT_TRUE((*gesture)->scene.model);
  for (std::size_t i = 0; i < samples_.size(); i += 97) {
    EXPECT_EQ((*gesture)->samples[i].tick, samples_[i].tick);
    EXPECT_NEAR((*gesture)->samples[i].p_WT_m[2], samples_[i].p_WT_m[2], 0.51e-6);
    EXPECT_EQ((*gesture)->sampleAt((*gesture)->timeOfTick(samples_[i].tick) + 0.0004), i);
  }
  EXPECT_THAT((*gesture)->title(),
              HasSubstr("tina, Shoulder phantom: subacromial bursa, " +
                        localTime(info_.description().started_unix_ns(), TimeForm::kMinute)));
  ASSERT_EQ((*gesture)->annotations.size(), 1u);
  const auto& events = (*gesture)->trace.events();
  EXPECT_TRUE(std::any_of(events.begin(), events.end(), [](const TraceEvent& e) {
    return e.kind == TraceEvent::Kind::kRemark && e.text == "anna: slower here";
  }));
}

bool approximateAt(const StoredGesture& gesture, double time_s) {
  const auto moments = gesture.trace.between(time_s, time_s + 0.002);
  EXPECT_FALSE(moments.empty()) << time_s;
  EXPECT_TRUE(moments.empty() || moments.front().inside) << time_s;
  return !moments.empty() && moments.front().approximate;
}

TEST_F(StoredGestureTest, isApproximateBehindADamagedChunkAndNotBefore) {
  // inside from about 0.5 s to 2.0 s
  const auto gesture = loadGesture(damagedCall(2), info_.description().session_id());
  ASSERT_TRUE(gesture.ok()) << gesture.error().message;
  EXPECT_EQ((*gesture)->samples.size(), samples_.size() - 500);
  EXPECT_FALSE(approximateAt(**gesture, 0.9));
  EXPECT_TRUE(approximateAt(**gesture, 1.7));
}

TEST_F(StoredGestureTest, knowsOldCutsBehindADamagedChunkFromTheNextChunksMemory) {
  auto profile = parseProfile(profile_, "sample");
  ASSERT_TRUE(profile.ok());
  profile->add_effects(pb::Profile::CUT_MEMORY);
  profile->mutable_cut_memory()->set_cutting_share(0.3);
  profile->mutable_cut_memory()->set_radius_m(0.001);
  // in and out twice along one line; what the engine remembers before the second pass
  const std::uint64_t once = samples_.size();
  const auto model = compile(*sceneSpecOf(*profile), 1000);
  ASSERT_TRUE(model.ok());
  const auto state = std::make_unique<SimState>();
  StepReport report;
  std::vector<double> cutting_N;
  Bytes memory;
  for (std::uint64_t k = 0; k < 2 * once; ++k) {
    if (k >= once) {
      samples_.push_back(samples_[k - once]);
      samples_.back().tick = k;
      samples_.back().time_ns += static_cast<std::int64_t>(once) * 1'000'000;
    }
    const TipSample tip = test::tipOf(samples_[k]);
    step(*model, tip, *state, report);
    samples_[k] = test::storedSample(k, tip, report);
    cutting_N.push_back(report.cutting_N);
    if (k == once) memory = encodeCuts({k, state->cuts, state->insertions});
  }
  pb::SessionInfo info = lessonInfo(profileJson(*profile));
  ASSERT_NO_FATAL_FAILURE(uploadLesson(server_, key_, info, samples_));
  for (const bool with_memory : {false, true}) {
    SCOPED_TRACE(with_memory);
    // chunk 5 begins with the second pass
    const auto remember = [&](pb::Chunk& chunk) {
      if (!with_memory || chunk.seq() != once / 500) return;
      const auto samples = decodeChunk(viewOf(chunk.data()));
      ASSERT_TRUE(samples.ok());
      chunk.set_data(std::string(textOf(encodeChunk(Resolution::standard(), *samples, memory))));
    };
    const auto gesture = loadGesture(damagedCall(2, remember), info.description().session_id());
    ASSERT_TRUE(gesture.ok()) << gesture.error().message;
    EXPECT_FALSE(approximateAt(**gesture, 0.9));
    EXPECT_TRUE(approximateAt(**gesture, 1.7));
    const double again_s = static_cast<double>(once) / 1000 + 0.75;
    EXPECT_EQ(approximateAt(**gesture, again_s), !with_memory);
    const auto moments = (*gesture)->trace.between(again_s, again_s + 0.002);
    if (with_memory) {
      EXPECT_NEAR(moments.front().term(Effect::kCutting), cutting_N[once + 750], 0.1);
    }
  }
}

TEST_F(StoredGestureTest, hasTheRequirementsOfItsScore) {
  pb::Request list;
  list.mutable_list_exercises();
  const auto exercises = instructor_->call(list);
  ASSERT_TRUE(exercises.ok());
  std::map<std::string, std::optional<double>> expected;  // the greatest allowed value for each measure
  for (const auto& row : exercises->exercises().exercises()) {
    const auto exercise = parseExercise(row.json(), "exercise");
    ASSERT_TRUE(exercise.ok());
    if (exercise->id() != info_.description().exercise_id()) continue;
    for (const auto& requirement : exercise->requirements())
      if (requirement.has_max()) expected[requirement.measure()] = requirement.max();
  }
  ASSERT_FALSE(expected.empty());
  const auto gesture = loadGesture(call(), info_.description().session_id());
  ASSERT_TRUE(gesture.ok());
  for (const auto& [measure, max] : expected) {
    const auto& all = (*gesture)->requirements;
    const auto found = std::find_if(all.begin(), all.end(),
                                    [&name = measure](const auto& each) { return each.measure == name; });
    ASSERT_NE(found, all.end()) << measure;
    EXPECT_EQ(found->max, max) << measure;
  }
}

TEST_F(StoredGestureTest, becomesAReport) {
  const auto gesture = loadGesture(call(), info_.description().session_id());
  ASSERT_TRUE(gesture.ok());
  const auto data = collectReport(call(), *gesture);
  ASSERT_TRUE(data.ok()) << data.error().message;
  EXPECT_FALSE(data->measures.empty());
  EXPECT_EQ(data->attempt, 1u);
  EXPECT_NE(reportHtml(*data).find("Definitions of version"), std::string::npos);
}

TEST_F(StoredGestureTest, hasItsExercisesPlanAsItIsToday) {
  for (const bool with_plan : {false, true}) {
    changeExercise([&](pb::Exercise& exercise) {
      exercise.clear_plan();
      if (with_plan) *exercise.mutable_plan() = straightDown().plan();
    });
    const auto gesture = loadGesture(call(), info_.description().session_id());
    ASSERT_TRUE(gesture.ok()) << gesture.error().message;
    ASSERT_EQ((*gesture)->plan_W.has_value(), with_plan);
    if (with_plan) {
      EXPECT_EQ((*gesture)->plan_W->direction, (Vec3{0, 0, -1}));
    }
    EXPECT_TRUE((*gesture)->notes.empty());
  }
}

TEST_F(StoredGestureTest, hasNoPlanOfAnExerciseThatIsForAnotherPatientToday) {
  const LabCall moved = [&](const pb::Request& request) -> Result<pb::Reply> {
    auto reply = instructor_->call(request);
    if (!reply.ok() || !request.has_list_exercises()) return reply;
    for (auto& row : *reply->mutable_exercises()->mutable_exercises()) {
      auto exercise = parseExercise(row.json(), "exercise");
      if (!exercise.ok()) return exercise.error();
      exercise->set_profile_id("knee-adult");
      row.set_json(exerciseJson(*exercise));
    }
    return reply;
  };
  const auto gesture = loadGesture(moved, info_.description().session_id());
  ASSERT_TRUE(gesture.ok()) << gesture.error().message;
  EXPECT_FALSE((*gesture)->plan_W);
  EXPECT_EQ((*gesture)->notes,
            std::vector<std::string>{"the exercise now has another patient: no planned line is shown"});
}

/// `measures_json` without this measure's row.
std::string withoutMeasure(const std::string& measures_json, const std::string& name) {
  auto rows = nlohmann::json::parse(measures_json);
  const auto end = std::remove_if(rows.begin(), rows.end(),
                                  [&](const nlohmann::json& row) { return row.at("measure") == name; });
  EXPECT_NE(end, rows.end());
  rows.erase(end, rows.end());
  return rows.dump();
}

TEST_F(StoredGestureTest, takesItsPlanFromTheScoreAndMarksUnconfirmedParts) {
  enum class Score { kWithPlan, kWithoutPlan, kNone };
  Score score = Score::kWithPlan;
  const LabCall changed = [&](const pb::Request& request) -> Result<pb::Reply> {
    if (request.has_get_score() && score == Score::kNone)
      return Error{ErrorCode::kNotFound, "there is no score yet"};
    auto reply = instructor_->call(request);
    if (reply.ok() && request.has_get_score() && score == Score::kWithoutPlan)
      reply->mutable_score()->set_measures_json(
          withoutMeasure(reply->score().measures_json(), "largest_planned_line_error_m"));
    return reply;
  };
  struct Row {
    Score score;
    bool plan;
    std::vector<std::string> notes;
  };
  const Row rows[] = {{Score::kWithPlan, true, {}},
                      {Score::kWithoutPlan,
                       false,
                       {"this session was scored without a plan: the exercise's current plan is not shown"}},
                      {Score::kNone, true, {"the planned line is the exercise's current one"}}};
  for (const Row& row : rows) {
    score = row.score;
    const auto gesture = loadGesture(changed, info_.description().session_id());
    ASSERT_TRUE(gesture.ok()) << gesture.error().message;
    EXPECT_EQ((*gesture)->plan_W.has_value(), row.plan) << row.notes.size();
    EXPECT_EQ((*gesture)->notes, row.notes);
  }
}

TEST_F(StoredGestureTest, saysThatThePlanWasChangedBehindTheScore) {
  pb::SessionInfo shown;  // what the server reports about the session, where it differs
  const LabCall changed = [&](const pb::Request& request) -> Result<pb::Reply> {
    auto reply = instructor_->call(request);
    if (reply.ok() && request.has_get_session()) reply->mutable_session()->MergeFrom(shown);
    return reply;
  };
  const std::string words =
      "the exercise's plan was changed after this session was scored: its score uses the plan of that time";
  const auto isSaid = [&] {
    const auto gesture = loadGesture(changed, info_.description().session_id());
    EXPECT_TRUE(gesture.ok());
    if (!gesture.ok()) return false;
    EXPECT_TRUE((*gesture)->plan_W);
    const auto& notes = (*gesture)->notes;
    return std::find(notes.begin(), notes.end(), words) != notes.end();
  };
  EXPECT_FALSE(isSaid());
  changeExercise([](pb::Exercise& exercise) { exercise.mutable_plan()->mutable_entry_m()->set_x(5e-5); });
  EXPECT_FALSE(isSaid()) << "moved by less than 0.1 mm";
  changeExercise([](pb::Exercise& exercise) {
    *exercise.mutable_plan() = straightDown().plan();
    exercise.mutable_plan()->mutable_entry_m()->set_x(0.003);
  });
  EXPECT_TRUE(isSaid());
  // the score covers more samples than can be read: no statement is possible
  shown.set_samples(samples_.size() + 1);
  EXPECT_FALSE(isSaid());
  shown.Clear();
  shown.mutable_removed_original()->set_fate(pb::RemovedOriginal::THINNED);
  shown.mutable_removed_original()->set_thinned_rate_hz(1000);
  EXPECT_FALSE(isSaid());
}

TEST_F(StoredGestureTest, isReadWithoutAPlanWhereItsProfileIsNotReadable) {
  bool readable = true;
  const LabCall garbling = [&](const pb::Request& request) -> Result<pb::Reply> {
    auto reply = instructor_->call(request);
    if (reply.ok() && request.has_get_session() && !readable)
      reply->mutable_session()->mutable_description()->set_profile_json("{}");
    return reply;
  };
  for (const bool each : {true, false}) {
    readable = each;
    const auto gesture = loadGesture(garbling, info_.description().session_id());
    ASSERT_TRUE(gesture.ok()) << gesture.error().message;
    EXPECT_EQ((*gesture)->plan_W.has_value(), readable) << "the sample's exercise has a plan";
    EXPECT_EQ((*gesture)->notes.empty(), readable);
  }
}

TEST_F(StoredGestureTest, aMissingPlanReplyDoesNotPreventReading) {
  const LabCall deaf = [&](const pb::Request& request) -> Result<pb::Reply> {
    if (request.has_list_exercises()) return Error{ErrorCode::kDenied, "not for you"};
    return instructor_->call(request);
  };
  const auto gesture = loadGesture(deaf, info_.description().session_id());
  ASSERT_TRUE(gesture.ok()) << gesture.error().message;
  EXPECT_EQ((*gesture)->samples.size(), samples_.size());
  ASSERT_EQ((*gesture)->notes.size(), 1u);
  EXPECT_EQ((*gesture)->notes[0], "the exercise's plan: not for you");
}

TEST_F(StoredGestureTest, missingPartsAreReported) {
  EXPECT_EQ(loadGesture(call(), std::string(16, 'x')).error().code, ErrorCode::kNotFound);
  LoadProgress progress;
  progress.stop = true;
  EXPECT_FALSE(loadGesture(call(), info_.description().session_id(), {}, &progress).ok());
}

}  // namespace
}  // namespace needlelab
