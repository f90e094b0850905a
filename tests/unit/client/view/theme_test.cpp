#include "client/view/theme.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>

#include <string>

#include "common/base/text/text.h"
#include "tests/support/pictures/picture_check.h"
#include "tests/support/pictures/view_stage.h"

namespace needlelab {
namespace {

class ThemeTest : public test::ViewStage {
 protected:
  ThemeTest() {
    options_.width_px = 640;
    options_.height_px = 400;
  }
};

TEST_F(ThemeTest, aSolidRectangleIsExactlyThatAndStaysInItsClip) {
  const RgbaImage picture = draw([] {
    beginScreen("s");
    ImGui::PushClipRect({0, 0}, {150, 400}, true);
    solidRect(*ImGui::GetWindowDrawList(), {100, 50}, {200, 90}, kBlue);
    ImGui::PopClipRect();
    ImGui::GetWindowDrawList()->AddRectFilled({110, 60}, {120, 70}, IM_COL32(255, 255, 255, 255));
    endScreen();
  });
  EXPECT_EQ(test::pixelAt(picture, 100, 50), 0x0072B2u);
  EXPECT_EQ(test::pixelAt(picture, 149, 89), 0x0072B2u);
  EXPECT_EQ(test::pixelAt(picture, 99, 50), 0x14171Cu);
  EXPECT_EQ(test::pixelAt(picture, 100, 90), 0x14171Cu);
  EXPECT_EQ(test::pixelAt(picture, 151, 60), 0x14171Cu);
  EXPECT_EQ(test::pixelAt(picture, 115, 65), 0xFFFFFFu);
}

TEST_F(ThemeTest, aPanelHasItsGroundAndItsWordsLieOverIt) {
  const RgbaImage picture = draw([] {
    beginScreen("s");
    ImGui::SetCursorScreenPos({40, 40});
    beginPanel("p", "Heading", 300, 200);
    textLine("words");
    endPanel();
    endScreen();
  });
  EXPECT_EQ(test::pixelAt(picture, 200, 200), 0x1D2128u);
  EXPECT_EQ(test::pixelAt(picture, 400, 200), 0x14171Cu);
  // letters are light
  bool light = false;
  for (int y = 45; y < 110; ++y)
    for (int x = 45; x < 200; ++x) light = light || (test::pixelAt(picture, x, y) & 255u) > 220;
  EXPECT_TRUE(light);
}

TEST_F(ThemeTest, aTooLongNameIsCutBetweenLettersWithAMark) {
  draw([] {
    beginScreen("s");
    const std::string name = "Gelenkhöhle über dem Knie";
    const float whole_px = ImGui::CalcTextSize(name.c_str()).x;
    EXPECT_EQ(fittedText(name, whole_px), name);
    std::size_t longest = 0;
    for (float width_px = ImGui::CalcTextSize("…").x + 1; width_px < whole_px; width_px += 1) {
      const std::string cut = fittedText(name, width_px);
      EXPECT_LE(ImGui::CalcTextSize(cut.c_str()).x, width_px);
      EXPECT_TRUE(cut.ends_with("…"));
      EXPECT_TRUE(isUtf8(cut)) << cut;
      const std::string kept = cut.substr(0, cut.size() - std::string("…").size());
      EXPECT_TRUE(name.starts_with(kept)) << cut;
      EXPECT_GE(kept.size(), longest) << "a wider place shows no less";
      longest = kept.size();
    }
    EXPECT_GT(longest, name.size() / 2);
    endScreen();
  });
}

TEST_F(ThemeTest, aLineThatIsTooLongIsCutWithinItsWidth) {
  float used_px = 0;
  draw([&] {
    beginScreen("s");
    textLine("A very long line of words that has no room here, with an ä in it and more after that", 120);
    used_px = ImGui::GetItemRectSize().x;
    endScreen();
  });
  EXPECT_GT(used_px, 60);
  EXPECT_LE(used_px, 121);
}

TEST_F(ThemeTest, aButtonThatIsNotToBePressedIsNot) {
  int pressed = 0;
  bool enabled = false;
  const auto screen = [&] {
    beginScreen("s");
    ImGui::SetCursorScreenPos({20, 20});
    if (bigButton("go", true, 200, enabled)) ++pressed;
    endScreen();
  };
  draw(screen);
  click(screen, 60, 35);
  EXPECT_EQ(pressed, 0);
  enabled = true;
  click(screen, 60, 35);
  EXPECT_EQ(pressed, 1);
}

TEST_F(ThemeTest, widgetsLookAsTheirReference) {
  const RgbaImage picture = draw([] {
    beginScreen("s");
    beginPanel("left", "Lesson", 300, 0);
    figure("1.84", "N", "force on the hand", kOrange);
    ImGui::Spacing();
    figure("23.4", "mm", "depth · muscle");
    conditionLine(Condition::kGood, "the loop keeps its time");
    conditionLine(Condition::kAttention, "the device rests: take the handle");
    conditionLine(Condition::kTrouble, "FAULT: the tip jumped");
    levelBar(0.62, "3.1 of 5 N", kSkyBlue);
    levelBar(1.2, "6.0 of 5 N", kSkyBlue);
    endPanel();
    ImGui::SameLine();
    beginPanel("right", "Exercise", 0, 0);
    textBlock("Reach the subacromial bursa: ± 3 mm, at most 5 N, α ≥ 20°, µ = 0.3, 10² → ≤ 2 s.");
    bigButton("Start", true, 200);
    bigButton("Leave", false, 200);
    keyHint("Space", "pause");
    keyHint("Esc", "back");
    endPanel();
    endScreen();
  });
  EXPECT_TRUE(test::looksLike(picture, std::string(NEEDLELAB_REFERENCE) + "/theme.png"));
}

TEST_F(ThemeTest, aLevelIsFullAboveItsLimitAndEmptyWithoutANumber) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const auto rightEnd = [&](double share) {
    const RgbaImage picture = draw([&] {
      beginScreen("s");
      ImGui::SetCursorScreenPos({20, 20});
      levelBar(share, "x", kSkyBlue, 400);
      endScreen();
    });
    return test::pixelAt(picture, 400, 32);
  };
  const unsigned empty = rightEnd(0), full = rightEnd(1), over = rightEnd(1.5);
  EXPECT_NE(full, empty);
  EXPECT_NE(over, full) << "too much has another colour";
  struct Row {
    double share;
    unsigned expected;
  };
  for (const Row& row : {Row{-3, empty}, Row{0.5, empty}, Row{0.99, full}, Row{1e300, over},
                         Row{kInfinity, over}, Row{-kInfinity, empty}, Row{std::nan(""), empty}})
    EXPECT_EQ(rightEnd(row.share), row.expected) << row.share;
}

TEST_F(ThemeTest, allLettersAndSpacesGrowByTheSameFactor) {
  for (const double scale : {1.0, 1.5, 2.0, 2.5}) {
    surface_->setFontScale(scale);
    std::array<float, 5> sizes_px{};
    draw(
        [&] {
          for (const Letters letters : {Letters::kBody, Letters::kSmall, Letters::kHeading, Letters::kFigure})
            sizes_px[static_cast<std::size_t>(letters)] = fontOf(letters)->FontSize;
          sizes_px[4] = space();
        },
        3);
    constexpr std::array<double, 5> kSizes = {18, 15, 24, 44, 9};
    for (std::size_t i = 0; i < kSizes.size(); ++i)
      EXPECT_NEAR(static_cast<double>(sizes_px[i]), kSizes[i] * scale, 0.5) << i << " at " << scale;
  }
}

}  // namespace
}  // namespace needlelab
