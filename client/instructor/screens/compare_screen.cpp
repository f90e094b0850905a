#include "client/instructor/screens/compare_screen.h"

#include <algorithm>
#include <array>

#include "client/instructor/screens/desk_frame.h"
#include "client/view/theme.h"
#include "common/base/text.h"

namespace needlelab {
namespace {

constexpr std::array kShown = {ComparedSeries::kTotalForce, ComparedSeries::kSpeed, ComparedSeries::kLateral,
                               ComparedSeries::kTilt};
constexpr std::array<const char*, 4> kUnits = {"N", "mm/s", "mm", "°"};
constexpr std::array<double, 4> kScales = {1, 1000, 1000, 57.29577951308232};

}  // namespace

void CompareScreen::takeIn(const GestureComparison& comparison) {
  if (of_ == comparison.points.data() && of_size_ == comparison.points.size()) return;
  of_ = comparison.points.data();
  of_size_ = comparison.points.size();
  alignment = comparison.alignment;
  x_.clear();
  curves_.assign(kShown.size(), {});
  const double scale = comparison.alignment == Alignment::kDepth ? 1000
                       : comparison.alignment == Alignment::kDtw ? 100
                                                                 : 1;
  for (const ComparedPoint& point : comparison.points) {
    x_.push_back(scale * point.at);
    for (std::size_t i = 0; i < kShown.size(); ++i) {
      const double a = kScales[i] * valueOfA(kShown[i], point), b = kScales[i] * valueOfB(kShown[i], point);
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

void CompareScreen::showChoice(Desk& desk) {
  const auto title = [](Rgb colour, const char* sign, const std::string& words) {
    WithTextColour text(colour);
    ImGui::TextUnformatted((std::string(sign) + " " + words).c_str());
  };
  title(kFirstGesture, "—", desk.bench.first()->title());
  if (desk.bench.second()) {
    ImGui::SameLine(0, 2 * space());
    title(kSecondGesture, "– –", desk.bench.second()->title());
  }
  if (desk.bench.second() || desk.bench.busy()) {
    for (const Alignment each : {Alignment::kDepth, Alignment::kDtw, Alignment::kTime}) {
      const char* const word = each == Alignment::kDepth ? "by depth"
                               : each == Alignment::kDtw ? "warped (DTW)"
                                                         : "by time";
      if (ImGui::RadioButton(word, alignment == each)) {
        alignment = each;
        desk.bench.compare(each);
      }
      ImGui::SameLine();
    }
    ImGui::SameLine(0, 2 * space());
    ImGui::Checkbox("laid over each other", &overlaid_);
    ImGui::SameLine(0, 2 * space());
  }
  if (ImGui::Button("Beside the expert's reference")) {
    desk.bench.loadSecond("reference");
  }
  ImGui::SameLine();
  if (ImGui::Button("Another second …")) desk.screen = DeskScreen::kSessions;
}

void CompareScreen::showScenes(Desk& desk, ImVec2 size_px) {
  const GestureComparison& comparison = *desk.bench.comparison();
  const StoredGesture& a = *desk.bench.first();
  const StoredGesture& b = *desk.bench.second();
  const ComparedPoint& point = pointAt(comparison);
  const Moment& now_a = a.trace.at(point.time_a_s);
  const Moment& now_b = b.trace.at(point.time_b_s);
  TipTrail trail_a = trailOf(a.trace, point.time_a_s, 30, kFirstGesture);
  TipTrail trail_b = trailOf(b.trace, point.time_b_s, 30, kSecondGesture);
  if (overlaid_) {
    first_.show("both", a.scene.view, now_a, allAidSet(), size_px, now_b,
                {std::move(trail_a), std::move(trail_b)});
    return;
  }
  const float half = (size_px.y - ImGui::GetStyle().ItemSpacing.y) * 0.5F;
  ImGui::BeginChild("pair", size_px, false, ImGuiWindowFlags_NoBackground);
  first_.show("first", a.scene.view, now_a, allAidSet(), {0, half}, {}, {std::move(trail_a)});
  second_.show("second", b.scene.view, now_b, allAidSet(), {0, half}, {}, {std::move(trail_b)});
  ImGui::EndChild();
}

void CompareScreen::showCurves(Desk& desk, ImVec2 size_px) {
  const GestureComparison& comparison = *desk.bench.comparison();
  std::vector<StackedPlot> plots;
  for (std::size_t i = 0; i < kShown.size(); ++i) {
    StackedPlot plot;
    plot.spec.title = std::string(wordOf(kShown[i]));
    plot.spec.unit = kUnits[i];
    plot.spec.from = x_.front();
    plot.spec.to = x_.back() > x_.front() ? x_.back() : x_.front() + 1;
    plot.spec.clock_axis = comparison.alignment == Alignment::kTime;
    plot.spec.x_unit = comparison.alignment == Alignment::kDepth ? "mm inserted" : "% of the way";
    plot.spec.show_x_axis = i + 1 == kShown.size();
    plot.spec.cursor = at_;
    plot.series.push_back({"first", kFirstGesture, columnsOf(x_, curves_[i].a), false, false});
    plot.series.push_back({"second", kSecondGesture, columnsOf(x_, curves_[i].b), true, false});
    plot.series.push_back(
        {"second − first", kReddishPurple, columnsOf(x_, curves_[i].difference), false, true});
    plots.push_back(std::move(plot));
  }
  ImGui::BeginChild("curves", size_px, false, ImGuiWindowFlags_NoScrollbar | ImGuiWindowFlags_NoBackground);
  const float words = ImGui::GetTextLineHeightWithSpacing() * static_cast<float>(comparison.words.size());
  const auto result = plotStack("compared", plots, {0, ImGui::GetContentRegionAvail().y - words});
  if (result.clicked_x) at_ = std::clamp(*result.clicked_x, x_.front(), x_.back());
  for (const std::string& line : comparison.words) textLine(line);
  ImGui::EndChild();
}

void CompareScreen::show(Desk& desk) {
  showWork(desk);
  if (!desk.bench.first()) {
    if (desk.bench.busy()) return;
    if (showEmpty("Nothing to compare yet", "Load one session, then choose a second one in the list.",
                  "To the sessions"))
      desk.screen = DeskScreen::kSessions;
    return;
  }
  showChoice(desk);
  // a second one came: compared as it was asked for
  if (desk.bench.second() && !desk.bench.comparison() && !desk.bench.busy() && desk.bench.trouble().empty())
    desk.bench.compare(alignment);
  if (!desk.bench.second() || !desk.bench.comparison()) {
    if (!desk.bench.busy())
      showEmpty(desk.bench.trouble().empty() ? "One session is loaded" : "That does not work",
                desk.bench.trouble().empty() ? "Choose a second one in the list (button “beside”), or the "
                                               "expert's reference of its exercise."
                                             : desk.bench.trouble());
    return;
  }
  takeIn(*desk.bench.comparison());
  if (x_.empty()) {
    showEmpty("Both needles met nowhere", "There is no depth that both reached.");
    return;
  }
  const ImVec2 room = ImGui::GetContentRegionAvail();
  showScenes(desk, {room.x * 0.45F, room.y});
  ImGui::SameLine();
  showCurves(desk, {0, room.y});
}

}  // namespace needlelab
