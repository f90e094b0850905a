// Runs the instructor's window as a program: log-in, screenshot, exit.
#include <epoxy/gl.h>

#include <functional>
#include <utility>

#include "client/instructor/model/lab_state.h"
#include "client/instructor/screens/instructor_window.h"
#include "common/base/time/clock.h"
#include "common/fem/needle_mesh.h"

namespace needlelab {
namespace {

double secondsSince(std::int64_t began_ns) {
  return 1e-9 * static_cast<double>(steadyNowNs() - began_ns);
}

}  // namespace

Status runInstructorWindow(const WindowRunOptions& options, const std::function<bool()>& stopped) {
  ASSIGN_OR_RETURN(auto surface, Surface::open(options.surface));
  LabState lab(addCompliance);
  lab.form = options.form;
  ASSIGN_OR_RETURN(auto window, InstructorWindow::make(*surface, lab));
  if (!lab.form.password.empty() && !options.driver) lab.logIn();

  const std::int64_t began_ns = steadyNowNs();
  bool arrived = false;
  while (!stopped() && surface->beginFrame()) {
    lab.update(secondsSince(began_ns));
    if (lab.inside() && !std::exchange(arrived, true)) {
      // if this fails, the user types the log-in again next time
      if (!options.login_memory.empty()) (void)rememberLogin(options.login_memory, lab.form).ok();
      if (!options.station.empty()) lab.open(options.station);
      if (!options.session.empty()) {
        lab.analysis.loadFirst(options.session);
        lab.screen = WindowScreen::kReplay;
      }
    }
    window->draw(options.driver != nullptr);
    surface->endFrame();
    // wait until drawing has finished: the latency ends here
    glFinish();
    lab.presented(wallNowNs());
    if (options.driver && !options.driver(*window)) break;
    if (!options.screenshot.empty() && secondsSince(began_ns) >= options.screenshot_at_s)
      return savePng(surface->picture(), options.screenshot);
    if (options.seconds && secondsSince(began_ns) >= *options.seconds) break;
  }
  return {};
}

}  // namespace needlelab
