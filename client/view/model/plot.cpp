#include "client/view/model/plot.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/core.h>

#include "common/base/text/text.h"

namespace needlelab {
namespace {

constexpr double kLargest = 1e12;  // larger values make an axis unreadable

// Returns the smallest 1, 2 or 5 times a power of ten that is at least `rough`.
double roundStep(double rough) {
  const double power = std::pow(10.0, std::floor(std::log10(rough)));
  for (const double factor : {1.0, 2.0, 5.0})
    if (rough <= factor * power * (1 + 1e-9)) return factor * power;
  return 10 * power;
}

constexpr double kZeroIsNear = 0.6;  // of the largest value: the axis includes zero if it is at most this far
                                     // away

struct QuantityRow {
  PlotQuantity quantity;
  std::string_view unit;
  double min_span;
};
/// Each span is large compared with the devices' noise (0.03 mm, 0.01 N, 0.1°) and small compared with what a
/// teacher corrects. `quantityOfUnit` returns a unit's first row.
constexpr std::array kQuantities{
    QuantityRow{PlotQuantity::kNumber, "", 1},        // counts are whole
    QuantityRow{PlotQuantity::kForce, "N", 2},        // skin yields at 1 to 3 N
    QuantityRow{PlotQuantity::kTorque, "N·m", 0.05},  // 1 N at 50 mm, a needle's length
    QuantityRow{PlotQuantity::kDistance, "mm", 5},    // a few needle diameters
    QuantityRow{PlotQuantity::kDepth, "mm", 10},      // skin and fat; a tremor of 0.5 mm looks flat
    QuantityRow{PlotQuantity::kSpeed, "mm/s", 20},    // a slow insertion
    QuantityRow{PlotQuantity::kAngle, "°", 10},       // visibly oblique
    QuantityRow{PlotQuantity::kTime, "s", 5},         // smaller differences between attempts do not matter
    QuantityRow{PlotQuantity::kArea, "cm²", 0.5},     // 10 mm aside at a depth of 5 mm
    QuantityRow{PlotQuantity::kWork, "J", 0.05},      // 1 N over 50 mm
    QuantityRow{PlotQuantity::kShare, "%", 100},      // all of it
    QuantityRow{PlotQuantity::kOther, "another unit", 0},
};

}  // namespace

double leastSpanOf(PlotQuantity quantity) {
  const auto* const row = std::find_if(kQuantities.begin(), kQuantities.end(),
                                       [&](const QuantityRow& each) { return each.quantity == quantity; });
  return row == kQuantities.end() ? 0 : row->min_span;
}

PlotQuantity quantityOfUnit(std::string_view shown_unit) {
  const auto* const row = std::find_if(kQuantities.begin(), kQuantities.end(),
                                       [&](const QuantityRow& each) { return each.unit == shown_unit; });
  return row == kQuantities.end() ? PlotQuantity::kOther : row->quantity;
}

AxisSpan fittedSpan(const Plot& plot, const std::optional<AxisSpan>& data) {
  AxisSpan span = data.value_or(AxisSpan{0, 0});
  for (const PlotLimit& limit : plot.limits) {
    if (!std::isfinite(limit.at)) continue;
    span.low = std::min(span.low, limit.at);
    span.high = std::max(span.high, limit.at);
  }
  if (span.low > 0 && span.low < kZeroIsNear * span.high) span.low = 0;
  if (span.high < 0 && span.high > kZeroIsNear * span.low) span.high = 0;
  const bool above = span.low >= 0, below = span.high <= 0;
  span.low = plot.low.value_or(span.low);
  span.high = plot.high.value_or(span.high);
  const bool by_unit = plot.quantity == PlotQuantity::kOther && !plot.unit.empty();
  const double least = leastSpanOf(by_unit ? quantityOfUnit(plot.unit) : plot.quantity);
  const double missing = (!data && least == 0 ? 1 : least) - (span.high - span.low);
  if (!(missing > 0) || (plot.low && plot.high)) return span;
  if (plot.low) return {span.low, span.high + missing};
  if (plot.high) return {span.low - missing, span.high};
  span.low -= 0.5 * missing;
  span.high += 0.5 * missing;
  // keep the width: what is cut at zero is added at the other end
  if (above && span.low < 0) return {0, span.high - span.low};
  if (below && span.high > 0) return {span.low - span.high, 0};
  return span;
}

AxisTicks axisTicks(double low, double high, int wanted, bool widen, double min_step) {
  if (!std::isfinite(low)) low = 0;
  if (!std::isfinite(high)) high = low;
  low = std::clamp(low, -kLargest, kLargest);
  high = std::clamp(high, -kLargest, kLargest);
  if (high < low) std::swap(low, high);
  const double least = std::max(1e-9, 1e-9 * std::max(std::fabs(low), std::fabs(high)));
  if (high - low < least) {
    const double half = std::max(0.5 * least, 0.5 * std::max(std::fabs(low), 1.0) * 0.2);
    low -= half;
    high += half;
  }
  AxisTicks ticks;
  // multiples by index, so that steps do not accumulate errors
  double first = 0, last = 0;
  // A range may contain one multiple or none; a single tick does not show the scale.
  for (double rough = (high - low) / std::max(wanted, 2);; rough *= 0.5) {
    ticks.step = roundStep(std::max(rough, min_step));
    first = std::ceil(low / ticks.step - 1e-9);
    last = std::floor(high / ticks.step + 1e-9);
    if (last > first || widen || ticks.step <= min_step) break;
  }
  ticks.decimals = std::max(0, static_cast<int>(std::ceil(-std::log10(ticks.step) - 1e-9)));
  if (widen) {
    first = std::floor(low / ticks.step + 1e-9);
    last = std::ceil(high / ticks.step - 1e-9);
    low = first * ticks.step;
    high = last * ticks.step;
  }
  ticks.low = low;
  ticks.high = high;
  for (double i = first; i <= last; ++i) ticks.at.push_back(i * ticks.step);
  return ticks;
}

std::string tickText(double value, int decimals) {
  const std::string text = fixedText(value, std::clamp(decimals, 0, 9));
  return text.front() == '-' ? "\u2212" + text.substr(1) : text;
}

std::string clockText(double seconds, int decimals) {
  if (!std::isfinite(seconds)) return "–:––";
  // round first, so that 59.96 does not become 0:60.0
  const double unit = decimals > 0 ? 10 : 1;
  const auto units = static_cast<long long>(std::floor(std::fmin(std::fabs(seconds), 1e9) * unit + 0.5));
  // a time that rounds to zero has no minus
  const std::string sign = seconds < 0 && units > 0 ? "\u2212" : "";
  const long long per_minute = 60 * static_cast<long long>(unit);
  const long long minutes = units / per_minute, rest = units % per_minute;
  if (decimals > 0) return sign + fmt::format("{}:{:02}.{}", minutes, rest / 10, rest % 10);
  return sign + fmt::format("{}:{:02}", minutes, rest);
}

void fillColumns(std::span<const double> x, std::span<const double> y, double from, double to,
                 std::span<PixelColumn> out) {
  std::fill(out.begin(), out.end(), PixelColumn{});
  if (out.empty() || !(to > from)) return;
  const double per_x = static_cast<double>(out.size()) / (to - from);
  const std::size_t count = std::min(x.size(), y.size());
  const auto begin = x.begin(), end = x.begin() + static_cast<std::ptrdiff_t>(count);
  for (auto at = std::lower_bound(begin, end, from); at != end && *at < to; ++at) {
    // Also skips values that are infinite as a float: they would ruin the axis for all others.
    const auto value = static_cast<float>(y[static_cast<std::size_t>(at - begin)]);
    if (!std::isfinite(value)) continue;
    const auto column = std::min(static_cast<std::size_t>((*at - from) * per_x), out.size() - 1);
    out[column].take(value);
  }
}

ColumnSource columnsOf(std::span<const double> x, std::span<const double> y) {
  return [x, y](double from, double to, std::span<PixelColumn> out) { fillColumns(x, y, from, to, out); };
}

bool isBroken(const Plot& plot, std::size_t left, std::size_t right, std::size_t count) {
  const double width = (plot.to - plot.from) / static_cast<double>(count);
  if (!(width > 0)) return false;
  const auto columnOf = [&](double x) { return std::floor((x - plot.from) / width); };
  // the first gap that ends in or after `right`
  const auto gap = std::partition_point(plot.gaps.begin(), plot.gaps.end(), [&](const PlotGap& each) {
    return columnOf(each.to) < static_cast<double>(right);
  });
  return gap != plot.gaps.end() && columnOf(gap->from) <= static_cast<double>(left);
}

std::optional<int> momentDecimals(std::string_view shown_unit) {
  if (shown_unit == "N") return 2;
  if (shown_unit == "N·m") return 3;
  return std::nullopt;
}

std::string momentText(double value, std::string_view unit) {
  return tickText(value, momentDecimals(unit).value_or(2)) + " " + std::string(unit);
}

std::string headingOf(const Plot& plot) {
  if (plot.title.empty() || plot.unit.empty()) return plot.title + plot.unit;
  return plot.title + ", " + plot.unit;
}

}  // namespace needlelab
