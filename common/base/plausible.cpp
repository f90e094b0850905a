#include "common/base/plausible.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "common/base/histogram.h"

namespace needlelab {
namespace {

struct LikelyUnit {
  const char* name = nullptr;
  double size = 0;  // in the quantity's own unit
};

struct PlausibleRow {
  Quantity quantity;
  const char* unit;
  double most, usual;  // `usual` chooses among the likely units
  std::array<LikelyUnit, 4> likely;
};

constexpr LikelyUnit kMillimetres{"millimetres", 1e-3}, kCentimetres{"centimetres", 1e-2},
    kInches{"inches", 0.0254}, kMilliseconds{"milliseconds", 1e-3}, kMicroseconds{"microseconds", 1e-6},
    kNanoseconds{"nanoseconds", 1e-9};

constexpr PlausibleRow kPlausible[] = {
    {Quantity::kTool, "m", 1, 0.15, {{kMillimetres, kCentimetres, kInches}}},
    {Quantity::kPlacement, "m", 2, 0.05, {{kMillimetres, kCentimetres, kInches}}},
    {Quantity::kWay, "m", 2, 0.06, {{kMillimetres, kCentimetres}}},
    {Quantity::kDepth, "m", 0.4, 0.05, {{kMillimetres, kCentimetres}}},
    {Quantity::kStep, "s", 0.5, 0.005, {{kMilliseconds, kMicroseconds, kNanoseconds}}},
    {Quantity::kTime, "s", 3600, 10, {{kMilliseconds, kMicroseconds, kNanoseconds}}},
    {Quantity::kSpeed,
     "m/s",
     1,
     0.005,
     {{{"millimetres a second", 1e-3}, {"millimetres a minute", 1e-3 / 60}, {"centimetres a second", 1e-2}}}},
    {Quantity::kDiameter, "m", 0.01, 1e-3, {{kMillimetres, {"micrometres", 1e-6}}}},
    {Quantity::kForce, "N", 20, 1, {{{"gram-force", 9.80665e-3}, {"millinewtons", 1e-3}}}},
    {Quantity::kShare, "", 1, 0.5, {{{"percent", 1e-2}}}},
};

}  // namespace

std::string implausible(Quantity quantity, double value) {
  const PlausibleRow& row = *std::ranges::find(kPlausible, quantity, &PlausibleRow::quantity);
  const double size = std::abs(value);
  if (size <= row.most) return {};
  const auto distance = [&](const LikelyUnit& unit) {
    return std::abs(std::log(size * unit.size / row.usual));
  };
  const LikelyUnit* likely = &row.likely[0];
  for (const LikelyUnit& unit : row.likely)
    if (unit.name != nullptr && distance(unit) < distance(*likely)) likely = &unit;
  const auto withUnit = [&](double number) {
    return fmt::format("{:.6g}{}{}", number, row.unit[0] == '\0' ? "" : " ", row.unit);
  };
  return fmt::format("{}: at most {} is plausible; looks like {}: {:.6g} {} are {}", withUnit(value),
                     withUnit(row.most), likely->name, value, likely->name, withUnit(value * likely->size));
}

Status checkPlausible(std::string_view where, Quantity quantity, double value) {
  const std::string why = implausible(quantity, value);
  if (why.empty()) return {};
  return Error{ErrorCode::kInvalidInput, fmt::format("{} is {}", where, why)};
}

Status checkTimeStep(std::string_view where, std::span<const double> t_s) {
  constexpr std::size_t kFewest = 50;
  if (t_s.size() < kFewest) return {};
  std::vector<double> steps;
  for (std::size_t i = 1; i < t_s.size(); ++i) steps.push_back(t_s[i] - t_s[i - 1]);
  return checkPlausible(fmt::format("{}: the usual step between rows", where), Quantity::kStep,
                        medianOf(std::move(steps)));
}

}  // namespace needlelab
