#include "common/base/time/clock.h"

#include <fmt/core.h>
#include <time.h>

#include <array>
#include <cmath>
#include <ctime>
#include <string_view>

namespace needlelab {
namespace {

std::int64_t readNs(clockid_t id) noexcept {
  timespec now{};
  clock_gettime(id, &now);
  return static_cast<std::int64_t>(now.tv_sec) * 1'000'000'000 + now.tv_nsec;
}

double quantile(const std::vector<double>& sorted, double q) {
  if (sorted.empty()) return 0;
  const double rank = std::ceil(q * static_cast<double>(sorted.size()));
  return sorted[static_cast<std::size_t>(std::max(rank, 1.0)) - 1];
}

double measuredClock_ns() {
  constexpr int kReadings = 1000;
  std::vector<double> costs_ns;
  for (int i = 0; i < kReadings; ++i) {
    // ten at a time, because one reading takes about one clock step
    const std::int64_t from_ns = steadyNowNs();
    for (int k = 0; k < 9; ++k) keep(steadyNowNs());
    costs_ns.push_back(static_cast<double>(steadyNowNs() - from_ns) / 10);
  }
  std::sort(costs_ns.begin(), costs_ns.end());
  return quantile(costs_ns, 0.5);
}

}  // namespace

std::int64_t steadyNowNs() noexcept {
  return readNs(CLOCK_MONOTONIC);
}
std::int64_t wallNowNs() noexcept {
  return readNs(CLOCK_REALTIME);
}

Timing timingOf(std::vector<double> means_ns, std::size_t per_batch) {
  std::sort(means_ns.begin(), means_ns.end());
  Timing timing;
  timing.batches = means_ns.size();
  timing.per_batch = per_batch;
  if (means_ns.empty() || per_batch == 0) return timing;
  timing.median_ns = quantile(means_ns, 0.5);
  timing.p99_ns = quantile(means_ns, 0.99);
  timing.min_ns = means_ns.front();
  timing.resolution_ns = clockCost_ns() / static_cast<double>(per_batch);
  return timing;
}

Timing timingOfRuns(const std::vector<double>& means_ns, std::size_t per_batch, std::size_t runs) {
  Timing timing = timingOf(means_ns, per_batch);
  const std::size_t count = means_ns.size();
  runs = std::min(runs, count);
  std::vector<double> medians_ns, tails_ns;
  for (std::size_t r = 0; r < runs; ++r) {
    const auto begin = means_ns.begin() + static_cast<std::ptrdiff_t>(r * count / runs);
    const auto end = means_ns.begin() + static_cast<std::ptrdiff_t>((r + 1) * count / runs);
    const Timing run = timingOf({begin, end}, per_batch);
    medians_ns.push_back(run.median_ns);
    tails_ns.push_back(run.p99_ns);
  }
  std::sort(medians_ns.begin(), medians_ns.end());
  std::sort(tails_ns.begin(), tails_ns.end());
  timing.median_ns = quantile(medians_ns, 0.5);
  timing.p99_ns = quantile(tails_ns, 0.5);
  return timing;
}

double clockCost_ns() {
  static const double cost_ns = measuredClock_ns();
  return cost_ns;
}

namespace {

constexpr std::array<std::string_view, 12> kMonths = {"January",   "February", "March",    "April",
                                                      "May",       "June",     "July",     "August",
                                                      "September", "October",  "November", "December"};

// moments before 1970 round down, too
std::time_t secondOf(std::int64_t unix_ns) {
  return unix_ns / 1'000'000'000 - (unix_ns % 1'000'000'000 < 0 ? 1 : 0);
}

std::string writtenTime(const std::tm& parts, TimeForm form) {
  const std::string day =
      fmt::format("{:04}-{:02}-{:02}", parts.tm_year + 1900, parts.tm_mon + 1, parts.tm_mday);
  const std::string minute = fmt::format("{:02}:{:02}", parts.tm_hour, parts.tm_min);
  switch (form) {
    case TimeForm::kDay:
      return day;
    case TimeForm::kMinute:
      return day + " " + minute;
    case TimeForm::kClock:
      return fmt::format("{}:{:02}", minute, parts.tm_sec);
    case TimeForm::kWords:
      return fmt::format("{} {} {}, {}", parts.tm_mday, kMonths.at(static_cast<std::size_t>(parts.tm_mon)),
                         parts.tm_year + 1900, minute);
    case TimeForm::kZoned:
      break;
  }
  return fmt::format("{} {}:{:02} {}", day, minute, parts.tm_sec, parts.tm_zone);
}

}  // namespace

std::string localTime(std::int64_t unix_ns, TimeForm form) {
  const std::time_t seconds = secondOf(unix_ns);
  std::tm parts{};
  ::tzset();  // localtime_r need not read TZ
  if (unix_ns == 0 || ::localtime_r(&seconds, &parts) == nullptr) return "-";
  return writtenTime(parts, form);
}

std::string utcTime(std::int64_t unix_ns) {
  const std::time_t seconds = secondOf(unix_ns);
  std::tm parts{};
  if (unix_ns == 0 || ::gmtime_r(&seconds, &parts) == nullptr) return "-";
  parts.tm_zone = "UTC";
  return writtenTime(parts, TimeForm::kZoned);
}

std::string spreadsheetTime(std::int64_t unix_ns) {
  const std::time_t seconds = secondOf(unix_ns);
  std::tm parts{};
  if (unix_ns == 0 || ::gmtime_r(&seconds, &parts) == nullptr) return {};
  return writtenTime(parts, TimeForm::kDay) + " " + writtenTime(parts, TimeForm::kClock);
}

std::string isoTime(std::int64_t unix_ns) {
  std::string text = spreadsheetTime(unix_ns);
  if (text.empty()) return text;
  text[text.find(' ')] = 'T';
  return text + "Z";
}

std::string isoTimeMs(std::int64_t unix_ns) {
  std::string text = isoTime(unix_ns);
  if (text.empty()) return text;
  text.pop_back();
  const std::int64_t past_second_ns = unix_ns - static_cast<std::int64_t>(secondOf(unix_ns)) * 1'000'000'000;
  return text + fmt::format(".{:03}Z", past_second_ns / 1'000'000);
}

std::int64_t localMidnightNs(int year, int month, int day) {
  std::tm parts{};
  parts.tm_year = year - 1900;
  parts.tm_mon = month - 1;
  parts.tm_mday = day;
  parts.tm_isdst = -1;  // let the time zone decide for that day
  return static_cast<std::int64_t>(std::mktime(&parts)) * 1'000'000'000;
}

}  // namespace needlelab
