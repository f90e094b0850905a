#include "client/instructor/screens/screens.h"

#include <imgui/imgui_stdlib.h>

#include <array>
#include <cmath>
#include <utility>

#include "client/instructor/model/live/session_scene.h"
#include "client/view/action_bar.h"
#include "client/view/theme.h"
#include "common/base/text/text.h"
#include "common/base/time/clock.h"
#include "common/scoring/measures/measure_table.h"
#include "common/scoring/measures/measures.h"

namespace needlelab {
namespace {

std::pair<Condition, const char*> verdictOf(const pb::SessionInfo& row) {
  if (row.state() == pb::SESSION_OPEN) return {Condition::kUnknown, "in progress"};
  if (!row.has_passed()) return {Condition::kUnknown, verdictName({})};
  return {row.passed() ? Condition::kGood : Condition::kTrouble, verdictName(row.passed())};
}

std::string figureText(const pb::SessionInfo& row, const MeasureKind& measure) {
  const double value = figureOf(row, measure.name);
  return std::isfinite(value) ? valueText(value, std::string(measure.unit)) : std::string("–");
}

}  // namespace

void SessionsScreen::showFilter(LabState& lab) {
  const auto field = [](const char* id, const char* hint, std::string& text, float width) {
    ImGui::SetNextItemWidth(width);
    const bool go = ImGui::InputTextWithHint(id, hint, &text, ImGuiInputTextFlags_EnterReturnsTrue);
    ImGui::SameLine();
    return go;
  };
  bool go = field("##who", "trainee", query.search, 24 * space());
  ImGui::SetNextItemWidth(28 * space());
  std::string exercise = "any exercise";
  for (const ExerciseChoice& choice : lab.exercises())
    if (choice.id == query.exercise_id) exercise = choice.name;
  if (ImGui::BeginCombo("##exercise", exercise.c_str())) {
    if (ImGui::Selectable("any exercise", query.exercise_id.empty())) query.exercise_id.clear(), go = true;
    for (const ExerciseChoice& choice : lab.exercises())
      if (ImGui::Selectable((choice.name + "##" + choice.id).c_str(), choice.id == query.exercise_id))
        query.exercise_id = choice.id, go = true;
    ImGui::EndCombo();
  }
  ImGui::SameLine();
  go |= field("##from", "from 2026-11-01", query.from, 17 * space());
  go |= field("##to", "to 2026-11-21", query.to, 17 * space());
  const std::array<std::pair<pb::ListSessions::Verdict, const char*>, 4> verdicts = {
      {{pb::ListSessions::ANY, "any verdict"},
       {pb::ListSessions::PASSED, verdictName(true)},
       {pb::ListSessions::FAILED, verdictName(false)},
       {pb::ListSessions::NONE, verdictName({})}}};
  ImGui::SetNextItemWidth(16 * space());
  const char* word = verdicts.front().second;
  for (const auto& [verdict, name] : verdicts)
    if (verdict == query.verdict) word = name;
  if (ImGui::BeginCombo("##verdict", word)) {
    for (const auto& [verdict, name] : verdicts)
      if (ImGui::Selectable(name, verdict == query.verdict)) query.verdict = verdict, go = true;
    ImGui::EndCombo();
  }
  ImGui::SameLine();
  const auto actions = searchActions(lab.sessions.nothingMatches() && query != SessionQuery{});
  go |= actionLine(actions) == kActSearch;
  go |= pressedAction(actions) == kActSearch;
  if (go) lab.sessions.search(query);
  if (!lab.sessions.trouble().empty()) conditionLine(Condition::kAttention, lab.sessions.trouble());
}

void SessionsScreen::showTable(LabState& lab) {
  constexpr ImGuiTableFlags kFlags = ImGuiTableFlags_RowBg | ImGuiTableFlags_ScrollY |
                                     ImGuiTableFlags_Sortable | ImGuiTableFlags_BordersInnerH |
                                     ImGuiTableFlags_SizingStretchProp;
  if (!ImGui::BeginTable("sessions", 8, kFlags)) return;
  ImGui::TableSetupScrollFreeze(0, 1);
  // Each column sorts in one direction only (SessionOrder), so its arrow never changes.
  constexpr ImGuiTableColumnFlags kNoSort = ImGuiTableColumnFlags_NoSort,
                                  kUp = ImGuiTableColumnFlags_NoSortDescending,
                                  kDown = ImGuiTableColumnFlags_NoSortAscending;
  ImGui::TableSetupColumn("when", ImGuiTableColumnFlags_DefaultSort | kDown, 1.2F);
  ImGui::TableSetupColumn("trainee", kUp, 1);
  ImGui::TableSetupColumn("exercise", kUp, 1.5F);
  ImGui::TableSetupColumn("station", kNoSort, 0.8F);
  ImGui::TableSetupColumn("verdict", kUp, 1);
  ImGui::TableSetupColumn("peak force", kDown, 0.8F);
  ImGui::TableSetupColumn("time", kNoSort, 0.6F);
  ImGui::TableSetupColumn("", kNoSort, 1.6F);
  ImGui::TableHeadersRow();
  if (ImGuiTableSortSpecs* specs = ImGui::TableGetSortSpecs(); specs != nullptr && specs->SpecsDirty) {
    constexpr std::array kOrders = {SessionOrder::kNewest, SessionOrder::kTrainee, SessionOrder::kExercise,
                                    SessionOrder::kNewest, SessionOrder::kVerdict, SessionOrder::kPeakForce};
    const int column = specs->SpecsCount > 0 ? specs->Specs[0].ColumnIndex : 0;
    if (column >= 0 && column < 6) lab.sessions.order(kOrders[static_cast<std::size_t>(column)]);
    specs->SpecsDirty = false;
  }
  ImGuiListClipper clipper;
  const auto& rows = lab.sessions.rows();
  clipper.Begin(static_cast<int>(rows.size()));
  while (clipper.Step()) {
    for (int i = clipper.DisplayStart; i < clipper.DisplayEnd; ++i) {
      const pb::SessionInfo& row = rows[static_cast<std::size_t>(i)];
      const auto& d = row.description();
      ImGui::PushID(i);
      ImGui::TableNextRow();
      const auto cell = [](const std::string& text) {
        ImGui::TableNextColumn();
        textLine(printable(text));
      };
      cell(localTime(d.started_unix_ns(), TimeForm::kMinute));
      cell(traineeName(d));
      cell(lab.exerciseName(d.exercise_id()));
      cell(d.station());
      ImGui::TableNextColumn();
      const auto [condition, word] = verdictOf(row);
      conditionLine(condition, word);
      cell(figureText(row, measureOf(MeasureRole::kForce)));
      cell(figureText(row, measureOf(MeasureRole::kTime)));
      ImGui::TableNextColumn();
      if (ImGui::SmallButton("Replay")) {
        lab.analysis.loadFirst(d.session_id());
        lab.screen = WindowScreen::kReplay;
      }
      ImGui::SameLine();
      if (ImGui::SmallButton("Scores")) {
        lab.analysis.loadFirst(d.session_id());
        lab.screen = WindowScreen::kScores;
      }
      if (lab.analysis.first()) {
        ImGui::SameLine();
        if (ImGui::SmallButton("beside")) {
          lab.analysis.loadSecond(d.session_id());
          lab.screen = WindowScreen::kCompare;
        }
      }
      ImGui::PopID();
    }
  }
  ImGui::EndTable();
}

void SessionsScreen::show(LabState& lab) {
  if (!lab.sessions.asked()) lab.sessions.search(query);
  showFilter(lab);
  WithTextColour dim(kDimText);
  ImGui::TextUnformatted(lab.sessions.countText().c_str());
  if (lab.sessions.hasMore()) {
    ImGui::SameLine();
    if (ImGui::SmallButton("More")) lab.sessions.more();
  }
  WithTextColour text(kText);
  if (lab.sessions.nothingMatches()) {
    if (showEmpty("No session matches", "Widen the search: fewer letters, another time, any verdict.",
                  query == SessionQuery{} ? nullptr : "Search all")) {
      query = {};
      lab.sessions.search(query);
    }
    return;
  }
  if (!lab.sessions.rows().empty()) showTable(lab);
}

}  // namespace needlelab
