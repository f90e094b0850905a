#include "client/instructor/screens/instructor_window.h"

#include <optional>
#include <utility>

#include "client/instructor/screens/desk_frame.h"
#include "client/instructor/screens/lab_screen.h"
#include "client/instructor/screens/login_screen.h"
#include "client/instructor/screens/screen_text.h"
#include "client/instructor/screens/shortcuts.h"
#include "client/view/theme.h"

namespace needlelab {

Result<std::unique_ptr<InstructorWindow>> InstructorWindow::make(Surface& surface, Desk& desk) {
  auto live = ScenePane::make();
  if (!live.ok()) return live.error();
  auto replay = ScenePane::make();
  if (!replay.ok()) return replay.error();
  auto first = ScenePane::make();
  if (!first.ok()) return first.error();
  auto second = ScenePane::make();
  if (!second.ok()) return second.error();
  return std::unique_ptr<InstructorWindow>(new InstructorWindow(
      surface, desk, std::move(*live), std::move(*replay), std::move(*first), std::move(*second)));
}

InstructorWindow::InstructorWindow(Surface& surface, Desk& desk, ScenePane live, ScenePane replay,
                                   ScenePane first, ScenePane second)
    : live_screen(std::move(live)),
      replay_screen(std::move(replay)),
      compare_screen(std::move(first), std::move(second)),
      surface_(surface),
      desk_(desk) {}

void InstructorWindow::drawScreen() {
  switch (desk_.screen) {
    case DeskScreen::kLogin:
      return showLogin(desk_);
    case DeskScreen::kLab:
      return showLab(desk_);
    case DeskScreen::kLive:
      return live_screen.show(desk_);
    case DeskScreen::kSessions:
      return sessions_screen.show(desk_);
    case DeskScreen::kReplay:
      return replay_screen.show(desk_);
    case DeskScreen::kCompare:
      return compare_screen.show(desk_);
    case DeskScreen::kRerun:
      return rerun_screen.show(desk_);
    case DeskScreen::kScores:
      return scores_screen.show(desk_);
  }
}

void InstructorWindow::draw(bool read_text) {
  actOnKeys(*this);
  beginScreen("instructor");
  std::optional<ScreenText> reader;
  if (read_text) reader.emplace();
  if (desk_.inside()) {
    showNavigation(desk_, show_help);
    showLinkBanner(desk_);
  }
  drawScreen();
  showNotices(desk_);
  if (show_help) showShortcuts();
  if (reader) text_ = flatText(reader->take());
  reader.reset();
  endScreen();
}

}  // namespace needlelab
