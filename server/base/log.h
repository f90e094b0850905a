/// Writes log lines to standard error, as text `event key=value …` or as JSON, one object per line. Quotes
/// and escapes values from the network, so that a peer cannot forge a line.
#pragma once

#include <concepts>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>

#include "common/base/result.h"

namespace needlelab {

enum class LogLevel { kDebug, kInfo, kWarning, kError, kOff };

struct LogField {
  LogField(std::string_view name, std::string_view text) : key(name), value(text) {}
  LogField(std::string_view name, const char* text) : key(name), value(text) {}
  LogField(std::string_view name, const std::string& text) : key(name), value(text) {}
  template <std::integral T>
  LogField(std::string_view name, T given) : key(name), value(std::to_string(given)), number(true) {}
  std::string_view key;
  std::string value;
  bool number = false;  ///< `value` is a number
};

/// Each text takes at most about 500 bytes of the line. Thread: any.
void logEvent(LogLevel level, std::string_view event, std::initializer_list<LogField> fields = {});
/// A line as in `logEvent`, without time and level.
std::string logLine(std::string_view event, std::initializer_list<LogField> fields);

/// The members `"event":…,"key":…` of a JSON object, without braces, time and level. Replaces bytes that are
/// not UTF-8.
std::string logMembers(std::string_view event, std::initializer_list<LogField> fields);

/// Limits the log lines that network peers can cause to a number per period; further ones are only counted.
/// Times: steady clock (ns), from the caller. Thread: one.
class LogBound {
 public:
  static constexpr std::int64_t kMinute_ns = 60'000'000'000;
  explicit LogBound(std::uint64_t lines, std::int64_t period_ns = kMinute_ns)
      : lines_(lines), period_ns_(period_ns) {}
  /// Whether one more line may be written. If false, it is counted as left out.
  bool take(std::int64_t now_ns);
  /// Number of lines left out in periods that have ended; each is reported once.
  std::uint64_t takeOmittedCount(std::int64_t now_ns);
  /// True when no period is active and takeOmittedCount() has nothing left to report.
  bool over(std::int64_t now_ns);

 private:
  void turnTo(std::int64_t now_ns);
  const std::uint64_t lines_;
  const std::int64_t period_ns_;
  std::optional<std::int64_t> began_ns_;  // of the period; it begins with its first line
  std::uint64_t written_ = 0, omitted_ = 0, to_report_ = 0;
};

enum class LogFormat { kText, kJson };
/// "text" or "json". Errors: kInvalidInput.
Result<LogFormat> parseLogFormat(std::string_view name);
/// Sets the format of all further lines. When standard error is the journal (JOURNAL_STREAM,
/// systemd.exec(5)), each line begins with its priority, "<6>", and text has no time. Thread: call it before
/// other threads log.
void setLogFormat(LogFormat format);

/// "debug", "info", "warning", "error", "off". Errors: kInvalidInput.
Result<LogLevel> parseLogLevel(std::string_view name);
void setLogLevel(LogLevel level);

}  // namespace needlelab
