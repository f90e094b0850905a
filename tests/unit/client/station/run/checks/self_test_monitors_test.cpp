#include "client/station/run/checks/self_test.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <string>

#include "tests/support/temp_folder.h"

namespace needlelab {
namespace {

/// A base EDID block with these sizes: the preferred timing's in mm, the screen's in cm.
std::string edidOf(int width_mm, int height_mm, int width_cm, int height_cm) {
  std::string edid(128, 0);
  edid.replace(0, 8, std::string("\x00\xFF\xFF\xFF\xFF\xFF\xFF\x00", 8));
  edid[21] = static_cast<char>(width_cm);
  edid[22] = static_cast<char>(height_cm);
  edid[66] = static_cast<char>(width_mm & 0xFF);
  edid[67] = static_cast<char>(height_mm & 0xFF);
  edid[68] = static_cast<char>((width_mm >> 8) << 4 | height_mm >> 8);
  return edid;
}

TEST(Edid, saysTheDiagonal) {
  // 24 inches, 16:9
  EXPECT_NEAR(*edidDiagonal_m(edidOf(531, 299, 53, 30)), std::hypot(0.531, 0.299), 1e-12);
  EXPECT_NEAR(*edidDiagonal_m(edidOf(1210, 680, 121, 68)), std::hypot(1.210, 0.680), 1e-12);
  EXPECT_NEAR(*edidDiagonal_m(edidOf(0, 0, 53, 30)), std::hypot(0.53, 0.30), 1e-12) << "in cm only";
  EXPECT_NEAR(*edidDiagonal_m(edidOf(531, 299, 53, 30) + std::string(128, 7)), 0.6094, 1e-4)
      << "with an extension";
}

TEST(Edid, withoutDataGivesNothing) {
  EXPECT_EQ(edidDiagonal_m(edidOf(0, 0, 0, 0)), std::nullopt) << "a projector";
  EXPECT_EQ(edidDiagonal_m(edidOf(531, 0, 0, 30)), std::nullopt);
  EXPECT_EQ(edidDiagonal_m(""), std::nullopt);
  EXPECT_EQ(edidDiagonal_m(edidOf(531, 299, 53, 30).substr(0, 127)), std::nullopt);
  std::string other = edidOf(531, 299, 53, 30);
  other[1] = 0;
  EXPECT_EQ(edidDiagonal_m(other), std::nullopt) << "no EDID";
}

TEST(SelfTestMonitors, areThoseThatSayTheirSize) {
  const test::TempFolder folder;
  for (const char* name : {"card0", "card0-HDMI-A-1", "card0-VGA-1", "card1-DP-2", "renderD128"})
    std::filesystem::create_directory(folder.path() / name);
  folder.write("card0-HDMI-A-1/edid", edidOf(531, 299, 53, 30));
  folder.write("card0-VGA-1/edid", "");
  folder.write("card1-DP-2/edid", edidOf(0, 0, 60, 34));
  const auto found = connectedMonitors(folder.path());
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found[0].plug, "DP-2");
  EXPECT_NEAR(found[0].diagonal_m, std::hypot(0.60, 0.34), 1e-12);
  EXPECT_EQ(found[1].plug, "HDMI-A-1");
  EXPECT_TRUE(connectedMonitors(folder.path() / "nowhere").empty());
}

}  // namespace
}  // namespace needlelab
