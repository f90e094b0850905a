/// The trainee's window off screen, with a board that the test fills.
#pragma once

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "client/station/run/io/options.h"
#include "client/station/window/trainee_window.h"
#include "tests/support/pictures/picture_check.h"
#include "tests/support/pictures/view_stage.h"
#include "tests/support/view_lesson/sample_lesson.h"

namespace needlelab::test {

class TraineeStage : public ViewStage {
 protected:
  TraineeStage() {
    ::setenv("TZ", "UTC", 1);
    options_.width_px = 1280;
    options_.height_px = 720;
    options_.viewing.emplace();
  }
  void SetUp() override {
    ViewStage::SetUp();
    if (surface_ == nullptr) return;
    auto window = TraineeWindow::make(board_, requests_);
    ASSERT_TRUE(window.ok()) << window.error().message;
    window_ = std::move(*window);
  }
  void TearDown() override {
    window_.reset();
    ViewStage::TearDown();
  }

  std::function<void()> screen() {
    return [this] { window_->frame(); };
  }
  RgbaImage picture(int frames = 4) { return draw(screen(), frames); }

  /// Shows the Start screen, with a server and three exercises.
  void showStart() {
    board_.change([](BoardState& state) {
      state.stage = Stage::kStart;
      state.server = "server";
      state.device = {"simulated Virtuose 6D Desktop", "you move it with mouse and keys", true, true};
      state.lists.trainees = {"mia", "tom", "zoe"};
      state.lists.assigned = {{"tom", "shoulder-bursa"}};
      const char* names[][2] = {{"ball-free-practice", "Training ball: free practice"},
                                {"knee-recess", "Knee: suprapatellar recess"},
                                {"shoulder-bursa", "Shoulder: subacromial bursa"}};
      for (const auto& [id, name] : names) {
        ListedExercise exercise;
        exercise.exercise_id = id;
        exercise.name = name;
        exercise.cached_revision = 1;
        state.lists.exercises.push_back(exercise);
        state.lists.descriptions.push_back(
            {id, name, "", "A thin target between muscle and tendon: stop when the resistance drops."});
      }
      state.choice = {"tom", "shoulder-bursa", false};
    });
  }

  /// Gives the Start screen a server's data: tom has passed the first of a course's three steps, the last is
  /// locked; one exercise is assigned alone, one is free to practise. Two people share a full name.
  void addLadder(std::int64_t now_unix_ns) {
    Curriculum curriculum;
    const auto add = [&](const char* id, const char* name, const char* course_id, const char* course) {
      curriculum.exercises.push_back({id, name, "", "", course_id, course});
    };
    add("ball-free-practice", "Training ball: free practice", "basics", "Needle injection: the basics");
    add("knee-recess", "Knee: suprapatellar recess", "basics", "Needle injection: the basics");
    add("shoulder-bursa", "Shoulder: subacromial bursa", "basics", "Needle injection: the basics");
    add("hip-joint", "Hip: joint space", "advanced", "Deep joints");
    add("epidural", "Spine: epidural space", "advanced", "Deep joints");
    curriculum.trainees = {{"mia", "Mia Meier"}, {"tom", "Tom Tailor"}, {"zoe", "Mia Meier"}};
    TraineeStanding& tom = curriculum.standings["tom"];
    tom.as_of_unix_ns = now_unix_ns;
    tom.courses = {"basics"};
    tom.exercises = {"hip-joint"};
    for (const ServerExercise& exercise : curriculum.exercises) {
      tom.steps.emplace_back();
      tom.steps.back().exercise_id = exercise.exercise_id;
    }
    tom.steps[0].done = true;
    tom.steps[1].attempts_left = 2;
    tom.steps[2].locked_by = {"knee-recess"};
    board_.change([&](BoardState& state) {
      state.lists.descriptions = curriculum.exercises;
      state.lists.curriculum = std::make_shared<const Curriculum>(std::move(curriculum));
      state.choice = {"tom", "", false};
    });
  }

  /// Shows a lesson at patient_ until `seconds` of it have been drawn.
  void showLesson(double seconds, const AidList& aids = usualAids(), bool steered = false) {
    if (sample_.samples.empty()) sample_ = sampleLesson(patient_);
    StationOptions options;
    options.profile_file = NEEDLELAB_SAMPLES "/" + patient_ + ".json";
    auto beginning = std::make_shared<LessonBeginning>();
    beginning->lesson = *lessonOfFile(options);
    pb::Exercise exercise;
    exercise.set_id("shoulder-bursa");
    exercise.set_profile_id("shoulder-adult");
    exercise.set_name("Shoulder: subacromial bursa");
    exercise.set_description("A thin target between muscle and tendon: stop when the resistance drops.");
    *exercise.mutable_aids()->mutable_allowed() = aids;
    if (with_plan_) {
      exercise.mutable_plan()->set_frame(pb::Exercise::Plan::LIMB);
      // oblique, beside the needle
      exercise.mutable_plan()->mutable_entry_m()->set_x(0.02);
      exercise.mutable_plan()->mutable_entry_m()->set_z(std::sqrt(0.06 * 0.06 - 0.02 * 0.02) - 0.06);
      exercise.mutable_plan()->mutable_direction()->set_x(-0.3);
      exercise.mutable_plan()->mutable_direction()->set_z(-1);
    }
    beginning->lesson.exercise = exercise;
    beginning->lesson.exam = exam_;
    beginning->lesson.attempt = 2;
    beginning->lesson.attempts_left = 3;
    beginning->trainee = "tom";
    if (steered) {
      steering_ = std::make_shared<HandSteering>();
      beginning->steering = steering_;
    }
    beginning->way = {{0, 0, 0}, {0, 0, -1}, 0.02};
    board_.began(beginning);
    const auto count = std::min(sample_.samples.size(), static_cast<std::size_t>(seconds * 1000));
    for (std::size_t i = 0; i < count; i += 20) {
      const auto from = sample_.samples.begin() + static_cast<std::ptrdiff_t>(i);
      SamplePiece piece;
      piece.samples = std::make_shared<const std::vector<GestureSample>>(
          from, from + static_cast<std::ptrdiff_t>(std::min<std::size_t>(20, count - i)));
      board_.piece(piece);
    }
    standing_.time_s = seconds;
    standing_.left_s = 60 - seconds;
    standing_.limit_runs = true;
    standing_.spool = "recording";
    standing_.server = "server";
    standing_.wakeup = {20'000, 30'000, 45'000, 60'000};
    standing_.waits = true;
    board_.status(standing_);
  }

  LessonBoard board_;
  LessonRequests requests_;
  std::unique_ptr<TraineeWindow> window_;
  std::string patient_ = "shoulder-adult";  ///< of showLesson, below the samples' folder
  SampleLesson sample_;
  bool exam_ = false;
  bool with_plan_ = false;  ///< whether the lesson's exercise has a planned line
  LessonStatus standing_;
  std::shared_ptr<HandSteering> steering_;
};

inline std::filesystem::path referenceOf(const std::string& name) {
  return std::filesystem::path(NEEDLELAB_REFERENCE) / (name + ".png");
}

}  // namespace needlelab::test
