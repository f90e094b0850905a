#include "client/instructor/model/stored/report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace needlelab {
namespace {

using testing::HasSubstr;
using testing::Not;

const std::vector<double> kX = {0, 1, 2, 3, 4}, kY = {0, 2, 1, std::nan(""), 4};

Plot plot() {
  Plot plot;
  plot.title = "force <b>";
  plot.unit = "N";
  plot.to = 4.1;  // columns are half-open
  plot.series.push_back({"all", kBlue, columnsOf(kX, kY), false});
  return plot;
}

TEST(SvgPlot, namesAreEscapedAndNoNumberIsBroken) {
  Plot one = plot();
  one.series[0].name = "a&b";
  one.series.push_back({"c", kOrange, columnsOf(kX, kY), true});
  one.bands.push_back({0, 2, kYellow, "'skin'"});
  one.marks.push_back({2, kDimText, "▼", "\"said\""});
  const std::string svg = svgPlot(one);
  for (const char* part :
       {"force &lt;b&gt;, N", "a&amp;b", "&#39;skin&#39;", "&quot;said&quot;", "stroke-dasharray"})
    EXPECT_THAT(svg, HasSubstr(part));
  for (const char* part : {"<b>", "nan", "inf"}) EXPECT_THAT(svg, Not(HasSubstr(part)));
  // Every opened element is closed.
  EXPECT_EQ(svg.rfind("</svg>"), svg.size() - 6);
}

TEST(SvgPlot, aLongLegendDoesNotRunIntoTheHeading) {
  Plot one = plot();
  one.title = "force at the hand, all of it";
  for (const char* name : {"cutting", "attracted", "friction", "puncture", "clamping"})
    one.series.push_back({name, kOrange, columnsOf(kX, kY), true});
  const std::string svg = svgPlot(one);
  // the position of the legend's first name, and where a heading of this many 12 px letters may end
  const std::size_t first = svg.find("' y='14.0' text-anchor='start'>all<");
  ASSERT_NE(first, std::string::npos) << svg;
  const double x = std::stod(svg.substr(svg.rfind("x='", first) + 3));
  EXPECT_GT(x, 56 + 7.5 * static_cast<double>(one.title.size() + 3));
}

TEST(SvgPlot, theGreatestValueIsNearTheTopAndDepthGrowsDownward) {
  const auto yOfLast = [](const std::string& svg) {
    // the curve's last point
    const std::size_t path = svg.find("<path d='"), end = svg.find("' stroke", path);
    const std::string d = svg.substr(path + 9, end - path - 9);
    return std::stod(d.substr(d.rfind(' ') + 1));
  };
  Plot one = plot();
  const double up = yOfLast(svgPlot(one));
  one.downward = true;
  const double down = yOfLast(svgPlot(one));
  EXPECT_LT(up, 60);
  EXPECT_GT(down, 120);
}

TEST(SvgPlot, aGapBeginsAnotherPieceOfTheCurve) {
  const auto piecesOf = [](const std::string& svg) {
    const std::size_t path = svg.rfind("<path d='"), end = svg.find("' stroke", path);
    const std::string d = svg.substr(path + 9, end - path - 9);
    return std::count(d.begin(), d.end(), 'M');
  };
  Plot one = plot();
  EXPECT_EQ(piecesOf(svgPlot(one)), 1) << "a value that is not finite is not a gap";
  one.gaps = {{1, 2}};
  EXPECT_EQ(piecesOf(svgPlot(one)), 2);
}

TEST(SvgPlot, nothingAtAllIsAPictureToo) {
  Plot one;
  one.from = one.to = 3;
  EXPECT_THAT(svgPlot(one), HasSubstr("</svg>"));
  one.series.push_back({"value", kBlue, {}, false, true, {}, {}});
  EXPECT_THAT(svgPlot(one, {340, 130}), HasSubstr("</svg>"));
}

TEST(SvgPlot, noiseIsALineAndALimitHasItsWords) {
  const std::vector<double> noise = {0.01, 0.02, 0.01, 0.02, 0.01};
  Plot one = plot();
  one.series = {{"noise", kBlue, columnsOf(kX, noise), false}};
  one.quantity = PlotQuantity::kForce;
  // the axis shows its minimum span, not the noise's
  EXPECT_THAT(svgPlot(one), HasSubstr("'end'>2.0<"));
  EXPECT_THAT(svgPlot(one), Not(HasSubstr("'end'>0.020<")));
  one.limits.push_back({5, "at most 5 N"});
  const std::string svg = svgPlot(one);
  EXPECT_THAT(svg, HasSubstr(">at most 5 N<"));
  EXPECT_THAT(svg, HasSubstr("'end'>5<"));
}

TEST(SvgPlot, aFewPointsAreMarkedAndJoined) {
  Plot one;
  one.from = 1;
  one.to = 3;
  one.clock_axis = false;
  one.x_unit = "attempt";
  one.series.push_back({"value", kBlue, {}, false, false, {1, 2, 3}, {4, 2, 3}});
  const std::string svg = svgPlot(one, {340, 130});
  std::size_t points = 0;
  for (std::size_t at = svg.find("<circle"); at != std::string::npos; at = svg.find("<circle", at + 1))
    ++points;
  EXPECT_EQ(points, 3u);
  EXPECT_THAT(svg, HasSubstr(">attempt<"));
}

TEST(SvgPlot, onPaperWhiteIsBlackAndPaleColoursAreDarker) {
  Plot one = plot();
  one.series[0].colour = kWhite;
  EXPECT_THAT(svgPlot(one), HasSubstr("stroke='#000000'"));
  one.series[0].colour = kYellow;
  EXPECT_THAT(svgPlot(one), Not(HasSubstr("stroke='" + hexText(kYellow))));
}

TEST(SvgPlace, theDiamondLiesOnTheSideThatTheTextNames) {
  for (const double value : {-5.0, 1.5, 10.0}) {
    const std::string svg = svgPlace(placeMarks({1, 2}, value));
    const std::size_t path = svg.find("<path d='M"), bar = svg.find("<rect x='");
    ASSERT_NE(path, std::string::npos);
    ASSERT_NE(bar, std::string::npos);
    const double at = std::stod(svg.substr(path + 10)) + 4.5, from = std::stod(svg.substr(bar + 9));
    const double to = from + std::stod(svg.substr(svg.find("width='", bar) + 7));
    EXPECT_GT(at, 9) << "in the picture";
    EXPECT_LT(at, 171);
    EXPECT_EQ(at < from, value < 1) << svg;
    EXPECT_EQ(at > to, value > 2) << svg;
  }
}

TEST(HtmlText, nothingOfItIsMarkup) {
  EXPECT_EQ(htmlText("<script>alert('a & \"b\"')</script>"),
            "&lt;script&gt;alert(&#39;a &amp; &quot;b&quot;&#39;)&lt;/script&gt;");
  EXPECT_EQ(htmlText("µm – ok"), "µm – ok");
  EXPECT_EQ(htmlText(std::string("a\0b\x1b", 4)), "a?b?");
  EXPECT_EQ(htmlText("\xff"), "?");
}

}  // namespace
}  // namespace needlelab
