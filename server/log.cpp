#include "server/log.h"

#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <array>
#include <memory>
#include <utility>

namespace needlelab {
namespace {

spdlog::level::level_enum levelOf(LogLevel level) {
  switch (level) {
    case LogLevel::kDebug:
      return spdlog::level::debug;
    case LogLevel::kInfo:
      return spdlog::level::info;
    case LogLevel::kWarning:
      return spdlog::level::warn;
    case LogLevel::kError:
      return spdlog::level::err;
    case LogLevel::kOff:
      break;
  }
  return spdlog::level::off;
}

spdlog::logger& logger() {
  static const auto instance = [] {
    auto made = std::make_shared<spdlog::logger>("server", std::make_shared<spdlog::sinks::stderr_sink_mt>());
    made->set_pattern("%Y-%m-%dT%H:%M:%S.%e%z %l %v");
    made->flush_on(spdlog::level::info);
    return made;
  }();
  return *instance;
}

bool isPlain(std::string_view text) {
  for (const char c : text) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                       std::string_view("-_.:/[]+@").find(c) != std::string_view::npos;
    if (!plain) return false;
  }
  return !text.empty();
}

void appendQuoted(std::string& out, std::string_view text) {
  constexpr std::string_view kHex = "0123456789abcdef";
  constexpr std::size_t kMost = 500;
  out += '"';
  unsigned char before = 0;
  for (const char c : text.substr(0, kMost)) {
    const auto byte = static_cast<unsigned char>(c);
    // U+0080 to U+009F: a terminal takes some of them for commands
    const bool c1 = std::exchange(before, byte) == 0xc2 && byte >= 0x80 && byte < 0xa0;
    if (c == '"' || c == '\\') {
      out += '\\';
      out += c;
    } else if (byte < 0x20 || byte == 0x7f || c1) {
      out += "\\x";
      out += kHex[byte >> 4];
      out += kHex[byte & 15];
    } else {
      out += c;
    }
  }
  if (text.size() > kMost) out += "…";
  out += '"';
}

}  // namespace

std::string logLine(std::string_view event, std::initializer_list<LogField> fields) {
  std::string line(event);
  for (const LogField& field : fields) {
    line += ' ';
    line += field.key;
    line += '=';
    if (isPlain(field.value) && field.value.size() <= 200) {
      line += field.value;
    } else {
      appendQuoted(line, field.value);
    }
  }
  return line;
}

void logEvent(LogLevel level, std::string_view event, std::initializer_list<LogField> fields) {
  if (level == LogLevel::kOff || !logger().should_log(levelOf(level))) return;
  logger().log(levelOf(level), logLine(event, fields));
}

Result<LogLevel> parseLogLevel(std::string_view name) {
  constexpr std::array<std::string_view, 5> kNames = {"debug", "info", "warning", "error", "off"};
  for (std::size_t i = 0; i < kNames.size(); ++i) {
    if (kNames[i] == name) return static_cast<LogLevel>(i);
  }
  return Error{ErrorCode::kInvalidInput,
               "--log-level '" + std::string(name) + "' is not one of debug, info, warning, error, off"};
}

void setLogLevel(LogLevel level) {
  logger().set_level(levelOf(level));
}

}  // namespace needlelab
