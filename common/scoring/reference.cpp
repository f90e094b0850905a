
#include "common/scoring/reference.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "common/scoring/measure_groups.h"

namespace needlelab {
namespace {

/// Between ranks, linearly: h = (n − 1)·p (the usual choice, number 7 of Hyndman and Fan 1996).
double percentileOf(const std::vector<double>& sorted, double p) {
  const double place = static_cast<double>(sorted.size() - 1) * p;
  const auto i = static_cast<std::size_t>(place);
  if (i + 1 >= sorted.size()) return sorted.back();
  return sorted[i] + (place - static_cast<double>(i)) * (sorted[i + 1] - sorted[i]);
}

/// Position of a row in a score: the position of its kind, then layers by number.
std::pair<std::ptrdiff_t, std::size_t> orderOf(const std::string& name) {
  const auto kinds = measureKinds();
  const MeasureKind* const kind = measureKind(name);
  return {kind == nullptr ? static_cast<std::ptrdiff_t>(kinds.size()) : kind - kinds.data(), name.size()};
}

/// The side on which a value stands, as the words after it.
std::string sideWords(const Comparison& row) {
  switch (row.standing) {
    case Standing::kBetter:
    case Standing::kWorse: {
      const char* const direction = betterOf(row.name) == Better::kMore ? "more" : "less";
      return fmt::format(", {} than they are: {} is better", standingName(row.standing), direction);
    }
    case Standing::kDifferent:
      return betterOf(row.name) == Better::kNeither ? ", unlike them; neither less nor more is better"
                                                    : ", unlike them; the attempt was not passed";
    case Standing::kLikeReference:
    case Standing::kTooFew:
      break;
  }
  return {};
}

Standing outsideStanding(const std::string& name, bool above, std::optional<bool> passed) {
  const Better better = betterOf(name);
  if (better == Better::kNeither) return Standing::kDifferent;
  if ((better == Better::kMore) != above) return Standing::kWorse;
  return passed.value_or(true) ? Standing::kBetter : Standing::kDifferent;
}

void judge(Comparison& row, const std::string& words, std::optional<bool> passed) {
  const ReferenceBand& band = row.band;
  const std::string group = fmt::format("{} reference gesture{}", band.n, band.n == 1 ? "" : "s");
  const auto text = [&](double value) { return valueText(value, row.unit); };
  row.words = words + " " + text(row.value);
  if (band.n < kLeastForZScore) {
    row.standing = Standing::kTooFew;
    row.words += band.n == 1
                     ? ": the only reference gesture has " + text(band.mean)
                     : ": the " + group + " lie between " + text(band.least) + " and " + text(band.greatest);
    row.words += fmt::format("; too few for a comparison, which needs {}", kLeastForZScore);
    return;
  }
  const bool above = row.value > band.mean;
  const double sd = std::max(band.sd, leastDifference(row.name, band.mean));
  // rounding differences between equal values are not a spread
  if (sd <= 1e-12 * std::max(1.0, std::abs(band.mean))) {
    const bool same = std::abs(row.value - band.mean) <= 1e-12 * std::max(1.0, std::abs(band.mean));
    row.standing = same ? Standing::kLikeReference : outsideStanding(row.name, above, passed);
    row.words += same ? ": as all " + group : ": all " + group + " have " + text(band.mean) + sideWords(row);
    return;
  }
  row.z = (row.value - band.mean) / sd;
  const double n = static_cast<double>(band.n);
  const bool like = std::abs(*row.z) <= studentQuantile975(band.n - 1) * std::sqrt(1 + 1 / n);
  row.standing = like ? Standing::kLikeReference : outsideStanding(row.name, above, passed);
  if (like) {
    row.words += ": like the experts; the mean of " + group + " is " + text(band.mean);
    return;
  }
  const bool far = std::abs(*row.z) > kFarFromExperts;
  row.words += std::string(far ? ": far from the experts, " : ": ") + (above ? "above" : "below") +
               " the mean of " + group + ", " + text(band.mean) + sideWords(row);
}

}  // namespace

double studentQuantile975(std::size_t df) {
  constexpr std::array<double, 30> kTable = {12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306,
                                             2.262,  2.228, 2.201, 2.179, 2.160, 2.145, 2.131, 2.120,
                                             2.110,  2.101, 2.093, 2.086, 2.080, 2.074, 2.069, 2.064,
                                             2.060,  2.056, 2.052, 2.048, 2.045, 2.042};
  if (df == 0) df = 1;
  if (df <= kTable.size()) return kTable[df - 1];
  // expansion in 1/df about the normal quantile z (Abramowitz and Stegun 26.7.5)
  constexpr double kZ = 1.959964, kZ3 = kZ * kZ * kZ;
  const double n = static_cast<double>(df);
  return kZ + (kZ3 + kZ) / (4 * n) + (5 * kZ3 * kZ * kZ + 16 * kZ3 + 3 * kZ) / (96 * n * n);
}

ReferenceBand bandOf(std::string name, std::string unit, std::span<const double> values) {
  ReferenceBand band;
  band.name = std::move(name);
  band.unit = std::move(unit);
  std::vector<double> sorted;
  std::copy_if(values.begin(), values.end(), std::back_inserter(sorted),
               [](double v) { return std::isfinite(v); });
  if (sorted.empty()) return band;
  std::sort(sorted.begin(), sorted.end());
  band.n = sorted.size();
  double sum = 0;
  for (const double v : sorted) sum += v;
  band.mean = sum / static_cast<double>(band.n);
  double squares = 0;
  for (const double v : sorted) squares += (v - band.mean) * (v - band.mean);
  band.sd = band.n > 1 ? std::sqrt(squares / static_cast<double>(band.n - 1)) : 0;
  band.least = sorted.front();
  band.greatest = sorted.back();
  band.median = percentileOf(sorted, 0.5);
  if (band.n < kLeastForZScore) return band;
  band.p10 = percentileOf(sorted, 0.1);
  band.p25 = percentileOf(sorted, 0.25);
  band.p75 = percentileOf(sorted, 0.75);
  band.p90 = percentileOf(sorted, 0.9);
  return band;
}

std::vector<ReferenceBand> referenceBands(std::span<const std::vector<Measure>> gestures) {
  std::map<std::string, std::pair<std::string, std::vector<double>>> values;
  for (const auto& gesture : gestures) {
    for (const Measure& row : gesture) {
      if (!row.measured) continue;
      auto& [unit, list] = values[row.name];
      unit = row.unit;
      list.push_back(row.value);
    }
  }
  std::vector<ReferenceBand> bands;
  for (const auto& [name, entry] : values) bands.push_back(bandOf(name, entry.first, entry.second));
  std::stable_sort(bands.begin(), bands.end(),
                   [](const auto& a, const auto& b) { return orderOf(a.name) < orderOf(b.name); });
  return bands;
}

std::vector<double> distancesAmong(std::span<const TipPath> references) {
  return distancesAmong(references.size(), [&](std::size_t i, std::size_t j) {
    return dtwDistance(references[i], references[j]);
  });
}

std::vector<double> distancesAmong(std::size_t references, const DistanceBetween& between) {
  std::vector<std::optional<double>> nearest(references);
  for (std::size_t i = 0; i < references; ++i) {
    for (std::size_t j = i + 1; j < references; ++j) {
      const auto distance = between(i, j);
      if (!distance) continue;
      for (auto* const one : {&nearest[i], &nearest[j]}) {
        if (!*one || *distance < **one) *one = distance;
      }
    }
  }
  std::vector<double> distances;
  for (const auto& one : nearest) {
    if (one) distances.push_back(*one);
  }
  return distances;
}

std::string_view standingName(Standing standing) {
  switch (standing) {
    case Standing::kLikeReference:
      return "like_reference";
    case Standing::kBetter:
      return "better";
    case Standing::kWorse:
      return "worse";
    case Standing::kDifferent:
      return "different";
    case Standing::kTooFew:
      break;
  }
  return "too_few";
}

std::vector<Comparison> compareWithReference(std::span<const Measure> measures,
                                             std::span<const ReferenceBand> bands, std::optional<bool> passed,
                                             std::span<const std::string> layer_names) {
  std::vector<Comparison> rows;
  for (const Measure& measure : measures) {
    if (!measure.measured) continue;
    const auto band = std::find_if(bands.begin(), bands.end(),
                                   [&](const ReferenceBand& b) { return b.name == measure.name && b.n > 0; });
    if (band == bands.end()) continue;
    Comparison row;
    row.name = measure.name;
    row.unit = measure.unit;
    row.value = measure.value;
    row.band = *band;
    const std::string words = measureWords(row.name, layer_names);
    judge(row, words, passed);
    rows.push_back(std::move(row));
  }
  return rows;
}

std::string bandsJson(std::span<const ReferenceBand> bands) {
  using OrderedJson = nlohmann::ordered_json;
  OrderedJson rows = OrderedJson::array();
  const auto orNull = [](std::optional<double> value) { return value ? OrderedJson(*value) : OrderedJson(); };
  for (const ReferenceBand& band : bands) {
    rows.push_back({{"measure", band.name},
                    {"unit", band.unit},
                    {"n", band.n},
                    {"mean", band.mean},
                    {"sd", band.n > 1 ? OrderedJson(band.sd) : OrderedJson()},
                    {"least", band.least},
                    {"p10", orNull(band.p10)},
                    {"p25", orNull(band.p25)},
                    {"median", band.median},
                    {"p75", orNull(band.p75)},
                    {"p90", orNull(band.p90)},
                    {"greatest", band.greatest}});
  }
  return rows.dump();
}

std::string comparisonJson(std::span<const Comparison> comparisons) {
  using OrderedJson = nlohmann::ordered_json;
  OrderedJson rows = OrderedJson::array();
  for (const Comparison& row : comparisons) {
    rows.push_back({{"measure", row.name},
                    {"value", row.value},
                    {"unit", row.unit},
                    {"n", row.band.n},
                    {"mean", row.band.mean},
                    {"sd", row.band.n > 1 ? OrderedJson(row.band.sd) : OrderedJson()},
                    {"z", row.z ? OrderedJson(*row.z) : OrderedJson()},
                    {"better", betterName(betterOf(row.name))},
                    {"standing", standingName(row.standing)},
                    {"words", row.words}});
  }
  return rows.dump();
}

}  // namespace needlelab
