#include "client/instructor/screens/screens.h"

#include <algorithm>

#include "client/view/theme.h"

namespace needlelab {

void CompareScreen::updateCurves(const LabState& lab) {
  const GestureComparison& comparison = *lab.analysis.comparison();
  if (of_first_.lock() == lab.analysis.first() && of_second_.lock() == lab.analysis.second() &&
      of_alignment_ == comparison.alignment)
    return;
  of_first_ = lab.analysis.first();
  of_second_ = lab.analysis.second();
  of_alignment_ = comparison.alignment;
  alignment = comparison.alignment;
  x_.clear();
  plotted_ = plottedSeries(comparison);
  curves_.assign(plotted_.size(), {});
  const double scale = comparison.alignment == Alignment::kDepth ? 1000
                       : comparison.alignment == Alignment::kDtw ? 100
                                                                 : 1;
  for (const ComparedPoint& point : comparison.points) {
    x_.push_back(scale * point.at);
    for (std::size_t i = 0; i < plotted_.size(); ++i) {
      const double shown = shownPerSi(plotted_[i]);
      const double a = shown * valueOfA(plotted_[i], point), b = shown * valueOfB(plotted_[i], point);
      curves_[i].a.push_back(a);
      curves_[i].b.push_back(b);
      curves_[i].difference.push_back(b - a);
    }
  }
  at_ = x_.empty() ? 0 : x_.back() * 0.5;
}

const ComparedPoint& CompareScreen::pointAt(const GestureComparison& comparison) const {
  const auto after = std::upper_bound(x_.begin(), x_.end(), at_);
  const auto index = after == x_.begin() ? 0 : after - x_.begin() - 1;
  return comparison.points[static_cast<std::size_t>(index)];
}

void CompareScreen::showChoice(LabState& lab) {
  const auto title = [](Rgb colour, const char* sign, const std::string& words) {
    WithTextColour text(colour);
    ImGui::TextUnformatted((std::string(sign) + " " + words).c_str());
  };
  title(kFirstGesture, "—", lab.analysis.first()->title());
  if (lab.analysis.second()) {
    ImGui::SameLine(0, 2 * space());
    title(kSecondGesture, "– –", lab.analysis.second()->title());
  }
  if (lab.analysis.second() || lab.analysis.busy()) {
    for (const Alignment each : {Alignment::kDepth, Alignment::kDtw, Alignment::kTime}) {
      const char* const word = each == Alignment::kDepth ? "by depth"
                               : each == Alignment::kDtw ? "warped (DTW)"
                                                         : "by time";
      if (ImGui::RadioButton(word, alignment == each)) {
        alignment = each;
        lab.analysis.compare(each);
      }
      ImGui::SameLine();
    }
    ImGui::SameLine(0, 2 * space());
    ImGui::Checkbox("overlaid", &overlaid_);
    ImGui::SameLine(0, 2 * space());
  }
  if (ImGui::Button("Beside the expert's reference")) {
    lab.analysis.loadSecond("reference");
  }
  ImGui::SameLine();
  if (ImGui::Button("Other session …")) lab.screen = WindowScreen::kSessions;
}

void CompareScreen::showScenes(LabState& lab, ImVec2 size_px) {
  const GestureComparison& comparison = *lab.analysis.comparison();
  const StoredGesture& a = *lab.analysis.first();
  const StoredGesture& b = *lab.analysis.second();
  const ComparedPoint& point = pointAt(comparison);
  const Moment& now_a = a.trace.at(point.time_a_s);
  const Moment& now_b = b.trace.at(point.time_b_s);
  TipTrail trail_a = trailOf(a.trace, point.time_a_s, 30, kFirstGesture);
  TipTrail trail_b = trailOf(b.trace, point.time_b_s, 30, kSecondGesture);
  if (overlaid_) {
    const SharedPlan plan = sharedPlanOf(a, b);
    ImGui::BeginChild("over", size_px, false, ImGuiWindowFlags_NoScrollbar | ImGuiWindowFlags_NoBackground);
    if (!plan.omission_reason.empty()) textLine(plan.omission_reason);
    first_.show("both", a.scene.view, now_a, plan.plan_W, allAidSet(), {0, 0}, now_b,
                {std::move(trail_a), std::move(trail_b)});
    ImGui::EndChild();
    return;
  }
  const float half = (size_px.y - ImGui::GetStyle().ItemSpacing.y) * 0.5F;
  ImGui::BeginChild("pair", size_px, false, ImGuiWindowFlags_NoBackground);
  first_.show("first", a.scene.view, now_a, a.planView(), allAidSet(), {0, half}, {}, {std::move(trail_a)});
  second_.show("second", b.scene.view, now_b, b.planView(), allAidSet(), {0, half}, {}, {std::move(trail_b)});
  ImGui::EndChild();
}

void CompareScreen::showCurves(LabState& lab, ImVec2 size_px) {
  const GestureComparison& comparison = *lab.analysis.comparison();
  std::vector<Plot> plots;
  for (std::size_t i = 0; i < plotted_.size(); ++i) {
    Plot plot;
    plot.title = std::string(nameOf(plotted_[i]));
    plot.unit = std::string(unitOf(plotted_[i]));
    plot.from = x_.front();
    plot.to = x_.back() > x_.front() ? x_.back() : x_.front() + 1;
    plot.clock_axis = comparison.alignment == Alignment::kTime;
    plot.x_unit = comparison.alignment == Alignment::kDepth ? "mm inserted" : "% of the way";
    plot.cursor = at_;
    addLimits(plot, plotted_[i], *lab.analysis.first(), *lab.analysis.second());
    plot.series.push_back({"first", kFirstGesture, columnsOf(x_, curves_[i].a), false, false});
    plot.series.push_back({"second", kSecondGesture, columnsOf(x_, curves_[i].b), true, false});
    plot.series.push_back(
        {"second − first", kReddishPurple, columnsOf(x_, curves_[i].difference), false, true});
    plots.push_back(std::move(plot));
  }
  ImGui::BeginChild("curves", size_px, false, ImGuiWindowFlags_NoScrollbar | ImGuiWindowFlags_NoBackground);
  const float words = ImGui::GetTextLineHeightWithSpacing() * static_cast<float>(comparison.sentences.size());
  const auto result = plotStack("compared", plots, {0, ImGui::GetContentRegionAvail().y - words});
  if (result.clicked_x) at_ = std::clamp(*result.clicked_x, x_.front(), x_.back());
  for (const std::string& line : comparison.sentences) textLine(line);
  ImGui::EndChild();
}

void CompareScreen::show(LabState& lab) {
  showWork(lab);
  if (!lab.analysis.first()) {
    if (lab.analysis.busy()) return;
    if (showEmpty("Nothing to compare yet", "Load one session, then choose a second one in the list.",
                  "To the sessions"))
      lab.screen = WindowScreen::kSessions;
    return;
  }
  showChoice(lab);
  // after a second session was loaded, compare with the chosen alignment
  if (lab.analysis.second() && !lab.analysis.comparison() && !lab.analysis.busy() &&
      lab.analysis.troubleOf(AnalysisJob::kCompare).empty())
    lab.analysis.compare(alignment);
  if (!lab.analysis.second() || !lab.analysis.comparison()) {
    const std::string trouble = lab.analysis.troubleOf(AnalysisJob::kCompare);
    if (!lab.analysis.busy())
      showEmpty(trouble.empty() ? "One session is loaded" : "The comparison failed",
                trouble.empty() ? "Choose a second one in the list (button “beside”), or the expert's "
                                  "reference of its exercise."
                                : trouble);
    return;
  }
  updateCurves(lab);
  if (x_.empty()) {
    showEmpty("No common depth", "There is no depth that both needles reached.");
    return;
  }
  const ImVec2 room = ImGui::GetContentRegionAvail();
  showScenes(lab, {room.x * 0.45F, room.y});
  ImGui::SameLine();
  showCurves(lab, {0, room.y});
}

}  // namespace needlelab
