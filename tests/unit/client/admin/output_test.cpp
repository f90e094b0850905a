// Tables, JSON and texts of the commands.
#include "client/admin/output.h"

#include <gtest/gtest.h>

#include <sstream>
#include <vector>

#include "tests/support/time_zone.h"

namespace needlelab {
namespace {

TEST(Output, timesInATableAreLocalAndNameTheirZone) {
  const test::WithZone zone(test::kStJohns);
  const std::vector<Column> when = {{"at", "AT", Column::Kind::kTime}};
  const auto table = [&](std::int64_t unix_ns) { return tableText(when, Json::array({{{"at", unix_ns}}})); };
  EXPECT_EQ(table(0), "AT\n-\n");
  // 2026-07-01 12:00 UTC, in summer 2 h 30 min earlier
  EXPECT_EQ(table((20635 * 86'400LL + 12 * 3600) * 1'000'000'000), "AT\n2026-07-01 09:30:00 NDT\n");
}

TEST(Output, sizesAreRounded) {
  EXPECT_EQ(bytesText(0), "0 B");
  EXPECT_EQ(bytesText(999), "999 B");
  EXPECT_EQ(bytesText(1'000), "1 kB");
  EXPECT_EQ(bytesText(999'600), "1 MB");
  EXPECT_EQ(bytesText(12'345'678), "12.3 MB");
}

TEST(Output, nothingReachesATerminalButText) {
  EXPECT_EQ(oneLine("a\x1b[2J\nb\tc\x7f"), "a [2J b c ");
  EXPECT_EQ(oneLine("a\xc2\x9b"
                    "2Jb"),
            "a 2Jb")
      << "U+009B means ESC [ to a terminal";
  EXPECT_EQ(oneLine("é, ü, \xc2\xa0, \xc2"), "é, ü, \xc2\xa0, \xc2");
  EXPECT_EQ(oneLine("Tom \u202eegroeG"), "Tom [U+202E]egroeG");
}

TEST(Output, aStoredTextThatIsNoJsonIsNull) {
  EXPECT_EQ(storedJson(R"({"a":[1]})").dump(), R"({"a":[1]})");
  for (const char* bad : {"", "{", "not json", "[1] 2"}) EXPECT_EQ(storedJson(bad).dump(), "null") << bad;
}

TEST(OutputTable, columnsAlignInEveryAlphabet) {
  const Json rows = Json::array(
      {{{"name", "Jürgen"}, {"n", 1}}, {{"name", "x"}, {"n", 20.5}}, {{"name", nullptr}, {"n", true}}});
  EXPECT_EQ(tableText({{"name", "NAME"}, {"n", "N"}, {"missing", "M"}}, rows),
            "NAME    N     M\n"
            "Jürgen  1     -\n"
            "x       20.5  -\n"
            "-       yes   -\n");
}

TEST(OutputTable, verdictsUseTheScreensWordsForEveryCode) {
  Json rows = Json::array();
  for (const Json& code : {Json("passed"), Json("failed"), Json(true), Json(false), Json()})
    rows.push_back({{"verdict", code}});
  EXPECT_EQ(tableText({{"verdict", "VERDICT", Column::Kind::kVerdict}}, rows),
            "VERDICT\n"
            "passed\n"
            "not passed\n"
            "passed\n"
            "not passed\n"
            "-\n");
}

TEST(OutputJson, remarksNeverMixWithIt) {
  std::ostringstream out, err;
  Output output(out, err, "");
  output.done("added");
  output.text("a table");
  ASSERT_TRUE(
      output.list({{"a", "A"}}, Json::array({{{"a", "caf\xe9"}}})).ok());  // not UTF-8: must not throw
  EXPECT_EQ(err.str(), "added\n");
  EXPECT_EQ(Json::parse(out.str()).at("rows").size(), 1u);
}

}  // namespace
}  // namespace needlelab
