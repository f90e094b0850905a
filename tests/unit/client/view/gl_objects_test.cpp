#include "client/view/gl_objects.h"

#include <gtest/gtest.h>

#include <utility>

#include "tests/support/pictures/picture_check.h"
#include "tests/support/pictures/view_stage.h"

namespace needlelab {
namespace {

using test::pixelAt;

class GlObjectsTest : public test::ViewStage {
 protected:
  GlObjectsTest() {
    options_.width_px = 200;
    options_.height_px = 120;
  }
  // drawn pixel by pixel at 10, 10
  static void show(const Texture& texture) {
    ImGui::GetForegroundDrawList()->AddImage(
        texture.id(), {10, 10},
        {10 + static_cast<float>(texture.width()), 10 + static_cast<float>(texture.height())});
  }
};

TEST_F(GlObjectsTest, greyAndColourTexturesShowTheirPixelsTheRightWayUp) {
  GreyImage grey{5, 3, {0, 50, 100, 150, 200, 10, 20, 30, 40, 250, 1, 2, 3, 4, 5}};
  RgbaImage colour{2, 2, {255, 0, 0, 255, 0, 255, 0, 255, 0, 0, 255, 255, 255, 255, 255, 255}};
  Texture texture;
  texture.upload(grey);
  RgbaImage picture = draw([&] { show(texture); });
  for (int y = 0; y < 3; ++y)
    for (int x = 0; x < 5; ++x) {
      const unsigned value = grey.pixels[static_cast<std::size_t>(y * 5 + x)];
      EXPECT_EQ(pixelAt(picture, 10 + x, 10 + y), value << 16 | value << 8 | value);
    }
  texture.upload(colour);
  picture = draw([&] { show(texture); });
  EXPECT_EQ(pixelAt(picture, 10, 10), 0xFF0000u);
  EXPECT_EQ(pixelAt(picture, 11, 10), 0x00FF00u);
  EXPECT_EQ(pixelAt(picture, 10, 11), 0x0000FFu);
}

TEST_F(GlObjectsTest, aNewUploadIsSeenAlthoughTheFramesListsAreTheSame) {
  Texture texture;
  texture.upload(GreyImage{2, 2, {10, 10, 10, 10}});
  draw([&] { show(texture); }, 4);
  texture.upload(GreyImage{2, 2, {200, 200, 200, 200}});
  EXPECT_EQ(pixelAt(draw([&] { show(texture); }, 1), 10, 10), 0xC8C8C8u);
}

TEST_F(GlObjectsTest, aTextureMovesAndEmpties) {
  Texture a;
  a.upload(GreyImage{2, 1, {7, 9}});
  const ImTextureID id = a.id();
  Texture b = std::move(a);
  EXPECT_EQ(b.id(), id);
  EXPECT_EQ(b.width(), 2);
  b.upload(GreyImage{});
  EXPECT_EQ(b.id(), nullptr);
  EXPECT_EQ(b.width(), 0);
}

}  // namespace
}  // namespace needlelab
