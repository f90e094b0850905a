/// Log lines on standard error, as text `event key=value …` or as JSON, one object a line. Values from the
/// network are quoted and escaped: nobody can forge a line.
#pragma once

#include <concepts>
#include <initializer_list>
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
  bool number = false;  ///< `value` is one
};

/// Thread: any.
void logEvent(LogLevel level, std::string_view event, std::initializer_list<LogField> fields = {});
/// The line without time and level, as `logEvent` writes it.
std::string logLine(std::string_view event, std::initializer_list<LogField> fields);

/// The members `"event":…,"key":…` of a JSON object, without its braces, time and level. Bytes that are not
/// UTF-8 are replaced.
std::string logMembers(std::string_view event, std::initializer_list<LogField> fields);

enum class LogFormat { kText, kJson };
/// "text" or "json". Errors: kInvalidInput.
Result<LogFormat> parseLogFormat(std::string_view name);
/// How lines look from now on. Where standard error is the journal (JOURNAL_STREAM, systemd.exec(5)), each
/// line begins with its priority, "<6>", and text has no time of its own. Thread: before others log.
void setLogFormat(LogFormat format);

/// "debug", "info", "warning", "error", "off". Errors: kInvalidInput.
Result<LogLevel> parseLogLevel(std::string_view name);
void setLogLevel(LogLevel level);

}  // namespace needlelab
