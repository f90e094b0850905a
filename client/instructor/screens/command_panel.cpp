#include "client/instructor/screens/screens.h"

#include <array>
#include <utility>

#include <imgui/imgui_stdlib.h>

#include <fmt/core.h>

#include "client/view/action_bar.h"
#include "client/view/input_queue.h"
#include "client/view/theme.h"

namespace needlelab {
namespace {

/// What instructors say most often; sent at once.
constexpr std::array kPhrases = {"Slowly, please.",
                                 "Feel for the landmark first.",
                                 "Look at the planned line before you go in.",
                                 "Draw back before you inject.",
                                 "Please stop, and wait for me.",
                                 "Well done. Once more, please."};

bool lineAndButton(const char* id, const char* hint, std::string& text, const char* button, bool& focus,
                   float width) {
  if (std::exchange(focus, false)) focusNextField();
  ImGui::SetNextItemWidth(width);
  bool go = ImGui::InputTextWithHint(id, hint, &text, ImGuiInputTextFlags_EnterReturnsTrue);
  ImGui::SameLine();
  go |= ImGui::Button(button);
  return go && !text.empty();
}

}  // namespace

float CommandPanel::height_px() {
  return 10.5F * space();
}

void CommandPanel::showTexts(LabState& lab, const std::vector<Addressee>& to) {
  const bool watches = lab.screen == WindowScreen::kLive;
  const float width = ImGui::GetContentRegionAvail().x * 0.3F;
  ImGui::SetNextItemWidth(17 * space());
  if (ImGui::BeginCombo("##phrases", "Say …")) {
    for (const char* phrase : kPhrases)
      if (ImGui::Selectable(phrase)) lab.commands.message(to, phrase);
    ImGui::EndCombo();
  }
  ImGui::SameLine();
  const std::string hint =
      to.size() == 1 ? "message to the trainee" : fmt::format("message to {} trainees", to.size());
  if (lineAndButton("##message", hint.c_str(), message_, "Send", focus_message_, width)) {
    // unsent text stays in its field
    if (lab.commands.message(to, message_)) message_.clear();
  }
  if (!watches) return;
  ImGui::SameLine(0, 3 * space());
  const bool paused = lab.live()->paused();
  if (lineAndButton("##remark", paused ? "remark at the moment shown" : "remark at this moment", remark_,
                    "Annotate", focus_remark_, width)) {
    if (lab.annotate(remark_)) remark_.clear();
  }
}

void CommandPanel::showExercise(LabState& lab, const std::vector<Addressee>& to) {
  ImGui::SetNextItemWidth(25 * space());
  if (ImGui::BeginCombo("##next", "Next exercise …")) {
    for (const ExerciseChoice& exercise : lab.exercises()) {
      if (ImGui::Selectable((exercise.name + "##" + exercise.id).c_str()))
        lab.commands.nextExercise(to, exercise.id, exercise.name);
    }
    ImGui::EndCombo();
  }
}

void CommandPanel::showAids(LabState& lab) {
  AidSet aids(lab.aidsNow());
  ImGui::SetNextItemWidth(25 * space());
  if (!ImGui::BeginCombo("##aids", "What the trainee sees …", ImGuiComboFlags_HeightLarge)) return;
  for (int number = pb::Exercise::Aid_MIN + 1; number <= pb::Exercise::Aid_MAX; ++number) {
    const auto aid = static_cast<pb::Exercise::Aid>(number);
    bool on = aids.has(aid);
    if (!ImGui::Checkbox(std::string(aidWord(aid)).c_str(), &on)) continue;
    aids.set(aid, on);
    lab.setAids(aids.list());
  }
  if (ImGui::Button("As the exercise sets it")) lab.resetAids();
  ImGui::EndCombo();
}

void CommandPanel::showStop(LabState& lab, const std::vector<Addressee>& lessons) {
  StopQuestion& question = lab.stop_question;
  const auto actions = stopActions(question.asking(), lessons.size());
  const bool answerable = stop_gate_.opens(question.asking() ? 1 : 0);
  if (!question.asking()) {
    if (actionLine(actions) == kActStop) question.ask(lessons);
    return;
  }
  // confirmation within the panel
  ImGui::SetNextItemWidth(26 * space());
  ImGui::InputTextWithHint("##reason", "reason (the trainee sees it)", &question.reason);
  ImGui::SameLine();
  ImGui::BeginDisabled(!answerable);
  auto chosen = actionLine(actions, true);
  ImGui::EndDisabled();
  if (answerable && !chosen) chosen = pressedAction(actions);
  if (chosen == kActStopNow) lab.commands.stopLessons(lessons, question.reason);
  if (chosen) question.withdraw();
}

void CommandPanel::show(LabState& lab, const std::vector<Addressee>& to) {
  const auto lessons = lessonsOf(to);
  beginPanel("talk", {}, 0, 0);
  showTexts(lab, to);
  showExercise(lab, to);
  ImGui::SameLine();
  showAids(lab);
  ImGui::SameLine(0, 3 * space());
  showStop(lab, lessons);
  endPanel();
}

}  // namespace needlelab
