#include "common/base/time/local_time.h"

#include <fmt/core.h>

#include <array>
#include <ctime>
#include <string_view>

namespace needlelab {
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
