#include "client/view/surface.h"

#include <epoxy/gl.h>
#include <gtest/gtest.h>
#include <imgui/imgui.h>

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <array>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

#include "client/view/theme.h"
#include "tests/support/pictures/picture_check.h"
#include "tests/support/pictures/view_stage.h"
#include "tests/support/temp_folder.h"
#include "tests/support/time/fake_time.h"

namespace needlelab {
namespace {

using test::pixelAt;

class SurfaceTest : public test::ViewStage {
 protected:
  SurfaceTest() {
    options_.width_px = 400;
    options_.height_px = 240;
  }
};

void redSquare() {
  ImGui::GetForegroundDrawList()->AddRectFilled({100, 50}, {200, 150}, IM_COL32(255, 0, 0, 255));
}

TEST_F(SurfaceTest, thePictureIsUpright) {
  const RgbaImage picture = draw(redSquare);
  EXPECT_EQ(picture.width, 400);
  EXPECT_EQ(picture.height, 240);
  EXPECT_EQ(pixelAt(picture, 150, 60), 0xFF0000u);
  EXPECT_EQ(pixelAt(picture, 150, 40), 0x14171Cu);
  EXPECT_EQ(pixelAt(picture, 150, 160), 0x14171Cu);
  EXPECT_EQ(pixelAt(picture, 90, 60), 0x14171Cu);
}

TEST_F(SurfaceTest, theSameCallsGiveTheSameBytes) {
  const auto screen = [] {
    beginScreen("s");
    figure("12.4", "mm", "depth");
    conditionLine(Condition::kAttention, "the device rests — 5 µm, α → θ");
    endScreen();
  };
  const RgbaImage first = draw(screen, 3);
  surface_.reset();
  SetUp();
  const RgbaImage second = draw(screen, 3);
  EXPECT_EQ(first.pixels, second.pixels);
}

TEST_F(SurfaceTest, aFrameThatIsTheSameIsNotDrawnAgain) {
  draw(redSquare, 3);
  const std::uint64_t before = surface_->framesDrawn();
  draw(redSquare, 10);
  EXPECT_LE(surface_->framesDrawn(), before + 1);
  draw(
      [] {
        ImGui::GetForegroundDrawList()->AddRectFilled({100, 50}, {200, 151}, IM_COL32(255, 0, 0, 255));
      },
      1);
  EXPECT_GT(surface_->framesDrawn(), before);
  EXPECT_EQ(pixelAt(surface_->picture(), 150, 150), 0xFF0000u);
}

TEST_F(SurfaceTest, aSolidRectanglesNewColourIsDrawnAtOnce) {
  const auto screen = [](Rgb colour) {
    beginScreen("s");
    solidRect(*ImGui::GetWindowDrawList(), {10, 10}, {50, 50}, colour);
    endScreen();
  };
  draw([&] { screen(kBlue); }, 4);
  EXPECT_EQ(pixelAt(draw([&] { screen(kVermillion); }, 1), 30, 30), 0xD55E00u);
}

TEST_F(SurfaceTest, mouseKeysAndTextReachTheWidgets) {
  int pressed = 0;
  bool escape = false;
  std::array<char, 32> text{};
  const auto screen = [&] {
    beginScreen("s");
    ImGui::SetCursorScreenPos({20, 20});
    if (ImGui::Button("press", {100, 40})) ++pressed;
    ImGui::SetCursorScreenPos({20, 100});
    ImGui::InputText("name", text.data(), text.size());
    escape = escape || ImGui::IsKeyPressed(GLFW_KEY_F5);
    endScreen();
  };
  draw(screen);
  click(screen, 70, 40);
  EXPECT_EQ(pressed, 1);
  click(screen, 300, 40);
  EXPECT_EQ(pressed, 1);
  click(screen, 60, 112);
  surface_->typeText("Ångström");
  draw(screen, 2);
  EXPECT_STREQ(text.data(), "Ångström");
  press(screen, GLFW_KEY_F5);
  EXPECT_TRUE(escape);
}

// Everything happens between two frames, as if one stood still. The button is drawn before the field, and a
// click on it takes the keyboard from the field.
TEST_F(SurfaceTest, aMessageIsSentBeforeTheClickAfterItCounts) {
  std::array<char, 32> text{};
  std::vector<std::string> done;
  const auto screen = [&] {
    beginScreen("s");
    ImGui::SetCursorScreenPos({20, 20});
    if (ImGui::Button("stop", {100, 40})) done.emplace_back("stop");
    ImGui::SetCursorScreenPos({20, 100});
    if (ImGui::InputText("message", text.data(), text.size(), ImGuiInputTextFlags_EnterReturnsTrue)) {
      done.push_back(std::string("sent: ") + text.data());
      text = {};
    }
    endScreen();
  };
  const auto clickAtOnce = [&](double x_px, double y_px) {
    surface_->moveMouse(x_px, y_px);
    for (const bool down : {true, false}) surface_->setMouseButton(0, down);
  };
  draw(screen);
  clickAtOnce(60, 112);
  surface_->typeText("hm");
  for (const bool down : {true, false}) surface_->setKey(GLFW_KEY_ENTER, down);
  clickAtOnce(70, 40);
  clickAtOnce(60, 112);
  surface_->typeText("well");
  clickAtOnce(70, 40);
  draw(screen, 20);
  EXPECT_EQ(done, (std::vector<std::string>{"sent: hm", "stop", "stop"}));
  EXPECT_STREQ(text.data(), "well") << "not sent, and not lost";
}

TEST_F(SurfaceTest, lettersGrowWithTheirScaleWhichIsHeldToItsRange) {
  float height_px = 0;
  const auto screen = [&] { height_px = ImGui::GetFontSize(); };
  draw(screen);
  EXPECT_FLOAT_EQ(height_px, 18);
  surface_->setFontScale(2);
  draw(screen);
  EXPECT_FLOAT_EQ(height_px, 36);
  surface_->setFontScale(100);
  EXPECT_DOUBLE_EQ(surface_->fontScale(), 2.5);
  surface_->setFontScale(0);
  EXPECT_DOUBLE_EQ(surface_->fontScale(), 0.8);
  draw(screen);
  EXPECT_NEAR(height_px, 14.4, 0.5);
}

TEST_F(SurfaceTest, theSignsThatTheWindowsUseHaveGlyphs) {
  draw([] {});
  for (const Letters letters : {Letters::kBody, Letters::kSmall}) {
    const ImFont* font = fontOf(letters);
    for (const ImWchar sign :
         {L'µ', L'α', L'θ', L'Δ', L'—', L'–', L'−', L'→', L'↷', L'°', L'²', L'≤', L'≥', L'≈', L'●', L'▲',
          L'■', L'○', L'◎', L'⚠', L'✓', L'✗', L'✎', L'✶', L'▼', L'…', L'·', L'é', L'ß', L'Ł', L'ж'})
      EXPECT_NE(font->FindGlyphNoFallback(sign), nullptr) << static_cast<unsigned>(sign);
  }
  for (const ImWchar sign : {L'0', L'−', L'°', L'α', L'▲', L'■', L'✓', L'—'})
    EXPECT_NE(fontOf(Letters::kFigure)->FindGlyphNoFallback(sign), nullptr) << static_cast<unsigned>(sign);
}

TEST_F(SurfaceTest, offScreenTimeGoesByFrames) {
  double first_s = 0, last_s = 0;
  draw([&] { first_s = surface_->time_s(); }, 1);
  draw([&] { last_s = surface_->time_s(); }, 30);
  EXPECT_NEAR(last_s - first_s, 1, 1e-4);
}

TEST_F(SurfaceTest, aClosedSurfaceGivesNoFrames) {
  draw([] {});
  surface_->close();
  EXPECT_FALSE(surface_->beginFrame());
  EXPECT_FALSE(surface_->isWindow());
}

TEST_F(SurfaceTest, pngGoesOutAndComesInTheSame) {
  const test::TempFolder folder;
  const RgbaImage picture = draw(redSquare);
  ASSERT_TRUE(savePng(picture, folder.path() / "a.png"));
  const auto read = loadPng(folder.path() / "a.png");
  ASSERT_TRUE(read);
  EXPECT_EQ(read->pixels, picture.pixels);
  EXPECT_FALSE(savePng({}, folder.path() / "b.png"));
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "b.png"));
  const Status refused = savePng(picture, folder.path() / "no" / "such" / "a.png");
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("a.png"), std::string::npos);
  EXPECT_EQ(loadPng(folder.path() / "c.png").error().code, ErrorCode::kNotFound);
  folder.write("d.png", "not a picture");
  EXPECT_EQ(loadPng(folder.path() / "d.png").error().code, ErrorCode::kCorrupt);
}

TEST(SurfacePacing, aLateFrameDoesNotHurryTheNext) {
  test::FakeTime time;
  const std::int64_t first_ns = time.nowNs();
  SurfaceOptions options;
  options.time = &time;
  options.kind = SurfaceOptions::Kind::kOffScreen;
  options.frames_per_s = 50;
  options.width_px = options.height_px = 64;
  auto surface = Surface::open(options);
  if (!surface) GTEST_SKIP() << surface.error().message;
  constexpr std::int64_t kMs = 1'000'000;
  time.late_ns = {{1, 50 * kMs}, {3, 5 * kMs}};  // third frame: over a period late, fifth: less
  std::vector<std::int64_t> begins_ms;
  for (int i = 0; i < 7; ++i) {
    ASSERT_TRUE((*surface)->beginFrame());
    begins_ms.push_back((time.nowNs() - first_ns) / kMs);
    (*surface)->endFrame();
  }
  EXPECT_EQ(begins_ms, (std::vector<std::int64_t>{0, 20, 90, 110, 135, 150, 170}));
}

TEST(SurfacePacing, onlyAPictureTakesAnotherTimeThanTheMachines) {
  test::FakeTime time;
  SurfaceOptions options;
  options.time = &time;
  for (const auto kind : {SurfaceOptions::Kind::kWindow, SurfaceOptions::Kind::kAny}) {
    options.kind = kind;
    const auto surface = Surface::open(options);
    ASSERT_FALSE(surface) << "a window would wait for its events for ever";
    EXPECT_EQ(surface.error().code, ErrorCode::kInvalidInput);
    EXPECT_NE(surface.error().message.find("SurfaceOptions.time"), std::string::npos);
  }
}

TEST(SurfaceWindow, withoutADisplayItGivesAdvice) {
  const char* display = std::getenv("DISPLAY");
  const std::string before = display == nullptr ? "" : display;
  ::unsetenv("DISPLAY");
  SurfaceOptions options;
  options.kind = SurfaceOptions::Kind::kWindow;
  const auto surface = Surface::open(options);
  if (!before.empty()) ::setenv("DISPLAY", before.c_str(), 1);
  ASSERT_FALSE(surface);
  EXPECT_EQ(surface.error().code, ErrorCode::kUnavailable);
  EXPECT_NE(surface.error().message.find("DISPLAY"), std::string::npos);
}

}  // namespace
}  // namespace needlelab
