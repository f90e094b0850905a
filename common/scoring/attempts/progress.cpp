#include "common/scoring/attempts/progress.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>

#include "common/scoring/measures/measure_groups.h"
#include "common/scoring/measures/measure_table.h"

namespace needlelab {
namespace {

constexpr std::size_t kMaxExactTrend = 50;

/// P(|S| ≥ |s|) for Kendall's S over all orders of n different values, from the numbers of inversions.
double exactTrendP(std::size_t n, long s) {
  std::vector<double> share{1};  // share[k]: share of the orders with k inversions
  for (std::size_t m = 2; m <= n; ++m) {
    std::vector<double> next(share.size() + m - 1, 0.0);
    for (std::size_t k = 0; k < share.size(); ++k) {
      for (std::size_t j = 0; j < m; ++j) next[k + j] += share[k] / static_cast<double>(m);
    }
    share = std::move(next);
  }
  const long pairs = static_cast<long>(n * (n - 1) / 2);
  double p = 0;
  for (std::size_t k = 0; k < share.size(); ++k) {
    if (std::abs(pairs - 2 * static_cast<long>(k)) >= std::abs(s)) p += share[k];
  }
  return std::min(1.0, p);
}

double normalTrendP(const std::vector<double>& values, long s) {
  const double n = static_cast<double>(values.size());
  std::vector<double> sorted(values);
  std::sort(sorted.begin(), sorted.end());
  double variance = n * (n - 1) * (2 * n + 5);
  for (std::size_t i = 0; i < sorted.size();) {
    const auto end = std::upper_bound(sorted.begin(), sorted.end(), sorted[i]) - sorted.begin();
    const double t = static_cast<double>(end) - static_cast<double>(i);
    variance -= t * (t - 1) * (2 * t + 5);
    i = static_cast<std::size_t>(end);
  }
  variance /= 18;
  if (!(variance > 0) || s == 0) return 1;
  const double z = (std::abs(static_cast<double>(s)) - 1) / std::sqrt(variance);
  return std::erfc(z / std::numbers::sqrt2);
}

/// Least-squares fit of y = a + b·x, with the residual sum of squares.
struct LineFit {
  double a = 0, b = 0, rest = 0;
};
LineFit fitLine(std::span<const double> x, std::span<const double> y) {
  const double n = static_cast<double>(y.size());
  double mean_x = 0, mean_y = 0, xx = 0, xy = 0;
  for (std::size_t i = 0; i < y.size(); ++i) mean_x += x[i] / n, mean_y += y[i] / n;
  for (std::size_t i = 0; i < y.size(); ++i) {
    xx += (x[i] - mean_x) * (x[i] - mean_x);
    xy += (x[i] - mean_x) * (y[i] - mean_y);
  }
  LineFit fit;
  fit.b = xx > 0 ? xy / xx : 0;
  fit.a = mean_y - fit.b * mean_x;
  for (std::size_t i = 0; i < y.size(); ++i) {
    const double left = y[i] - fit.a - fit.b * x[i];
    fit.rest += left * left;
  }
  return fit;
}

/// Corrected Akaike criterion of a least-squares fit with `k` parameters plus the spread.
double criterion(double rest, double n, double k) {
  return n * std::log(rest / n) + 2 * (k + 1) + 2 * (k + 1) * (k + 2) / (n - k - 2);
}

LineFit fitCurve(std::span<const double> y, double attempts) {
  std::vector<double> x(y.size());
  for (std::size_t i = 0; i < y.size(); ++i) x[i] = std::exp(-static_cast<double>(i) / attempts);
  return fitLine(x, y);
}

/// How often chance alone makes as clear a trend.
std::string chanceWords(double p) {
  constexpr const char* kChance = "chance alone does as much in";
  if (p < 0.001) return fmt::format("{} fewer than 1 of 1000 cases", kChance);
  if (p < 0.01) return fmt::format("{} {:.0f} of 1000 cases", kChance, 1000 * p);
  return fmt::format("{} {:.0f} of 100 cases", kChance, 100 * p);
}

std::string trendWords(const MeasureProgress& row) {
  if (!row.trend)
    return fmt::format("too few attempts for a trend, which needs {} with this measure", kMinForTrend);
  const std::string chance = chanceWords(row.trend->p);
  if (row.trend->p > 0.05) return "no clear trend (" + chance + ")";
  const bool rises = row.trend->tau > 0;
  const Better better = betterOf(row.name);
  const char* const verdict = better == Better::kNeither           ? "neither is better"
                              : (better == Better::kMore) == rises ? "it became better"
                                                                   : "it became worse";
  return std::string(rises ? "rises" : "falls") + " by " +
         meanText(row.name, std::abs(row.trend->slope_per_attempt), row.unit) + " with each attempt (" +
         chance + "): " + verdict;
}

}  // namespace

std::optional<Trend> trendOf(std::span<const double> all) {
  std::vector<double> values;
  std::copy_if(all.begin(), all.end(), std::back_inserter(values), [](double v) { return std::isfinite(v); });
  const std::size_t n = values.size();
  if (n < kMinForTrend) return std::nullopt;
  long s = 0;
  bool ties = false;
  std::vector<double> slopes;
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = i + 1; j < n; ++j) {
      const double difference = values[j] - values[i];
      s += difference > 0 ? 1 : difference < 0 ? -1 : 0;
      ties = ties || difference == 0;
      slopes.push_back(difference / static_cast<double>(j - i));
    }
  }
  std::sort(slopes.begin(), slopes.end());
  const std::size_t half = slopes.size() / 2;
  Trend trend;
  trend.slope_per_attempt = slopes.size() % 2 == 1 ? slopes[half] : 0.5 * (slopes[half - 1] + slopes[half]);
  trend.tau = static_cast<double>(s) / static_cast<double>(slopes.size());
  trend.p = ties || n > kMaxExactTrend ? normalTrendP(values, s) : exactTrendP(n, s);
  return trend;
}

std::optional<LearningCurve> learningCurveOf(std::span<const double> values, std::string* why) {
  const auto none = [&](std::string reason) {
    if (why != nullptr) *why = std::move(reason);
    return std::optional<LearningCurve>();
  };
  if (values.size() < kMinForCurve)
    return none(fmt::format("a learning curve needs {} attempts", kMinForCurve));
  if (!std::all_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); }))
    return none("not every attempt has a finite value");
  const double n = static_cast<double>(values.size());
  std::vector<double> numbers(values.size());
  for (std::size_t i = 0; i < numbers.size(); ++i) numbers[i] = static_cast<double>(i);
  const LineFit line = fitLine(numbers, values);
  double mean = 0, all = 0;
  for (const double v : values) mean += v / n;
  for (const double v : values) all += (v - mean) * (v - mean);
  if (!(all > 1e-24 * std::max(1.0, mean * mean) * n)) return none("the values hardly differ");

  // one parameter is not linear: search a fine grid in its logarithm, then halve the steps around the best
  // value
  const double low = std::log(0.25), high = std::log(2 * n);
  constexpr int kSteps = 200;
  double best = low, best_rest = std::numeric_limits<double>::infinity();
  const auto look = [&](double logarithm) {
    const double rest = fitCurve(values, std::exp(logarithm)).rest;
    if (rest < best_rest) best_rest = rest, best = logarithm;
  };
  for (int i = 0; i <= kSteps; ++i) look(low + (high - low) * i / kSteps);
  for (double step = (high - low) / kSteps; step > 1e-9; step /= 2) {
    const double middle = best;
    look(std::max(low, middle - step));
    look(std::min(high, middle + step));
  }

  const double attempts = std::exp(best);
  // a perfect fit would win by an infinite margin: bound the residual by rounding
  const auto score = [&](double rest, double k) {
    return criterion(std::max(rest, 1e-20 * std::max(all, 1e-300)), n, k);
  };
  const double margin = std::min(score(all, 1), score(line.rest, 2)) - score(best_rest, 3);
  if (margin < 2) return none("a curve describes the attempts no better than a straight line or a constant");
  if (attempts < 0.5 || attempts > n) return none("it levels out outside of the attempts so far");
  const LineFit fit = fitCurve(values, attempts);
  return LearningCurve{fit.a, fit.b, attempts, 1 - fit.rest / all};
}

std::vector<MeasureProgress> progressOf(std::span<const std::vector<Measure>> attempts, std::size_t before) {
  std::map<std::string, MeasureProgress> by_name;
  for (std::size_t i = 0; i < attempts.size(); ++i) {
    for (const Measure& measure : attempts[i]) {
      if (!measure.measured) continue;
      MeasureProgress& row = by_name[measure.name];
      row.name = measure.name;
      row.unit = measure.unit;
      row.attempts.push_back(before + i);
      row.values.push_back(measure.value);
    }
  }
  std::vector<MeasureProgress> rows;
  for (auto& [name, row] : by_name) {
    row.trend = trendOf(row.values);
    row.words = trendWords(row);
    std::string why;
    row.curve = learningCurveOf(row.values, &why);
    if (!row.curve && row.trend) row.words += "; no learning curve: " + why;
    if (row.curve)
      row.words += "; it levels out at " + meanText(row.name, row.curve->end, row.unit) +
                   ", with most of the way done after " + valueText(std::ceil(row.curve->attempts), "") +
                   " attempts";
    rows.push_back(std::move(row));
  }
  const auto kinds = measureKinds();
  const auto place = [&](const MeasureProgress& row) {
    const MeasureKind* const kind = measureKind(row.name);
    return std::pair(kind == nullptr ? static_cast<std::ptrdiff_t>(kinds.size()) : kind - kinds.data(),
                     row.name.size());
  };
  std::stable_sort(rows.begin(), rows.end(),
                   [&](const auto& a, const auto& b) { return place(a) < place(b); });
  return rows;
}

std::string progressJson(std::span<const MeasureProgress> progress) {
  using OrderedJson = nlohmann::ordered_json;
  OrderedJson rows = OrderedJson::array();
  for (const MeasureProgress& row : progress) {
    OrderedJson trend, curve;
    if (row.trend)
      trend = {
          {"slope_per_attempt", row.trend->slope_per_attempt}, {"tau", row.trend->tau}, {"p", row.trend->p}};
    if (row.curve)
      curve = {{"end", row.curve->end},
               {"gain", row.curve->gain},
               {"attempts", row.curve->attempts},
               {"r_squared", row.curve->r_squared}};
    rows.push_back({{"measure", row.name},
                    {"unit", row.unit},
                    {"better", betterName(betterOf(row.name))},
                    {"attempts", row.attempts},
                    {"values", row.values},
                    {"trend", trend},
                    {"curve", curve},
                    {"words", row.words}});
  }
  return rows.dump();
}

}  // namespace needlelab
