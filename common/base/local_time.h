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

/// A moment, ns since 1970, as a person reads it here; "-" for 0 (never), and for what no calendar has.
std::string localTime(std::int64_t unix_ns, TimeForm form);

/// "2026-07-01 12:04:56 UTC": for texts that are stored.
std::string utcTime(std::int64_t unix_ns);
/// The same by ISO 8601, "2026-07-01T12:04:56Z": for tables that other programs read. Empty for 0 (never).
std::string isoTime(std::int64_t unix_ns);

/// The beginning of a day here, ns since 1970. `day` may be one beyond the month's last: then the next
/// month's first. A day lasts 23, 24 or 25 hours: its end is the beginning of `day + 1`.
std::int64_t localMidnightNs(int year, int month, int day);

}  // namespace needlelab
