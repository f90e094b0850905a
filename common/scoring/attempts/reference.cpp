#include "common/scoring/attempts/reference.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "common/scoring/measures/measure_groups.h"

namespace needlelab {
namespace {

/// Interpolates linearly between ranks: h = (n − 1)·p (the usual choice, number 7 in Hyndman and Fan 1996).
double percentileOf(const std::vector<double>& sorted, double p) {
  const double place = static_cast<double>(sorted.size() - 1) * p;
  const auto i = static_cast<std::size_t>(place);
  if (i + 1 >= sorted.size()) return sorted.back();
  return sorted[i] + (place - static_cast<double>(i)) * (sorted[i + 1] - sorted[i]);
}

/// A row's position in a score: by its kind's position, then layers by number.
std::pair<std::ptrdiff_t, std::size_t> orderOf(const std::string& name) {
  const auto kinds = measureKinds();
  const MeasureKind* const kind = measureKind(name);
  return {kind == nullptr ? static_cast<std::ptrdiff_t>(kinds.size()) : kind - kinds.data(), name.size()};
}

}  // namespace

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
  if (band.n < kMinReferences) return band;
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

std::optional<ExpertRange> expertRange(const ReferenceBand& band) {
  if (band.n < kMinReferences || formOf(band.name) == MeasureForm::kYesNo) return std::nullopt;
  if (measureText(band.name, band.least, band.unit) == measureText(band.name, band.greatest, band.unit))
    return std::nullopt;
  return ExpertRange{band.least, band.greatest};
}

std::string_view placeName(ExpertPlace place) {
  switch (place) {
    case ExpertPlace::kBelow:
      return "below";
    case ExpertPlace::kAbove:
      return "above";
    case ExpertPlace::kWithin:
      break;
  }
  return "within";
}

std::optional<ExpertPlace> placeAmong(const ReferenceBand& band, double value) {
  const auto range = expertRange(band);
  if (!range) return std::nullopt;
  return value < range->least      ? ExpertPlace::kBelow
         : value > range->greatest ? ExpertPlace::kAbove
                                   : ExpertPlace::kWithin;
}

PlaceMarks placeMarks(const ExpertRange& range, double value) {
  const double low = std::min(range.least, value), high = std::max(range.greatest, value);
  constexpr double kFree = 0.1;
  const auto at = [&](double v) { return kFree + (1 - 2 * kFree) * (v - low) / (high - low); };
  return {at(range.least), at(range.greatest), at(value)};
}

namespace {

std::string placeWords(const Comparison& row, ExpertPlace place, std::span<const std::string> layer_names) {
  const auto text = [&](double value) { return measureText(row.name, value, row.unit); };
  const double edge = place == ExpertPlace::kBelow ? row.least : row.greatest;
  // if rounding hides the difference, state that there is one
  const bool just = place != ExpertPlace::kWithin && text(row.value) == text(edge);
  return fmt::format("{} {}: {}{} the experts' range, {} to {} ({} gestures)",
                     measureWords(row.name, layer_names), text(row.value), just ? "just " : "",
                     placeName(place), text(row.least), text(row.greatest), row.n);
}

}  // namespace

std::vector<Comparison> compareWithReference(std::span<const Measure> measures,
                                             std::span<const ReferenceBand> bands,
                                             std::span<const std::string> layer_names) {
  std::vector<Comparison> rows;
  for (const Measure& measure : measures) {
    if (!measure.measured) continue;
    const auto band = std::find_if(bands.begin(), bands.end(),
                                   [&](const ReferenceBand& b) { return b.name == measure.name && b.n > 0; });
    if (band == bands.end()) continue;
    Comparison row{measure.name, measure.unit, measure.value, band->n, band->least, band->greatest, {}, {}};
    row.place = placeAmong(*band, row.value);
    if (row.place) row.words = placeWords(row, *row.place, layer_names);
    rows.push_back(std::move(row));
  }
  return rows;
}

std::string whyNoReference(std::span<const Measure> measures) {
  std::string why;
  for (const Measure& row : measures) {
    const MeasureKind* const kind = measureKind(row.name);
    if (kind == nullptr || kind->fault.one.empty() || !row.measured || !(row.value > 0)) continue;
    why += why.empty() ? "" : ", ";
    why += row.value == 1 ? std::string(kind->fault.one)
                          : fmt::format(fmt::runtime(kind->fault.many), row.value);
  }
  return why;
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
                    {"n", row.n},
                    {"least", row.least},
                    {"greatest", row.greatest},
                    {"place", row.place ? OrderedJson(placeName(*row.place)) : OrderedJson()},
                    {"better", betterName(betterOf(row.name))},
                    {"words", row.words}});
  }
  return rows.dump();
}

}  // namespace needlelab
