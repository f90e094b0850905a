#include "client/instructor/screens/screens.h"

#include <imgui/imgui_stdlib.h>

#include <algorithm>
#include <string>
#include <vector>

#include "client/view/plots.h"
#include "client/view/theme.h"
#include "common/scoring/measures/measure_table.h"

namespace needlelab {
namespace {

/// Draws the experts' range as a bar, this value as a diamond.
void placeBar(const PlaceMarks& marks, float width) {
  const ImVec2 low = ImGui::GetCursorScreenPos();
  const float height = ImGui::GetFontSize();
  ImGui::Dummy({width, height});
  const auto x = [&](double share) { return low.x + static_cast<float>(share) * width; };
  ImDrawList& list = *ImGui::GetWindowDrawList();
  const float middle = low.y + height * 0.5F;
  list.AddLine({low.x, middle}, {low.x + width, middle}, packed(kLineGrey), 2);
  list.AddRectFilled({x(marks.least), middle - 5}, {x(marks.greatest) + 1, middle + 5},
                     packed(kBluishGreen, 0.7F));
  const float v = x(marks.value);
  list.AddQuadFilled({v - 6, middle}, {v, middle - 7}, {v + 6, middle}, {v, middle + 7}, packed(kVermillion));
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
  const std::vector<std::string> names = layerNamesOf(data);
  for (const bool required : {true, false}) {
    for (const Measure& measure : data.measures) {
      if (measure.passed.has_value() != required || isOfTissueNotMet(measure)) continue;
      ImGui::TableNextRow();
      ImGui::TableNextColumn();
      if (required) {
        const ConditionStyle& style = styleOf(*measure.passed ? Condition::kGood : Condition::kTrouble);
        WithTextColour colour(style.colour);
        ImGui::TextUnformatted(*measure.passed ? "✔" : "✘");
      }
      ImGui::TableNextColumn();
      textLine(measureWords(measure.name, names));
      ImGui::TableNextColumn();
      textLine(rowText(measure));
      ImGui::TableNextColumn();
      textLine(requirementText(measure.name, measure.unit, measure.min, measure.max));
      ImGui::TableNextColumn();
      if (const PlaceRow* const row = placeOf(data, measure.name); row != nullptr) {
        placeBar(row->marks, ImGui::GetContentRegionAvail().x);
        if (ImGui::IsItemHovered()) ImGui::SetTooltip("%s", row->words.c_str());
      }
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
    linePlot(row.measure.c_str(), progressPlot(data, row), {0, 13 * space()});
    WithFont small(Letters::kSmall);
    WithTextColour dim(kDimText);
    textLine(row.words);
  }
  if (!any) {
    WithTextColour dim(kDimText);
    textBlock("Progress appears from the second scored attempt on.");
  }
}

void ScoresScreen::showExport(LabState& lab) {
  ImGui::SetNextItemWidth(40 * space());
  ImGui::InputTextWithHint("##file", "report.html or samples.csv", &file_);
  ImGui::SameLine();
  if (ImGui::Button("Export")) lab.analysis.exportTo(file_);
  ImGui::SameLine();
  WithTextColour dim(kDimText);
  textLine(".html: report with plots; .csv: samples");
}

void ScoresScreen::show(LabState& lab) {
  showWork(lab);
  if (!lab.analysis.first()) {
    if (lab.analysis.busy()) return;
    if (showEmpty("No session is loaded", "Choose the session whose score you want to see.",
                  "To the sessions"))
      lab.screen = WindowScreen::kSessions;
    return;
  }
  // requests once when the screen opens; after an error the user retries
  if (!lab.analysis.report() && !lab.analysis.busy() &&
      (asked_for_ != lab.analysis.first().get() || lab.analysis.troubleOf(AnalysisJob::kScore).empty())) {
    asked_for_ = lab.analysis.first().get();
    lab.analysis.collect();
  }
  {
    WithFont font(Letters::kHeading);
    ImGui::TextUnformatted(lab.analysis.first()->title().c_str());
  }
  if (!lab.analysis.report()) {
    const std::string trouble = lab.analysis.troubleOf(AnalysisJob::kScore);
    if (!lab.analysis.busy() && !trouble.empty() &&
        showEmpty("The score could not be read", trouble, "Try again"))
      asked_for_ = nullptr;
    return;
  }
  const ReportData& data = *lab.analysis.report();
  ImGui::SameLine(0, 2 * space());
  if (data.passed)
    conditionLine(*data.passed ? Condition::kGood : Condition::kTrouble, verdictName(data.passed));
  else
    conditionLine(Condition::kUnknown, data.measures.empty() ? "no score yet" : "nothing was required");
  showExport(lab);
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
