#include "client/station/window/end_screen.h"

#include <imgui/imgui.h>

#include <algorithm>
#include <span>
#include <string>

#include "client/station/window/depth_plot.h"
#include "client/station/window/keys.h"
#include "client/station/window/start_choice.h"
#include "client/view/plots.h"
#include "client/view/theme.h"

namespace needlelab {
namespace {

constexpr double kKeysAfter_s = 0.7;

Condition conditionOf(LessonVerdict::Kind kind) {
  switch (kind) {
    case LessonVerdict::Kind::kPassed:
      return Condition::kGood;
    case LessonVerdict::Kind::kNotYet:
      return Condition::kAttention;
    case LessonVerdict::Kind::kNoRequirements:
    case LessonVerdict::Kind::kNoScore:
      break;
  }
  return Condition::kUnknown;
}

// sign and words, the words wrapped beside the sign
void verdictRow(const VerdictRow& row) {
  const Condition condition = !row.passed   ? Condition::kUnknown
                              : *row.passed ? Condition::kGood
                                            : Condition::kTrouble;
  {
    const WithTextColour colour(styleOf(condition).colour);
    ImGui::TextUnformatted(styleOf(condition).sign.data());
  }
  ImGui::SameLine();
  const WithTextColour colour(row.passed ? kText : kDimText);
  textBlock(row.words);
}

}  // namespace

void EndScreen::take(const LessonOutcome& outcome) {
  if (outcome.summary.session_id != session_ || keys_from_s_ == 0)
    keys_from_s_ = ImGui::GetTime() + kKeysAfter_s;
  session_ = outcome.summary.session_id;
  verdict_ = verdictOf(outcome);
  time_s_.clear();
  lateral_mm_.clear();
  for (const CurvePoint& point : outcome.curve) {
    time_s_.push_back(static_cast<double>(point.time_s));
    lateral_mm_.push_back(1e3 * static_cast<double>(point.lateral_error_m));
  }
}

void EndScreen::show(const BoardState& state, bool changed, const SceneView* scene, LessonBoard& board) {
  if (!state.outcome) return;
  if (changed && state.outcome != shown_) {
    shown_ = state.outcome;
    take(*shown_);
  }
  beginScreen("end");
  {
    const WithFont heading(Letters::kHeading);
    std::string title = exerciseName(state.offers, shown_->summary.exercise);
    if (state.beginning) {
      const StationLesson& lesson = state.beginning->lesson;
      title = lesson.exercise ? lesson.exercise->name() : lesson.profile.name();
    }
    textLine(title + ": how it went");
  }
  const float foot = 9.6F * space();
  const ImVec2 rest = ImGui::GetContentRegionAvail();
  const float gap = ImGui::GetStyle().ItemSpacing.x;
  beginPanel("verdict", "", 0.5F * rest.x - gap, rest.y - foot);
  showVerdict();
  endPanel();
  ImGui::SameLine();
  beginPanel("plots", "", 0, rest.y - foot);
  showPlots(*shown_, scene);
  endPanel();
  showNext(state, board);
  endScreen();
}

void EndScreen::showVerdict() {
  {
    const WithFont heading(Letters::kHeading);
    conditionLine(conditionOf(verdict_.kind), verdict_.title);
  }
  {
    const WithFont small(Letters::kSmall);
    {
      const WithTextColour dim(kDimText);
      textBlock("The lesson ended: " + verdict_.ended +
                (verdict_.by.empty() ? "." : "; " + verdict_.by + "."));
    }
    const WithTextColour colour(verdict_.kept_well ? kDimText : styleOf(Condition::kTrouble).colour);
    textBlock(verdict_.kept);
  }
  ImGui::Spacing();
  for (const VerdictRow& row : verdict_.required) verdictRow(row);
  if (verdict_.others.empty()) return;
  ImGui::Spacing();
  const bool all = verdict_.required.empty();
  if (ImGui::CollapsingHeader(all ? "All measures" : "All other measures",
                              all ? ImGuiTreeNodeFlags_DefaultOpen : 0)) {
    const WithFont small(Letters::kSmall);
    for (const VerdictRow& row : verdict_.others) verdictRow(row);
  }
}

void EndScreen::showPlots(const LessonOutcome& outcome, const SceneView* scene) {
  if (outcome.curve.empty() || scene == nullptr) {
    const WithTextColour dim(kDimText);
    textBlock("There is nothing to draw.");
    return;
  }
  const ImVec2 rest = ImGui::GetContentRegionAvail();
  depthPlot(outcome.curve, *scene, {rest.x, 0.58F * rest.y});
  PlotSpec spec;
  spec.title = "beside the line";
  spec.unit = "mm";
  spec.from = 0;
  spec.to = std::max(1.0, time_s_.back());
  spec.low = 0;
  spec.legend = false;
  const PlotSeries series{"beside the line", kBluishGreen, columnsOf(time_s_, lateral_mm_), false, true};
  linePlot("lateral", spec, std::span(&series, 1), {rest.x, 0.40F * rest.y});
}

void EndScreen::showNext(const BoardState& state, LessonBoard& board) {
  const bool passed =
      verdict_.kind == LessonVerdict::Kind::kPassed || verdict_.kind == LessonVerdict::Kind::kNoRequirements;
  LessonChoice again = state.choice;
  LessonChoice next = again;
  if (state.next) next.exercise = state.next->exercise, next.by_profile = false;
  const auto begin = [&](const LessonChoice& choice) { board.ask({BoardWish::Kind::kBegin, choice}); };
  ImGui::Spacing();
  if (state.next) {
    const std::string label =
        "Next: " + exerciseName(state.offers, state.next->exercise) + " (" + state.next->from + ")";
    if (bigButton(label.c_str(), true)) begin(next);
    ImGui::SameLine();
  }
  if (bigButton("Next try", !state.next && !passed)) begin(again);
  ImGui::SameLine();
  if (bigButton("Other exercise", !state.next && passed)) board.ask({BoardWish::Kind::kStart, {}});
  ImGui::SameLine();
  if (bigButton("Quit")) board.ask({BoardWish::Kind::kQuit, {}});
  keyHint("Enter", state.next ? "the next exercise" : "next try");
  ImGui::SameLine();
  keyHint("O", "other exercise");
  if (ImGui::GetTime() < keys_from_s_) return;
  if (enterPressed()) begin(state.next ? next : again);
  if (ImGui::IsKeyPressed(GLFW_KEY_O, false)) board.ask({BoardWish::Kind::kStart, {}});
}

}  // namespace needlelab
