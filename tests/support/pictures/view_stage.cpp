#include "tests/support/pictures/view_stage.h"

namespace needlelab::test {

void ViewStage::SetUp() {
  options_.kind = SurfaceOptions::Kind::kOffScreen;
  options_.frames_per_s = 0;
  auto surface = Surface::open(options_);
  if (surface) {
    surface_ = std::move(surface).value();
    return;
  }
  GTEST_SKIP() << surface.error().message;
}

void ViewStage::TearDown() {
  surface_.reset();
}

RgbaImage ViewStage::draw(const std::function<void()>& screen, int frames) {
  for (int i = 0; i < frames; ++i) {
    if (!surface_->beginFrame()) break;
    screen();
    surface_->endFrame();
  }
  return surface_->picture();
}

void ViewStage::click(const std::function<void()>& screen, double x_px, double y_px) {
  surface_->moveMouse(x_px, y_px);
  draw(screen, 1);
  surface_->setMouseButton(0, true);
  draw(screen, 1);
  surface_->setMouseButton(0, false);
  draw(screen, 1);
}

void ViewStage::press(const std::function<void()>& screen, int glfw_key) {
  surface_->setKey(glfw_key, true);
  draw(screen, 1);
  surface_->setKey(glfw_key, false);
  draw(screen, 1);
}

}  // namespace needlelab::test
