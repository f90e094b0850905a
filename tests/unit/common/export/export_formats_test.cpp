// The table of export formats. The console reads it from client/web/app/lib/export_formats.js, which a test
// here makes: NEEDLELAB_WRITE_FORMATS=1 bin/export_test --gtest_filter='Console*'
#include "common/export/export_formats.h"
#include "common/base/program.h"

#include <fmt/core.h>
#include <gmock/gmock.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

namespace needlelab {
namespace {

using enum ExportPlace;
using testing::HasSubstr;

constexpr ExportPlace kAllPlaces[] = {kSessionExport, kStudyRecording, kStudyExport, kRecords,
                                      kScoresExport,  kResults,        kWebSamples,  kWebScores,
                                      kWebResults,    kWebStudy};

std::string formatsModule() {
  std::string text =
      "// The formats of the console's downloads. Made by export_test from the table in common/export;\n"
      "// not to be edited (tests/unit/common/export/export_formats_test.cpp).\n"
      "// prettier-ignore\nexport const kExportFormats = {\n";
  const std::pair<const char*, ExportPlace> places[] = {
      {"samples", kWebSamples}, {"scores", kWebScores}, {"results", kWebResults}, {"study", kWebStudy}};
  for (const auto& [name, place] : places) {
    text += fmt::format("  {}: [\n", name);
    for (const ExportFormat* format : formatsAt(place))
      text += fmt::format("    {{ name: '{}', suffix: '{}', type: '{}', title: '{}', words: '{}' }},\n",
                          format->name, format->suffix, format->media_type, format->title, format->words);
    text += "  ],\n";
  }
  return text + "};\n";
}

TEST(ConsoleFormats, areThoseOfTheTable) {
  const std::string path = std::string(NEEDLELAB_SOURCE_DIR) + "/client/web/app/lib/export_formats.js";
  if (std::getenv("NEEDLELAB_WRITE_FORMATS") != nullptr) std::ofstream(path) << formatsModule();
  std::stringstream found;
  found << std::ifstream(path).rdbuf();
  EXPECT_EQ(found.str(), formatsModule()) << "make it again, see above";
}

TEST(ExportFormats, areDistinctAtEachPlaceAndHaveItsWriter) {
  for (const ExportPlace place : kAllPlaces) {
    std::set<std::string_view> names, suffixes;
    const auto formats = formatsAt(place);
    EXPECT_FALSE(formats.empty()) << static_cast<int>(place);
    for (const ExportFormat* format : formats) {
      EXPECT_TRUE(names.insert(format->name).second) << format->name;
      EXPECT_TRUE(suffixes.insert(format->suffix).second) << format->suffix;
      EXPECT_TRUE(format->suffix.starts_with('.')) << format->suffix;
      EXPECT_NE(format->media_type, "");
      EXPECT_NE(format->title, "");
      EXPECT_NE(format->words, "");
      const bool fits = place == kSessionExport || place == kStudyRecording
                            ? (format->samples != nullptr) == (format->form == ExportForm::kText)
                        : format->form == ExportForm::kBids             ? place == kStudyExport
                        : place == kWebSamples                          ? format->samples != nullptr
                        : place == kScoresExport || place == kWebScores ? format->scores != nullptr
                        : place == kResults || place == kWebResults     ? format->results != nullptr
                                                                        : format->record != nullptr;
      EXPECT_TRUE(fits) << format->name << " at " << static_cast<int>(place);
    }
  }
  for (const ExportFormat& format : exportFormats()) EXPECT_FALSE(format.places.empty()) << format.name;
}

TEST(ExportFormats, areChosenByNameThenBySuffixThenTheFirst) {
  const auto name = [](std::string_view given, const std::string& file) {
    const auto format = formatFor(kSessionExport, given, file);
    return format ? std::string((*format)->name) : format.error().message;
  };
  EXPECT_EQ(name("json", "x.txt"), "json");
  EXPECT_EQ(name("json", "x.json"), "json");
  EXPECT_EQ(name("", "folder.csv/x.NLREC"), "recording");
  EXPECT_EQ(name("", "x.json"), "json");
  EXPECT_EQ(name("", "x.h5"), "hdf5");
  EXPECT_EQ(name("", "x.txt"), "csv");
  EXPECT_EQ(name("", ""), "csv");
  EXPECT_THAT(name("csv", "x.json"), HasSubstr("--out x.json: the name says json, --format says csv"));
  EXPECT_EQ((*formatFor(kStudyExport, "", "x.csv"))->name, "jsonl") << "CSV is of other places";
}

TEST(ExportFormats, areListedInASentence) {
  EXPECT_EQ(formatList(kSessionExport, &ExportFormat::name), "csv, json, recording or hdf5");
  EXPECT_EQ(formatList(kResults, &ExportFormat::title), "CSV");
}

/// Two samples, the second 1 ms later.
std::string written(SampleWriter& writer) {
  std::string text;
  writer.begin(text, [] { return std::string("{\"station\":\"s1\"}"); });
  GestureSample sample;
  sample.time_ns = 5'000'000;
  writer.add(text, sample, 5'000'000);
  sample.tick = 1;
  sample.time_ns = 6'000'000;
  writer.add(text, sample, 5'000'000);
  writer.end(text);
  return text;
}

const ExportFormat& formatAt(ExportPlace place, std::string_view name) {
  return **formatFor(place, name, "");
}

TEST(ExportFormats, samplesAsCsvAreRowsBelowAHeader) {
  const std::string text = written(*formatAt(kWebSamples, "csv").samples());
  EXPECT_TRUE(text.starts_with("t_s,tick,time_ns,px_m,"));
  EXPECT_THAT(text, HasSubstr("\n0.001,1,6000000,0,"));
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 3);
}

TEST(ExportFormats, aSpreadsheetHasOfEach4msTheSampleWithTheGreatestForce) {
  const auto writer = formatAt(kSessionExport, "csv").samples();
  std::string text;
  writer->begin(text, {});
  const double force_N[] = {1, 3, 2, 3, 0, 0, 0, 0, 5};  // at 0, 1, … ms
  for (std::size_t ms = 0; ms < std::size(force_N); ++ms) {
    GestureSample sample;
    sample.tick = ms;
    sample.time_ns = 7'000'000'000 + static_cast<std::int64_t>(ms) * 1'000'000;
    sample.force_W_N[2] = -force_N[ms];
    writer->add(text, sample, 7'000'000'000);
  }
  writer->end(text);
  std::vector<std::string> rows;
  std::stringstream lines(text);
  for (std::string line; std::getline(lines, line);) rows.push_back(line.substr(0, line.find(",70")));
  EXPECT_THAT(rows, testing::ElementsAre(testing::StartsWith("t_s,tick"), "0.001,1", "0.004,4", "0.008,8"));
}

TEST(ExportFormats, samplesAsJsonHaveTheSessionAndTheRows) {
  const std::string text = written(*formatAt(kSessionExport, "json").samples());
  EXPECT_TRUE(text.starts_with("{\"version\":\"" + programVersion() + "\",\"machine\":\"")) << text;
  EXPECT_THAT(text, HasSubstr("\",\"session\":{\"station\":\"s1\"},\"rows\":[\n{\"t_s\":0,"));
  EXPECT_THAT(text, HasSubstr("},\n{\"t_s\":0.001,\"tick\":1,"));
  EXPECT_TRUE(text.ends_with("}\n]}\n"));
  EXPECT_EQ(nlohmann::json::parse(text)["rows"].size(), 2u);
}

TEST(ExportFormats, scoresOfTheConsoleHaveARowAMeasure) {
  const auto writer = formatAt(kWebScores, "csv").scores();
  std::string text;
  writer->begin(text);
  pb::ScoreRow row;
  auto& attempt = *row.mutable_attempt();
  attempt.set_session_id(std::string("\x01", 1) + std::string(15, '\0'));
  attempt.set_trainee("=anna, b");
  attempt.set_exercise_id("knee");
  attempt.set_number(2);
  attempt.set_started_unix_ns(1'700'000'000'123'456'789);
  row.mutable_score()->set_passed(true);
  row.mutable_score()->set_definition_version(7);
  row.mutable_score()->set_measures_json(
      R"([{"measure": "peak_force_n", "value": 1.5, "unit": "N", "max": 6, "passed": false},
          {"measure": "sparc", "value": null, "unit": ""}, 3])");
  EXPECT_TRUE(writer->add(text, row).ok());
  row.mutable_score()->set_measures_json("{broken");
  EXPECT_TRUE(writer->add(text, row).ok()) << "it is left out";
  writer->end(text);
  const std::string head = "\"'=anna, b\",knee,2,01000000-0000-0000-0000-000000000000,1700000000123,yes,7,";
  EXPECT_EQ(
      text,
      "trainee,exercise_id,attempt,session_id,started_unix_ms,passed,definition_version,measure,value,unit,"
      "min,max,met\r\n" +
          head + "peak_force_n,1.5,N,,6,no\r\n" + head + "sparc,,,,,\r\n");
}

TEST(ExportFormats, aScoreThatIsInvalidIsNamedByItsSession) {
  const auto writer = formatAt(kScoresExport, "csv").scores();
  pb::ScoreRow row;
  row.mutable_attempt()->set_session_id(std::string(16, '\x02'));
  row.mutable_score()->set_measures_json("{broken");
  std::string text;
  const Status done = writer->add(text, row);
  ASSERT_FALSE(done.ok());
  EXPECT_THAT(done.error().message, HasSubstr("session 02020202-0202-0202-0202-020202020202: "));
  EXPECT_EQ(text, "");
}

}  // namespace
}  // namespace needlelab
