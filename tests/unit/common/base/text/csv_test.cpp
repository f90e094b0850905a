#include "common/base/text/csv.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>

#include "tests/support/random.h"
#include "tests/support/temp_folder.h"

namespace needlelab {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using namespace std::string_view_literals;

struct Csv : ::testing::Test {
  test::TempFolder folder;
  Result<CsvTable> read(std::string_view text, std::size_t max_rows = 1000) {
    return readCsv(folder.write("t.csv", text), {"t_s", "px_m"}, {"plunger"}, {.max_rows = max_rows});
  }
  std::string refusal(std::string_view text, std::size_t max_rows = 1000) {
    const auto table = read(text, max_rows);
    if (table.ok()) return "it was accepted";
    EXPECT_EQ(table.error().code, ErrorCode::kInvalidInput);
    EXPECT_THAT(table.error().message, HasSubstr("t.csv"));
    return table.error().message;
  }
};

TEST_F(Csv, columnsAreFoundByNameInAnyOrderAndOthersAreSkipped) {
  const auto table = read("px_m,remark,t_s\n1.5,hello,0\n-2e-3,,0.001\n");
  ASSERT_TRUE(table.ok()) << table.error().message;
  ASSERT_EQ(table->rows(), 2u);
  const auto px = static_cast<std::size_t>(table->find("px_m")),
             t = static_cast<std::size_t>(table->find("t_s"));
  EXPECT_EQ(table->columns[px][1], -2e-3);
  EXPECT_EQ(table->columns[t][1], 0.001);
  EXPECT_EQ(table->find("plunger"), -1);
  EXPECT_EQ(table->find("remark"), -1);
}

TEST_F(Csv, acceptsCrlfByteOrderMarkBlankLinesAndNoFinalNewline) {
  const auto table = read("\xEF\xBB\xBFt_s, px_m\r\n0, 1\r\n\r\n1,\t2");
  ASSERT_TRUE(table.ok()) << table.error().message;
  ASSERT_EQ(table->rows(), 2u);
  EXPECT_EQ(table->columns[1][1], 2.0);
}

TEST_F(Csv, badInputNamesLineColumnAndValue) {
  EXPECT_THAT(refusal(""), HasSubstr("empty"));
  EXPECT_THAT(refusal("t_s,px_m\n"), HasSubstr("no rows"));
  EXPECT_THAT(refusal("t_s,qx\n0,1\n"), AllOf(HasSubstr("px_m"), HasSubstr("missing")));
  EXPECT_THAT(refusal("t_s,px_m,px_m\n0,1,2\n"), AllOf(HasSubstr("px_m"), HasSubstr("twice")));
  EXPECT_THAT(refusal("t_s,px_m\n0,1\n0\n"),
              AllOf(HasSubstr("line 3"), HasSubstr("1 cells"), HasSubstr("2")));
  EXPECT_THAT(refusal("t_s,px_m\n0,1,2\n"), AllOf(HasSubstr("line 2"), HasSubstr("3 cells")));
  for (const char* bad : {"", "x", "1x", "0x10", "nan", "inf", "-inf", "1e999", "1 2", "--1"}) {
    const std::string text = std::string("t_s,px_m\n0,1\n1,") + bad + "\n";
    EXPECT_THAT(refusal(text),
                AllOf(HasSubstr("line 3"), HasSubstr("px_m"), HasSubstr("'" + std::string(bad) + "'")))
        << bad;
  }
  EXPECT_THAT(refusal("t_s,px_m\n0,1\n1,1\n2,1\n", 2), HasSubstr("more than 2 rows"));
  EXPECT_THAT(refusal("t_s,px_m\n0,\x1b[31m1\n"), HasSubstr("'?[31m1'")) << "a terminal is not steered";
}

TEST_F(Csv, columnsThatMayBeNotFinite) {
  const auto file = folder.write("w.csv", "t_s,wx_m\n0,nan\n1,-inf\n2,3\n");
  const auto table = readCsv(file, {"t_s", "wx_m"}, {}, {.not_finite = {"wx_m"}});
  ASSERT_TRUE(table.ok()) << table.error().message;
  EXPECT_TRUE(std::isnan(table->columns[1][0]));
  EXPECT_EQ(table->columns[1][1], -std::numeric_limits<double>::infinity());
  EXPECT_EQ(table->columns[1][2], 3);
  const auto word = folder.write("word.csv", "t_s,wx_m\n0,none\n");
  EXPECT_THAT(readCsv(word, {"t_s", "wx_m"}, {}, {.not_finite = {"wx_m"}}).error().message,
              AllOf(HasSubstr("line 2"), HasSubstr("'none' is not a number")));
  const auto time = folder.write("time.csv", "t_s,wx_m\nnan,0\n");
  EXPECT_THAT(readCsv(time, {"t_s", "wx_m"}, {}, {.not_finite = {"wx_m"}}).error().message,
              HasSubstr("'nan' is not a finite number"));
}

TEST_F(Csv, missingFileAndFolderAreInvalidInput) {
  EXPECT_EQ(readCsv(folder.path() / "none.csv", {"a"}).error().code, ErrorCode::kInvalidInput);
  EXPECT_EQ(readCsv(folder.path(), {"a"}).error().code, ErrorCode::kInvalidInput);
}

TEST_F(Csv, randomBytesNeverCrashIt) {
  test::Random random(3);
  static constexpr std::string_view kAlphabet = "t_spxm,,\n\r0123456789.e-+ \0\xFF\""sv;
  for (int i = 0; i < 300; ++i) {
    std::string text = i % 2 ? "t_s,px_m\n" : "";
    for (std::uint64_t n = random.below(80); n > 0; --n) text += kAlphabet[random.below(kAlphabet.size())];
    const auto table = read(text);
    if (!table.ok()) continue;
    for (const auto& column : table->columns) EXPECT_EQ(column.size(), table->rows());
  }
}

TEST(CsvNumber, readsBackAsTheSameDouble) {
  test::Random random(11);
  for (int i = 0; i < 2000; ++i) {
    const double value = std::bit_cast<double>(random.bits());
    if (!std::isfinite(value)) continue;
    std::string text;
    appendNumber(text, value);
    EXPECT_EQ(std::bit_cast<std::uint64_t>(std::strtod(text.c_str(), nullptr)),
              std::bit_cast<std::uint64_t>(value))
        << text;
  }
  std::string text;
  appendNumber(text, std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(text, "nan");
}

std::string textCell(std::string_view text, char separator) {
  std::string cell;
  appendCsvText(cell, text, separator);
  return cell;
}

std::string numberCell(double value, char decimal_sign) {
  std::string cell;
  appendCsvNumber(cell, value, decimal_sign);
  return cell;
}

TEST(CsvCells, textsAreQuotedWhereTheReaderWouldSplitThem) {
  EXPECT_EQ(textCell("Köhler, Anna", ';'), "Köhler, Anna");
  EXPECT_EQ(textCell("Köhler, Anna", ','), "\"Köhler, Anna\"");
  EXPECT_EQ(textCell("a;b", ';'), "\"a;b\"");
  EXPECT_EQ(textCell("a\tb", '\t'), "\"a\tb\"");
  EXPECT_EQ(textCell("the \"best\"", ','), "\"the \"\"best\"\"\"");
  EXPECT_EQ(textCell("two\nlines", ','), "\"two\nlines\"");
  EXPECT_EQ(textCell("", ','), "");
}

TEST(CsvCells, noTextIsAFormula) {
  for (const char* formula : {"=1+1", "+1", "-1", "@SUM(A1)"})
    EXPECT_EQ(textCell(formula, ','), std::string("'") + formula);
  EXPECT_EQ(textCell("=A1,B1", ','), "\"'=A1,B1\"");
  EXPECT_EQ(textCell("1-1", ','), "1-1");
}

TEST(CsvCells, numbersArePlainDecimals) {
  EXPECT_EQ(numberCell(3, '.'), "3");
  EXPECT_EQ(numberCell(-2.5, '.'), "-2.5");
  EXPECT_EQ(numberCell(-2.5, ','), "-2,5");
  EXPECT_EQ(numberCell(0.1 + 0.2, '.'), "0.3");
  EXPECT_EQ(numberCell(1e-9, '.'), "0");
  EXPECT_EQ(numberCell(-1e-9, ','), "0") << "never -0";
  EXPECT_EQ(numberCell(1200, ','), "1200");
  EXPECT_EQ(numberCell(123456789.25, ','), "123456789,25");
}

TEST(CsvCells, aStyleIsFoundByItsName) {
  EXPECT_EQ(csvStyleOf("comma")->separator, ',');
  EXPECT_EQ(csvStyleOf("comma")->decimal_sign, '.');
  EXPECT_EQ(csvStyleOf("semicolon")->separator, ';');
  EXPECT_EQ(csvStyleOf("semicolon")->decimal_sign, ',');
  EXPECT_EQ(csvStyleOf("tab")->separator, '\t');
  for (const std::string_view name : kCsvSeparators) EXPECT_TRUE(csvStyleOf(name).ok()) << name;
  const auto unknown = csvStyleOf("space");
  ASSERT_FALSE(unknown.ok());
  EXPECT_EQ(unknown.error().code, ErrorCode::kInvalidInput);
  EXPECT_EQ(unknown.error().message, "separator: 'space', allowed are comma, semicolon, tab");
}

}  // namespace
}  // namespace needlelab
