#include "client/instructor/screens/scores_screen.h"

#include <imgui/imgui_stdlib.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>
#include <vector>

#include "client/instructor/screens/desk_frame.h"
#include "client/view/plots.h"
#include "client/view/theme.h"
#include "common/base/text.h"
#include "common/scoring/measure_table.h"

namespace needlelab {
namespace {

/// The experts' range as a bar, their mean as a line, this value as a diamond.
void standingBar(const pb::ReferenceBand& band, double value, float width) {
  const ImVec2 low = ImGui::GetCursorScreenPos();
  const float height = ImGui::GetFontSize();
  ImGui::Dummy({width, height});
  const double least = std::min(band.least(), value), greatest = std::max(band.greatest(), value);
  const double range = greatest > least ? greatest - least : 1;
  const auto x = [&](double v) {
    return low.x + 6 + static_cast<float>(std::clamp((v - least) / range, 0.0, 1.0)) * (width - 12);
  };
  ImDrawList& list = *ImGui::GetWindowDrawList();
  const float middle = low.y + height * 0.5F;
  list.AddRectFilled({x(band.least()), middle - 3}, {x(band.greatest()) + 1, middle + 3}, packed(kLineGrey));
  if (band.has_p10() && band.has_p90())
    list.AddRectFilled({x(band.p10()), middle - 5}, {x(band.p90()) + 1, middle + 5},
                       packed(kBluishGreen, 0.7F));
  list.AddLine({x(band.mean()), middle - 8}, {x(band.mean()), middle + 8}, packed(kWhite), 2);
  const float v = x(value);
  list.AddQuadFilled({v - 6, middle}, {v, middle - 7}, {v + 6, middle}, {v, middle + 7}, packed(kVermillion));
}

/// A few points as a line from one to the next; each point is a small peg on it.
ColumnSource lineThrough(std::vector<double> x, std::vector<double> y) {
  return [x = std::move(x), y = std::move(y)](double from, double to, std::span<PixelColumn> out) {
    const double width = (to - from) / static_cast<double>(out.size());
    double low = y.front(), high = y.front();
    for (const double v : y) low = std::min(low, v), high = std::max(high, v);
    const double peg = 0.03 * (high - low);
    for (std::size_t i = 0; i < out.size(); ++i) {
      out[i] = {};
      const double at = from + (static_cast<double>(i) + 0.5) * width;
      if (at < x.front() - 0.5 * width || at > x.back() + 0.5 * width) continue;
      const auto right = std::min<std::size_t>(
          static_cast<std::size_t>(std::upper_bound(x.begin(), x.end(), at) - x.begin()), x.size() - 1);
      const std::size_t left = right == 0 ? 0 : right - 1;
      const double step = x[right] - x[left];
      const double share = step > 0 ? std::clamp((at - x[left]) / step, 0.0, 1.0) : 0.0;
      const double value = y[left] + share * (y[right] - y[left]);
      const bool point = std::abs(at - x[left]) <= 1.5 * width || std::abs(at - x[right]) <= 1.5 * width;
      out[i].last = static_cast<float>(value);
      out[i].min = static_cast<float>(value - (point ? peg : 0));
      out[i].max = static_cast<float>(value + (point ? peg : 0));
    }
  };
}

std::string allowedText(const Measure& measure) {
  if (measure.min && measure.max)
    return valueText(*measure.min, measure.unit) + " – " + valueText(*measure.max, measure.unit);
  if (measure.min) return "≥ " + valueText(*measure.min, measure.unit);
  if (measure.max) return "≤ " + valueText(*measure.max, measure.unit);
  return {};
}

}  // namespace

void ScoresScreen::showMeasures(const ReportData& data) {
  constexpr ImGuiTableFlags kFlags = ImGuiTableFlags_RowBg | ImGuiTableFlags_ScrollY |
                                     ImGuiTableFlags_BordersInnerH | ImGuiTableFlags_SizingStretchProp;
  if (!ImGui::BeginTable("measures", 5, kFlags)) return;
  ImGui::TableSetupScrollFreeze(0, 1);
  ImGui::TableSetupColumn("", ImGuiTableColumnFlags_WidthFixed, 3 * space());
  ImGui::TableSetupColumn("measure", 0, 2);
  ImGui::TableSetupColumn("value", 0, 0.9F);
  ImGui::TableSetupColumn("required", 0, 0.9F);
  ImGui::TableSetupColumn("beside the experts", 0, 1.3F);
  ImGui::TableHeadersRow();
  for (const bool required : {true, false}) {
    for (const Measure& measure : data.measures) {
      if (measure.passed.has_value() != required) continue;
      ImGui::TableNextRow();
      ImGui::TableNextColumn();
      if (required) {
        const ConditionStyle& style = styleOf(*measure.passed ? Condition::kGood : Condition::kTrouble);
        WithTextColour colour(style.colour);
        ImGui::TextUnformatted(*measure.passed ? "✔" : "✘");
      }
      ImGui::TableNextColumn();
      textLine(measureWords(measure.name));
      ImGui::TableNextColumn();
      textLine(measure.measured ? valueText(measure.value, measure.unit) : std::string("not measured"));
      ImGui::TableNextColumn();
      textLine(allowedText(measure));
      ImGui::TableNextColumn();
      const auto band = std::find_if(data.bands.begin(), data.bands.end(),
                                     [&](const pb::ReferenceBand& b) { return b.measure() == measure.name; });
      if (band != data.bands.end() && measure.measured)
        standingBar(*band, measure.value, ImGui::GetContentRegionAvail().x);
    }
  }
  ImGui::EndTable();
}

void ScoresScreen::showProgress(const ReportData& data) {
  bool any = false;
  for (const ProgressRow& row : data.progress) {
    const MeasureKind* const kind = measureKind(row.measure);
    if (row.values.size() < 2 || kind == nullptr || kind->better == Better::kNeither) continue;
    any = true;
    PlotSpec spec;
    spec.title = std::string(kind->words);
    const double scale = row.unit == "m" ? 1000 : row.unit == "m^2" ? 1e4 : 1;
    spec.unit = row.unit == "m" ? "mm" : row.unit == "m^2" ? "cm²" : row.unit;
    spec.from = 1;
    spec.to = std::max(2.0, row.attempts.back()) + 0.001;
    spec.clock_axis = false;
    spec.x_unit = "attempt";
    spec.legend = false;
    for (const pb::ReferenceBand& band : data.bands)
      if (band.measure() == row.measure)
        spec.bands.push_back({scale * (band.has_p10() ? band.p10() : band.least()),
                              scale * (band.has_p90() ? band.p90() : band.greatest()), kBluishGreen,
                              "experts"});
    std::vector<double> values;
    for (const double v : row.values) values.push_back(scale * v);
    const std::vector<PlotSeries> series = {
        {"value", kSkyBlue, lineThrough(row.attempts, values), false, false}};
    linePlot(row.measure.c_str(), spec, series, {0, 13 * space()});
    WithFont small(Letters::kSmall);
    WithTextColour dim(kDimText);
    textLine(row.words);
  }
  if (!any) {
    WithTextColour dim(kDimText);
    textBlock("Progress is shown from the second attempt with a score on.");
  }
}

void ScoresScreen::showExport(Desk& desk) {
  ImGui::SetNextItemWidth(40 * space());
  ImGui::InputTextWithHint("##file", "report.html or samples.csv", &file_);
  ImGui::SameLine();
  if (ImGui::Button("Export")) desk.bench.exportTo(file_);
  ImGui::SameLine();
  WithTextColour dim(kDimText);
  textLine(".html: report with plots; .csv: samples");
}

void ScoresScreen::show(Desk& desk) {
  showWork(desk);
  if (!desk.bench.first()) {
    if (desk.bench.busy()) return;
    if (showEmpty("No session is loaded", "Choose the one whose score is to be looked at.",
                  "To the sessions"))
      desk.screen = DeskScreen::kSessions;
    return;
  }
  // asked for once when it is looked at first
  if (!desk.bench.report() && !desk.bench.busy() && asked_for_ != desk.bench.first().get()) {
    asked_for_ = desk.bench.first().get();
    desk.bench.collect();
  }
  {
    WithFont font(Letters::kHeading);
    ImGui::TextUnformatted(desk.bench.first()->title().c_str());
  }
  if (!desk.bench.report()) {
    if (!desk.bench.busy() && !desk.bench.trouble().empty() &&
        showEmpty("The score could not be read", desk.bench.trouble(), "Try again"))
      asked_for_ = nullptr;
    return;
  }
  const ReportData& data = *desk.bench.report();
  ImGui::SameLine(0, 2 * space());
  if (data.passed)
    conditionLine(*data.passed ? Condition::kGood : Condition::kTrouble,
                  *data.passed ? "passed" : "not passed");
  else
    conditionLine(Condition::kUnknown, data.measures.empty() ? "no score yet" : "nothing was required");
  showExport(desk);
  const ImVec2 room = ImGui::GetContentRegionAvail();
  beginPanel("score", "Measures", room.x * 0.64F, room.y);
  showMeasures(data);
  endPanel();
  ImGui::SameLine();
  beginPanel("progress", "Progress", 0, room.y);
  showProgress(data);
  endPanel();
}

}  // namespace needlelab
