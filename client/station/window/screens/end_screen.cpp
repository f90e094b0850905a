#include "client/station/window/screens/end_screen.h"

#include <fmt/core.h>
#include <imgui/imgui.h>

#include <algorithm>
#include <array>
#include <cmath>
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

// --- force over depth ---

namespace {

constexpr double kOutside_m = 0.005;

struct DepthAxes {
  ImVec2 corner, size;
  DepthPlotRange range;
  [[nodiscard]] float x(double depth_m) const {
    return corner.x + size.x * static_cast<float>((depth_m - range.from_m) / (range.to_m - range.from_m));
  }
  [[nodiscard]] float y(double force_N) const {
    return corner.y + size.y * static_cast<float>(1 - force_N / range.force_N);
  }
};

void drawBands(ImDrawList* draw, const DepthAxes& axes, const TissuesOnLine& way, const SceneView& scene) {
  const float bottom = axes.corner.y + axes.size.y, end = axes.corner.x + axes.size.x;
  std::array<float, 4> row_end{};  // where the names end so far; a name without room is omitted
  for (const TissuesOnLine::Tissue& tissue : way.tissues) {
    const LayerView& layer = scene.layers[static_cast<std::size_t>(tissue.layer)];
    if (tissue.top_m >= axes.range.to_m) break;
    const float left = axes.x(tissue.top_m), right = std::min(end, axes.x(tissue.bottom_m));
    draw->AddRectFilled({left, axes.corner.y}, {right, bottom}, packed(layer.colour, 0.35F));
    draw->AddLine({left, axes.corner.y}, {left, bottom}, packed(kLineGrey));
    if (isTarget(scene, tissue.layer)) continue;
    // moves names of thin layers to other rows
    const std::string name = fittedText(layer.name, axes.size.x - 6);
    const float width = ImGui::CalcTextSize(name.c_str()).x, from = std::min(left + 3, end - width);
    const auto row = std::ranges::find_if(row_end, [&](float taken) { return from >= taken; });
    if (row == row_end.end()) continue;
    *row = from + width + 0.5F * space();
    draw->AddText(
        {from, axes.corner.y + 2 + static_cast<float>(row - row_end.begin()) * ImGui::GetTextLineHeight()},
        packed(kText), name.c_str());
  }
  for (const TissuesOnLine::Aim& aim : way.targets) {
    const float left = axes.x(aim.top_m), right = std::max(left + 2, std::min(axes.x(aim.bottom_m), end));
    if (left > end) continue;
    draw->AddRectFilled({left, bottom - 6}, {right, bottom}, packed(kTargetColour));
    draw->AddRect({left, axes.corner.y}, {right, bottom}, packed(kTargetColour, 0.8F));
    if (aim.name.empty()) continue;
    const std::string name = fittedText(aim.name, axes.size.x - 6);
    const float width = ImGui::CalcTextSize(name.c_str()).x;
    const ImVec2 from{std::min(left + 3, end - width - 3), bottom - 8 - ImGui::GetTextLineHeight()};
    draw->AddRectFilled({from.x - 2, from.y}, {from.x + width + 2, bottom - 8}, packed(kBlack, 0.6F));
    draw->AddText(from, packed(kTargetColour), name.c_str());
  }
}

void drawAxes(ImDrawList* draw, const DepthAxes& axes) {
  const float bottom = axes.corner.y + axes.size.y, line = ImGui::GetTextLineHeight();
  const AxisTicks depths = axisTicks(1e3 * axes.range.from_m, 1e3 * axes.range.to_m, 7, false);
  for (const double mm : depths.at) {
    const std::string text = tickText(mm, depths.decimals);
    const float x = axes.x(1e-3 * mm);
    draw->AddLine({x, bottom}, {x, bottom + 4}, packed(kDimText));
    draw->AddText({x - 0.5F * ImGui::CalcTextSize(text.c_str()).x, bottom + 5}, packed(kDimText),
                  text.c_str());
  }
  const AxisTicks forces = axisTicks(0, axes.range.force_N, 5, false);
  for (const double force : forces.at) {
    const std::string text = tickText(force, forces.decimals);
    const float y = axes.y(force);
    draw->AddLine({axes.corner.x, y}, {axes.corner.x + axes.size.x, y}, packed(kLineGrey, 0.6F));
    draw->AddText({axes.corner.x - ImGui::CalcTextSize(text.c_str()).x - 5, y - 0.5F * line},
                  packed(kDimText), text.c_str());
  }
}

// one line per direction, each with its own colour
void drawGesture(ImDrawList* draw, const DepthAxes& axes, const GestureCurve& curve,
                 const TissuesOnLine& way) {
  std::vector<ImVec2> points;
  bool inward = true, off_way = false;
  const auto flush = [&] {
    if (points.size() > 1)
      draw->AddPolyline(points.data(), static_cast<int>(points.size()),
                        packed(off_way  ? kDimText
                               : inward ? kSkyBlue
                                        : kOrange),
                        0, 2);
    if (!points.empty()) points.erase(points.begin(), points.end() - 1);
  };
  double turn_m = 0;
  constexpr double kTurn_m = 1e-3;  // smaller changes are tremor
  for (const CurvePoint& point : curve) {
    const double depth = static_cast<double>(point.depth_m);
    if (std::isnan(depth)) {
      flush();
      points.clear();
      continue;
    }
    if (points.empty()) turn_m = depth;
    turn_m = inward ? std::max(turn_m, depth) : std::min(turn_m, depth);
    if (std::abs(depth - turn_m) > kTurn_m) {
      flush();
      inward = !inward;
      turn_m = depth;
    }
    if (const bool off = isOffWay(point, way); off != off_way) {
      flush();
      off_way = off;
    }
    points.push_back({axes.x(depth), axes.y(static_cast<double>(point.force_N))});
  }
  flush();
}

}  // namespace

bool isOffWay(const CurvePoint& point, const TissuesOnLine& way) {
  const auto at_m = static_cast<double>(point.depth_m);
  return point.layer >= 0 && std::ranges::none_of(way.tissues, [&](const TissuesOnLine::Tissue& tissue) {
           return tissue.holds(point.layer, at_m);
         });
}

TissuesOnLine wayOf(const LessonOutcome& outcome, const SceneView& scene) {
  const NeedleLine line = outcome.deepest.value_or(lineToTarget(scene));
  return tissuesOnLine(scene, line, lineReach_m(scene, line.entry_W_m, line.u_W));
}

DepthPlotRange depthPlotRange(const GestureCurve& curve, const TissuesOnLine& way) {
  DepthPlotRange range;
  double deepest = 0, force = 0;
  for (const CurvePoint& point : curve) {
    const auto depth = static_cast<double>(point.depth_m);
    if (std::isnan(depth)) continue;
    deepest = std::max(deepest, depth);
    force = std::max(force, static_cast<double>(point.force_N));
  }
  for (const TissuesOnLine::Aim& aim : way.targets)
    if (!aim.name.empty()) deepest = std::max(deepest, aim.bottom_m);
  range.from_m = -kOutside_m;
  range.to_m = std::max(1.08 * deepest, 1e-3 * leastSpanOf(PlotQuantity::kDepth));
  range.force_N = std::max(1.1 * force, leastSpanOf(PlotQuantity::kForce));
  return range;
}

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

void depthPlot(const GestureCurve& curve, const TissuesOnLine& way, const SceneView& scene, ImVec2 size_px) {
  const WithFont small(Letters::kSmall);
  const ImVec2 corner = ImGui::GetCursorScreenPos();
  if (size_px.x <= 0) size_px.x = ImGui::GetContentRegionAvail().x;
  ImGui::Dummy(size_px);
  ImDrawList* const draw = ImGui::GetWindowDrawList();
  const float line = ImGui::GetTextLineHeight(), left = 4.5F * space();
  draw->AddText(corner, packed(kText), "force over depth, N over mm");
  // the legend, right of the title
  const bool off = std::ranges::any_of(curve, [&](const CurvePoint& point) { return isOffWay(point, way); });
  const char* const words = off ? "— in   — out   — on another line" : "— in   — out";
  const float x = corner.x + size_px.x - ImGui::CalcTextSize(words).x - space();
  if (off) draw->AddText({x, corner.y}, packed(kDimText), words);
  draw->AddText({x, corner.y}, packed(kSkyBlue), "— in");
  draw->AddText({x + ImGui::CalcTextSize("— in   ").x, corner.y}, packed(kOrange), "— out");
  const DepthAxes axes{{corner.x + left, corner.y + 1.4F * line},
                       {size_px.x - left - space(), size_px.y - 2.9F * line},
                       depthPlotRange(curve, way)};
  if (axes.size.y < 20) return;
  const ImVec2 end{axes.corner.x + axes.size.x, axes.corner.y + axes.size.y};
  draw->PushClipRect(axes.corner, end, true);
  drawBands(draw, axes, way, scene);
  draw->PopClipRect();
  drawAxes(draw, axes);
  draw->PushClipRect(axes.corner, end, true);
  drawGesture(draw, axes, curve, way);
  draw->PopClipRect();
  draw->AddRect(axes.corner, end, packed(kLineGrey));
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

bool EndScreen::show(const BoardState& state, bool changed, const SceneView* scene, bool keys, bool may_quit,
                     LessonBoard& board) {
  if (!state.outcome) return false;
  if (changed && state.outcome != shown_) {
    shown_ = state.outcome;
    take(*shown_);
  }
  beginScreen("end");
  {
    const WithFont heading(Letters::kHeading);
    std::string title = exerciseName(state.lists, shown_->summary.exercise);
    if (state.beginning) {
      const StationLesson& lesson = state.beginning->lesson;
      title = lesson.exercise ? lesson.exercise->name() : lesson.profile.name();
    }
    const bool exam = state.beginning && state.beginning->lesson.exam;
    textLine(exam ? "Exam: " + title : title + ": how it went");
  }
  const float foot = 9.6F * space();
  const ImVec2 rest = ImGui::GetContentRegionAvail();
  const float gap = ImGui::GetStyle().ItemSpacing.x;
  beginPanel("verdict", "", 0.5F * rest.x - gap, rest.y - foot);
  showVerdict(state.beginning ? lessonWord(state.beginning->lesson) : "lesson");
  endPanel();
  ImGui::SameLine();
  beginPanel("plots", "", 0, rest.y - foot);
  showPlots(*shown_, scene);
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
  if (verdict_.others.empty()) return;
  ImGui::Spacing();
  const bool all = verdict_.required.empty();
  if (ImGui::CollapsingHeader(all ? "All measures" : "All other measures",
                              all ? ImGuiTreeNodeFlags_DefaultOpen : 0)) {
    const WithFont small(Letters::kSmall);
    for (const VerdictRow& row : verdict_.others) verdictRow(row);
  }
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

void EndScreen::showPlots(const LessonOutcome& outcome, const SceneView* scene) {
  if (outcome.curve.empty() || scene == nullptr) {
    const WithTextColour dim(kDimText);
    textBlock(outcome.summary.results_from_unix_ns != 0 ? "This is an exam." : "There is nothing to draw.");
    return;
  }
  const ImVec2 rest = ImGui::GetContentRegionAvail();
  depthPlot(outcome.curve, wayOf(outcome, *scene), *scene, {rest.x, 0.58F * rest.y});
  linePlot("lateral", lateralPlot(time_s_, lateral_mm_, planned_mm_, measures_), {rest.x, 0.40F * rest.y});
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
