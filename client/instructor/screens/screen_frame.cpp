#include "client/instructor/screens/screens.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/core.h>

#include "client/view/action_bar.h"
#include "client/view/theme.h"
#include "common/base/time/clock.h"

namespace needlelab {
namespace {

struct Place {
  WindowScreen screen;
  const char* label;
};
constexpr std::array kPlaces = {
    Place{WindowScreen::kLab, "Lab"},           Place{WindowScreen::kLive, "Watch"},
    Place{WindowScreen::kSessions, "Sessions"}, Place{WindowScreen::kReplay, "Replay"},
    Place{WindowScreen::kCompare, "Compare"},   Place{WindowScreen::kRerun, "Re-run"},
    Place{WindowScreen::kScores, "Scores"}};

void linkWord(const LinkState& link) {
  switch (link.phase) {
    case LinkPhase::kOnline:
      return conditionLine(Condition::kGood, "online");
    case LinkPhase::kAway:
      return conditionLine(Condition::kAttention, "reconnecting");
    case LinkPhase::kRefused:
      return conditionLine(Condition::kTrouble, "refused");
    case LinkPhase::kConnecting:
      return conditionLine(Condition::kUnknown, "connecting");
    case LinkPhase::kLoggedOut:
      break;
  }
  conditionLine(Condition::kUnknown, "logged out");
}

}  // namespace

void showNavigation(LabState& lab, bool& show_help) {
  for (const Place& place : kPlaces) {
    const bool here = lab.screen == place.screen;
    ImGui::PushStyleColor(ImGuiCol_Button, here ? colourOf(kBlue) : colourOf(kPanelGrey));
    if (ImGui::Button(place.label)) lab.screen = place.screen;
    ImGui::PopStyleColor();
    if (here) {
      // not only by colour
      const ImVec2 low = ImGui::GetItemRectMin(), high = ImGui::GetItemRectMax();
      ImGui::GetWindowDrawList()->AddRectFilled({low.x, high.y - 3}, high, packed(kYellow));
    }
    ImGui::SameLine();
  }
  // at the right end: user, connection, log out, help
  const std::string who = lab.link().user + " @ " + lab.link().server;
  const float width = ImGui::CalcTextSize(who.c_str()).x + 30 * space();
  ImGui::SameLine(std::max(ImGui::GetCursorPosX() + space(), ImGui::GetWindowWidth() - width));
  {
    WithTextColour dim(kDimText);
    ImGui::TextUnformatted(who.c_str());
  }
  ImGui::SameLine();
  linkWord(lab.link());
  ImGui::SameLine(ImGui::GetWindowWidth() - 14.5F * space());
  if (ImGui::Button("Log out")) lab.logOut();
  ImGui::SameLine();
  if (ImGui::Button(" ? ")) show_help = !show_help;
}

void showLinkBanner(LabState& lab) {
  const LinkState& link = lab.link();
  if (link.phase != LinkPhase::kAway && link.phase != LinkPhase::kRefused) return;
  const bool refused = link.phase == LinkPhase::kRefused;
  beginPanel("link", {}, 0, 6.2F * space());
  const ImVec2 corner = ImGui::GetWindowPos(), size = ImGui::GetWindowSize();
  solidRect(*ImGui::GetWindowDrawList(), {corner.x + 1, corner.y + 1},
            {corner.x + size.x - 1, corner.y + size.y - 1},
            mixed(kPanelGrey, refused ? kVermillion : kOrange, 0.25F));
  const double away_s = 1e-9 * static_cast<double>(steadyNowNs() - link.away_since_ns);
  const double next_s = 1e-9 * static_cast<double>(link.next_try_ns - steadyNowNs());
  std::string words = link.trouble.what;
  if (!refused)
    words += fmt::format("  Disconnected for {:.0f} s; next try in {:.0f} s. The screen keeps the last data.",
                         std::max(0.0, away_s), std::max(0.0, std::ceil(next_s)));
  conditionLine(refused ? Condition::kTrouble : Condition::kAttention, words);
  {
    WithTextColour dim(kDimText);
    textLine(link.trouble.todo, ImGui::GetWindowWidth() - 22 * space());
  }
  ImGui::SameLine(ImGui::GetWindowWidth() - 18 * space());
  ImGui::SetCursorPosY(1.2F * space());
  if (actionLine(linkActions(link.phase)) == kActReconnect) {
    if (refused)
      lab.logOut();
    else
      lab.logIn();
  }
  endPanel();
}

void showNotices(LabState& lab) {
  const auto& notices = lab.notices.all();
  if (notices.empty()) return;
  const ImVec2 screen = ImGui::GetIO().DisplaySize;
  const float words_px = screen.x * 0.6F - 6 * space();
  float height = 2 * space();
  for (const Notice& notice : notices)
    height += ImGui::CalcTextSize(notice.text.c_str(), nullptr, false, words_px).y +
              ImGui::GetStyle().ItemSpacing.y;
  // above the input at the lower edge
  ImGui::SetCursorPos({screen.x * 0.2F, screen.y - height - 13 * space()});
  beginPanel("notices", {}, screen.x * 0.6F, height);
  for (const Notice& notice : notices) conditionLine(notice.condition, notice.text);
  endPanel();
}

bool showEmpty(std::string_view headline, std::string_view advice, const char* action) {
  const ImVec2 room = ImGui::GetContentRegionAvail();
  ImGui::SetCursorPos({ImGui::GetCursorPosX() + room.x * 0.2F, ImGui::GetCursorPosY() + room.y * 0.28F});
  ImGui::BeginGroup();
  ImGui::PushTextWrapPos(ImGui::GetCursorPosX() + room.x * 0.6F);
  {
    WithFont font(Letters::kHeading);
    ImGui::TextUnformatted(headline.data(), headline.data() + headline.size());
  }
  {
    WithTextColour dim(kDimText);
    ImGui::TextUnformatted(advice.data(), advice.data() + advice.size());
  }
  ImGui::PopTextWrapPos();
  ImGui::Dummy({0, space()});
  std::vector<ScreenAction> actions;
  if (action != nullptr) actions = {adviceAction(action)};
  auto chosen = actionButtons(actions);
  ImGui::EndGroup();
  if (!chosen) chosen = pressedAction(actions);
  return chosen == kActAdvice;
}

std::optional<int> pressedAction(std::span<const ScreenAction> actions) {
  // Enter belongs to a focused field or an open list
  const ImGuiIO& io = ImGui::GetIO();
  if (io.WantTextInput || io.NavVisible || ImGui::IsPopupOpen("", ImGuiPopupFlags_AnyPopup))
    return std::nullopt;
  return actionByKey(actions);
}

void showWork(const LabState& lab) {
  const std::string doing = lab.analysis.doing();
  if (doing.empty()) return;
  const double share = lab.analysis.loadedShare();
  const bool counts = doing.rfind("loading", 0) == 0;
  const std::string text = counts ? fmt::format("{}, {:.0f} %", doing, 100 * share) : doing;
  ImGui::TextUnformatted(text.c_str());
  if (counts) levelBar(std::min(1.0, share), "", kSkyBlue, 30 * space());
}

}  // namespace needlelab
