#include "server/base/log.h"

#include <fmt/core.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstdlib>
#include <memory>
#include <nlohmann/json.hpp>
#include <utility>

#include "common/base/text/text.h"

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

std::atomic<LogFormat> format_now{LogFormat::kText};

/// "<6>" etc.: the journal's priority prefix for a line (sd-daemon(3)).
class Priority : public spdlog::custom_flag_formatter {
 public:
  void format(const spdlog::details::log_msg& message, const std::tm&, spdlog::memory_buf_t& out) override {
    const std::string_view text = message.level >= spdlog::level::err    ? "<3>"
                                  : message.level == spdlog::level::warn ? "<4>"
                                  : message.level == spdlog::level::info ? "<6>"
                                                                         : "<7>";
    out.append(text.data(), text.data() + text.size());
  }
  [[nodiscard]] std::unique_ptr<custom_flag_formatter> clone() const override {
    return std::make_unique<Priority>();
  }
};

bool journalReads() {
  const char* const stream = std::getenv("JOURNAL_STREAM");
  struct stat info {};
  if (stream == nullptr || ::fstat(STDERR_FILENO, &info) != 0) return false;
  return stream == fmt::format("{}:{}", info.st_dev, info.st_ino);
}

bool isPlain(std::string_view text) {
  for (const char c : text) {
    const bool plain = isLetterOrDigit(c) || std::string_view("-_.:/[]+@").find(c) != std::string_view::npos;
    if (!plain) return false;
  }
  return !text.empty();
}

/// The beginning of a text that takes some 500 bytes of a line. A control character takes `control` bytes, a
/// byte above ASCII `high`.
std::string_view cutForLine(std::string_view text, std::size_t control, std::size_t high) {
  constexpr std::size_t kMost = 500;
  std::size_t count = 0, written = 0;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    const bool is_control = byte < 0x20 || byte == 0x7f;
    written += is_control ? control : byte >= 0x80 ? high : c == '"' || c == '\\' ? 2u : 1u;
    if (written > kMost) break;
    ++count;
  }
  return text.substr(0, count);
}

void appendQuoted(std::string& out, std::string_view text) {
  constexpr std::string_view kHex = "0123456789abcdef";
  const std::string_view cut = cutForLine(text, 4, 1);
  out += '"';
  unsigned char before = 0;
  for (const char c : cut) {
    const auto byte = static_cast<unsigned char>(c);
    // U+0080 to U+009F: a terminal interprets some of them as commands
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
  if (cut.size() < text.size()) out += "…";
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

std::string logMembers(std::string_view event, std::initializer_list<LogField> fields) {
  const auto quoted = [](std::string_view text) {
    const std::string_view cut = cutForLine(text, 6, 3);  // "\u0080": six bytes for two
    const nlohmann::json value(std::string(cut) + (cut.size() < text.size() ? "…" : ""));
    return value.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
  };
  std::string line = "\"event\":" + quoted(event);
  for (const LogField& field : fields)
    line += "," + quoted(field.key) + ":" + (field.number ? field.value : quoted(field.value));
  return line;
}

void logEvent(LogLevel level, std::string_view event, std::initializer_list<LogField> fields) {
  if (level == LogLevel::kOff || !logger().should_log(levelOf(level))) return;
  const bool json = format_now.load(std::memory_order_relaxed) == LogFormat::kJson;
  logger().log(levelOf(level), json ? logMembers(event, fields) : logLine(event, fields));
}

Result<LogLevel> parseLogLevel(std::string_view name) {
  constexpr std::array<std::string_view, 5> kNames = {"debug", "info", "warning", "error", "off"};
  for (std::size_t i = 0; i < kNames.size(); ++i) {
    if (kNames[i] == name) return static_cast<LogLevel>(i);
  }
  return Error{ErrorCode::kInvalidInput,
               "--log-level '" + std::string(name) + "' is not one of debug, info, warning, error, off"};
}

void LogBound::turnTo(std::int64_t now_ns) {
  if (!began_ns_ || now_ns - *began_ns_ < period_ns_) return;
  began_ns_.reset();
  written_ = 0;
  to_report_ += std::exchange(omitted_, 0);
}

bool LogBound::take(std::int64_t now_ns) {
  turnTo(now_ns);
  if (!began_ns_) began_ns_ = now_ns;
  const bool fits = written_ < lines_;
  ++(fits ? written_ : omitted_);
  return fits;
}

std::uint64_t LogBound::takeOmittedCount(std::int64_t now_ns) {
  turnTo(now_ns);
  return std::exchange(to_report_, 0);
}

bool LogBound::over(std::int64_t now_ns) {
  turnTo(now_ns);
  return !began_ns_ && to_report_ == 0;
}

Result<LogFormat> parseLogFormat(std::string_view name) {
  if (name == "text") return LogFormat::kText;
  if (name == "json") return LogFormat::kJson;
  return Error{ErrorCode::kInvalidInput, "--log-format '" + std::string(name) + "' is not one of text, json"};
}

void setLogFormat(LogFormat format) {
  format_now = format;
  const bool journal = journalReads();
  std::string pattern = journal ? "%*" : "";
  if (format == LogFormat::kJson) {
    pattern += R"({"time":"%Y-%m-%dT%H:%M:%S.%e%z","level":"%l",%v})";
  } else {
    pattern += journal ? "%v" : "%Y-%m-%dT%H:%M:%S.%e%z %l %v";
  }
  auto made = std::make_unique<spdlog::pattern_formatter>();
  made->add_flag<Priority>('*').set_pattern(pattern);
  logger().set_formatter(std::move(made));
}

void setLogLevel(LogLevel level) {
  logger().set_level(levelOf(level));
}

}  // namespace needlelab
