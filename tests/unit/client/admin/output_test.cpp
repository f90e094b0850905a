#include "client/admin/output.h"

#include <gtest/gtest.h>

#include <sstream>

namespace needlelab {
namespace {

TEST(OutputText, timesAreUtc) {
  EXPECT_EQ(timeText(0), "-");
  EXPECT_EQ(timeText(1'000'000'000'500'000'000), "2001-09-09 01:46:40Z");
}

TEST(OutputText, sizesAreRounded) {
  EXPECT_EQ(bytesText(0), "0 B");
  EXPECT_EQ(bytesText(999), "999 B");
  EXPECT_EQ(bytesText(1'000), "1 kB");
  EXPECT_EQ(bytesText(999'600), "1 MB");
  EXPECT_EQ(bytesText(12'345'678), "12.3 MB");
}

TEST(OutputText, nothingReachesATerminalButText) {
  EXPECT_EQ(oneLine("a\x1b[2J\nb\tc\x7f"), "a [2J b c ");
}

TEST(OutputTable, columnsStandUnderEachOtherWhateverTheAlphabet) {
  const Json rows = Json::array(
      {{{"name", "Jürgen"}, {"n", 1}}, {{"name", "x"}, {"n", 20.5}}, {{"name", nullptr}, {"n", true}}});
  EXPECT_EQ(tableText({{"name", "NAME"}, {"n", "N"}, {"missing", "M"}}, rows),
            "NAME    N     M\n"
            "Jürgen  1     -\n"
            "x       20.5  -\n"
            "-       yes   -\n");
}

TEST(OutputJson, remarksNeverMixWithIt) {
  std::ostringstream out, err;
  Output output(out, err, "");
  output.done("added");
  output.text("a table");
  ASSERT_TRUE(output.list({{"a", "A"}}, Json::array({{{"a", "caf\xe9"}}})).ok());  // no UTF-8: must not throw
  EXPECT_EQ(err.str(), "added\n");
  EXPECT_EQ(Json::parse(out.str()).at("rows").size(), 1u);
}

}  // namespace
}  // namespace needlelab
