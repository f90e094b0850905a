#include "client/view/plots.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "client/view/model/gesture_plots.h"
#include "client/view/theme.h"
#include "tests/support/pictures/picture_check.h"
#include "tests/support/pictures/view_stage.h"
#include "tests/support/view_lesson/sample_lesson.h"

namespace needlelab {
namespace {

const ImVec2 kCorner{20, 10}, kSize{560, 200};

class PlotsTest : public test::ViewStage {
 protected:
  PlotsTest() {
    options_.width_px = 600;
    options_.height_px = 420;
  }
  RgbaImage drawn(const Plot& spec, const std::vector<PlotSeries>& series, int frames = 2) {
    Plot plot = spec;
    plot.series = series;
    return draw(
        [&] {
          beginScreen("s");
          ImGui::SetCursorScreenPos(kCorner);
          result_ = linePlot("plot", plot, kSize);
          field_ = plotFieldAt(kCorner, kSize, true);
          endScreen();
        },
        frames);
  }
  // Returns the rows of a column that have the series' colour.
  std::pair<int, int> rowsOf(const RgbaImage& picture, int x, Rgb colour) const {
    int first = -1, last = -1;
    for (int y = static_cast<int>(field_.low_px.y); y < static_cast<int>(field_.high_px.y); ++y) {
      const unsigned p = test::pixelAt(picture, x, y);
      const auto near = [&](unsigned shift, float share) {
        return std::abs(static_cast<int>((p >> shift) & 255u) - static_cast<int>(share * 255)) < 40;
      };
      if (!near(16, colour.red) || !near(8, colour.green) || !near(0, colour.blue)) continue;
      if (first < 0) first = y;
      last = y;
    }
    return {first, last};
  }
  PlotResult result_;
  PlotField field_;
};

PlotSeries seriesThrough(const std::vector<double>& x, const std::vector<double>& y, Rgb colour) {
  PlotSeries series;
  series.name = "force";
  series.colour = colour;
  series.columns = columnsOf(x, y);
  return series;
}

Plot specFrom(double from, double to) {
  Plot spec;
  spec.title = "force";
  spec.unit = "N";
  spec.from = from;
  spec.to = to;
  spec.low = 0;
  spec.high = 4;
  return spec;
}

TEST_F(PlotsTest, aLineIsDrawnAtItsValues) {
  std::vector<double> x, y;
  for (int i = 0; i <= 1000; ++i) {
    x.push_back(i * 0.01);
    y.push_back(i < 500 ? 1.0 : 3.0);
  }
  const RgbaImage picture = drawn(specFrom(0, 10), {seriesThrough(x, y, kYellow)});
  const float height_px = field_.high_px.y - field_.low_px.y, width_px = field_.high_px.x - field_.low_px.x;
  for (const auto& [at, value] : {std::pair{2.0, 1.0}, std::pair{8.0, 3.0}}) {
    const auto column = static_cast<int>(field_.low_px.x + width_px * static_cast<float>(at / 10));
    const auto [first, last] = rowsOf(picture, column, kYellow);
    ASSERT_GE(first, 0) << at;
    const float expected_px = field_.high_px.y - height_px * static_cast<float>(value / 4);
    EXPECT_NEAR(0.5 * (first + last) + 0.5, static_cast<double>(expected_px), 1.6) << at;
  }
}

TEST_F(PlotsTest, aLineIsBrokenWhereSamplesAreMissingAndOnlyThere) {
  // 0.16 of 10 are some 8 columns, which a slow stream's line bridges
  std::vector<double> x, y;
  for (int i = 0; i <= 5000; ++i) {
    const double at = i * 0.002;
    if (at > 4.92 && at < 5.08) continue;
    x.push_back(at);
    y.push_back(2);
  }
  Plot spec = specFrom(0, 10);
  const auto rowInTheMiddle = [&] {
    const RgbaImage picture = drawn(spec, {seriesThrough(x, y, kYellow)});
    return rowsOf(picture, static_cast<int>(0.5F * (field_.low_px.x + field_.high_px.x)), kYellow).first;
  };
  EXPECT_GE(rowInTheMiddle(), 0);
  spec.gaps = {{4.92, 5.08}};
  EXPECT_LT(rowInTheMiddle(), 0);
}

TEST(PlotLabels, areCentredInsideTheFieldOrLeftAlignedIfWider) {
  const PlotField field{{100, 0}, {300, 50}};
  EXPECT_EQ(labelLeftAt(field, 200, 40), 180) << "centred";
  EXPECT_EQ(labelLeftAt(field, 100, 40), 92);
  EXPECT_EQ(labelLeftAt(field, 300, 40), 268);
  for (const float x_px : {100.0F, 200.0F, 300.0F}) EXPECT_EQ(labelLeftAt(field, x_px, 400), 92);
}

TEST_F(PlotsTest, aPlotNarrowerThanALabelIsDrawn) {
  Plot plot = specFrom(0, 3);
  plot.clock_axis = false;
  plot.x_unit = "millimetres inserted along the needle's own line";
  const RgbaImage picture = draw([&] {
    beginScreen("s");
    ImGui::SetCursorScreenPos(kCorner);
    result_ = linePlot("plot", plot, {100, 100});
    endScreen();
  });
  EXPECT_EQ(picture.width, 600);
}

TEST_F(PlotsTest, aSpikeOfOneSampleReachesItsHeight) {
  std::vector<double> x, y;
  for (int i = 0; i < 60000; ++i) {
    x.push_back(i * 0.001);
    y.push_back(i == 30000 ? 3.8 : 0.5);
  }
  const RgbaImage picture = drawn(specFrom(0, 60), {seriesThrough(x, y, kYellow)});
  const auto middle = static_cast<int>(0.5F * (field_.low_px.x + field_.high_px.x));
  int top = 10000;
  for (int column = middle - 3; column <= middle + 3; ++column) {
    for (int row = static_cast<int>(field_.low_px.y); row < static_cast<int>(field_.high_px.y); ++row) {
      const unsigned p = test::pixelAt(picture, column, row);
      if (((p >> 16) & 255u) > 90 && ((p >> 8) & 255u) > 90 && (p & 255u) < 110) {
        top = std::min(top, row);
        break;
      }
    }
  }
  const float expected_px = field_.high_px.y - (field_.high_px.y - field_.low_px.y) * 3.8F / 4;
  EXPECT_NEAR(top, static_cast<double>(expected_px), 3);
}

TEST_F(PlotsTest, aFewPointsAreJoinedByLines) {
  PlotSeries series;
  series.colour = kYellow;
  series.x = {0, 5, 10};
  series.y = {1, 3, 1};
  const RgbaImage picture = drawn(specFrom(0, 10), {series});
  const float height_px = field_.high_px.y - field_.low_px.y, width_px = field_.high_px.x - field_.low_px.x;
  for (const double at : {2.5, 7.5}) {
    const auto [first, last] =
        rowsOf(picture, static_cast<int>(field_.low_px.x + width_px * static_cast<float>(at / 10)), kYellow);
    ASSERT_GE(first, 0) << at;
    EXPECT_NEAR(0.5 * (first + last) + 0.5, static_cast<double>(field_.high_px.y - height_px * 0.5F), 2)
        << at;
  }
}

TEST_F(PlotsTest, aHoleIsNotBridged) {
  std::vector<double> x, y;
  for (int i = 0; i <= 1000; ++i) {
    if (i > 400 && i < 600) continue;
    x.push_back(i * 0.01);
    y.push_back(2);
  }
  const RgbaImage picture = drawn(specFrom(0, 10), {seriesThrough(x, y, kYellow)});
  EXPECT_LT(rowsOf(picture, static_cast<int>(0.5F * (field_.low_px.x + field_.high_px.x)), kYellow).first, 0);
}

TEST_F(PlotsTest, downwardAxesPutDepthBelow) {
  const std::vector<double> x = {0, 2.5, 5, 7.5, 10}, y = {3, 3, 3, 3, 3};
  Plot spec = specFrom(0, 10);
  spec.downward = true;
  spec.bands = {{0, 1, kOrange, "skin"}, {1, 4, kVermillion, "muscle"}};
  std::vector<double> many_x, many_y;
  for (int i = 0; i <= 600; ++i) {
    many_x.push_back(i / 60.0);
    many_y.push_back(3);
  }
  const RgbaImage picture = drawn(spec, {seriesThrough(many_x, many_y, kWhite)});
  const auto middle = static_cast<int>(0.5F * (field_.low_px.x + field_.high_px.x));
  const auto [first, last] = rowsOf(picture, middle + 7, kWhite);
  const float height_px = field_.high_px.y - field_.low_px.y;
  EXPECT_NEAR(0.5 * (first + last) + 0.5, static_cast<double>(field_.low_px.y + height_px * 0.75F), 1.6);
  // the bands tint the background: more red below, more green above
  const auto above =
      test::meanAround(picture, middle + 11, static_cast<double>(field_.low_px.y + height_px * 0.12F), 1);
  const auto below =
      test::meanAround(picture, middle + 11, static_cast<double>(field_.low_px.y + height_px * 0.6F), 1);
  EXPECT_GT(above.green, below.green + 4);
  EXPECT_GT(below.red, below.blue + 10);
}

TEST_F(PlotsTest, theMouseReadsSeeksAndZooms) {
  const std::vector<double> x = {0, 10}, y = {1, 1};
  const Plot spec = specFrom(100, 110);
  drawn(spec, {seriesThrough(x, y, kYellow)});
  EXPECT_FALSE(result_.hovered);
  const double middle_px = static_cast<double>(0.5F * (field_.low_px.x + field_.high_px.x));
  surface_->moveMouse(middle_px, 80);
  drawn(spec, {seriesThrough(x, y, kYellow)});
  EXPECT_TRUE(result_.hovered);
  EXPECT_NEAR(result_.hover_x, 105, 0.05);
  surface_->scroll(1);
  drawn(spec, {seriesThrough(x, y, kYellow)}, 1);
  EXPECT_DOUBLE_EQ(result_.scrolled, 1);
  surface_->setMouseButton(0, true);
  drawn(spec, {seriesThrough(x, y, kYellow)}, 1);
  ASSERT_TRUE(result_.clicked_x);
  EXPECT_NEAR(*result_.clicked_x, 105, 0.05);
  // Dragged beyond the end, it stays in the range.
  surface_->moveMouse(5000, 80);
  drawn(spec, {seriesThrough(x, y, kYellow)}, 1);
  EXPECT_NEAR(result_.clicked_x.value_or(0), 110, 1e-9);
  surface_->setMouseButton(0, false);
  drawn(spec, {seriesThrough(x, y, kYellow)}, 1);
  EXPECT_FALSE(result_.clicked_x);
}

TEST_F(PlotsTest, nothingOrNonsenseMakesAnEmptyPlot) {
  const auto anyYellow = [&](const RgbaImage& picture) {
    for (int x = static_cast<int>(field_.low_px.x); x < static_cast<int>(field_.high_px.x); ++x)
      if (rowsOf(picture, x, kYellow).first >= 0) return true;
    return false;
  };
  const std::vector<double> x = {5}, y = {1e300}, none;
  Plot spec;
  spec.legend = false;
  spec.from = spec.to = std::nan("");
  const RgbaImage empty = drawn(spec, {});
  EXPECT_GE(field_.high_px.x - field_.low_px.x, 400) << "the field is there";
  EXPECT_FALSE(anyYellow(empty));
  EXPECT_FALSE(anyYellow(drawn(spec, {seriesThrough(x, y, kYellow)})));
  spec.from = spec.to = 5;
  EXPECT_FALSE(anyYellow(drawn(spec, {seriesThrough(none, none, kYellow), PlotSeries{}})));
  // Even without any space, the plots draw nothing outside their area.
  const RgbaImage tiny = draw([&] {
    beginScreen("s");
    (void)linePlot("tiny", spec, {5, 5});
    (void)plotStack("none", {}, {50, 50});
    sparkline({}, 0, 1, kYellow, {50, 10});
    endScreen();
  });
  const unsigned ground = test::pixelAt(tiny, 590, 410);
  for (int row = 100; row < 420; ++row)
    for (int column = 100; column < 600; ++column)
      ASSERT_EQ(test::pixelAt(tiny, column, row), ground) << column << ", " << row;
}

TEST_F(PlotsTest, gesturePlotsLookAsTheirReference) {
  const test::SampleLesson lesson = test::sampleLesson("shoulder-adult");
  GestureReplica replica(lesson.model);
  GestureTrace trace;
  for (const GestureSample& sample : lesson.samples) trace.push(replica.feed(sample));
  std::vector<Plot> plots;
  for (const GesturePlot which : {GesturePlot::kForces, GesturePlot::kDepth, GesturePlot::kAngles})
    plots.push_back(gesturePlot(which, trace, lesson.scene.get(), 0, 5.6));
  plots[0].cursor = 2.4;
  const RgbaImage picture = draw([&] {
    beginScreen("s");
    plotStack("stack", plots, {0, 0});
    endScreen();
  });
  EXPECT_TRUE(test::looksLike(picture, std::string(NEEDLELAB_REFERENCE) + "/plots-gesture.png"));
}

TEST_F(PlotsTest, everyGesturePlotDraws) {
  const test::SampleLesson lesson = test::sampleLesson("lumbar-adult");
  GestureReplica replica(lesson.model);
  GestureTrace trace;
  for (const GestureSample& sample : lesson.samples) trace.push(replica.feed(sample));
  for (const GesturePlot which :
       {GesturePlot::kForces, GesturePlot::kDepth, GesturePlot::kSpeed, GesturePlot::kAlignment,
        GesturePlot::kAngles, GesturePlot::kPlaces, GesturePlot::kPlunger}) {
    Plot plot = gesturePlot(which, trace, nullptr, 1, 4);
    const RgbaImage with = drawn(plot, plot.series);
    const RgbaImage without = drawn(plot, {});
    EXPECT_GT(test::shareThatDiffers(with, without, 30), 0.001) << static_cast<int>(which);
  }
}

TEST_F(PlotsTest, aLineIsDrawnAtItsValuesAtEveryLetterSize) {
  std::vector<double> x, y;
  for (int i = 0; i <= 1000; ++i) {
    x.push_back(i * 0.01);
    y.push_back(3);
  }
  double left_before_px = 0;
  for (const double scale : {1.0, 1.5, 2.0}) {
    surface_->setFontScale(scale);
    const RgbaImage picture = drawn(specFrom(0, 10), {seriesThrough(x, y, kYellow)}, 3);
    EXPECT_GT(static_cast<double>(field_.low_px.x), left_before_px) << "larger numbers need more room";
    left_before_px = static_cast<double>(field_.low_px.x);
    const auto [first, last] =
        rowsOf(picture, static_cast<int>(0.4F * field_.low_px.x + 0.6F * field_.high_px.x), kYellow);
    ASSERT_GE(first, 0) << scale;
    const float height_px = field_.high_px.y - field_.low_px.y;
    EXPECT_NEAR(0.5 * (first + last) + 0.5, static_cast<double>(field_.high_px.y - height_px * 0.75F), 2)
        << scale;
  }
}

TEST_F(PlotsTest, oneBrokenSampleDoesNotTakeTheAxisFromTheOthers) {
  for (const double broken : {1e300, std::numeric_limits<double>::infinity(), std::nan("")}) {
    std::vector<double> x, y;
    for (int i = 0; i <= 1000; ++i) {
      x.push_back(70 + i * 0.01);
      y.push_back(i == 900 ? broken : 2);
    }
    Plot spec = specFrom(70, 80);
    spec.low.reset();
    spec.high.reset();
    const RgbaImage picture = drawn(spec, {seriesThrough(x, y, kYellow)});
    EXPECT_GE(rowsOf(picture, static_cast<int>(0.5F * (field_.low_px.x + field_.high_px.x)), kYellow).first,
              0)
        << broken;
  }
}

// only the strip above the field: its lines coincide
TEST_F(PlotsTest, aLegendWithoutRoomIsMarked) {
  const auto legendWith = [&](std::size_t count) {
    const std::vector<PlotSeries> series(count, seriesThrough({0, 10}, {1, 1}, {1, 0, 0}));
    const RgbaImage picture = drawn(specFrom(0, 10), series);
    std::vector<unsigned> strip;
    for (int y = static_cast<int>(kCorner.y); y < static_cast<int>(field_.low_px.y); ++y)
      for (int x = 0; x < picture.width; ++x) strip.push_back(test::pixelAt(picture, x, y));
    return strip;
  };
  // about ten fit; each further one changes the count at the end
  const auto many = legendWith(20), one_more = legendWith(21);
  EXPECT_NE(many, one_more);
  EXPECT_EQ(many, legendWith(20));
}

TEST_F(PlotsTest, aSinglePointIsVisible) {
  PlotSeries series;
  series.colour = kYellow;
  series.x = {5};
  series.y = {2};
  const RgbaImage picture = drawn(specFrom(0, 10), {series});
  const auto middle = static_cast<int>(0.5F * (field_.low_px.x + field_.high_px.x));
  bool found = false;
  for (int column = middle - 2; column <= middle + 2; ++column)
    found = found || rowsOf(picture, column, kYellow).first >= 0;
  EXPECT_TRUE(found);
  EXPECT_LT(rowsOf(picture, middle + 40, kYellow).first, 0) << "and is not a line";
}

}  // namespace
}  // namespace needlelab
