#include "common/gesture/sample.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <string>

#include "common/base/text/csv.h"
#include "common/gesture/sample_columns.h"

namespace needlelab {

Status validate(const Resolution& resolution) {
  const struct {
    const char* name;
    double step;
  } fields[] = {{"length_m", resolution.length_m}, {"quaternion", resolution.quaternion},
                {"force_N", resolution.force_N},   {"torque_Nm", resolution.torque_Nm},
                {"time_s", resolution.time_s},     {"speed_mps", resolution.speed_mps}};
  for (const auto& field : fields) {
    // this form also rejects not-a-number
    if (field.step == 0 || (field.step >= 1e-12 && field.step <= 1)) continue;
    std::string text = std::string("resolution.") + field.name + " is ";
    appendNumber(text, field.step);
    return Error{ErrorCode::kInvalidInput, text + "; allowed is 0 (lossless) or 1e-12 to 1"};
  }
  return {};
}

namespace {

template <typename Integer>
void appendInteger(std::string& out, Integer value) {
  char text[24];
  const auto [end, error] = std::to_chars(text, text + sizeof text, +value);
  (void)error;  // 24 characters hold any 64-bit integer
  out.append(text, end);
}

/// The decimals that tell values apart that are a step apart: 6 for 1e-6, 5 for 2^-15.
int decimalsOf(double step) {
  return static_cast<int>(std::ceil(-std::log10(step) - 1e-9));
}

/// Without zeros at the end.
void appendDecimals(std::string& out, double value, int decimals) {
  std::string text = fmt::format("{:.{}f}", value, decimals);
  if (std::isfinite(value)) {
    text.erase(text.find_last_not_of('0') + 1);
    if (text.ends_with('.')) text.pop_back();
    if (text == "-0") text = "0";
  }
  out += text;
}

/// A whole number within a field's range.
template <typename Integer>
bool putInteger(double value, Integer& field) {
  using Limits = std::numeric_limits<Integer>;
  // the limits of 64 bits cannot be represented as doubles; one step inside they can
  if (value != std::floor(value) || value < static_cast<double>(Limits::lowest()) ||
      value >= static_cast<double>(Limits::max()) + (sizeof(Integer) < 8 ? 1 : 0))
    return false;
  field = static_cast<Integer>(value);
  return true;
}

/// A spreadsheet writes 1945940123456 as 1.94594E+12. Then the times come from t_s; false: nothing was
/// rounded.
bool restoreRoundedTimes(std::vector<GestureSample>& samples, const std::vector<double>& t_s) {
  constexpr std::int64_t kRounded_ns = 100'000, kApart_ns = 10'000;
  std::int64_t farthest_ns = 0;
  std::vector<std::int64_t> times_ns;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (samples[i].time_ns % kRounded_ns != 0) return false;
    times_ns.push_back(samples.front().time_ns + std::llround(1e9 * (t_s[i] - t_s.front())));
    farthest_ns = std::max(farthest_ns, std::abs(times_ns.back() - samples[i].time_ns));
  }
  if (farthest_ns <= kApart_ns) return false;
  for (std::size_t i = 0; i < samples.size(); ++i) samples[i].time_ns = times_ns[i];
  return true;
}

}  // namespace

void appendSampleCsvHeader(std::string& out) {
  bool first = true;
  const GestureSample none;
  forEachSampleColumn(none, 0, [&](const SampleColumn& column, auto) {
    if (!first) out += ',';
    first = false;
    out += column.name;
  });
  out += '\n';
}

void appendSampleRow(std::string& out, const GestureSample& sample, std::int64_t first_time_ns,
                     char separator, std::string_view not_a_number) {
  bool first = true;
  forEachSampleColumn(sample, first_time_ns, [&](const SampleColumn&, auto value) {
    if (!first) out += separator;
    first = false;
    if constexpr (!std::is_floating_point_v<decltype(value)>)
      appendInteger(out, value);
    else if (std::isnan(value))
      out += not_a_number;
    else
      appendNumber(out, value);
  });
  out += '\n';
}

void appendSampleCsvRow(std::string& out, const GestureSample& sample, std::int64_t first_time_ns) {
  appendSampleRow(out, sample, first_time_ns, ',', "nan");
}

void appendRoundedCsvRow(std::string& out, const GestureSample& sample, std::int64_t first_time_ns) {
  const Resolution steps = Resolution::standard();
  bool first = true;
  forEachSampleColumn(sample, first_time_ns, [&](const SampleColumn& column, auto value) {
    if (!first) out += ',';
    first = false;
    if constexpr (!std::is_floating_point_v<decltype(value)>)
      appendInteger(out, value);
    else if (!std::isnan(value))
      appendDecimals(out, value, column.step != nullptr ? decimalsOf(steps.*column.step) : 6);
  });
  out += '\n';
}

void appendSampleJson(std::string& out, const GestureSample& sample, std::int64_t first_time_ns) {
  char separator = '{';
  forEachSampleColumn(sample, first_time_ns, [&](const SampleColumn& column, auto value) {
    out += separator;
    separator = ',';
    out += '"';
    out += column.name;
    out += "\":";
    if constexpr (std::is_floating_point_v<decltype(value)>) {
      if (std::isfinite(value))
        appendNumber(out, value);
      else
        out += "null";
    } else {
      appendInteger(out, value);
    }
  });
  out += '}';
}

Result<std::vector<GestureSample>> readSampleCsv(const std::filesystem::path& path, WallColumns wall,
                                                 std::string* note) {
  // t_s says what time_ns says, and stands in for it
  const auto is_read = [&](const std::string& name) {
    return name != "t_s" && (name[0] != 'w' || wall == WallColumns::kRead);
  };
  std::vector<std::string> names;
  GestureSample none;
  forEachSampleColumn(none, 0, [&](const SampleColumn& column, auto&) {
    if (is_read(column.name)) names.emplace_back(column.name);
  });
  ASSIGN_OR_RETURN(const auto table, readCsv(path, names, {"t_s"}, {.not_finite = {"wx_m", "wy_m", "wz_m"}}));
  std::vector<int> places;
  for (const std::string& name : names) places.push_back(table.find(name));
  std::vector<GestureSample> samples(table.rows());
  for (std::size_t row = 0; row < samples.size(); ++row) {
    std::size_t next = 0;
    const char* bad = nullptr;
    forEachSampleColumn(samples[row], 0, [&]<typename Field>(const SampleColumn& column, Field& field) {
      if (!is_read(column.name)) return;
      const double value = table.columns[static_cast<std::size_t>(places[next++])][row];
      if constexpr (std::is_floating_point_v<Field>)
        field = value;
      else if (!putInteger(value, field) && bad == nullptr)
        bad = column.name;
    });
    if (bad != nullptr)
      return Error{ErrorCode::kInvalidInput,
                   fmt::format("{}, line {}, column {}: no whole number in its range", path.string(),
                               table.lines[row], bad)};
  }
  if (const int t_s = table.find("t_s");
      t_s >= 0 && restoreRoundedTimes(samples, table.columns[static_cast<std::size_t>(t_s)]) &&
      note != nullptr)
    *note = fmt::format("{}: time_ns was rounded by a spreadsheet: times are those of t_s", path.string());
  return samples;
}

}  // namespace needlelab
