#include "client/station/window/screens/end_screen.h"

#include <fmt/core.h>
#include <imgui/imgui.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "client/station/run/lesson/trainee_code.h"
#include "client/station/window/lessons/start_choice.h"
#include "client/station/window/screens/station_actions.h"
#include "client/view/action_bar.h"
#include "client/view/input_queue.h"
#include "client/view/model/gesture_plots.h"
#include "client/view/model/palette.h"
#include "client/view/model/plot.h"
#include "client/view/plots.h"
#include "client/view/theme.h"
#include "common/base/text/plain_words.h"
#include "common/base/text/text.h"
#include "common/haptics/gate/handle_stiffness.h"
#include "common/scoring/measures/measure_table.h"
#include "common/scoring/measures/measures.h"
#include "common/scoring/targets/miss.h"

namespace needlelab {

// --- the verdict ---

namespace {

/// "Passed", "Not passed".
std::string verdictTitle(bool passed) {
  std::string title = verdictName(passed);
  title.front() = upperCase(title.front());
  return title;
}

void judge(const std::vector<Measure>& measures, LessonVerdict& verdict) {
  std::size_t missing = 0;
  for (const Measure& measure : measures) {
    VerdictRow row{measure.words, measure.passed};
    if (isOfTissueNotMet(measure)) continue;
    if (!measure.passed) {
      verdict.others.push_back(std::move(row));
      continue;
    }
    if (!*measure.passed) ++missing;
    verdict.required.push_back(std::move(row));
  }
  std::stable_sort(verdict.required.begin(), verdict.required.end(),
                   [](const VerdictRow& a, const VerdictRow& b) { return *a.passed < *b.passed; });
  const std::size_t all = verdict.required.size();
  if (all == 0) {
    verdict.kind = LessonVerdict::Kind::kNoRequirements;
    verdict.title = "Done: this exercise has no requirements";
  } else if (missing == 0) {
    verdict.kind = LessonVerdict::Kind::kPassed;
    verdict.title = all == 1 ? verdictTitle(true)
                             : verdictTitle(true) + fmt::format(": all {} requirements are met", all);
  } else {
    verdict.kind = LessonVerdict::Kind::kNotPassed;
    verdict.title = verdictTitle(false) + fmt::format(": {} of {} requirements {} not met", missing, all,
                                                      missing == 1 ? "is" : "are");
  }
}

}  // namespace

LessonVerdict verdictOf(const LessonOutcome& outcome) {
  const StationSummary& s = outcome.summary;
  LessonVerdict verdict;
  if (s.results_from_unix_ns != 0) {
    verdict.title = resultsText(s.results_from_unix_ns);
  } else if (const auto measures = parseScore(s.score_json); !s.score_json.empty() && measures.ok()) {
    judge(*measures, verdict);
    verdict.by = s.score_source == "server" ? "scored by the server" : "scored by this station";
  } else {
    verdict.title = "No score: too little was recorded";
  }
  verdict.ended = s.servo.fault != Fault::kNone ? std::string("FAULT: ") + faultText(s.servo.fault)
                  : s.stopped                   ? stopText(s.stopped)
                                                : servoEndText(s.servo.end);
  if (!outcome.stored.ok()) {
    verdict.kept = "Not all of the recording is stored: " + outcome.stored.error().message + ".";
    verdict.kept_well = false;
  } else if (!s.uplink.current_trouble.empty() && !s.uplink.current_verdict) {
    verdict.kept = "The server did not accept the recording: " + s.uplink.current_trouble + ".";
    verdict.kept_well = false;
  } else if (s.state == "COMPLETE" || s.state == "INTERRUPTED") {
    verdict.kept = "The recording is in the server's database.";
  } else if (s.has_server && !s.uplink.server_full.empty()) {
    verdict.kept = "The recording is safe here and waits: " + s.uplink.server_full + ".";
  } else if (s.has_server) {
    verdict.kept = "The recording is safe here, and on its way to the server.";
  } else {
    verdict.kept = "The recording is safe in this station's spool; it is sent once the station has a server.";
  }
  verdict.kept = plainWords(verdict.kept);
  if (outcome.code_unchecked) verdict.waits = kCodeUnchecked;
  verdict.lowered = stiffnessShareText(s.shares, s.left_out);
  return verdict;
}

// --- distance from a line ---

Plot lateralPlot(std::span<const double> time_s, std::span<const double> lateral_mm,
                 std::span<const double> planned_mm, std::span<const Measure> measures) {
  Plot plot;
  plot.title = "distance from own line";
  plot.unit = "mm";
  plot.quantity = PlotQuantity::kDistance;
  plot.from = 0;
  plot.to = std::max(1.0, time_s.empty() ? 0.0 : time_s.back());
  plot.low = 0;
  plot.legend = false;
  plot.series = {{"from own line", kBluishGreen, columnsOf(time_s, lateral_mm), false, true}};
  const auto requirements = requirementsOf(measures);
  addLimits(plot, GesturePlot::kAlignment, requirements);
  if (planned_mm.empty()) return plot;
  plot.title = "distance from a line";
  plot.legend = true;
  // below the other one; dashes are for limits
  plot.series.insert(plot.series.begin(),
                     {"from planned line", kPlanColour, columnsOf(time_s, planned_mm), false, false});
  // says which of the two lines each limit is for
  for (PlotLimit& limit : plot.limits) limit.text.insert(0, "own line: ");
  const std::size_t own = plot.limits.size();
  for (const PlotRequirement& requirement : requirements)
    if (roleOf(requirement.measure) == MeasureRole::kPlannedLine) addLimits(plot, requirement, 1e3);
  for (std::size_t i = own; i < plot.limits.size(); ++i) plot.limits[i].text.insert(0, "planned line: ");
  return plot;
}

// --- the screen ---

namespace {

constexpr double kKeysAfter_s = 0.7;

Condition conditionOf(LessonVerdict::Kind kind) {
  switch (kind) {
    case LessonVerdict::Kind::kPassed:
      return Condition::kGood;
    case LessonVerdict::Kind::kNotPassed:
      return Condition::kAttention;
    case LessonVerdict::Kind::kNoRequirements:
    case LessonVerdict::Kind::kNoScore:
      break;
  }
  return Condition::kUnknown;
}

// sign and text, the text wrapped beside the sign
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
  if (outcome.summary.session_id != session_ || keys_from_s_ == 0) {
    keys_from_s_ = ImGui::GetTime() + kKeysAfter_s;
    characters_typed_ = false;
    dropInputBefore(ImGui::GetFrameCount());
  }
  session_ = outcome.summary.session_id;
  verdict_ = verdictOf(outcome);
  measures_.clear();
  if (auto measures = parseScore(outcome.summary.score_json); measures.ok()) measures_ = *std::move(measures);
  time_s_.clear();
  lateral_mm_.clear();
  planned_mm_.clear();
  bool has_plan = false;
  for (const CurvePoint& point : outcome.curve) {
    time_s_.push_back(static_cast<double>(point.time_s));
    lateral_mm_.push_back(1e3 * static_cast<double>(point.lateral_error_m));
    planned_mm_.push_back(1e3 * static_cast<double>(point.planned_error_m));
    has_plan = has_plan || std::isfinite(point.planned_error_m);
  }
  if (!has_plan) planned_mm_.clear();
}

// The newest samples may come after the outcome.
void EndScreen::takeReplay(const LessonFollow& lesson) {
  const GestureTrace& trace = lesson.trace();
  if (std::exchange(replay_until_s_, trace.lastTime_s()) == trace.lastTime_s()) return;
  frame_ = SceneFrame{};
  frame_.plan_W = lesson.plan_W();
  frame_.show_hand = false;
  replay_ = insertionReplay(trace, *lesson.scene(), injectionsIn(shown_->summary.syringe_json),
                            lesson.beginning().rate_hz);
  if (replay_) frame_.camera = viewOfInsertion(*lesson.scene(), *replay_);
}

bool EndScreen::show(const BoardState& state, bool changed, const LessonFollow* lesson, bool keys,
                     bool may_quit, LessonBoard& board) {
  if (!state.outcome) return false;
  if (changed && state.outcome != shown_) {
    shown_ = state.outcome;
    take(*shown_);
  }
  if (std::exchange(replay_lesson_, state.lesson) != state.lesson) replay_until_s_ = -1;
  if (lesson == nullptr || shown_->summary.results_from_unix_ns != 0)
    replay_.reset();
  else
    takeReplay(*lesson);
  beginScreen("end");
  {
    const WithFont heading(Letters::kHeading);
    std::string title = exerciseName(state.lists, shown_->summary.exercise);
    if (state.beginning) {
      const StationLesson& ended = state.beginning->lesson;
      title = ended.exercise ? ended.exercise->name() : ended.profile.name();
    }
    const bool exam = state.beginning && state.beginning->lesson.exam;
    textBlock(exam ? "Exam: " + title : title + ": how it went");
  }
  const float foot = 9.6F * space();
  const ImVec2 rest = ImGui::GetContentRegionAvail();
  const float gap = ImGui::GetStyle().ItemSpacing.x;
  beginPanel("verdict", "", 0.5F * rest.x - gap, rest.y - foot);
  showVerdict(state.beginning ? lessonWord(state.beginning->lesson) : "lesson");
  endPanel();
  ImGui::SameLine();
  beginPanel("plots", "", 0, rest.y - foot);
  showGesture(*shown_, lesson);
  endPanel();
  const bool quits = showNext(state, keys, may_quit, board);
  endScreen();
  return quits;
}

void EndScreen::showVerdict(const std::string& what) {
  {
    const WithFont heading(Letters::kHeading);
    conditionLine(conditionOf(verdict_.kind), verdict_.title);
  }
  ImGui::Spacing();
  if (shown_->summary.miss) showMiss(*shown_->summary.miss);
  for (const VerdictRow& row : verdict_.required) verdictRow(row);
  ImGui::Spacing();
  {
    const WithFont small(Letters::kSmall);
    {
      const WithTextColour dim(kDimText);
      textBlock("The " + what + " ended: " + verdict_.ended +
                (verdict_.by.empty() ? "." : "; " + verdict_.by + "."));
    }
    {
      const WithTextColour colour(verdict_.kept_well ? kDimText : styleOf(Condition::kTrouble).colour);
      textBlock(verdict_.kept);
    }
    const WithTextColour attention(styleOf(Condition::kAttention).colour);
    if (!verdict_.waits.empty()) textBlock(verdict_.waits);
    if (!verdict_.lowered.empty()) textBlock(verdict_.lowered);
  }
  ImGui::Spacing();
  const bool all = verdict_.required.empty();
  if (!verdict_.others.empty() && ImGui::CollapsingHeader(all ? "All measures" : "All other measures",
                                                          all ? ImGuiTreeNodeFlags_DefaultOpen : 0)) {
    const WithFont small(Letters::kSmall);
    for (const VerdictRow& row : verdict_.others) verdictRow(row);
  }
  showDistance();
}

// shows by how much, in large letters
void EndScreen::showMiss(const Miss& miss) {
  {
    const WithFont heading(Letters::kHeading);
    conditionLine(miss.in_target && miss.through.empty() ? Condition::kGood : Condition::kAttention,
                  missText(miss));
  }
  {
    const WithFont small(Letters::kSmall);
    const WithTextColour dim(kDimText);
    textBlock(missDirectionText(miss));
  }
  ImGui::Spacing();
}

void EndScreen::showGesture(const LessonOutcome& outcome, const LessonFollow* lesson) {
  if ((outcome.curve.empty() && !replay_) || lesson == nullptr) {
    const WithTextColour dim(kDimText);
    textBlock(outcome.summary.results_from_unix_ns != 0 ? "This is an exam." : "There is nothing to draw.");
    return;
  }
  const SceneView& scene = *lesson->scene();
  std::optional<MarkedMoment> marked;
  if (replay_) {
    const Moment& now = lesson->trace().at(replay_->at_s);
    marked = MarkedMoment{replay_->at_s, now.insertion_m, forceOf(now)};
    if (renderer_.scene() != &scene) renderer_.setScene(lesson->scene());
    const ImVec2 rest = ImGui::GetContentRegionAvail();
    insertionPicture(*replay_, now, renderer_, frame_, {rest.x, 0.52F * rest.y});
    const WithFont small(Letters::kSmall);
    textBlock(replayText(*replay_, now, scene));
    insertionLegend(*replay_, frame_.plan_W.has_value());
  }
  if (outcome.curve.empty()) return;
  const ImVec2 rest = ImGui::GetContentRegionAvail();
  depthPlot(outcome.curve, wayOf(outcome, scene), scene, {rest.x, marked ? rest.y : 0.58F * rest.y}, marked);
  if (!marked)
    linePlot("lateral", lateralPlot(time_s_, lateral_mm_, planned_mm_, measures_), {rest.x, 0.40F * rest.y});
}

// beside a picture of the insertion the distance is in the verdict's panel, open if the exercise limits it
void EndScreen::showDistance() {
  if (!replay_ || time_s_.empty()) return;
  Plot plot = lateralPlot(time_s_, lateral_mm_, planned_mm_, measures_);
  plot.cursor = replay_->at_s;
  if (ImGui::CollapsingHeader("Distance from the line",
                              plot.limits.empty() ? 0 : ImGuiTreeNodeFlags_DefaultOpen))
    linePlot("lateral", plot, {0, 14 * space()});
}

bool EndScreen::acceptsKeys() const {
  return ImGui::GetTime() >= keys_from_s_;
}

bool EndScreen::showNext(const BoardState& state, bool keys, bool may_quit, LessonBoard& board) {
  LessonChoice again = state.choice;
  LessonChoice next = again;
  if (state.next) next.exercise = state.next->exercise, next.by_profile = false;
  ImGui::Spacing();
  const auto actions = endActions(state, may_quit);
  auto chosen = actionButtons(actions);
  actionHints(actions);
  if (replay_) {
    ImGui::SameLine();
    const int steps = replaySteps();
    if (keys) replay_->step(steps);
  }
  if (keys && !chosen && acceptsKeys()) {
    characters_typed_ = characters_typed_ || ImGui::GetIO().InputQueueCharacters.Size > 0;
    if (const auto by_key = actionByKey(actions)) chosen = endActionByKey(*by_key, characters_typed_);
  }
  if (chosen == kActNext) board.ask({BoardRequest::Kind::kBegin, next});
  if (chosen == kActAgain) board.ask({BoardRequest::Kind::kBegin, again});
  if (chosen == kActOther) board.ask({BoardRequest::Kind::kStart, {}});
  return chosen == kActQuit;
}

}  // namespace needlelab
