// The content of each plot of a gesture: series, colours, units, ranges and marks, by formula.
#include "client/view/model/gesture_plots.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/haptics/body/body_engine.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"
#include "tests/support/scenes/stored_sample.h"
#include "tests/support/view_lesson/sample_lesson.h"

namespace needlelab {
namespace {

constexpr double kAbsent_m = std::numeric_limits<double>::quiet_NaN();
constexpr double kDegree = 3.14159265358979323846 / 180;

/// A plane at z = 0, tissue below it: depth is −z.
SceneView flatScene() {
  SceneView scene;
  scene.limb_W = PlaneLimb{{0, 0, 0}, {0, 0, 1}};
  scene.layers.resize(2);
  scene.layers[0].colour = kindColour(pb::Volume::Structure::SKIN);
  scene.layers[0].name = "skin";
  scene.layers[0].bottom_m = 0.002;
  scene.layers[1].colour = kindColour(pb::Volume::Structure::MUSCLE);
  scene.layers[1].name = "muscle";
  scene.layers[1].top_m = 0.002;
  scene.layers[1].bottom_m = 0.03;
  scene.targets = {{"bursa", {0, 0, -0.02}, 0.003, {0, 0, -0.02}, {0, 0, 1}, 0.017, 0.023}};
  return scene;
}

Moment momentAtDepth(double time_s, double depth_m = 0) {
  Moment moment;
  moment.tick = static_cast<std::uint64_t>(std::llround(time_s * 1000));
  moment.time_s = time_s;
  moment.depth_m = depth_m;
  moment.wall_W_m = {kAbsent_m, kAbsent_m, kAbsent_m};
  return moment;
}

/// The only value of a series in [0, 2).
PixelColumn valueIn(const PlotSeries& series) {
  std::vector<PixelColumn> columns(1);
  series.columns(0, 2, columns);
  return columns[0];
}

TEST(GesturePlots, theForcesAreTheTotalThenTheEffectsInTableOrder) {
  std::vector<const EffectEntry*> expected;
  for (const EffectEntry* entry : effectEntries())
    if (entry->value != nullptr && entry->unit == "N") expected.push_back(entry);
  std::sort(expected.begin(), expected.end(),
            [](const EffectEntry* a, const EffectEntry* b) { return a->place < b->place; });

  Moment moment = momentAtDepth(1);
  moment.force_W_N = {2, -3, 6};  // |force| 7
  for (std::size_t i = 0; i < kEffectCount; ++i) moment.terms[i] = 0.5 * static_cast<double>(i + 1);
  GestureTrace trace;
  trace.push(moment);
  const Plot plot = gesturePlot(GesturePlot::kForces, trace, nullptr, 0, 2);
  ASSERT_EQ(plot.series.size(), expected.size() + 1);
  EXPECT_EQ(plot.series[0].name, "total");
  EXPECT_EQ(plot.series[0].colour, kWhite);
  EXPECT_FLOAT_EQ(valueIn(plot.series[0]).last, 7);
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const EffectEntry& entry = *expected[i];
    const PlotSeries& series = plot.series[i + 1];
    EXPECT_EQ(series.name, entry.term);
    EXPECT_EQ(hexText(series.colour), hexText(rgbOf(entry.colour))) << entry.term;
    // along u, a force that pushes the hand out is above zero
    const double term = 0.5 * static_cast<double>(static_cast<std::size_t>(entry.effect) + 1);
    EXPECT_FLOAT_EQ(valueIn(series).last, static_cast<float>(entry.along_u ? -term : term)) << entry.term;
  }
}

TEST(GesturePlots, theForcesAtTheCursorMatchThePicture) {
  const test::SampleLesson lesson = test::sampleLesson("shoulder-adult");
  GestureReplica replica(lesson.model);
  GestureTrace trace;
  for (const GestureSample& sample : lesson.samples) trace.push(replica.feed(sample));
  const Plot plot = gesturePlot(GesturePlot::kForces, trace, lesson.scene.get(), 0, trace.lastTime_s());
  for (double at_s = trace.firstTime_s(); at_s < trace.lastTime_s(); at_s += 0.0137) {
    // the picture draws this moment
    const Moment& shown = trace.at(at_s);
    ASSERT_TRUE(plot.series.at(0).reader(at_s)) << at_s;
    EXPECT_EQ(momentText(*plot.series[0].reader(at_s), plot.unit), momentText(forceOf(shown), "N"));
    std::size_t i = 0;
    for (const EffectEntry* effect : effectsAsShown()) {
      if (effect->unit != "N") continue;
      const auto read = plot.series.at(++i).reader(at_s);
      ASSERT_TRUE(read) << effect->name;
      EXPECT_EQ(std::abs(*read), std::abs(termOf(*effect, shown))) << effect->name << ", " << at_s;
    }
  }
  EXPECT_FALSE(plot.series[0].reader(trace.firstTime_s() - 0.1));
  EXPECT_FALSE(plot.series[0].reader(trace.lastTime_s() + 0.1));
}

TEST(GesturePlots, everyQuantityIsShownInTheUnitOfItsAxis) {
  struct Row {
    GesturePlot which;
    const char* heading;
    std::vector<float> values;  ///< per series
  };
  Moment moment = momentAtDepth(1, 0.0123);
  moment.inside = true;
  moment.speed_mps = -0.045;
  moment.lateral_error_m = 0.0021;
  moment.alpha_rad = 30 * kDegree;
  moment.tilt_rad = 12 * kDegree;
  moment.plunger = 0.25;
  moment.p_WT_m = {0.001, 0.002, -0.003};
  moment.wall_W_m = {0.004, 0.005, -0.006};
  GestureTrace trace;
  trace.push(moment);
  const std::vector<Row> rows = {{GesturePlot::kDepth, "depth, mm", {12.3F}},
                                 {GesturePlot::kSpeed, "speed, mm/s", {-45}},
                                 {GesturePlot::kAlignment, "distance from own line, mm", {2.1F}},
                                 {GesturePlot::kAngles, "angles, °", {30, 12}},
                                 {GesturePlot::kPlunger, "plunger, %", {25}},
                                 {GesturePlot::kPlaces, "tip and wall, mm", {1, 4, 2, 5, -3, -6}}};
  for (const Row& row : rows) {
    const Plot plot = gesturePlot(row.which, trace, nullptr, 0, 2);
    EXPECT_EQ(headingOf(plot), row.heading);
    EXPECT_EQ(plot.from, 0);
    EXPECT_EQ(plot.to, 2);
    ASSERT_EQ(plot.series.size(), row.values.size()) << row.heading;
    for (std::size_t i = 0; i < row.values.size(); ++i)
      EXPECT_NEAR(valueIn(plot.series[i]).last, row.values[i], 1e-4F) << row.heading << ", series " << i;
  }
}

TEST(GesturePlots, whereThereIsNoWallAndNoTiltNoneIsDrawn) {
  GestureTrace trace;
  trace.push(momentAtDepth(1));  // outside
  const Plot places = gesturePlot(GesturePlot::kPlaces, trace, nullptr, 0, 2);
  ASSERT_EQ(places.series.size(), 6u);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    EXPECT_FALSE(valueIn(places.series[2 * axis]).empty()) << "the tip is always somewhere";
    EXPECT_TRUE(valueIn(places.series[2 * axis + 1]).empty());
    EXPECT_EQ(places.series[2 * axis].colour, kAxisColours[axis]);
    EXPECT_FALSE(places.series[2 * axis].dashed);
    EXPECT_TRUE(places.series[2 * axis + 1].dashed) << "not by colour alone";
  }
  const Plot angles = gesturePlot(GesturePlot::kAngles, trace, nullptr, 0, 2);
  EXPECT_TRUE(valueIn(angles.series.at(1)).empty());
}

TEST(GesturePlots, theDepthAxisContainsTheTargetAndTheTip) {
  struct Row {
    const char* name;
    bool target;
    double depth_m, from_s;
    double
        high_mm;  ///< largest of 10 mm, the target's depth + 2 radii, and the depth in [from, from + 2) + 8 %
  };
  const std::vector<Row> rows = {{"nothing deep", false, -0.01, 0, 10},
                                 {"the target", true, -0.01, 0, 20 + 2 * 3},
                                 {"the tip, shallower than the target", true, 0.02, 0, 26},
                                 {"the tip, deeper", true, 0.03, 0, 30 * 1.08},
                                 {"the tip, deeper, at another time", true, 0.03, 4, 26}};
  for (const Row& row : rows) {
    SceneView scene = flatScene();
    if (!row.target) scene.targets.clear();
    GestureTrace trace;
    trace.push(momentAtDepth(1, row.depth_m));
    trace.push(momentAtDepth(5, -0.01));
    const Plot plot = gesturePlot(GesturePlot::kDepth, trace, &scene, row.from_s, row.from_s + 2);
    EXPECT_TRUE(plot.downward);
    ASSERT_TRUE(plot.low && plot.high) << row.name;
    EXPECT_NEAR(*plot.high, row.high_mm, 1e-4) << row.name;
    EXPECT_NEAR(*plot.low, -0.12 * row.high_mm, 1e-4) << row.name;
  }
}

TEST(GesturePlots, layersAndTheTargetAreBands) {
  const SceneView scene = flatScene();
  const GestureTrace trace;
  const Plot plot = gesturePlot(GesturePlot::kDepth, trace, &scene, 0, 2);
  ASSERT_EQ(plot.bands.size(), 3u);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(plot.bands[i].name, scene.layers[i].name);
    EXPECT_EQ(plot.bands[i].colour, scene.layers[i].colour);
    EXPECT_DOUBLE_EQ(plot.bands[i].low, 1000 * scene.layers[i].top_m);
    EXPECT_DOUBLE_EQ(plot.bands[i].high, 1000 * scene.layers[i].bottom_m);
  }
  EXPECT_TRUE(plot.bands[2].is_target);
  EXPECT_EQ(plot.bands[2].name, "bursa");
  EXPECT_EQ(plot.bands[2].colour, kTargetColour);
  EXPECT_NEAR(plot.bands[2].low, 17, 1e-9);
  EXPECT_NEAR(plot.bands[2].high, 23, 1e-9);
  EXPECT_TRUE(valueIn(plot.series[0]).empty()) << "no sample yet";

  const Plot without = gesturePlot(GesturePlot::kDepth, trace, nullptr, 0, 2);
  EXPECT_TRUE(without.bands.empty());
  EXPECT_EQ(without.series.size(), 1u);
  EXPECT_FALSE(without.low || without.high) << "fitted to the data";
}

// A needle that goes straight in beside the shoulder's slanting plan and presses on the humerus, then one
// that goes in 20 mm aside. In each tick the way along the needle and the plot's bands have the engine's own
// layer.
TEST(GesturePlots, inABodyTheTissuesAreThoseThatTheEngineSteppedOn) {
  const auto profile = *loadProfile(NEEDLELAB_SAMPLES "/volumes/shoulder-median.json");
  const SceneView scene = *sceneViewOf(profile);
  const auto model = std::make_shared<const SceneModel>(*compile(*sceneSpecOf(profile), 1000));
  const Vec3 in_W = -scene.focus_normal_W;
  GestureReplica replica(model);
  GestureTrace trace;
  SceneEngine engine(*model);
  StepReport report;
  std::vector<GestureSample> inside;
  for (std::uint64_t k = 0; k < 6000; ++k) {
    const double way_m = 0.03 * std::sin(3.14159265 * static_cast<double>(k % 3000) / 3000);
    const Vec3 from_W_m = scene.focus_W_m + Vec3{k < 3000 ? 0 : 0.02, 0, 0} - in_W * 0.004;
    const TipSample tip{from_W_m + in_W * way_m, normalized(Quat{-in_W.y, in_W.x, 0, 1 + in_W.z})};
    engine.step(tip, report);
    const GestureSample sample = test::storedSample(k, tip, report);
    if ((report.flags & kFlagEntry) != 0) replica.takePath({k, engine.pathInUse()});
    const Moment& now = replica.feed(sample);
    trace.push(now);
    if (report.layer < 0) continue;
    inside.push_back(sample);
    const TissuesOnLine way = tissuesOnLine(scene, *lineOf(now), scene.needle.length_m);
    ASSERT_TRUE(std::ranges::any_of(way.tissues, [&](const TissuesOnLine::Tissue& tissue) {
      return tissue.holds(report.layer, report.insertion_m);
    })) << k;
  }
  const Plot plot = gesturePlot(GesturePlot::kDepth, trace, &scene, 0, 6);
  for (const GestureSample& sample : inside) {
    const double t = static_cast<double>(sample.tick) / 1000,
                 mm = 1e3 * static_cast<double>(trace.value(TraceChannel::kDepth, t).value_or(-1));
    ASSERT_TRUE(std::ranges::any_of(plot.bands, [&](const PlotBand& band) {
      const LayerView& layer = scene.layers[static_cast<std::size_t>(sample.layer)];
      return !band.is_target && band.colour == layer.colour && t >= band.from && t <= band.to &&
             mm > band.low - 1 && mm < band.high + 1;
    })) << sample.tick;
  }
  EXPECT_TRUE(std::ranges::any_of(plot.bands, [](const PlotBand& band) {
    return band.is_target && band.name == "subacromial bursa" && band.high > band.low;
  }));
}

TEST(GesturePlots, eachEventIsAMarkWithASignAndWords) {
  using Kind = TraceEvent::Kind;
  struct Row {
    Kind kind;
    int layer;
    const char* text;  ///< of the event
    Rgb colour;
    const char* words;  ///< of the mark
  };
  const std::vector<Row> rows = {
      {Kind::kEntry, 0, "", kDimText, "in"},
      {Kind::kExit, -1, "", kDimText, "out"},
      {Kind::kLayerChange, 1, "", kDimText, "muscle"},
      {Kind::kLayerChange, 9, "", kDimText, "?"},
      {Kind::kRupture, 1, "", kYellow, "rupture"},
      {Kind::kTurn, 1, "", kReddishPurple, "change of trajectory"},
      {Kind::kStop, 1, "", kDimText, "at rest"},
      {Kind::kFault, 1, "", styleOf(Condition::kTrouble).colour, "FAULT"},
      {Kind::kGap, 1, "", styleOf(Condition::kAttention).colour, "samples missing"},
      {Kind::kBoneContact, 1, "", styleOf(Condition::kTrouble).colour, "bone contact"},
      {Kind::kHubContact, 1, "", styleOf(Condition::kTrouble).colour, "hub on the skin"},
      {Kind::kRemark, -1, "anna: slower", kSkyBlue, "anna: slower"}};
  GestureTrace trace;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    TraceEvent event;
    event.kind = rows[i].kind;
    event.time_s = static_cast<double>(i);
    event.layer = rows[i].layer;
    event.text = rows[i].text;
    trace.add(event);
  }
  const SceneView scene = flatScene();
  const Plot plot = gesturePlot(GesturePlot::kSpeed, trace, &scene, 0, 100);
  ASSERT_EQ(plot.marks.size(), rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    EXPECT_EQ(plot.marks[i].text, rows[i].words) << i;
    EXPECT_EQ(plot.marks[i].sign, signOf(rows[i].kind)) << rows[i].words;
    EXPECT_EQ(hexText(plot.marks[i].colour), hexText(rows[i].colour)) << rows[i].words;
    EXPECT_EQ(plot.marks[i].x, static_cast<double>(i));
  }
  // without a scene a layer has no name
  EXPECT_EQ(gesturePlot(GesturePlot::kSpeed, trace, nullptr, 2, 2).marks.at(0).text, "layer");
}

TEST(GesturePlots, aGapIsAMarkWithItsNumberAndBreaksTheCurve) {
  GestureTrace trace;
  for (int i = 0; i < 1000; ++i)
    if (i < 300 || i >= 350) trace.push(momentAtDepth(i * 0.001, 0.01));
  const Plot plot = gesturePlot(GesturePlot::kForces, trace, nullptr, 0, 1);
  ASSERT_EQ(plot.marks.size(), 1u);
  EXPECT_EQ(plot.marks[0].text, "50 samples missing (50 ms)");
  EXPECT_EQ(plot.marks[0].sign, signOf(TraceEvent::Kind::kGap));
  // 200 columns of 5 ms: the last value before the gap is in column 59, the first one after it in column 70
  EXPECT_TRUE(isBroken(plot, 59, 70, 200));
  EXPECT_FALSE(isBroken(plot, 58, 59, 200));
  EXPECT_FALSE(isBroken(plot, 70, 71, 200));
  EXPECT_TRUE(gesturePlot(GesturePlot::kForces, trace, nullptr, 0.5, 1).gaps.empty());
}

TEST(GesturePlots, noiseFillsNoPlot) {
  // an encoder's noise around a needle at rest
  GestureTrace trace;
  for (int i = 0; i < 100; ++i) {
    Moment moment = momentAtDepth(0.01 * i, 0.1497 + (i % 2) * 3e-5);
    moment.inside = true;
    moment.force_W_N = {0, 0, (i % 2) * 0.01};
    moment.speed_mps = (i % 2) * 3e-4;
    moment.lateral_error_m = (i % 2) * 3e-5;
    moment.tilt_rad = 0.1 * kDegree * (i % 2);
    trace.push(moment);
  }
  for (const GesturePlot which : {GesturePlot::kForces, GesturePlot::kDepth, GesturePlot::kSpeed,
                                  GesturePlot::kAlignment, GesturePlot::kAngles, GesturePlot::kPlaces}) {
    const Plot plot = gesturePlot(which, trace, nullptr, 0, 2);
    AxisSpan data{1e9, -1e9};
    for (const PlotSeries& series : plot.series) {
      const PixelColumn column = valueIn(series);
      if (column.empty()) continue;
      data = {std::min(data.low, static_cast<double>(column.min)),
              std::max(data.high, static_cast<double>(column.max))};
    }
    const AxisSpan span = fittedSpan(plot, data);
    EXPECT_LT(data.high - data.low, 0.02 * (span.high - span.low)) << plot.title;
    EXPECT_LE(span.low, data.low + 1e-9) << plot.title;
    EXPECT_GE(span.high, data.high - 1e-9) << plot.title;
  }
}

TEST(GesturePlots, exerciseLimitsAreLinesInTheirPlots) {
  pb::Exercise exercise;
  const auto require = [&](const char* measure, std::optional<double> min, std::optional<double> max) {
    auto& row = *exercise.add_requirements();
    row.set_measure(measure);
    if (min) row.set_min(*min);
    if (max) row.set_max(*max);
  };
  require("peak_force_n", {}, 5);
  require("largest_lateral_error_m", {}, 0.003);
  require("greatest_depth_m", 0.02, 0.03);
  require("peak_speed_m_s", {}, 0.1);
  require("entries", {}, 2);
  struct Row {
    GesturePlot which;
    std::vector<std::pair<double, std::string>> limits;
  };
  const GestureTrace trace;
  const SceneView scene = flatScene();
  for (const Row& row :
       {Row{GesturePlot::kForces, {{5, "at most 5 N"}}}, Row{GesturePlot::kAlignment, {{3, "at most 3 mm"}}},
        Row{GesturePlot::kDepth, {{20, "at least 20 mm"}, {30, "at most 30 mm"}}},
        Row{GesturePlot::kSpeed, {{100, "at most 100 mm/s, in any direction"}, {-100, ""}}},
        Row{GesturePlot::kAngles, {}}}) {
    Plot plot = gesturePlot(row.which, trace, &scene, 0, 2);
    addLimits(plot, row.which, requirementsOf(exercise));
    ASSERT_EQ(plot.limits.size(), row.limits.size()) << plot.title;
    const AxisSpan span = fittedSpan(plot, std::nullopt);
    for (std::size_t i = 0; i < row.limits.size(); ++i) {
      EXPECT_NEAR(plot.limits[i].at, row.limits[i].first, 1e-9);
      EXPECT_EQ(plot.limits[i].text, row.limits[i].second);
      EXPECT_LE(plot.limits[i].at, span.high) << "within the axis";
      EXPECT_GE(plot.limits[i].at, span.low) << "within the axis";
    }
  }
}

TEST(GesturePlots, aScoresRowsWithoutARequirementMakeNoLimit) {
  std::vector<Measure> measures(2);
  measures[0].name = "peak_force_n";
  measures[1].name = "largest_lateral_error_m";
  measures[1].max = 0.002;
  const auto requirements = requirementsOf(measures);
  ASSERT_EQ(requirements.size(), 1u);
  Plot plot;
  addLimits(plot, GesturePlot::kAlignment, requirements);
  ASSERT_EQ(plot.limits.size(), 1u);
  EXPECT_NEAR(plot.limits[0].at, 2, 1e-12);
}

TEST(GesturePlots, marksOutsideTheShownTimeAreOmitted) {
  GestureTrace trace;
  for (int i = 0; i < 10; ++i) {
    TraceEvent event;
    event.time_s = i;
    trace.add(event);
  }
  const Plot plot = gesturePlot(GesturePlot::kForces, trace, nullptr, 3, 6);
  ASSERT_EQ(plot.marks.size(), 4u);
  EXPECT_EQ(plot.marks.front().x, 3);
  EXPECT_EQ(plot.marks.back().x, 6);
}

}  // namespace
}  // namespace needlelab
