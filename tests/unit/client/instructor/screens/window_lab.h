/// A server, its stations, and an instructor's window rendered into memory.
#pragma once

// Included before the palette: otherwise GCC warns that enumerators of a scoped enum of the server shadow the
// palette's colours.
#include "tests/unit/server/live/running_server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "client/instructor/screens/instructor_window.h"
#include "tests/support/patience.h"
#include "tests/support/time_zone.h"
#include "tests/unit/client/instructor/screens/bench_station.h"
#include "tests/windows/script/script_runner.h"

namespace needlelab::test {

class WindowLab : public testing::Test {
 protected:
  WithZone zone_{"UTC"};  // the pictures show times of day
  int port_ = 0;
  RunningServer server_{[this](ServerOptions& options) {
    if (port_ != 0) options.listen = "127.0.0.1:" + std::to_string(port_);
  }};
  TempFolder files_;
  std::unique_ptr<Surface> surface_;
  std::unique_ptr<LabState> lab_;
  std::unique_ptr<InstructorWindow> window_;
  std::vector<std::string> printed_;
  const std::int64_t began_ns_ = steadyNowNs();
  double frame_s_ = 0;  ///< advances the lab's clock by this much per frame, so nothing has to wait
  double ahead_s_ = 0;  ///< relative to the machine's clock

  void SetUp() override {
    port_ = server_.server().port();
    server_.addUser("anna", pb::INSTRUCTOR, "correct horse battery");
    server_.addUser("tina", pb::TRAINEE, "correct horse battery");
    SurfaceOptions options;
    options.kind = SurfaceOptions::Kind::kOffScreen;
    options.frames_per_s = 30;
    auto surface = Surface::open(options);
    if (!surface.ok()) GTEST_SKIP() << surface.error().message;
    surface_ = std::move(*surface);
    LabConnectionSettings settings;
    settings.first_retry = milliseconds(20);
    settings.max_retry = milliseconds(200);
    lab_ = std::make_unique<LabState>(ScenePreparer{}, settings);
    const auto config = server_.config({});
    lab_->form.server = "127.0.0.1:" + std::to_string(config.server.port);
    lab_->form.ca_file = config.ca_file;
    lab_->form.user = "anna";
    lab_->form.password = "correct horse battery";
    auto window = InstructorWindow::make(*surface_, *lab_);
    ASSERT_TRUE(window.ok()) << window.error().message;
    window_ = std::move(*window);
  }
  void TearDown() override {
    window_.reset();
    lab_.reset();
    surface_.reset();
  }

  void frame() {
    ASSERT_TRUE(surface_->beginFrame());
    ahead_s_ += frame_s_;
    lab_->update(1e-9 * static_cast<double>(steadyNowNs() - began_ns_) + ahead_s_);
    window_->draw(true);
    surface_->endFrame();
    lab_->presented(wallNowNs());
  }
  void frames(int n) {
    for (int i = 0; i < n; ++i) frame();
  }
  /// Draws frames until the condition holds.
  bool until(const std::function<bool()>& so) {
    const auto end = std::chrono::steady_clock::now() + kPatience;
    while (!so()) {
      if (std::chrono::steady_clock::now() > end) return false;
      frame();
    }
    return true;
  }
  bool untilText(const std::string& words) {
    return until([&] { return window_->text().find(words) != std::string::npos; });
  }
  /// Runs a script to its end.
  Status script(const std::string& text) {
    auto actions = parseScript(text, "script");
    if (!actions.ok()) return actions.error();
    ScriptRunner runner(std::move(*actions), "script",
                        [this](const std::string& line) { printed_.push_back(line); });
    while (!runner.over()) {
      frame();
      runner.afterFrame(*window_);
    }
    return runner.status();
  }
  /// Presses and releases a key.
  void press(int key, bool ctrl = false, bool shift = false) {
    constexpr int kLeftShift = 340, kLeftCtrl = 341;
    if (ctrl) surface_->setKey(kLeftCtrl, true);
    if (shift) surface_->setKey(kLeftShift, true);
    surface_->setKey(key, true);
    frame();
    surface_->setKey(key, false);
    surface_->setKey(kLeftCtrl, false);
    surface_->setKey(kLeftShift, false);
    frames(2);
  }
};

}  // namespace needlelab::test
