#include "client/instructor/model/stored/report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <numbers>

#include "common/base/files/files.h"
#include "common/gesture/sample.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/client/instructor/model/lesson_gestures.h"

namespace needlelab {
namespace {

using testing::HasSubstr;
using testing::Not;

ReportData dataOf(const std::string& trainee = "tina") {
  const std::string json = test::sampleProfile("shoulder-adult");
  ReportData data;
  data.gesture = gestureOf(test::lessonInfo(json, trainee), test::lessonSamples(json, {}));
  Measure force;
  force.name = "peak_force_n";
  force.value = 3.25;
  force.unit = "N";
  force.max = 5;
  force.passed = true;
  force.words = "Greatest force 3.25 N";
  Measure entries;
  entries.name = "entries";
  entries.value = 1;
  data.measures = {entries, force};
  data.passed = true;
  data.definition_version = 2;
  pb::ReferenceBand band;
  band.set_measure("peak_force_n");
  band.set_unit("N");
  band.set_n(6);
  band.set_least(1);
  band.set_greatest(3);
  data.bands.push_back(band);
  data.places.push_back({"peak_force_n",
                         "Peak force 3.25 N: above the experts' range, 1 N to 3 N (6 gestures)",
                         placeMarks({1, 3}, 3.25)});
  data.progress.push_back(
      {"peak_force_n", "N", "falls by 0.3 N with each attempt", {1, 2, 3}, {4, 3.5, 3.25}});
  return data;
}

TEST(Report, aLayersMeasureHasTheLayersName) {
  ReportData data = dataOf();
  Measure bursa;
  bursa.name = "peak_force_layer_4_n";
  bursa.value = 2;
  bursa.unit = "N";
  bursa.words = "Peak force in layer 4 (BURSA) 2 N";  // as stored
  data.measures.push_back(bursa);
  EXPECT_THAT(reportHtml(data), HasSubstr(">Peak force in bursa</td>"));
  data.measures.back().value = 0;  // the tip never was there
  EXPECT_THAT(reportHtml(data), Not(HasSubstr("Peak force in bursa")));
  data.measures.back().passed = true;
  EXPECT_THAT(reportHtml(data), HasSubstr(">Peak force in bursa</td>")) << "where it is required";
  data.measures.back().passed.reset();
  data.measures.back().value = 2;
  auto profile = nlohmann::json::parse(test::sampleProfile("shoulder-adult"));
  const std::string name = "bursa <left>";
  profile["layers"][3]["name"] = profile["targets"][0]["anchor"]["layer"] = name;
  profile["targets"][0]["tissues"][0] = name;
  const std::string named = profile.dump();
  data.gesture = gestureOf(test::lessonInfo(named, "tina"), test::lessonSamples(named, {}));
  EXPECT_THAT(reportHtml(data), HasSubstr(">Peak force in bursa &lt;left&gt;</td>"));
  // unreadable
  data.gesture = gestureOf(test::lessonInfo("{}", "tina"), test::lessonSamples(named, {}));
  EXPECT_THAT(reportHtml(data), HasSubstr(">Peak force in layer 4</td>"));
}

TEST(Report, showsTheScoresValues) {
  const std::string html = reportHtml(dataOf());
  for (const char* part :
       {"✔ passed", "3.25 N", "at most 5", "above the experts&#39; range, 1 N to 3 N (6 gestures)",
        "falls by 0.3 N", "Definitions of version 2", "shoulder-bursa", "bench-1"})
    EXPECT_THAT(html, HasSubstr(part));
  // plots: forces, depth, speed, lateral error, angles; one of progress; one location
  std::size_t plots = 0;
  for (std::size_t at = html.find("<svg"); at != std::string::npos; at = html.find("<svg", at + 1)) ++plots;
  EXPECT_EQ(plots, 7u);
  EXPECT_THAT(html, HasSubstr("beside the experts"));
  // required ones first
  EXPECT_LT(html.find("at most 5"), html.find(">1<"));
}

TEST(Report, beginsWithVerdictPersonExerciseAndPatientAndSaysEachValueOnce) {
  ReportData data = dataOf();
  auto gesture = std::make_shared<StoredGesture>();
  gesture->info = data.gesture->info;
  gesture->info.mutable_description()->set_trainee_full_name("Tina Weber");
  gesture->scene = data.gesture->scene;
  gesture->samples = data.gesture->samples;
  data.gesture = gesture;
  data.exercise_name = "Shoulder: bursa";
  const std::string html = reportHtml(data);
  const std::string page = html.substr(html.find("<body>"));
  const std::string patient = htmlText(gesture->scene.profile.name());
  ASSERT_FALSE(patient.empty());
  EXPECT_TRUE(page.starts_with(
      "<body>\n<p class='v'>✔ passed</p>\n<h1>Tina Weber: Shoulder: bursa</h1>\n<p>Patient: " + patient +
      "</p>\n"))
      << page.substr(0, 300);
  for (const std::string& once : {std::string("3.25 N"), std::string("Tina Weber"),
                                  std::string("Shoulder: bursa"), patient, std::string("passed</p>")}) {
    const std::size_t at = page.find(once);
    ASSERT_NE(at, std::string::npos) << once;
    EXPECT_EQ(page.find(once, at + 1), std::string::npos) << once;
  }
}

TEST(Report, usesNamesForIdentifiersAndUnitsForShares) {
  ReportData data = dataOf();
  pb::Exercise exercise;
  for (const MeasureKind& kind : measureKinds()) {
    if (kind.name.find('K') != std::string_view::npos || kind.need == MeasureNeed::kPlan) continue;
    auto& requirement = *exercise.add_requirements();
    requirement.set_measure(std::string(kind.name));
    requirement.set_max(1);
  }
  data.measures = scoreGesture(data.gesture->samples, 1000, data.gesture->scene.profile,
                               data.gesture->scene.X_WL, &exercise);
  const std::string html = reportHtml(data);
  for (const MeasureKind& kind : measureKinds())
    if (kind.name.find('_') != std::string_view::npos)
      EXPECT_THAT(html, Not(HasSubstr(std::string(kind.name))));
  EXPECT_THAT(html, HasSubstr(">You did not inject.</td>"));
  EXPECT_THAT(html, HasSubstr("<td>at most 100 %</td>"));
  EXPECT_THAT(html, Not(HasSubstr("ENHANCED_TRACKING_WALL")));
}

TEST(Report, withoutExpertDataThereIsNoExpertColumn) {
  ReportData data = dataOf();
  data.places.clear();
  EXPECT_THAT(reportHtml(data), Not(HasSubstr("beside the experts")));
}

TEST(Report, listsContactsWithBone) {
  // the shoulder's bone is 35 mm deep below the target
  ReportData data = dataOf();
  EXPECT_THAT(reportHtml(data), Not(HasSubstr("bone contact"))) << "20 mm deep";
  data.gesture = test::lesson({.depth_m = 0.04});
  const std::string html = reportHtml(data);
  EXPECT_THAT(html, HasSubstr("</td><td>bone contact</td>"));
  EXPECT_LT(html.find("<td>in</td>"), html.find("<td>bone contact</td>"));
  EXPECT_LT(html.find("<td>bone contact</td>"), html.find("<td>out</td>"));
}

TEST(Report, listsMissingSamples) {
  const std::string json = test::sampleProfile("shoulder-adult");
  auto samples = test::lessonSamples(json, {});
  samples.erase(samples.begin() + 1000, samples.begin() + 1250);
  ReportData data = dataOf();
  EXPECT_THAT(reportHtml(data), Not(HasSubstr("missing")));
  data.gesture = gestureOf(test::lessonInfo(json), std::move(samples));
  EXPECT_THAT(reportHtml(data), HasSubstr("</td><td>250 samples missing (250 ms)</td>"));
}

TEST(Report, aRequirementIsALineInTheGestureAndProgressPlots) {
  const std::string html = reportHtml(dataOf());
  std::size_t lines = 0;
  for (std::size_t at = html.find(">at most 5 N</text>"); at != std::string::npos;
       at = html.find(">at most 5 N</text>", at + 1))
    ++lines;
  EXPECT_EQ(lines, 2u) << "the force over time, and the peak force over attempts";
}

TEST(ProgressPlot, attemptsThatHardlyDifferLookAlike) {
  const Plot plot = progressPlot({}, {"largest_lateral_error_m", "m", "", {1, 2}, {0.00201, 0.00204}});
  const AxisSpan span = fittedSpan(plot, AxisSpan{2.01, 2.04});
  EXPECT_EQ(span.low, 0);
  EXPECT_GE(span.high, 5);
}

TEST(Report, hasTheErrorsAgainstAPlanWhereThereIsOne) {
  ReportData data = dataOf();
  EXPECT_THAT(reportHtml(data), Not(HasSubstr("planned"))) << "no plan";
  pb::Exercise exercise;
  exercise.mutable_plan()->mutable_entry_m()->set_x(0.002);
  exercise.mutable_plan()->mutable_direction()->set_z(-1);
  data.measures = scoreGesture(data.gesture->samples, 1000, data.gesture->scene.profile,
                               data.gesture->scene.X_WL, &exercise);
  const std::string html = reportHtml(data);
  // straight down, 2 mm beside the plan
  EXPECT_THAT(html, HasSubstr("Entry-site error"));
  EXPECT_THAT(html, HasSubstr("Mean distance from the planned line"));
  EXPECT_THAT(html, HasSubstr("distance from own line"));
}

TEST(Report, isOneFileWithoutScriptsOrLinks) {
  const std::string html = reportHtml(dataOf());
  for (const char* part : {"<script", "http://", "https://", "<link", "<img", "@import", "url("})
    EXPECT_THAT(html, Not(HasSubstr(part)));
  const ReportData data = dataOf();
  EXPECT_EQ(reportHtml(data), reportHtml(data));
}

TEST(Report, saysByHowMuchTheNeedleMissed) {
  ReportData data = dataOf();
  auto gesture = std::make_shared<StoredGesture>();
  gesture->info = data.gesture->info;
  gesture->scene = data.gesture->scene;
  data.gesture = gesture;
  EXPECT_THAT(reportHtml(data), Not(HasSubstr("Missed"))) << "never in tissue";
  // the bursa's sphere of 3 mm is 26 mm deep
  pb::SyringeEvent injection;
  injection.set_kind(pb::SyringeEvent::INJECTION);
  injection.mutable_begin()->set_in_tissue(true);
  const Pose X_WT = gesture->scene.X_WL * Pose{{0, 0.0051, -0.026}, {1, 0, 0, 0}};  // straight down
  injection.mutable_begin()->set_x_m(X_WT.p.x);
  injection.mutable_begin()->set_y_m(X_WT.p.y);
  injection.mutable_begin()->set_z_m(X_WT.p.z);
  gesture->events = {injection};
  GestureSample sample;
  sample.layer = 3;
  sample.insertion_m = 0.026;
  const double at[] = {X_WT.p.x, X_WT.p.y, X_WT.p.z}, turned[] = {X_WT.q.x, X_WT.q.y, X_WT.q.z, X_WT.q.w};
  std::ranges::copy(at, sample.p_WT_m);
  std::ranges::copy(turned, sample.q_WT);
  gesture->samples = {sample};
  EXPECT_THAT(reportHtml(data),
              HasSubstr("<p>Missed by 2.1 mm towards the head. Where the last injection began"));
}

TEST(Report, aSofterRenderingIsNotedWithTheVerdict) {
  ReportData data = dataOf();
  EXPECT_THAT(reportHtml(data), Not(HasSubstr("were rendered at")));
  auto gesture = std::make_shared<StoredGesture>();
  gesture->info = data.gesture->info;
  gesture->info.mutable_description()->set_stiffness_share(0.55);
  data.gesture = gesture;
  EXPECT_THAT(reportHtml(data), HasSubstr("were rendered at 55 % of the profile"));
}

TEST(Report, whatComesFromElsewhereIsEscaped) {
  const std::string evil = "<img src=x onerror='alert(1)'>";
  ReportData data = dataOf(evil);
  auto gesture = std::make_shared<StoredGesture>();
  gesture->info = data.gesture->info;
  auto& d = *gesture->info.mutable_description();
  d.set_station(evil);
  d.set_device(evil);
  d.set_profile_id(evil);
  d.set_exercise_id(evil);
  d.add_device_notes(evil);
  gesture->notes.push_back(evil);
  pb::Annotation remark;
  remark.set_author(evil);
  remark.set_text(evil);
  data.remarks.push_back(remark);
  pb::SyringeEvent event;
  event.mutable_begin()->set_tissue(evil);
  event.mutable_begin()->set_target(evil);
  event.add_hazards(evil);
  gesture->events.push_back(event);
  data.gesture = gesture;
  data.exercise_name = data.exercise_text = evil;
  data.measures[0].name = data.measures[0].words = data.measures[0].unit = evil;
  data.places[0].words = evil;
  data.progress[0].words = evil;
  data.notes.push_back(evil);
  const std::string html = reportHtml(data);
  EXPECT_THAT(html, Not(HasSubstr("<img")));
  EXPECT_THAT(html, Not(HasSubstr("onerror='")));
  EXPECT_THAT(html, HasSubstr("&lt;img"));
}

TEST(Report, aSessionWithoutScoreOrSamplesHasAPageToo) {
  ReportData data;
  data.gesture = gestureOf(test::lessonInfo("{}"), {});
  const std::string html = reportHtml(data);
  EXPECT_THAT(html, HasSubstr("no score yet"));
  EXPECT_THAT(html, Not(HasSubstr("nan")));
}

TEST(Report, theCsvHoldsTheSamples) {
  const test::TempFolder folder;
  const auto gesture = test::lesson();
  const auto file = folder.path() / "samples.csv";
  ASSERT_TRUE(writeSamplesCsv(*gesture, file).ok());
  const auto back = readSampleCsv(file);
  ASSERT_TRUE(back.ok()) << back.error().message;
  ASSERT_EQ(back->size(), gesture->samples.size());
  for (std::size_t i = 0; i < back->size(); i += 100) {
    EXPECT_EQ((*back)[i].tick, gesture->samples[i].tick);
    EXPECT_EQ((*back)[i].p_WT_m[2], gesture->samples[i].p_WT_m[2]);
    EXPECT_EQ((*back)[i].force_W_N[0], gesture->samples[i].force_W_N[0]);
  }
  EXPECT_FALSE(writeSamplesCsv(*gesture, folder.path() / "no" / "such" / "folder.csv").ok());
}

TEST(ReportData, rowsOfJsonFromTheNetwork) {
  EXPECT_TRUE(progressRowsOf("").empty());
  EXPECT_TRUE(progressRowsOf("{}").empty());
  EXPECT_TRUE(progressRowsOf("[1, \"x\", {}]").empty());
  const auto rows = progressRowsOf(
      R"([{"measure":"peak_force_n","unit":"N","attempts":[0,1,2,"x"],"values":[4,null,3,5],"words":"falls"}])");
  ASSERT_EQ(rows.size(), 1u);
  EXPECT_EQ(rows[0].attempts, (std::vector<double>{1, 3}));
  EXPECT_EQ(rows[0].values, (std::vector<double>{4, 3})) << "each value stays with its own attempt";
  const auto places =
      placeRowsOf(R"([{"measure":"a","value":3,"least":1,"greatest":2,"place":"above","words":"w"},)"
                  R"({"measure":"b","value":3,"least":1,"greatest":1,"place":null,"words":""},)"
                  R"({"measure":"c","value":3,"least":2,"greatest":2,"place":"above","words":"w"},7])");
  ASSERT_EQ(places.size(), 1u) << "the others are not mentioned";
  EXPECT_EQ(places[0].measure, "a");
  EXPECT_NEAR(places[0].marks.value, 0.9, 1e-12);
}

TEST(ProgressPlot, isInTheUnitsAndTheExpertsRangeThatTheReaderSees) {
  struct Row {
    const char *measure, *unit, *shown_unit;
    double value, shown;
  };
  for (const Row& row :
       {Row{"largest_lateral_error_m", "m", "mm", 0.0023, 2.3},
        Row{"tissue_damage_m2", "m^2", "cm²", 1.5e-4, 1.5},
        Row{"planned_angle_error_rad", "rad", "°", std::numbers::pi / 18, 10},
        Row{"clamping_work_j", "J", "mJ", 0.0061, 6.1}, Row{"injected_share", "", "%", 0.08, 8},
        Row{"mean_speed_m_s", "m/s", "mm/s", 0.02, 20}, Row{"peak_force_n", "N", "N", 3.25, 3.25},
        Row{"elapsed_s", "s", "s", 61, 61}}) {
    for (const bool enough : {true, false}) {
      ReportData data;
      pb::ReferenceBand band;
      band.set_measure(row.measure);
      band.set_unit(row.unit);
      band.set_n(enough ? 5 : 4);
      band.set_least(0.5 * row.value);
      band.set_greatest(2 * row.value);
      data.bands.push_back(band);
      band.set_measure("another");
      data.bands.push_back(band);
      const Plot plot = progressPlot(data, {row.measure, row.unit, "", {1, 4}, {row.value, 2 * row.value}});
      EXPECT_EQ(plot.unit, row.shown_unit);
      EXPECT_FALSE(plot.clock_axis);
      EXPECT_EQ(plot.from, 1);
      EXPECT_NEAR(plot.to, 4, 0.01);
      ASSERT_EQ(plot.series.size(), 1u);
      EXPECT_EQ(plot.series[0].x, (std::vector<double>{1, 4})) << "attempts without a value are left out";
      ASSERT_EQ(plot.series[0].y.size(), 2u);
      EXPECT_NEAR(plot.series[0].y[0], row.shown, 1e-9) << row.measure;
      ASSERT_EQ(plot.bands.size(), enough ? 1u : 0u) << "only this measure's, and of five gestures on";
      if (!enough) continue;
      EXPECT_NEAR(plot.bands[0].low, 0.5 * row.shown, 1e-9) << row.measure;
      EXPECT_NEAR(plot.bands[0].high, 2 * row.shown, 1e-9) << row.measure;
    }
  }
}

}  // namespace
}  // namespace needlelab
