#include "client/instructor/screens/instructor_window.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <array>
#include <optional>
#include <utility>

#include <imgui/imgui.h>
#include <imgui/imgui_internal.h>

#include "client/instructor/screens/screens.h"
#include "client/view/theme.h"

namespace needlelab {
namespace {

/// Collects all text written between construction and `take`, in order. At most one instance, within one
/// ImGui window that opens no other (tooltips end the collection).
class ScreenText {
 public:
  ScreenText() { ImGui::LogToBuffer(); }
  ~ScreenText() { ImGui::LogFinish(); }
  ScreenText(const ScreenText&) = delete;
  ScreenText& operator=(const ScreenText&) = delete;
  std::string take() {
    const ImGuiTextBuffer& buffer = ImGui::GetCurrentContext()->LogBuffer;
    std::string text(buffer.begin(), buffer.end());
    ImGui::LogFinish();
    return text;
  }
};

struct Key {
  const char* key;
  const char* meaning;
};
constexpr std::array kKeys = {Key{"F1  ?", "this list"},
                              Key{"Ctrl 1 … 7", "lab, watch, sessions, replay, compare, re-run, scores"},
                              Key{"Ctrl +  Ctrl −  Ctrl 0", "larger, smaller, normal letters"},
                              Key{"Space", "pause and follow; play and pause"},
                              Key{"←  →", "scroll back and forward 1 s; a step of 10 ms"},
                              Key{"PgUp  PgDn", "ten times as far"},
                              Key{"Home  End", "to the beginning, to the newest"},
                              Key{"+  −", "zoom plots in and out; faster and slower"},
                              Key{"L", "loop 2 s from here, or end the loop (replay)"},
                              Key{"V", "next camera"},
                              Key{"P", "next set of plots"},
                              Key{"M", "message to the trainee (watch), to those chosen (lab)"},
                              Key{"N", "remark at this moment"},
                              Key{"H", "watch the station that calls for help first (lab)"},
                              Key{"Ctrl and click", "choose stations for a command (lab)"},
                              Key{"1 … 9", "watch that tile's station, in the order shown (lab)"},
                              Key{"Esc", "back to the lab; dismiss notices; choose none"}};

bool pressed(int key, bool repeat = false) {
  return ImGui::IsKeyPressed(key, repeat);
}

/// Keys available on every screen.
bool actEverywhere(InstructorWindow& window) {
  LabState& lab = window.lab();
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
  constexpr std::array kScreens = {WindowScreen::kLab,    WindowScreen::kLive,    WindowScreen::kSessions,
                                   WindowScreen::kReplay, WindowScreen::kCompare, WindowScreen::kRerun,
                                   WindowScreen::kScores};
  for (std::size_t i = 0; lab.inside() && i < kScreens.size(); ++i)
    if (pressed(GLFW_KEY_1 + static_cast<int>(i))) lab.screen = kScreens[i];
  return true;
}

void actInLab(InstructorWindow& window) {
  LabState& lab = window.lab();
  const auto calls = lab.overview.calls().open(lab.now_s());
  if (pressed(GLFW_KEY_H) && !calls.empty()) return lab.open(std::string(calls.front()->station));
  if (pressed(GLFW_KEY_M)) window.lab_screen.commands.focusMessage();
  for (int i = 0; i < 9; ++i) {
    if (!pressed(GLFW_KEY_1 + i)) continue;
    const auto tiles = lab.overview.tiles(lab.filter);
    if (static_cast<std::size_t>(i) < tiles.size()) lab.open(tiles[static_cast<std::size_t>(i)]->station);
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
  LiveStation* const live = window.lab().live();
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
  if (pressed(GLFW_KEY_M)) window.live_screen.commands.focusMessage();
  if (pressed(GLFW_KEY_N)) window.live_screen.commands.focusRemark();
}

void actInReplay(InstructorWindow& window) {
  ReplayPlayer& player = window.lab().analysis.player;
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
  // without a session the remark field does not exist
  if (pressed(GLFW_KEY_N) && window.lab().analysis.first()) window.replay_screen.focusRemark();
}

/// Handles this frame's key presses; does nothing while the user types.
void actOnKeys(InstructorWindow& window) {
  LabState& lab = window.lab();
  if (actEverywhere(window)) return;
  if (ImGui::GetIO().WantTextInput || !lab.inside()) return;
  if (pressed(GLFW_KEY_SLASH) && ImGui::GetIO().KeyShift) window.show_help = !window.show_help;
  // Esc then belongs to the question
  const bool asking = lab.stop_question.asking();
  if (pressed(GLFW_KEY_ESCAPE) && !asking) {
    if (window.show_help)
      window.show_help = false;
    else if (!lab.notices.all().empty())
      lab.notices.dismiss();
    else if (lab.screen == WindowScreen::kLab)
      lab.chosen.clear();
    else
      lab.screen = WindowScreen::kLab;
    return;
  }
  switch (lab.screen) {
    case WindowScreen::kLab:
      return actInLab(window);
    case WindowScreen::kLive:
      return actLive(window);
    case WindowScreen::kReplay:
      return actInReplay(window);
    default:
      return;
  }
}

/// On screens that use the arrows and Space, Dear ImGui's keyboard navigation must be off: it would press the
/// focused button too. An open list keeps its arrows. Takes effect in the next frame.
void shareKeys(const LabState& lab) {
  const bool own_keys = lab.screen == WindowScreen::kLive || lab.screen == WindowScreen::kReplay;
  ImGuiIO& io = ImGui::GetIO();
  if (own_keys && !ImGui::IsPopupOpen("", ImGuiPopupFlags_AnyPopup))
    io.ConfigFlags &= ~ImGuiConfigFlags_NavEnableKeyboard;
  else
    io.ConfigFlags |= ImGuiConfigFlags_NavEnableKeyboard;
}

/// Draws the list of keys over the screen.
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

}  // namespace

std::string flatText(const std::string& text) {
  std::string flat;
  for (const char c : text) {
    const bool blank = c == ' ' || c == '\n' || c == '\r' || c == '\t';
    if (blank && (flat.empty() || flat.back() == ' ')) continue;
    flat += blank ? ' ' : c;
  }
  return flat;
}

Result<std::unique_ptr<InstructorWindow>> InstructorWindow::make(Surface& surface, LabState& lab) {
  ASSIGN_OR_RETURN(auto live, ScenePane::make());
  ASSIGN_OR_RETURN(auto replay, ScenePane::make());
  ASSIGN_OR_RETURN(auto first, ScenePane::make());
  ASSIGN_OR_RETURN(auto second, ScenePane::make());
  return std::unique_ptr<InstructorWindow>(new InstructorWindow(
      surface, lab, std::move(live), std::move(replay), std::move(first), std::move(second)));
}

InstructorWindow::InstructorWindow(Surface& surface, LabState& lab, ScenePane live, ScenePane replay,
                                   ScenePane first, ScenePane second)
    : live_screen(std::move(live)),
      replay_screen(std::move(replay)),
      compare_screen(std::move(first), std::move(second)),
      surface_(surface),
      lab_(lab) {}

void InstructorWindow::drawScreen() {
  switch (lab_.screen) {
    case WindowScreen::kLogin:
      return showLogin(lab_);
    case WindowScreen::kLab:
      return lab_screen.show(lab_);
    case WindowScreen::kLive:
      return live_screen.show(lab_);
    case WindowScreen::kSessions:
      return sessions_screen.show(lab_);
    case WindowScreen::kReplay:
      return replay_screen.show(lab_);
    case WindowScreen::kCompare:
      return compare_screen.show(lab_);
    case WindowScreen::kRerun:
      return rerun_screen.show(lab_);
    case WindowScreen::kScores:
      return scores_screen.show(lab_);
  }
}

void InstructorWindow::draw(bool read_text) {
  actOnKeys(*this);
  beginScreen("instructor");
  std::optional<ScreenText> reader;
  if (read_text) reader.emplace();
  if (lab_.inside()) {
    showNavigation(lab_, show_help);
    showLinkBanner(lab_);
  }
  drawScreen();
  showNotices(lab_);
  if (show_help) showShortcuts();
  if (reader) text_ = flatText(reader->take());
  reader.reset();
  endScreen();
  shareKeys(lab_);
}

}  // namespace needlelab
