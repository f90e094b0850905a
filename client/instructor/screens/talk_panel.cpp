#include "client/instructor/screens/talk_panel.h"

#include <imgui/imgui_stdlib.h>

#include <utility>

#include "client/view/model/aids.h"
#include "client/view/theme.h"

namespace needlelab {
namespace {

bool lineAndButton(const char* id, const char* hint, std::string& text, const char* button, bool& focus,
                   float width) {
  if (std::exchange(focus, false)) ImGui::SetKeyboardFocusHere();
  ImGui::SetNextItemWidth(width);
  bool go = ImGui::InputTextWithHint(id, hint, &text, ImGuiInputTextFlags_EnterReturnsTrue);
  ImGui::SameLine();
  go |= ImGui::Button(button);
  return go && !text.empty();
}

}  // namespace

void TalkPanel::showWords(Desk& desk) {
  const float width = ImGui::GetContentRegionAvail().x * 0.34F;
  if (lineAndButton("##message", "say to the trainee", message_, "Send", focus_message_, width)) {
    desk.talk.message(desk.live()->station(), message_);
    message_.clear();
  }
  ImGui::SameLine(0, 3 * space());
  const bool paused = desk.live()->paused();
  if (lineAndButton("##remark", paused ? "remark at the moment that is shown" : "remark at this moment",
                    remark_, "Annotate", focus_remark_, width)) {
    desk.annotate(remark_);
    remark_.clear();
  }
}

void TalkPanel::showExercise(Desk& desk) {
  ImGui::SetNextItemWidth(25 * space());
  if (ImGui::BeginCombo("##next", "Next exercise …")) {
    for (const ExerciseChoice& exercise : desk.exercises()) {
      if (ImGui::Selectable((exercise.name + "##" + exercise.id).c_str()))
        desk.talk.nextExercise(desk.live()->station(), exercise.id);
    }
    ImGui::EndCombo();
  }
}

void TalkPanel::showAids(Desk& desk) {
  AidSet aids(desk.aidsNow());
  ImGui::SetNextItemWidth(25 * space());
  if (!ImGui::BeginCombo("##aids", "What the trainee sees …", ImGuiComboFlags_HeightLarge)) return;
  for (int number = pb::Exercise::Aid_MIN + 1; number <= pb::Exercise::Aid_MAX; ++number) {
    const auto aid = static_cast<pb::Exercise::Aid>(number);
    bool on = aids.has(aid);
    if (!ImGui::Checkbox(std::string(aidWord(aid)).c_str(), &on)) continue;
    aids.set(aid, on);
    desk.setAids(aids.list());
  }
  if (ImGui::Button("As the exercise has it")) desk.resetAids();
  ImGui::EndCombo();
}

void TalkPanel::showStop(Desk& desk) {
  if (!confirm_stop_) {
    if (ImGui::Button("Stop lesson …")) confirm_stop_ = true;
    return;
  }
  // asked once more, within the panel
  ImGui::SetNextItemWidth(26 * space());
  ImGui::InputTextWithHint("##reason", "reason, for the trainee", &reason_);
  ImGui::SameLine();
  ImGui::PushStyleColor(ImGuiCol_Button, colourOf(kVermillion));
  if (ImGui::Button("■ Stop it now")) {
    desk.talk.stopLesson(desk.live()->station(), desk.live()->sessionId(), reason_);
    confirm_stop_ = false;
    reason_.clear();
  }
  ImGui::PopStyleColor();
  ImGui::SameLine();
  if (ImGui::Button("Do not")) confirm_stop_ = false;
}

void TalkPanel::show(Desk& desk) {
  beginPanel("talk", {}, 0, 0);
  showWords(desk);
  showExercise(desk);
  ImGui::SameLine();
  showAids(desk);
  ImGui::SameLine(0, 3 * space());
  showStop(desk);
  endPanel();
}

}  // namespace needlelab
