#include "client/instructor/screens/desk_frame.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "client/view/theme.h"
#include "common/base/clock.h"
#include "common/base/text.h"

namespace needlelab {
namespace {

struct Place {
  DeskScreen screen;
  const char* label;
};
constexpr std::array kPlaces = {
    Place{DeskScreen::kLab, "Lab"},           Place{DeskScreen::kLive, "Look over"},
    Place{DeskScreen::kSessions, "Sessions"}, Place{DeskScreen::kReplay, "Replay"},
    Place{DeskScreen::kCompare, "Compare"},   Place{DeskScreen::kRerun, "Re-run"},
    Place{DeskScreen::kScores, "Scores"}};

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

void showNavigation(Desk& desk, bool& show_help) {
  for (const Place& place : kPlaces) {
    const bool here = desk.screen == place.screen;
    ImGui::PushStyleColor(ImGuiCol_Button, here ? colourOf(kBlue) : colourOf(kPanelGrey));
    if (ImGui::Button(place.label)) desk.screen = place.screen;
    ImGui::PopStyleColor();
    if (here) {
      // not by colour alone
      const ImVec2 low = ImGui::GetItemRectMin(), high = ImGui::GetItemRectMax();
      ImGui::GetWindowDrawList()->AddRectFilled({low.x, high.y - 3}, high, packed(kYellow));
    }
    ImGui::SameLine();
  }
  // the right end: who, how the line stands, out, help
  const std::string who = desk.link().user + " @ " + desk.link().server;
  const float width = ImGui::CalcTextSize(who.c_str()).x + 30 * space();
  ImGui::SameLine(std::max(ImGui::GetCursorPosX() + space(), ImGui::GetWindowWidth() - width));
  {
    WithTextColour dim(kDimText);
    ImGui::TextUnformatted(who.c_str());
  }
  ImGui::SameLine();
  linkWord(desk.link());
  ImGui::SameLine(ImGui::GetWindowWidth() - 14.5F * space());
  if (ImGui::Button("Log out")) desk.logOut();
  ImGui::SameLine();
  if (ImGui::Button(" ? ")) show_help = !show_help;
}

void showLinkBanner(Desk& desk) {
  const LinkState& link = desk.link();
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
    words += formatted("  Away for %.0f s; next try in %.0f s. What is shown stays.", std::max(0.0, away_s),
                       std::max(0.0, std::ceil(next_s)));
  conditionLine(refused ? Condition::kTrouble : Condition::kAttention, words);
  {
    WithTextColour dim(kDimText);
    textLine(link.trouble.todo, ImGui::GetWindowWidth() - 22 * space());
  }
  ImGui::SameLine(ImGui::GetWindowWidth() - 18 * space());
  ImGui::SetCursorPosY(1.2F * space());
  if (ImGui::Button(refused ? "Log in again" : "Try now")) {
    if (refused)
      desk.logOut();
    else
      desk.logIn();
  }
  endPanel();
}

void showNotices(Desk& desk) {
  const auto& notices = desk.notices.all();
  if (notices.empty()) return;
  const ImVec2 screen = ImGui::GetIO().DisplaySize;
  const float words_px = screen.x * 0.6F - 6 * space();
  float height = 2 * space();
  for (const Notice& notice : notices)
    height += ImGui::CalcTextSize(notice.text.c_str(), nullptr, false, words_px).y +
              ImGui::GetStyle().ItemSpacing.y;
  // above what is typed at the lower edge
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
  const bool pressed = action != nullptr && bigButton(action, true);
  ImGui::EndGroup();
  return pressed;
}

void showWork(const Desk& desk) {
  const std::string doing = desk.bench.doing();
  if (doing.empty()) return;
  const double share = desk.bench.loadedShare();
  const bool counts = doing.rfind("loading", 0) == 0;
  const std::string text = counts ? formatted("%s, %.0f %%", doing.c_str(), 100 * share) : doing;
  ImGui::TextUnformatted(text.c_str());
  if (counts) levelBar(std::min(1.0, share), "", kSkyBlue, 30 * space());
}

}  // namespace needlelab
