#include "client/instructor/screens/screens.h"

#include <imgui/imgui_stdlib.h>

#include <algorithm>

#include "client/view/action_bar.h"
#include "client/view/theme.h"

namespace needlelab {
namespace {

bool field(const char* caption, const char* id, std::string& text, const char* hint,
           ImGuiInputTextFlags flags = 0) {
  {
    WithTextColour dim(kDimText);
    ImGui::TextUnformatted(caption);
  }
  ImGui::SetNextItemWidth(-1);
  return ImGui::InputTextWithHint(id, hint, &text, flags | ImGuiInputTextFlags_EnterReturnsTrue);
}

void showFormError(const LabState& lab) {
  if (!lab.form_trouble.empty()) return conditionLine(Condition::kAttention, lab.form_trouble);
  const LinkState& link = lab.link();
  if (link.phase == LinkPhase::kConnecting) return conditionLine(Condition::kUnknown, "connecting …");
  if (link.phase != LinkPhase::kAway && link.phase != LinkPhase::kRefused) return;
  conditionLine(link.trouble.needs_person ? Condition::kTrouble : Condition::kAttention, link.trouble.what);
  textBlock(link.trouble.todo);
  WithFont small(Letters::kSmall);
  WithTextColour dim(kDimText);
  textBlock(link.trouble.detail);
}

}  // namespace

void showLogin(LabState& lab) {
  const ImVec2 room = ImGui::GetContentRegionAvail();
  const float width = std::min(room.x, 56 * space());
  ImGui::SetCursorPos({(room.x - width) * 0.5F, room.y * 0.07F});
  beginPanel("login", "needlelab: instructor", width, room.y * 0.88F);
  {
    WithTextColour dim(kDimText);
    textBlock("Watch the lab, message trainees, review recordings.");
  }
  ImGui::Dummy({0, space()});
  bool go = field("Server (host:port)", "##server", lab.form.server, "lab.example:7750");
  go |= field("CA file: the server's tls/ca.crt", "##ca", lab.form.ca_file, "/path/to/ca.crt");
  go |= field("Name", "##user", lab.form.user, "your name as an instructor");
  go |= field("Password", "##password", lab.form.password, "", ImGuiInputTextFlags_Password);
  ImGui::Dummy({0, space()});
  const bool busy = lab.link().phase == LinkPhase::kConnecting;
  const auto actions = loginActions(busy);
  go |= actionButtons(actions, 20 * space()) == kActLogIn;
  // Enter logs in from a field and from anywhere else
  if (!ImGui::GetIO().NavVisible) go |= actionByKey(actions) == kActLogIn;
  if (go && !busy) lab.logIn();
  ImGui::Dummy({0, 0.5F * space()});
  showFormError(lab);
  endPanel();
}

}  // namespace needlelab
