// CSV as spreadsheets and instruments write it.
#include "common/base/text/csv_rows.h"

#include <gmock/gmock.h>

#include <string>
#include <vector>

#include "tests/support/random.h"

namespace needlelab {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using namespace std::string_literals;

struct ReadRow {
  std::size_t line = 0;
  std::vector<std::string> cells;
  friend bool operator==(const ReadRow&, const ReadRow&) = default;
};
std::vector<ReadRow> rowsOf(std::string_view text, std::size_t lines_above = 0,
                            CommentLines comments = CommentLines::kNo) {
  CsvRows rows(text, lines_above, comments);
  std::vector<ReadRow> read;
  for (;;) {
    const auto there = rows.next();
    EXPECT_TRUE(there.ok()) << there.error().message;
    if (!there.ok() || !*there) return read;
    read.push_back({rows.line(), {rows.cells().begin(), rows.cells().end()}});
  }
}
std::string faultOf(std::string_view text) {
  CsvRows rows(text);
  for (;;) {
    const auto there = rows.next();
    if (!there.ok()) return there.error().message;
    if (!*there) return "it was read";
  }
}

TEST(CsvRows, theSeparatorIsTheFirstRowsMostFrequentOutsideQuotes) {
  EXPECT_EQ(rowsOf("a,b\n1,2"), (std::vector<ReadRow>{{1, {"a", "b"}}, {2, {"1", "2"}}}));
  EXPECT_EQ(rowsOf("a;b,c;d\n1;2;3"), (std::vector<ReadRow>{{1, {"a", "b,c", "d"}}, {2, {"1", "2", "3"}}}));
  EXPECT_EQ(rowsOf("a\tb\n1\t2"), (std::vector<ReadRow>{{1, {"a", "b"}}, {2, {"1", "2"}}}));
  EXPECT_EQ(rowsOf("\"a,b,c\";d\n1;2"), (std::vector<ReadRow>{{1, {"a,b,c", "d"}}, {2, {"1", "2"}}}));
  EXPECT_EQ(rowsOf("sep=;\na,b;c\n"), (std::vector<ReadRow>{{2, {"a,b", "c"}}}));
  EXPECT_EQ(rowsOf("name\nanna"), (std::vector<ReadRow>{{1, {"name"}}, {2, {"anna"}}}));
}

TEST(CsvRows, lineEndsOfAllSystemsAndRowsWithoutText) {
  const std::vector<ReadRow> right = {{1, {"a", "b"}}, {3, {"1", "2"}}, {5, {"3", ""}}};
  EXPECT_EQ(rowsOf("a,b\n,\n1,2\n\n3,\n"), right);
  EXPECT_EQ(rowsOf("a,b\r\n , \r\n1,2\r\n\r\n3,\r\n\r\n"), right);
  EXPECT_EQ(rowsOf("a,b\r,\r1,2\r\r3,"), right);
  EXPECT_EQ(rowsOf("\n\n;;\nname;role\nx;y"), (std::vector<ReadRow>{{4, {"name", "role"}}, {5, {"x", "y"}}}));
  EXPECT_EQ(rowsOf("Instrument 7, run 3\nN; mm\na;b\n1;2", 2),
            (std::vector<ReadRow>{{3, {"a", "b"}}, {4, {"1", "2"}}}));
  EXPECT_TRUE(rowsOf("").empty());
  EXPECT_TRUE(rowsOf("\n", 5).empty());
}

TEST(CsvRows, quotedCellsMayHaveSeparatorsQuotesAndLineEnds) {
  EXPECT_EQ(
      rowsOf("a,b\r\n \"Bauer, Anna\" ,\"says \"\"no\"\"\nand goes\"\r\nc,\"\""),
      (std::vector<ReadRow>{{1, {"a", "b"}}, {2, {"Bauer, Anna", "says \"no\"\nand goes"}}, {4, {"c", ""}}}));
  EXPECT_EQ(rowsOf("a,b\n5\" pipe,2"), (std::vector<ReadRow>{{1, {"a", "b"}}, {2, {"5\" pipe", "2"}}}));
  EXPECT_EQ(faultOf("a,b\nc,\"d\ne,f\n"), "line 2: a quote is not closed");
  EXPECT_EQ(faultOf("a,b\n\"c\"d,e"), "line 2: something follows the closing quote of a cell");
}

TEST(CsvRows, randomTablesSurviveWritingAndReading) {
  test::Random random(11);
  const std::vector<std::string> marks = {"a", "\"", ",", "\n", "\r\n", ";", " ", "é", "\t"};
  for (int round = 0; round < 300; ++round) {
    std::vector<std::vector<std::string>> table(1 + random.below(5));
    const std::size_t width = 2 + random.below(4);
    std::string text = "sep=,\n";
    for (auto& row : table) {
      for (std::size_t i = 0; i < width; ++i) {
        std::string cell = i == 0 ? "x" : "";
        for (std::size_t n = random.below(6); i > 0 && n > 0; --n) cell += marks[random.below(marks.size())];
        text += (i == 0 ? "\"" : ",\"");
        for (const char c : cell) text += c == '"' ? "\"\""s : std::string(1, c);
        text += "\"";
        row.push_back(cell);
      }
      text += "\r\n";
    }
    const auto read = rowsOf(text);
    ASSERT_EQ(read.size(), table.size()) << text;
    for (std::size_t i = 0; i < table.size(); ++i) EXPECT_EQ(read[i].cells, table[i]) << text;
  }
}

TEST(CsvColumns, areFoundInAnyCaseAndWithTheirUnitInBrackets) {
  for (const char* const cell : {"force_n", "Force_N", " FORCE [N] ", "force (n)", "force_n [N]"})
    EXPECT_TRUE(isColumn(cell, "force_n")) << cell;
  EXPECT_TRUE(isColumn("Speed [m/s]", "speed_m_s"));
  EXPECT_TRUE(isColumn("Full Name", "full_name"));
  EXPECT_TRUE(isColumn("p_WH_z_m", "p_WH_z_m"));
  for (const char* const cell : {"", "force", "force [mN]", "force_n [mN]", "Depth [mm]", "force_n2"})
    EXPECT_FALSE(isColumn(cell, "force_n")) << cell;
  EXPECT_FALSE(isColumn("depth_m (mm)", "depth_m")) << "millimetres are not metres";
}

TEST(CsvNumbers, useADecimalCommaOnlyWithAnotherSeparator) {
  EXPECT_EQ(csvNumber("1,25", ';'), 1.25);
  EXPECT_EQ(csvNumber("-1,5e-3", '\t'), -1.5e-3);
  EXPECT_EQ(csvNumber("1.25", ';'), 1.25);
  for (const char* const cell : {"1,25", "", "1.2.3", "x"}) EXPECT_FALSE(csvNumber(cell, ',')) << cell;
  EXPECT_FALSE(csvNumber("1.234,5", ';')) << "a separator of thousands: which is it?";
  EXPECT_FALSE(csvNumber("1,2,3", ';'));
}

TEST(CsvNumbers, haveTheSignsAndBlanksOfInstrumentsAndSpreadsheets) {
  for (const char* const cell : {"+0.5", " 0.5 ", "0.5\u00a0", "\u202f+0.5\u2009", "5e-1", "5E\u221201"})
    EXPECT_EQ(numberOf(cell), 0.5) << cell;
  EXPECT_EQ(numberOf("\u22120.004"), -0.004);
  EXPECT_EQ(numberOf("\u22121,5", ';'), -1.5);
  for (const char* const cell : {"++1", "+-1", "-+1", "\u2212-1", "+", "\u2212", "1 2", "\u00a0"})
    EXPECT_FALSE(numberOf(cell)) << cell;
  EXPECT_EQ(csvNumber("0.5 # touched", ','), 0.5);
  EXPECT_FALSE(csvNumber("0.5#", ','));
}

TEST(CsvRows, commentsAreNotRowsWhereAReaderSaysSo) {
  const auto read = [](std::string_view text) { return rowsOf(text, 0, CommentLines::kYes); };
  const ReadRow first{2, {"0", "1"}};
  EXPECT_EQ(read("# t_s,force_n\n0,1\n"), (std::vector<ReadRow>{{1, {"t_s", "force_n"}}, first}))
      << "numpy.savetxt";
  EXPECT_EQ(read("# specimen,force_n\ns0,1\n"),
            (std::vector<ReadRow>{{1, {"specimen", "force_n"}}, {2, {"s0", "1"}}}));
  EXPECT_EQ(read("% by hand; 18G\n// t_s;force_n\n0;1\n"),
            (std::vector<ReadRow>{{2, {"t_s", "force_n"}}, {3, {"0", "1"}}}));
  EXPECT_EQ(read("# by hand\nt_s,force_n\n0,1\n# a rest\n2,3\n# end\n"),
            (std::vector<ReadRow>{{2, {"t_s", "force_n"}}, {3, {"0", "1"}}, {5, {"2", "3"}}}));
  EXPECT_EQ(read("t_s,force_n\n0,1, # touched, then let go\n"),
            (std::vector<ReadRow>{{1, {"t_s", "force_n"}}, first}));
  EXPECT_EQ(rowsOf("#name,role\n#1,a\n"), (std::vector<ReadRow>{{1, {"#name", "role"}}, {2, {"#1", "a"}}}))
      << "a class list has none";
}

TEST(TextEncodings, defaultToUnicode) {
  EXPECT_EQ(*utf8TextOf("f", "\xef\xbb\xbfK\xc3\xb6hler"), "Köhler");
  EXPECT_EQ(*utf8TextOf("f", "\xff\xfeK\0\xf6\0"s), "Kö");
  EXPECT_EQ(*utf8TextOf("f", "\xfe\xff\0K\0\xf6"s), "Kö");
  EXPECT_EQ(*utf8TextOf("f", "K\xf6hler \x80", TextEncoding::kWindows1252), "Köhler €");
  const auto refused = utf8TextOf("class.csv", "name\nK\xf6hler\n");
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidInput);
  EXPECT_THAT(refused.error().message, HasSubstr("class.csv: line 2"));
  EXPECT_THAT(refused.error().message, HasSubstr("windows-1252"));
  EXPECT_FALSE(utf8TextOf("f", "\xff\xfeK"s).ok()) << "half a character";
}

}  // namespace
}  // namespace needlelab
