#include "client/admin/when.h"

#include <cstdio>
#include <ctime>

namespace needlelab {

Result<std::int64_t> momentOf(const std::string& field, const std::string& text) {
  const auto wrong = [&](const std::string& why) {
    return Error{ErrorCode::kInvalidInput, field + ": '" + text + "' " + why +
                                               "; write it as 2026-12-01T18:00Z or 2026-12-01T18:00+01:00"};
  };
  std::tm parts{};
  int used = 0;
  if (std::sscanf(text.c_str(), "%4d-%2d-%2dT%2d:%2d%n", &parts.tm_year, &parts.tm_mon, &parts.tm_mday,
                  &parts.tm_hour, &parts.tm_min, &used) != 5)
    return wrong("is no moment");
  std::string zone = text.substr(static_cast<std::size_t>(used));
  if (zone.starts_with(":")) {
    int more = 0;
    if (std::sscanf(zone.c_str(), ":%2d%n", &parts.tm_sec, &more) != 1) return wrong("is no moment");
    zone.erase(0, static_cast<std::size_t>(more));
  }
  int offset_s = 0;
  if (zone != "Z") {
    int hours = 0, minutes = 0, more = 0;
    char sign = 0;
    if (std::sscanf(zone.c_str(), "%c%2d:%2d%n", &sign, &hours, &minutes, &more) != 3 ||
        static_cast<std::size_t>(more) != zone.size() || (sign != '+' && sign != '-') || hours > 14 ||
        minutes > 59)
      return wrong(zone.empty() ? "has no time zone" : "has no time zone that is known");
    offset_s = (hours * 3600 + minutes * 60) * (sign == '-' ? -1 : 1);
  }
  const std::tm given = parts;
  parts.tm_year -= 1900;
  parts.tm_mon -= 1;
  const std::time_t seconds = ::timegm(&parts);
  // timegm takes a 31st of February for a day in March
  if (parts.tm_mon + 1 != given.tm_mon || parts.tm_mday != given.tm_mday || parts.tm_hour != given.tm_hour ||
      parts.tm_min != given.tm_min || given.tm_year < 1970 || given.tm_year > 2261)
    return wrong("is no day or time that there is");
  return (static_cast<std::int64_t>(seconds) - offset_s) * 1'000'000'000;
}

}  // namespace needlelab
