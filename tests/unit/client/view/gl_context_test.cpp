#include "client/view/gl_context.h"

#include <gtest/gtest.h>

#include <string>

#include "tests/support/temp_folder.h"

namespace needlelab {
namespace {

TEST(GlContext, theWindowsStateSurvivesARoundTrip) {
  const test::TempFolder folder;
  const auto file = folder.path() / "new" / "window.json";
  ASSERT_TRUE(writeWindowState(file, {-40, 25, 1600, 900, 1.25}));
  const auto state = readWindowState(file);
  ASSERT_TRUE(state);
  EXPECT_EQ(state->x_px, -40);
  EXPECT_EQ(state->y_px, 25);
  EXPECT_EQ(state->width_px, 1600);
  EXPECT_EQ(state->height_px, 900);
  EXPECT_DOUBLE_EQ(state->font_scale, 1.25);
}

TEST(GlContext, unusableStateOfTheWindowIsPassedOver) {
  const test::TempFolder folder;
  EXPECT_FALSE(readWindowState({}));
  EXPECT_FALSE(readWindowState(folder.path() / "missing.json"));
  EXPECT_FALSE(readWindowState(folder.path()));
  const std::string good = R"({"x_px": 0, "y_px": 0, "width_px": 800, "height_px": 600, "font_scale": 1})";
  EXPECT_TRUE(readWindowState(folder.write("good.json", good)));
  for (const char* text : {"", "{", "[]", "null", R"({"x_px": 0})",
                           R"({"x_px": "0", "y_px": 0, "width_px": 800, "height_px": 600, "font_scale": 1})",
                           R"({"x_px": 1e99, "y_px": 0, "width_px": 800, "height_px": 600, "font_scale": 1})",
                           R"({"x_px": 0, "y_px": 0, "width_px": 1, "height_px": 600, "font_scale": 1})",
                           R"({"x_px": 0, "y_px": 0, "width_px": 800, "height_px": 600, "font_scale": 40})"})
    EXPECT_FALSE(readWindowState(folder.write("bad.json", text))) << text;
  EXPECT_FALSE(readWindowState(folder.write("long.json", good + std::string(10000, ' '))));
}

}  // namespace
}  // namespace needlelab
