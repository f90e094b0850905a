#include "client/sim/tools/gnuplot.h"

#include <gmock/gmock.h>

#include <cstdlib>
#include <filesystem>
#include <string>

#include "common/base/files/files.h"
#include "tests/support/temp_folder.h"

namespace needlelab {
namespace {

using testing::HasSubstr;

std::size_t filesIn(const std::filesystem::path& folder) {
  return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(folder), {}));
}

// with the test's own plot file
Status drawScript(std::string_view script, const std::filesystem::path& png,
                  const std::vector<PlotVariable>& variables = {}) {
  const EmbeddedFile files[] = {
      {"terminal.gp", "set terminal pngcairo size width,height\nset encoding utf8\nset output png\n"},
      {"script.gp", script}};
  return drawPlot(files, "script", png, variables);
}

// The picture of the demonstration's session, from deploy/session.gp.
TEST(Gnuplot, aSessionOfNoiseSpansWhatTheWindowsPlotsSpan) {
  if (!hasGnuplot()) GTEST_SKIP() << "gnuplot is not on the PATH";
  const test::TempFolder folder;
  std::string csv = "t_s,px_m,py_m,pz_m,fx_n,fy_n,fz_n,insertion_m,lateral_error_m,wz_m\n";
  // 0.03 mm of encoder noise about a tip 400 mm from the origin
  for (int i = 0; i < 100; ++i)
    csv += std::to_string(0.01 * i) + "," + (i % 2 == 0 ? "0.40000" : "0.40003") + ",0.4,0.4,0,0,0,0,0,0.4\n";
  const std::string data = folder.write("session.csv", csv).string();
  const std::string png = (folder.path() / "session.png").string(),
                    range = (folder.path() / "range").string();
  const std::string command = "gnuplot -e \"csv='" + data + "'; png='" + png +
                              "'\" '" NEEDLELAB_SESSION_PLOT "' -e \"set print '" + range +
                              "'; print GPVAL_Y_MAX - GPVAL_Y_MIN\"";
  ASSERT_EQ(std::system(command.c_str()), 0);
  EXPECT_GE(std::stod(*readWholeFile(range)), 10) << "mm, of the last plot: the tip";
  EXPECT_GT(std::filesystem::file_size(png), 1000u);
}

TEST(Gnuplot, aSessionsPictureNamesTheHand) {
  if (!hasGnuplot()) GTEST_SKIP() << "gnuplot is not on the PATH";
  const test::TempFolder folder;
  const std::string data = folder
                               .write("session.csv",
                                      "t_s,px_m,py_m,pz_m,fx_n,fy_n,fz_n,insertion_m,lateral_error_m,wz_m\n"
                                      "0,0,0,0,0,0,0,0,0,0\n1,0,0,0.01,0,0,1,0.01,0,0.01\n")
                               .string();
  const auto draw = [&](const std::string& name, const std::string& more) {
    const std::string png = (folder.path() / name).string();
    const std::string command =
        "gnuplot -e \"csv='" + data + "'; png='" + png + "'" + more + "\" '" NEEDLELAB_SESSION_PLOT "'";
    EXPECT_EQ(std::system(command.c_str()), 0);
    return *readWholeFile(png);
  };
  const std::string plain = draw("plain.png", "");
  EXPECT_EQ(draw("again.png", ""), plain);
  EXPECT_NE(draw("hand.png", "; hand='simulated hand, no person'"), plain);
}

TEST(Gnuplot, drawsAPictureOfTheAskedSize) {
  if (!hasGnuplot()) GTEST_SKIP() << "gnuplot is not on the PATH";
  const test::TempFolder folder;
  const auto png = folder.path() / "it's a test.png";
  const Status status = drawScript("load 'terminal.gp'\nplot sin(x) title words[2], height_m[1]\n", png,
                                   {{"width", 640.0},
                                    {"height", 360.0},
                                    {"height_m", std::vector<double>{0.5}},
                                    {"words", std::vector<std::string>{"a", "it's ω_n"}}});
  ASSERT_TRUE(status.ok()) << status.error().message;
  const std::string bytes = *readWholeFile(png);
  // PNG signature, then the header chunk with width and height, big-endian
  ASSERT_GT(bytes.size(), 1000u);
  EXPECT_EQ(bytes.substr(0, 8), "\x89PNG\r\n\x1a\n");
  const auto number = [&](std::size_t at) {
    unsigned value = 0;
    for (std::size_t i = 0; i < 4; ++i) value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
    return value;
  };
  EXPECT_EQ(number(16), 640u);
  EXPECT_EQ(number(20), 360u);
  EXPECT_EQ(filesIn(folder.path()), 1u);
}

TEST(Gnuplot, aWrongScriptFailsWithGnuplotsWordsAndLeavesNothing) {
  if (!hasGnuplot()) GTEST_SKIP() << "gnuplot is not on the PATH";
  const test::TempFolder folder;
  const Status status = drawScript("plod sin(x)\n", folder.path() / "p.png");
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kFailed);
  EXPECT_THAT(status.error().message, HasSubstr("plod"));
  EXPECT_EQ(filesIn(folder.path()), 0u);
}

TEST(Gnuplot, anUnknownPlotFileIsNamed) {
  const test::TempFolder folder;
  const Status status = drawPlot("fig99", folder.path() / "p.png", {});
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kNotFound);
  EXPECT_THAT(status.error().message, HasSubstr("fig99"));
  EXPECT_EQ(filesIn(folder.path()), 0u);
}

TEST(Gnuplot, isNotThereWhenThePathHasNone) {
  const test::TempFolder folder;
  const std::string path = std::getenv("PATH");
  ::setenv("PATH", folder.path().c_str(), 1);
  const bool found = hasGnuplot();
  ::setenv("PATH", "", 1);
  const bool found_nowhere = hasGnuplot();
  ::setenv("PATH", path.c_str(), 1);
  EXPECT_FALSE(found);
  EXPECT_FALSE(found_nowhere);
}

// ---- a picture's data

TEST(PlotTable, hasItsHeaderThenNumbersWithNineDigitsThenTexts) {
  PlotTable table("a,b,c");
  table.row({1.0 / 3, 1e-12, -2}, {});
  table.row({0.1}, {"x", "y"});
  table.row({}, {"only", "texts", ""});
  EXPECT_EQ(table.take(), "a,b,c\n0.333333333,1e-12,-2\n0.1,x,y\nonly,texts,\n");
}

TEST(PlotBlocks, followTheirFirstRowsAndRowsFindTheirBlock) {
  PlotBlocks blocks;
  EXPECT_EQ(blocks.text(), "");
  blocks.row("b", {1, 2.5});
  blocks.row("a", {}, {"one, with a comma", "two"});
  blocks.row("b", {1.0 / 7}, {"text"});
  // gnuplot separates blocks by two empty lines
  EXPECT_EQ(blocks.text(), "# b;\n1\t2.5\n0.142857143\ttext\n\n\n# a;\none, with a comma\ttwo\n");
}

}  // namespace
}  // namespace needlelab
