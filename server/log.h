/// Log lines `event key=value …` on standard error. Values from the network are quoted and escaped: nobody
/// can forge a line.
#pragma once

#include <concepts>
#include <initializer_list>
#include <string>
#include <string_view>

#include "base/result.h"

namespace needlelab {

enum class LogLevel { kDebug, kInfo, kWarning, kError, kOff };

struct LogField {
  LogField(std::string_view name, std::string_view text) : key(name), value(text) {}
  LogField(std::string_view name, const char* text) : key(name), value(text) {}
  LogField(std::string_view name, const std::string& text) : key(name), value(text) {}
  template <std::integral T>
  LogField(std::string_view name, T number) : key(name), value(std::to_string(number)) {}
  std::string_view key;
  std::string value;
};

/// Thread: any.
void logEvent(LogLevel level, std::string_view event, std::initializer_list<LogField> fields = {});
/// The line without time and level, as `logEvent` writes it.
std::string logLine(std::string_view event, std::initializer_list<LogField> fields);

/// "debug", "info", "warning", "error", "off". Errors: kInvalidInput.
Result<LogLevel> parseLogLevel(std::string_view name);
void setLogLevel(LogLevel level);

}  // namespace needlelab
