// The letter sizes of the trainee's window on a 24-inch monitor at 2 m, by the font of each word; and
// everything shown fits in the window.
#include <gmock/gmock.h>
#include <imgui/imgui.h>
#include <imgui/imgui_internal.h>

#include <cmath>
#include <string>

#include "common/scoring/measures/measures.h"
#include "tests/unit/client/station/window/drawn_letters.h"
#include "tests/unit/client/station/window/stage.h"

namespace needlelab::test {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::MatchesRegex;
using testing::Not;

struct Resolution {
  int width_px, height_px;
};

class LettersTest : public TraineeStage, public testing::WithParamInterface<Resolution> {
 protected:
  LettersTest() {
    options_.width_px = GetParam().width_px;
    options_.height_px = GetParam().height_px;
    options_.viewing = Viewing{24 * 0.0254, 2};
  }

  /// By geometry: pixels along the diagonal.
  static double arcminOf(double height_px) {
    const double pixel_m = 24 * 0.0254 / std::hypot(GetParam().width_px, GetParam().height_px);
    return std::atan(height_px * pixel_m / 2) * 180 * 60 / std::acos(-1.0);
  }
  /// Of a capital letter, minus the partial pixel that its outline may be shorter.
  static double arcminOf(Letters letters) {
    const bool bold = letters == Letters::kHeading || letters == Letters::kFigure;
    const double share = capitalHeight(bold ? "/usr/share/fonts/truetype/dejavu/DejaVuSans-Bold.ttf"
                                            : "/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf") -
                         0.001;
    return arcminOf(share * static_cast<double>(fontOf(letters)->FontSize));
  }
  DrawnLetters drawn() {
    picture(5);
    const DrawnLetters letters;
    EXPECT_FALSE(letters.scaled());
    return letters;
  }
  /// Expects that no window of the last frame whose name contains this has more content than it shows or
  /// extends beyond the window.
  static void expectRoom(const std::string& name) {
    int windows = 0;
    for (const ImGuiWindow* window : ImGui::GetCurrentContext()->Windows) {
      if (!window->Active || std::string(window->Name).find(name) == std::string::npos) continue;
      ++windows;
      EXPECT_LE(window->ScrollMax.y, 0.5F) << window->Name;
      EXPECT_LE(window->ScrollMax.x, 1.0F) << window->Name;
      EXPECT_LE(window->Pos.y + window->Size.y, ImGui::GetIO().DisplaySize.y + 0.5F) << window->Name;
    }
    EXPECT_GT(windows, 0) << name;
  }
};

TEST_P(LettersTest, haveTheirAngles) {
  showLesson(2.4);
  picture(2);
  EXPECT_GE(arcminOf(Letters::kFigure), 16);
  EXPECT_GE(arcminOf(Letters::kHeading), 16);
  EXPECT_GE(arcminOf(Letters::kBody), 10);
  EXPECT_GE(arcminOf(Letters::kSmall), 10);
}

TEST_P(LettersTest, aLessonsMainFiguresAreLargeAndEverythingFits) {
  showLesson(2.4, usualAids(), true);
  const DrawnLetters letters = drawn();
  EXPECT_THAT(letters.in(Letters::kFigure), MatchesRegex("[0-9]\\.[0-9][0-9]+\\.[0-9]"))
      << "force, insertion";
  EXPECT_THAT(letters.in(Letters::kHeading),
              AllOf(HasSubstr("0:58left"), HasSubstr("goingin"), HasSubstr("inmuscle")));
  EXPECT_THAT(letters.all(),
              AllOf(HasSubstr("StationOK"), HasSubstr("forceonthehand"), HasSubstr("force,N")));
  for (const char* engineering : {"1000Hz", "missed", "chunk", "α"})
    EXPECT_THAT(letters.all(), Not(HasSubstr(engineering)));
  expectRoom("lesson");
  press(screen(), GLFW_KEY_I);
  EXPECT_THAT(drawn().all(), AllOf(HasSubstr("loop1000Hz:99%within45µs,0missed"), HasSubstr("tiltlimitα"),
                                   HasSubstr("Shift")));
  expectRoom("details");
  press(screen(), GLFW_KEY_I);
  EXPECT_THAT(drawn().all(), Not(HasSubstr("1000Hz")));
}

TEST_P(LettersTest, anInstructorsMessageIsLarge) {
  showLesson(2.4);
  board_.change([](BoardState& state) {
    state.messages = {{"ines", "Good. A little slower near the bursa, and keep the needle upright.",
                       1'700'000'000'000'000'000, 2}};
  });
  EXPECT_THAT(drawn().in(Letters::kHeading),
              HasSubstr("Good.Alittleslowernearthebursa,andkeeptheneedleupright."));
}

TEST_P(LettersTest, anAlarmIsLarge) {
  showLesson(2.4);
  standing_.fault = Fault::kTipTooFast;
  board_.status(standing_);
  EXPECT_THAT(drawn().in(Letters::kHeading), AllOf(HasSubstr("Theforcewastakenaway"),
                                                   HasSubstr("Taketheneedleoutofthetissue,thenpressEnter")));
  expectRoom("overlay");
}

TEST_P(LettersTest, theVerdictIsLargeAndByHowMuchItMissed) {
  showLesson(6);
  picture(2);
  auto outcome = std::make_shared<LessonOutcome>();
  pb::Exercise exercise;
  exercise.add_requirements()->set_measure("time_at_target_s");
  exercise.mutable_requirements(0)->set_min(9);
  outcome->summary.score_json =
      scoreJson(scoreGesture(sample_.samples, 1000, sample_.profile, {}, &exercise));
  outcome->summary.score_source = "server";
  outcome->summary.exercise = "shoulder-bursa";
  outcome->summary.miss = Miss{Miss::At::kFurthest, false, {}, 0.0039, 0.0021, {"towards the head"}};
  board_.change([&](BoardState& state) {
    state.stage = Stage::kEnd;
    state.outcome = outcome;
    state.choice = {"tom", "shoulder-bursa", false};
  });
  EXPECT_THAT(drawn().in(Letters::kHeading), AllOf(HasSubstr("Notpassed:1of1requirementsisnotmet"),
                                                   HasSubstr("Missedby2.1mmtowardsthehead,3.9mmtoodeep.")));
  expectRoom("end");
}

TEST_P(LettersTest, theStartHasRoomForItsHeadings) {
  showStart();
  EXPECT_THAT(drawn().in(Letters::kHeading),
              AllOf(HasSubstr("Trainee"), HasSubstr("Exercise"), HasSubstr("Thisstation")));
  expectRoom("start");
  board_.change([](BoardState& state) {
    state.server = "server away, 3 chunks wait";
    state.server_away = true;
  });
  EXPECT_THAT(drawn().all(), AllOf(HasSubstr("Theserverisunreachable"), Not(HasSubstr("chunks"))));
}

TEST_P(LettersTest, aLongDescriptionIsWholeBeforeALesson) {
  showStart();
  const std::string description =
      "From the side, below the acromion: find its edge by feel, take the cap off, go through the deltoid "
      "muscle to the bursa, stop where the resistance drops, aspirate, and inject slowly.";
  board_.change([&](BoardState& state) {
    for (int i = 0; i < 12; ++i) {
      ListedExercise& listed = state.lists.exercises.emplace_back();
      listed.exercise_id = "more-" + std::to_string(i);
      listed.name = "A further exercise with a name that is longer than the list is wide";
      listed.cached_revision = 1;
    }
    state.lists.exercises[9].exercise_id = "long";
    state.lists.descriptions.push_back({"long", "", "", description});
    state.choice.exercise = "long";
  });
  std::string whole = description;
  std::erase(whole, ' ');
  EXPECT_THAT(drawn().all(), AllOf(HasSubstr(whole), HasSubstr("namethatislongerthanthelistiswide")));
  EXPECT_THAT(drawn().all(), Not(HasSubstr("…")));
}

TEST_P(LettersTest, aBodysLadderHasWholeNames) {
  const SampleLesson body = sampleLesson("volumes/shoulder-median");
  Moment now;
  now.layer = -1;
  showStart();
  const double width_px = 0.16 * GetParam().width_px, height_px = 0.33 * GetParam().height_px;
  draw(
      [&] {
        beginScreen("ladder");
        layerLadder(*body.scene, now, usualAidSet(),
                    {static_cast<float>(width_px), static_cast<float>(height_px)});
        endScreen();
      },
      3);
  const std::string all = DrawnLetters().all();
  for (const char* name : {"subcutaneousfat", "deltoidmuscle", "subacromialbursa"})
    EXPECT_THAT(all, HasSubstr(name));
  EXPECT_THAT(all, Not(HasSubstr("…")));
}

TEST_P(LettersTest, besideTheSliceTheLaddersWordsAreWhole) {
  AidList aids = usualAids();
  aids.Add(pb::Exercise::ULTRASOUND);
  patient_ = "volumes/shoulder-median";
  showLesson(2.4, aids);
  EXPECT_THAT(drawn().all(), HasSubstr("subcutaneousfat"));
  std::vector<std::string> lines;
  for (const DrawnLine& line : drawnText()) lines.push_back(line.text);
  for (const char* word : {"subcutaneous", "subacromial"})
    EXPECT_THAT(lines, Contains(HasSubstr(word))) << "in one line";
}

INSTANTIATE_TEST_SUITE_P(Resolutions, LettersTest,
                         testing::Values(Resolution{1280, 720}, Resolution{1920, 1080},
                                         Resolution{2560, 1440}, Resolution{3840, 2160}),
                         [](const auto& of) { return std::to_string(of.param.height_px); });

}  // namespace
}  // namespace needlelab::test
