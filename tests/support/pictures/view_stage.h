/// A surface without a display for tests of screens and widgets.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <memory>

#include "client/view/surface.h"

namespace needlelab::test {

/// Makes one off-screen surface for the test. Without OpenGL the test is skipped with the reason, which
/// deploy/test does not allow. The derived class chooses sizes and scale.
class ViewStage : public ::testing::Test {
 protected:
  void SetUp() override;
  void TearDown() override;
  /// The options to use; set them before SetUp() runs.
  SurfaceOptions options_;
  std::unique_ptr<Surface> surface_;

  /// Draws that many frames of these ImGui calls; returns the picture of the last one.
  RgbaImage draw(const std::function<void()>& screen, int frames = 2);
  /// Presses and releases the left button there, over three frames of `screen`.
  void click(const std::function<void()>& screen, double x_px, double y_px);
  /// Presses and releases a key (GLFW's number), over two frames.
  void press(const std::function<void()>& screen, int glfw_key);
};

}  // namespace needlelab::test
