/// Times of day for people: in this machine's time zone (TZ). Files, logs and the database keep UTC.
#pragma once

#include <cstdint>
#include <string>

namespace needlelab {

enum class TimeForm : std::uint8_t {
  kDay,     ///< 2026-07-01
  kMinute,  ///< 2026-07-01 09:34
  kClock,   ///< 09:34:56
  kWords,   ///< 1 July 2026, 09:34: in a sentence
  kZoned,   ///< 2026-07-01 09:34:56 NDT: for texts that may be read in another zone
};

/// A time, ns since 1970, in local form; "-" for 0 (never) and for times that no calendar can express.
std::string localTime(std::int64_t unix_ns, TimeForm form);

/// "2026-07-01 12:04:56 UTC": for texts that are stored.
std::string utcTime(std::int64_t unix_ns);
/// UTC in ISO 8601, "2026-07-01T12:04:56Z": for tables that other programs read. Empty for 0 (never).
std::string isoTime(std::int64_t unix_ns);
/// Like isoTime, to the millisecond, rounded down: "2026-07-01T12:04:56.999Z".
std::string isoTimeMs(std::int64_t unix_ns);
/// "2026-07-01 12:04:56", UTC: spreadsheets read it as a date and a time, in any language. Empty for 0
/// (never).
std::string spreadsheetTime(std::int64_t unix_ns);

/// The beginning of a local day, ns since 1970. `day` may be one past the end of the month; it then means the
/// first of the next month. A day lasts 23, 24 or 25 hours: it ends at the beginning of `day + 1`.
std::int64_t localMidnightNs(int year, int month, int day);

}  // namespace needlelab
