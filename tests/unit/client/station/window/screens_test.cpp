// Compares every screen of the trainee's window with its reference picture, and checks the requests made by
// its keys and buttons.
#include <gmock/gmock.h>

#include <cmath>
#include <regex>

#include "client/station/run/lesson/local_score.h"
#include "common/haptics/gate/force_gate.h"
#include "common/scoring/measures/measures.h"
#include "common/scoring/targets/miss.h"
#include "tests/unit/client/station/window/drawn_letters.h"
#include "tests/unit/client/station/window/stage.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class Screens : public TraineeStage {
 protected:
  /// Returns the share of pixels that change when `change` is applied to the board.
  double changes(const std::function<void()>& change) {
    const RgbaImage before = picture();
    change();
    return shareThatDiffers(before, picture(), 28);
  }
  /// The server asks for tom's code, or says that the last one was wrong.
  void askForCode(bool wrong) {
    board_.change([&](BoardState& state) {
      state.code_question =
          wrong
              ? CodeQuestion{"tom", "this is not the code of tom; 4 tries left", true, 2}
              : CodeQuestion{"tom", "tom has a code: type the PIN or hold the badge to the reader", false, 1};
    });
  }
  void showEnd(bool passed) {
    showLesson(6);
    picture(2);
    auto outcome = std::make_shared<LessonOutcome>();
    pb::Exercise exercise;
    const auto require = [&](const char* measure, double min, double max) {
      auto* requirement = exercise.add_requirements();
      requirement->set_measure(measure);
      if (min > 0) requirement->set_min(min);
      if (max > 0) requirement->set_max(max);
    };
    require("target_reached", 1, 0);
    require("time_at_target_s", passed ? 0.1 : 9, 0);
    require("peak_force_n", 0, passed ? 9 : 0.2);
    require("entries", 0, 2);
    const auto measures = scoreGesture(sample_.samples, 1000, sample_.profile, {}, &exercise);
    outcome->summary.score_json = scoreJson(measures);
    outcome->summary.score_source = "server";
    outcome->summary.state = "COMPLETE";
    outcome->summary.has_server = true;
    outcome->summary.exercise = "shoulder-bursa";
    outcome->summary.servo.end = ServoEnd::kTicksDone;
    outcome->curve = gestureCurve(sample_.samples, sample_.model->limb);
    outcome->summary.miss = passed
                                ? missOf(sample_.samples, {}, sample_.profile, {})
                                : Miss{Miss::At::kFurthest, false, {}, 0.0039, 0.0021, {"towards the head"}};
    board_.change([&](BoardState& state) {
      state.stage = Stage::kEnd;
      state.outcome = outcome;
      state.choice = {"tom", "shoulder-bursa", false};
    });
  }
};

TEST_F(Screens, start) {
  showStart();
  EXPECT_TRUE(looksLike(picture(), referenceOf("start")));
}

TEST_F(Screens, startBeginsByEnterOrButton) {
  showStart();
  picture();
  press(screen(), GLFW_KEY_ENTER);
  BoardRequest request = board_.waitForRequest(0ms);
  ASSERT_EQ(request.kind, BoardRequest::Kind::kBegin);
  EXPECT_EQ(request.choice, (LessonChoice{"tom", "shoulder-bursa", false}));
  // select another trainee and exercise by keys
  press(screen(), GLFW_KEY_RIGHT);
  press(screen(), GLFW_KEY_UP);
  press(screen(), GLFW_KEY_ENTER);
  request = board_.waitForRequest(0ms);
  EXPECT_EQ(request.choice.trainee, "zoe");
  EXPECT_EQ(request.choice.exercise, "knee-recess") << "nothing is assigned to zoe: by name";
}

TEST_F(Screens, startWithTheServerAwayAndALessonThatDidNotBegin) {
  showStart();
  board_.change([](BoardState& state) {
    state.server = "server away, 3 chunks wait";
    state.server_away = true;
    state.lists.exercises[1].cached_revision.reset();
    state.trouble = "exercise knee-recess was never fetched from a server";
    state.device = {"Virtuose 6D Desktop", "no library: install the vendor's package", false, true};
    state.next = SuggestedExercise{"ines", "knee-recess"};
  });
  EXPECT_TRUE(looksLike(picture(), referenceOf("start_trouble")));
  press(screen(), GLFW_KEY_RIGHT);
  picture(2);
  EXPECT_EQ(window_->shown().trouble, "") << "it is not for the next trainee";
}

TEST_F(Screens, aTypedNameNeedsNoClickAndBackspaceCorrectsIt) {
  showStart();
  picture();
  for (int i = 0; i < 2; ++i) press(screen(), GLFW_KEY_DOWN);  // knee-recess
  surface_->typeText("mix");
  picture(5);
  EXPECT_THAT(DrawnLetters().all(), HasSubstr("Typing\"mix\":Backspacecorrects.Nonameherehasthisinit."));
  press(screen(), GLFW_KEY_BACKSPACE);
  picture(2);
  EXPECT_THAT(DrawnLetters().all(),
              AllOf(HasSubstr("Typing\"mi\":Backspacecorrects.Righttakesmia."), Not(HasSubstr("zoe"))));
  surface_->typeText("a");
  picture(2);
  press(screen(), GLFW_KEY_ENTER);
  BoardRequest request = board_.waitForRequest(0ms);
  EXPECT_EQ(request.kind, BoardRequest::Kind::kBegin);
  EXPECT_EQ(request.choice, (LessonChoice{"mia", "knee-recess", false})) << "the exercise stays";
}

TEST_F(Screens, aBadgeThatWasNotAskedForBeginsNothingAndIsNotLeft) {
  showStart();
  board_.change([](BoardState& state) {
    state.lists.asks_code = {"tom"};
    state.choice.trainee = "mia";
  });
  picture();
  surface_->typeText("08154711");
  picture(9);
  press(screen(), GLFW_KEY_ENTER);
  picture(2);
  EXPECT_FALSE(board_.requestWaits());
  EXPECT_THAT(DrawnLetters().all(), Not(HasSubstr("0815")));
}

TEST_F(Screens, startShowsTheLadderAndBeginsTheNextStepByOneKey) {
  showStart();
  addLadder(wallNowNs());
  EXPECT_TRUE(looksLike(picture(), referenceOf("start_ladder")));
  EXPECT_EQ(board_.waitForRequest(0ms).kind, BoardRequest::Kind::kNothing) << "the standing is of now";
  press(screen(), GLFW_KEY_ENTER);
  EXPECT_EQ(board_.waitForRequest(0ms).choice, (LessonChoice{"tom", "knee-recess", false}));
  // another trainee, not known yet: the window asks for them by itself
  press(screen(), GLFW_KEY_RIGHT);
  const BoardRequest request = board_.waitForRequest(0ms);
  EXPECT_EQ(request.kind, BoardRequest::Kind::kTrainee);
  EXPECT_EQ(request.choice.trainee, "zoe");
}

TEST_F(Screens, startOffLineShowsTheLadderOfItsTime) {
  showStart();
  addLadder(1'795'000'000'000'000'000);
  board_.change([](BoardState& state) {
    state.server = "server away";
    state.server_away = true;
  });
  EXPECT_TRUE(looksLike(picture(), referenceOf("start_ladder_away")));
}

TEST_F(Screens, startAsksForTheCodeOfTheTraineeAndEnterBegins) {
  showStart();
  askForCode(false);
  EXPECT_TRUE(looksLike(picture(), referenceOf("start_code")));
  surface_->typeText("badge-4711");
  picture(2);
  press(screen(), GLFW_KEY_ENTER);
  const BoardRequest request = board_.waitForRequest(0ms);
  ASSERT_EQ(request.kind, BoardRequest::Kind::kBegin);
  EXPECT_EQ(request.choice, (LessonChoice{"tom", "shoulder-bursa", false}));
  EXPECT_EQ(request.code, "badge-4711");
}

TEST_F(Screens, startAcceptsABadgeAtOnceForAKnownCode) {
  showStart();
  board_.change([](BoardState& state) { state.lists.asks_code = {"tom"}; });
  picture(4);
  // the arrow keys still choose
  press(screen(), GLFW_KEY_RIGHT);
  picture(4);
  press(screen(), GLFW_KEY_LEFT);
  picture(4);
  press(screen(), GLFW_KEY_DOWN);  // another trainee starts a new choice
  surface_->typeText("badge-4711");
  picture(2);
  press(screen(), GLFW_KEY_ENTER);
  BoardRequest request = board_.waitForRequest(0ms);
  while (request.kind == BoardRequest::Kind::kTrainee) request = board_.waitForRequest(0ms);
  ASSERT_EQ(request.kind, BoardRequest::Kind::kBegin);
  EXPECT_EQ(request.choice.trainee, "tom");
  EXPECT_EQ(request.code, "badge-4711");
}

TEST_F(Screens, startReadsABadgeOnAFrenchKeyboardAndDigitsOfAnyScript) {
  showStart();
  askForCode(false);
  picture();
  // a reader's 471221, which AZERTY turns into the signs below the digits
  const std::pair<int, const char*> keys[] = {{GLFW_KEY_4, "'"}, {GLFW_KEY_7, "è"}, {GLFW_KEY_1, "&"},
                                              {GLFW_KEY_2, "é"}, {GLFW_KEY_2, "é"}, {GLFW_KEY_1, "&"}};
  for (const auto& [key, sign] : keys) {
    surface_->setKey(key, true);
    surface_->typeText(sign);
    surface_->setKey(key, false);
  }
  picture(14);
  surface_->typeText("٣&");  // without a digit's key: as typed
  picture(2);
  press(screen(), GLFW_KEY_ENTER);
  EXPECT_EQ(board_.waitForRequest(0ms).code, "4712213&");
}

TEST_F(Screens, startReportsAWrongCodeAndClearsTheField) {
  showStart();
  askForCode(false);
  picture();
  surface_->typeText("0000");
  picture(2);
  askForCode(true);
  EXPECT_TRUE(looksLike(picture(), referenceOf("start_code_wrong")));
  surface_->typeText("4711");
  picture(2);
  press(screen(), GLFW_KEY_ENTER);
  EXPECT_EQ(board_.waitForRequest(0ms).code, "4711");
}

TEST_F(Screens, keysInTheFieldOfTheCodeDoNothingElse) {
  showStart();
  askForCode(false);
  picture();
  surface_->typeText("47");
  picture(2);
  for (const int key : {GLFW_KEY_DOWN, GLFW_KEY_UP, GLFW_KEY_UP, GLFW_KEY_RIGHT, GLFW_KEY_RIGHT, GLFW_KEY_O})
    press(screen(), key);
  EXPECT_FALSE(board_.requestWaits());
  press(screen(), GLFW_KEY_ENTER);
  EXPECT_FALSE(board_.requestWaits()) << "too short to be a code";
  picture();
  surface_->typeText("11");
  picture(2);
  press(screen(), GLFW_KEY_ENTER);
  const BoardRequest request = board_.waitForRequest(0ms);
  ASSERT_EQ(request.kind, BoardRequest::Kind::kBegin);
  EXPECT_EQ(request.code, "4711") << "the field continues after the Enter that was too early";
  EXPECT_EQ(request.choice, (LessonChoice{"tom", "shoulder-bursa", false})) << "neither of both was changed";
}

TEST_F(Screens, theFieldOfTheCodeIsGoneWithTheTrainee) {
  showStart();
  askForCode(false);
  picture();
  surface_->typeText("4711");
  picture(2);
  click(screen(), 1000, 712);  // below, outside the field
  press(screen(), GLFW_KEY_RIGHT);
  const RgbaImage without = picture();
  board_.change([](BoardState& state) { state.code_question.reset(); });
  EXPECT_LT(shareThatDiffers(without, picture(), 28), 1e-4) << "there was no field any more";
  press(screen(), GLFW_KEY_ENTER);
  const BoardRequest request = board_.waitForRequest(0ms);
  EXPECT_EQ(request.choice.trainee, "zoe");
  EXPECT_EQ(request.code, "") << "the typed code was tom's";
}

TEST_F(Screens, preparingCanBeCalledOff) {
  showStart();
  board_.change([](BoardState& state) {
    state.stage = Stage::kPreparing;
    state.preparing = "fetching the exercise";
  });
  EXPECT_TRUE(looksLike(picture(), referenceOf("preparing")));
}

TEST_F(Screens, anExamAsksBeforeItBeginsAndIsCalledAnExam) {
  showStart();
  board_.change([](BoardState& state) { state.stage = Stage::kPreparing; });
  const auto asks = [&](const char* terms) {
    board_.examWaits(terms);
    picture(8);
    return window_->shownFrame().question == ShownQuestion::kBeginExam;
  };
  EXPECT_TRUE(asks("1 attempt left, 5 min, counts"));
  EXPECT_TRUE(looksLike(picture(), referenceOf("exam_question")));
  press(screen(), GLFW_KEY_ENTER);
  EXPECT_FALSE(requests_.takeExamBegin());
  EXPECT_TRUE(requests_.takeStop()) << "not now";
  EXPECT_TRUE(asks("counts"));
  EXPECT_FALSE(asks("")) << "an instructor stopped it";
  EXPECT_TRUE(asks("counts"));
  press(screen(), GLFW_KEY_DELETE);
  EXPECT_TRUE(requests_.takeExamBegin());
  EXPECT_FALSE(asks(""));
  for (const bool ends : {false, true}) {
    const auto show = [&] { ends ? showEnd(false) : showLesson(2.4); };
    exam_ = false;
    show();
    picture();
    exam_ = true;
    EXPECT_GT(changes(show), 1e-3) << "its title, " << ends;
  }
}

TEST_F(Screens, theChosenExerciseOfALongListIsOnTheScreen) {
  showStart();
  board_.change([](BoardState& state) {
    for (int i = 10; i < 60; ++i) {
      ListedExercise& listed = state.lists.exercises.emplace_back();
      listed.exercise_id = listed.name = std::to_string(i);
      listed.cached_revision = 1;
    }
  });
  picture();
  board_.change([](BoardState& state) { state.choice.exercise = "58"; });
  picture();
  EXPECT_GT(changes([&] { board_.change([](BoardState& state) { state.choice.exercise = "57"; }); }), 5e-4);
}

TEST_F(Screens, lessonWithTheUsualAids) {
  showLesson(2.4);
  EXPECT_TRUE(looksLike(picture(), referenceOf("lesson")));
}

TEST_F(Screens, lessonInLargeLetters) {
  surface_->setFontScale(1.5);
  showLesson(2.4);
  EXPECT_TRUE(looksLike(picture(), referenceOf("lesson_large")));
}

TEST_F(Screens, lessonWithUltrasound) {
  AidList aids = usualAids();
  aids.Add(pb::Exercise::ULTRASOUND);
  showLesson(3.2, aids);
  PictureTolerance tolerance;
  tolerance.share_of_pixels = 0.03;  // The screen shows the measured cost, which varies.
  EXPECT_TRUE(looksLike(picture(), referenceOf("lesson_ultrasound"), tolerance));
}

TEST_F(Screens, lessonByFeel) {
  showLesson(2.4, AidList{});
  EXPECT_TRUE(looksLike(picture(), referenceOf("lesson_by_feel")));
}

// Each aid at once hides the item it names.
TEST_F(Screens, everyAidShowsSomethingAndCanBeTakenAway) {
  with_plan_ = true;
  standing_.alarms = {{Alarm::kHazard, "axillary nerve"}};
  for (int number = pb::Exercise::Aid_MIN + 1; number <= pb::Exercise::Aid_MAX; ++number) {
    AidList all = usualAids();
    all.Add(pb::Exercise::ULTRASOUND);
    if (number == pb::Exercise::STEPS) all.Add(number);  // they take room from the picture
    showLesson(2.4, all);
    picture();
    AidList less;
    for (const int aid : all)
      if (aid != number) less.Add(aid);
    EXPECT_GT(changes([&] {
                board_.aids({"ines", less, false});
              }),
              5e-4)
        << pb::Exercise::Aid_Name(static_cast<pb::Exercise::Aid>(number));
  }
}

TEST_F(Screens, aDemonstrationIsShownAndStoppedByItsKey) {
  const auto says = [&](const char* words) { return DrawnLetters().all().find(words) != std::string::npos; };
  showLesson(0.2);
  picture(5);
  EXPECT_TRUE(says("Showme[H]"));
  press(screen(), GLFW_KEY_H);
  // it is computed on another thread
  for (int frame = 0; frame < 100'000 && !says("Thisisademonstration"); ++frame) picture();
  EXPECT_TRUE(says("Thisisademonstrationbyasimulatedhand"));
  EXPECT_TRUE(says("Stop[H]"));
  press(screen(), GLFW_KEY_H);
  picture(2);
  EXPECT_FALSE(says("demonstration"));
  EXPECT_TRUE(says("tom,attempt2"));
}

TEST_F(Screens, anExamHasNeitherDemonstrationNorSteps) {
  exam_ = true;
  AidList aids = usualAids();
  aids.Add(pb::Exercise::STEPS);
  showLesson(0.2, aids);
  picture(5);
  press(screen(), GLFW_KEY_H);
  picture(5);
  for (const char* words : {"Showme", "demonstration", "Step1", "Step2"})
    EXPECT_EQ(DrawnLetters().all().find(words), std::string::npos) << words;
}

TEST_F(Screens, lessonWithSteps) {
  AidList aids = usualAids();
  aids.Add(pb::Exercise::STEPS);
  showLesson(0.2, aids, true);
  EXPECT_TRUE(looksLike(picture(), referenceOf("lesson_steps")));
}

TEST_F(Screens, aFaultIsShownOverThePictureAndEnterAcknowledges) {
  showLesson(2.4);
  standing_.fault = Fault::kTipTooFast;
  board_.status(standing_);
  EXPECT_TRUE(looksLike(picture(), referenceOf("lesson_fault")));
  EXPECT_FALSE(requests_.takeAcknowledgement());
  press(screen(), GLFW_KEY_ENTER);
  EXPECT_TRUE(requests_.takeAcknowledgement());
}

TEST_F(Screens, enterWithoutAFaultAcknowledgesNothing) {
  showLesson(1);
  picture();
  press(screen(), GLFW_KEY_ENTER);
  EXPECT_FALSE(requests_.takeAcknowledgement());
  EXPECT_FALSE(requests_.takeStop());
}

TEST_F(Screens, whatInstructorsSayAndWant) {
  showLesson(2.4);
  board_.change([](BoardState& state) {
    const std::int64_t noon_ns = 1'700'000'000'000'000'000;
    state.messages = {{"ines", "Aspirate before you inject.", noon_ns, 1},
                      {"ines", "Good. A little slower near the bursa, and keep the needle upright.",
                       noon_ns + 8'000'000'000, 2}};
    state.next = SuggestedExercise{"ines", "shoulder-bursa-frail"};
  });
  standing_.hold = "no one holds the handle";
  standing_.condition = kDeviceReleased;
  board_.status(standing_);
  EXPECT_TRUE(looksLike(picture(), referenceOf("lesson_messages")));
}

TEST_F(Screens, escapeAsksEnterGoesOnAndDeleteEnds) {
  showLesson(1);
  picture();
  EXPECT_EQ(window_->shownFrame().question, ShownQuestion::kNone);
  for (const int harmless : {GLFW_KEY_ESCAPE, GLFW_KEY_ENTER}) {
    press(screen(), GLFW_KEY_ESCAPE);
    picture(2);
    EXPECT_EQ(window_->shownFrame().question, ShownQuestion::kEndLesson);
    press(screen(), harmless);
    picture(2);
    EXPECT_EQ(window_->shownFrame().question, ShownQuestion::kNone);
  }
  press(screen(), GLFW_KEY_DELETE);
  EXPECT_FALSE(requests_.takeStop()) << "it was called off";
  press(screen(), GLFW_KEY_ESCAPE);
  picture(2);
  press(screen(), GLFW_KEY_DELETE);
  EXPECT_TRUE(requests_.takeStop());
}

TEST_F(Screens, mouseAndKeysBecomeWishesOfTheHand) {
  showLesson(0, usualAids(), true);
  picture();
  SteeringTarget request;
  ASSERT_TRUE(steering_->fetch(request));
  EXPECT_EQ(request.X_WT.p, (Vec3{0, 0, 0.03}));
  // seen from above, right is W's y
  press(screen(), GLFW_KEY_3);
  surface_->moveMouse(400, 400);
  picture(2);
  surface_->setMouseButton(0, true);
  picture(2);
  surface_->moveMouse(350, 400);
  picture(2);
  surface_->setMouseButton(0, false);
  picture(2);
  ASSERT_TRUE(steering_->fetch(request));
  EXPECT_NEAR(request.X_WT.p.y, -50 * PointerSteering::kAcross_m_per_px, 1e-9);
  EXPECT_NEAR(request.X_WT.p.z, 0.03, 1e-9);
  surface_->scroll(3);
  picture(2);
  ASSERT_TRUE(steering_->fetch(request));
  EXPECT_NEAR(request.X_WT.p.z, 0.03 - 3 * PointerSteering::kWheel_m, 1e-9);
  EXPECT_EQ(window_->shownFrame().aim_WT_m, request.X_WT.p);
  // W held for ten frames of 1/30 s
  surface_->setKey(GLFW_KEY_W, true);
  picture(10);
  surface_->setKey(GLFW_KEY_W, false);
  picture(2);
  ASSERT_TRUE(steering_->fetch(request));
  EXPECT_NEAR(request.X_WT.p.z, 0.027 - PointerSteering::kAdvance_mps * 10 / 30,
              PointerSteering::kAdvance_mps / 30);
  // The side panel does not belong to the picture.
  const Vec3 before = request.X_WT.p;
  surface_->moveMouse(1100, 400);
  picture(2);
  surface_->scroll(5);
  picture(2);
  ASSERT_TRUE(steering_->fetch(request));
  EXPECT_EQ(request.X_WT.p, before);
}

TEST_F(Screens, endOfALessonThatWasNotPassed) {
  showEnd(false);
  EXPECT_TRUE(looksLike(picture(), referenceOf("end_not_yet")));
  press(screen(), GLFW_KEY_ENTER);
  EXPECT_FALSE(board_.requestWaits()) << "that was meant for the lesson";
  picture(30);
  press(screen(), GLFW_KEY_ENTER);
  const BoardRequest request = board_.waitForRequest(0ms);
  EXPECT_EQ(request.kind, BoardRequest::Kind::kBegin);
  EXPECT_EQ(request.choice.exercise, "shoulder-bursa") << "the next try";
}

TEST_F(Screens, theEndStepsThroughTheLastInsertion) {
  showEnd(false);
  picture(30);
  // by the samples alone: from the entry to the deepest point, and to the exit
  std::uint64_t from = 0, to = 0, deepest = 0;
  for (const GestureSample& sample : sample_.samples) {
    if (sample.layer < 0) continue;
    if (to == 0 || sample.tick > to + 1) from = deepest = sample.tick;
    to = sample.tick;
    if (sample.insertion_m > sample_.samples[deepest].insertion_m) deepest = sample.tick;
  }
  double seconds = 1e-3 * static_cast<double>(deepest - from);
  const auto shows = [&] {
    static const std::regex line("Lastinsertion,([0-9.]+)sof([0-9.]+)s:([0-9.]+)N,in([a-z]+)");
    std::smatch found;
    const std::string all = DrawnLetters().all();
    ASSERT_TRUE(std::regex_search(all, found, line)) << all;
    EXPECT_NEAR(std::stod(found[1]), seconds, 0.025) << "kept 100 times a second";
    EXPECT_NEAR(std::stod(found[2]), 1e-3 * static_cast<double>(to - from), 0.025);
    const auto tick = from + static_cast<std::uint64_t>(1e3 * std::stod(found[1]));
    EXPECT_EQ(found[4], layerName(*sample_.scene, sample_.samples[tick].layer));
  };
  shows();
  const RgbaImage before = picture();
  for (int i = 0; i < 4; ++i) press(screen(), GLFW_KEY_LEFT);
  seconds -= 1;
  picture(2);
  shows();
  EXPECT_GT(shareThatDiffers(before, picture(), 28), 5e-4) << "the needle, and the line in the plot";
  press(screen(), GLFW_KEY_RIGHT);
  seconds += 0.25;
  picture(2);
  shows();
  EXPECT_FALSE(board_.requestWaits());
}

TEST_F(Screens, theEndOfAnExamWithoutItsResultShowsNothingOfTheNeedle) {
  showEnd(false);
  board_.change([](BoardState& state) {
    auto held = std::make_shared<LessonOutcome>(*state.outcome);
    held->summary.results_from_unix_ns = 1'780'495'200'000'000'000;
    held->summary.miss.reset();
    held->curve.clear();
    state.outcome = held;
  });
  picture(30);
  EXPECT_THAT(DrawnLetters().all(), AllOf(HasSubstr("Thisisanexam."), Not(HasSubstr("insertion"))));
  const RgbaImage before = picture();
  press(screen(), GLFW_KEY_LEFT);
  EXPECT_LT(shareThatDiffers(before, picture(), 28), 1e-5);
}

TEST_F(Screens, endOfALessonThatWasPassedOffersWhatTheInstructorWants) {
  showEnd(true);
  board_.nextExercise("ines", "knee-recess");
  EXPECT_TRUE(looksLike(picture(30), referenceOf("end_passed")));
  press(screen(), GLFW_KEY_ENTER);
  BoardRequest request = board_.waitForRequest(0ms);
  EXPECT_EQ(request.kind, BoardRequest::Kind::kBegin);
  EXPECT_EQ(request.choice.exercise, "knee-recess");
  EXPECT_EQ(request.choice.trainee, "tom");
  press(screen(), GLFW_KEY_O);
  request = board_.waitForRequest(0ms);
  EXPECT_EQ(request.kind, BoardRequest::Kind::kStart);
}

TEST_F(Screens, aBadgeAtTheEndLeadsToTheStartAndBeginsNothing) {
  showEnd(true);
  picture(30);
  for (const char* piece : {"08", "154711"}) {
    surface_->typeText(piece);
    picture(1);
  }
  press(screen(), GLFW_KEY_ENTER);
  EXPECT_EQ(board_.waitForRequest(0ms).kind, BoardRequest::Kind::kStart);
}

TEST_F(Screens, quittingAsksFirstAndEndsTheLesson) {
  showLesson(1);
  picture();
  for (const int harmless : {GLFW_KEY_ESCAPE, GLFW_KEY_ENTER}) {
    window_->askToQuit();
    picture(2);
    EXPECT_EQ(window_->shownFrame().question, ShownQuestion::kQuit);
    press(screen(), harmless);
    EXPECT_FALSE(requests_.takeStop());
    EXPECT_FALSE(board_.requestWaits()) << "it was called off";
    picture(2);
  }
  window_->askToQuit();
  picture(2);
  press(screen(), GLFW_KEY_DELETE);
  EXPECT_TRUE(requests_.takeStop());
  EXPECT_EQ(board_.waitForRequest(0ms).kind, BoardRequest::Kind::kQuit);
}

TEST_F(Screens, theFrameLogGivesTheSampleAndStartReadiness) {
  showStart();
  picture(2);
  EXPECT_EQ(window_->shownFrame().stage, Stage::kStart);
  EXPECT_TRUE(window_->shownFrame().can_begin);
  askForCode(false);
  picture(2);
  EXPECT_FALSE(window_->shownFrame().can_begin) << "the code is missing";
  EXPECT_TRUE(std::isnan(window_->shownFrame().p_WT_m.x));
  showLesson(1);
  picture();
  const ShownFrame frame = window_->shownFrame();
  const GestureSample& last = sample_.samples[999];
  EXPECT_EQ(frame.stage, Stage::kLesson);
  EXPECT_FALSE(frame.can_begin);
  EXPECT_EQ(frame.lesson, 1u);
  EXPECT_NEAR(frame.lesson_s, 1e-3 * static_cast<double>(last.tick), 1e-12);
  EXPECT_EQ(frame.p_WT_m, (Vec3{last.p_WT_m[0], last.p_WT_m[1], last.p_WT_m[2]}));
  EXPECT_EQ(frame.plunger, last.plunger);
  EXPECT_TRUE(std::isnan(frame.aim_WT_m.x)) << "the hand is not steered";
  // 0.7 s of frames of 1/30 s
  showEnd(false);
  picture(1);
  EXPECT_EQ(window_->shownFrame().stage, Stage::kEnd);
  EXPECT_FALSE(window_->shownFrame().can_begin);
  picture(20);
  EXPECT_FALSE(window_->shownFrame().can_begin);
  picture(2);
  EXPECT_TRUE(window_->shownFrame().can_begin);
}

TEST_F(Screens, enterAnswersTheQuestionAndNotTheScreenUnderIt) {
  showEnd(false);
  picture(30);
  window_->askToQuit();
  picture(2);
  press(screen(), GLFW_KEY_ENTER);
  EXPECT_FALSE(board_.requestWaits()) << "no next try";
  picture(2);
  press(screen(), GLFW_KEY_ENTER);
  EXPECT_EQ(board_.waitForRequest(0ms).kind, BoardRequest::Kind::kBegin) << "now it is the screen's again";
}

TEST_F(Screens, aHandIsRaisedAndLoweredOnEveryScreenOfAStationWithAServer) {
  showLesson(1);
  const auto serverSays = [&](const char* words) {
    LessonStatus status;
    status.server = words;
    board_.status(status);
    picture(2);
  };
  const auto pressF2 = [&] {
    press(screen(), GLFW_KEY_F2);
    picture(2);
    return requests_.handRaised();
  };
  serverSays("");
  EXPECT_FALSE(pressF2()) << "without a server no instructor sees it";
  serverSays("server live");
  EXPECT_TRUE(pressF2());
  EXPECT_THAT(DrawnLetters().all(), HasSubstr("theinstructorseesit.F2lowersit."));
  serverSays("server away, 3 chunks wait");
  EXPECT_THAT(DrawnLetters().all(), HasSubstr("callout.F2lowersit."));
  showEnd(true);
  EXPECT_FALSE(pressF2());
  EXPECT_THAT(DrawnLetters().all(), Not(HasSubstr("Yourhandisup")));
}

TEST_F(Screens, aStudentsStationDoesNotAskBecauseItCannotBeQuit) {
  auto window = TraineeWindow::make(board_, requests_, false);
  ASSERT_TRUE(window.ok()) << window.error().message;
  window_ = std::move(*window);
  showLesson(1);
  picture();
  window_->askToQuit();
  picture(2);
  press(screen(), GLFW_KEY_DELETE);
  EXPECT_FALSE(requests_.takeStop());
  EXPECT_FALSE(board_.requestWaits());
}

TEST_F(Screens, aStationThatCannotWorkGivesTheReason) {
  board_.change([](BoardState& state) {
    state.stage = Stage::kFailed;
    state.trouble =
        "the spool /var/lib/needlelab/spool cannot be opened: Permission denied; choose another with --spool";
  });
  EXPECT_TRUE(looksLike(picture(), referenceOf("failed")));
}

}  // namespace
}  // namespace needlelab::test
