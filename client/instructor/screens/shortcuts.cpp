#include "client/instructor/screens/shortcuts.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <array>

#include "client/instructor/screens/instructor_window.h"
#include "client/view/theme.h"

namespace needlelab {
namespace {

struct Key {
  const char* key;
  const char* meaning;
};
constexpr std::array kKeys = {Key{"F1  ?", "this list"},
                              Key{"Ctrl 1 … 7", "lab, look over, sessions, replay, compare, re-run, scores"},
                              Key{"Ctrl +  Ctrl −  Ctrl 0", "larger, smaller, usual letters"},
                              Key{"Space", "pause and follow; play and pause"},
                              Key{"←  →", "scroll back and forward 1 s; a step of 10 ms"},
                              Key{"PgUp  PgDn", "ten times as far"},
                              Key{"Home  End", "to the beginning, to the newest"},
                              Key{"+  −", "closer and wider plots; faster and slower"},
                              Key{"L", "loop 2 s from here, or end the loop (replay)"},
                              Key{"V", "next camera"},
                              Key{"P", "next set of plots"},
                              Key{"M", "message to the trainee (look over)"},
                              Key{"N", "remark at this moment"},
                              Key{"H", "only who needs help (lab)"},
                              Key{"1 … 9", "look over that tile, in the order shown (lab)"},
                              Key{"Esc", "back to the lab; away with notices"}};

bool pressed(int key, bool repeat = false) {
  return ImGui::IsKeyPressed(key, repeat);
}

/// What every screen has.
bool actEverywhere(InstructorWindow& window) {
  Desk& desk = window.desk();
  Surface& surface = window.surface();
  const ImGuiIO& io = ImGui::GetIO();
  if (pressed(GLFW_KEY_F1)) {
    window.show_help = !window.show_help;
    return true;
  }
  if (!io.KeyCtrl) return false;
  if (pressed(GLFW_KEY_EQUAL, true) || pressed(GLFW_KEY_KP_ADD, true))
    surface.setFontScale(surface.fontScale() + 0.1);
  if (pressed(GLFW_KEY_MINUS, true) || pressed(GLFW_KEY_KP_SUBTRACT, true))
    surface.setFontScale(surface.fontScale() - 0.1);
  if (pressed(GLFW_KEY_0)) surface.setFontScale(1);
  constexpr std::array kScreens = {DeskScreen::kLab,    DeskScreen::kLive,    DeskScreen::kSessions,
                                   DeskScreen::kReplay, DeskScreen::kCompare, DeskScreen::kRerun,
                                   DeskScreen::kScores};
  for (std::size_t i = 0; desk.inside() && i < kScreens.size(); ++i)
    if (pressed(GLFW_KEY_1 + static_cast<int>(i))) desk.screen = kScreens[i];
  return true;
}

void actInLab(Desk& desk) {
  if (pressed(GLFW_KEY_H)) desk.filter.only_help = !desk.filter.only_help;
  for (int i = 0; i < 9; ++i) {
    if (!pressed(GLFW_KEY_1 + i)) continue;
    const auto tiles = desk.overview.tiles(desk.order, desk.filter);
    if (static_cast<std::size_t>(i) < tiles.size()) desk.open(tiles[static_cast<std::size_t>(i)]->station);
    return;
  }
}

template <typename Screen>
void actOnPane(Screen& screen) {
  if (pressed(GLFW_KEY_V))
    screen.pane().look(static_cast<Look>((static_cast<int>(screen.pane().looking()) + 1) % 3));
  if (pressed(GLFW_KEY_P)) screen.plots = static_cast<PlotSet>((static_cast<int>(screen.plots) + 1) % 3);
}

void actLive(InstructorWindow& window) {
  LiveStation* const live = window.desk().live();
  actOnPane(window.live_screen);
  if (live == nullptr) return;
  if (pressed(GLFW_KEY_SPACE)) live->paused() ? live->resume() : live->pause();
  const auto scroll = [&](int key, double seconds) {
    if (pressed(key, true)) live->scrollTo(live->viewEnd_s() + seconds);
  };
  scroll(GLFW_KEY_LEFT, -1);
  scroll(GLFW_KEY_RIGHT, 1);
  scroll(GLFW_KEY_PAGE_UP, -10);
  scroll(GLFW_KEY_PAGE_DOWN, 10);
  if (pressed(GLFW_KEY_HOME)) live->scrollTo(live->trace().firstTime_s());
  if (pressed(GLFW_KEY_END)) live->resume();
  if (pressed(GLFW_KEY_EQUAL) || pressed(GLFW_KEY_KP_ADD)) live->setSpan(live->span_s() / 1.5);
  if (pressed(GLFW_KEY_MINUS) || pressed(GLFW_KEY_KP_SUBTRACT)) live->setSpan(live->span_s() * 1.5);
  if (pressed(GLFW_KEY_M)) window.live_screen.talk.focusMessage();
  if (pressed(GLFW_KEY_N)) window.live_screen.talk.focusRemark();
}

void actInReplay(InstructorWindow& window) {
  ReplayPlayer& player = window.desk().bench.player;
  actOnPane(window.replay_screen);
  if (pressed(GLFW_KEY_SPACE)) player.toggle();
  if (pressed(GLFW_KEY_LEFT, true)) player.step(-1);
  if (pressed(GLFW_KEY_RIGHT, true)) player.step(1);
  if (pressed(GLFW_KEY_PAGE_UP, true)) player.step(-10);
  if (pressed(GLFW_KEY_PAGE_DOWN, true)) player.step(10);
  if (pressed(GLFW_KEY_HOME)) player.seek(player.first_s());
  if (pressed(GLFW_KEY_END)) player.seek(player.last_s());
  if (pressed(GLFW_KEY_EQUAL) || pressed(GLFW_KEY_KP_ADD)) player.faster();
  if (pressed(GLFW_KEY_MINUS) || pressed(GLFW_KEY_KP_SUBTRACT)) player.slower();
  if (pressed(GLFW_KEY_L))
    player.setLoop(player.loop() ? std::nullopt
                                 : std::optional(ReplayLoop{player.at_s(), player.at_s() + 2}));
  if (pressed(GLFW_KEY_N)) window.replay_screen.focusRemark();
}

}  // namespace

void actOnKeys(InstructorWindow& window) {
  Desk& desk = window.desk();
  if (actEverywhere(window)) return;
  if (ImGui::GetIO().WantTextInput || !desk.inside()) return;
  if (pressed(GLFW_KEY_SLASH) && ImGui::GetIO().KeyShift) window.show_help = !window.show_help;
  if (pressed(GLFW_KEY_ESCAPE)) {
    if (window.show_help)
      window.show_help = false;
    else if (!desk.notices.all().empty())
      desk.notices.dismiss();
    else
      desk.screen = DeskScreen::kLab;
    return;
  }
  switch (desk.screen) {
    case DeskScreen::kLab:
      return actInLab(desk);
    case DeskScreen::kLive:
      return actLive(window);
    case DeskScreen::kReplay:
      return actInReplay(window);
    default:
      return;
  }
}

void showShortcuts() {
  const ImVec2 screen = ImGui::GetIO().DisplaySize;
  ImGui::SetCursorPos({screen.x * 0.18F, screen.y * 0.1F});
  beginPanel("shortcuts", "Keyboard", screen.x * 0.64F, screen.y * 0.82F);
  for (const Key& key : kKeys) {
    ImGui::TextUnformatted(key.key);
    ImGui::SameLine(26 * space());
    WithTextColour dim(kDimText);
    textLine(key.meaning);
  }
  endPanel();
}

}  // namespace needlelab
