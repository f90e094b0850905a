#include "client/view/ultrasound_view.h"

#include <gtest/gtest.h>

#include <string>

#include "client/view/theme.h"
#include "tests/support/pictures/picture_check.h"
#include "tests/support/pictures/view_stage.h"
#include "tests/support/view_lesson/sample_lesson.h"

namespace needlelab {
namespace {

class UltrasoundViewTest : public test::ViewStage {
 protected:
  UltrasoundViewTest() {
    options_.width_px = 420;
    options_.height_px = 380;
    options_.frames_per_s = 0;
  }
  RgbaImage drawn(UltrasoundView& view, int frames = 2) {
    return draw(
        [&] {
          beginScreen("s");
          ImGui::SetCursorScreenPos({10, 10});
          view.show("us", *lesson_.scene, moment_, {400, 360});
          endScreen();
        },
        frames);
  }
  void goTo(double time_s) {
    GestureReplica replica(lesson_.model);
    for (const GestureSample& sample : lesson_.samples)
      if (static_cast<double>(sample.tick) / 1000 < time_s) moment_ = replica.feed(sample);
  }
  test::SampleLesson lesson_ = test::sampleLesson("hip-adult", {0.001, 0.3});
  Moment moment_;
};

TEST_F(UltrasoundViewTest, followsTheNeedleAtItsOwnRate) {
  UltrasoundView view(10);
  goTo(2.0);
  const RgbaImage first = drawn(view, 1);
  goTo(2.8);
  // frames of 1/30 s: two more show the same picture, within four it is new
  const RgbaImage soon = drawn(view, 1);
  const RgbaImage later = drawn(view, 4);
  // The text above the picture's middle is the measured cost, which varies.
  const auto below = [](RgbaImage image) {
    image.pixels.erase(image.pixels.begin(), image.pixels.begin() + 4 * 420 * 60);
    image.height -= 60;
    return image;
  };
  EXPECT_EQ(test::shareThatDiffers(below(first), below(soon), 0), 0);
  EXPECT_GT(test::shareThatDiffers(below(first), below(later), 30), 0.002);
  EXPECT_GT(view.lastCost_s(), 0);
}

TEST_F(UltrasoundViewTest, looksAsItsReference) {
  UltrasoundView view;
  goTo(2.9);
  test::PictureTolerance tolerance;
  tolerance.passed_over = {{280, 0, 140, 40}};  // the cost
  tolerance.share_of_pixels = 0.03;
  EXPECT_TRUE(test::looksLike(drawn(view), std::string(NEEDLELAB_REFERENCE) + "/ultrasound.png", tolerance));
}

TEST_F(UltrasoundViewTest, withoutRoomNothingIsComputed) {
  UltrasoundView view;
  draw([&] {
    beginScreen("s");
    view.show("us", *lesson_.scene, moment_, {20, 20});
    endScreen();
  });
  EXPECT_EQ(view.lastCost_s(), 0);
}

}  // namespace
}  // namespace needlelab
