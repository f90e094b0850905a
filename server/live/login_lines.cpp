#include "server/live/login_lines.h"

namespace needlelab {
namespace {

constexpr const char* kRefused = "login_refused";
constexpr const char* kMustWait = "login_rate_limited";

}  // namespace

void LoginLines::refused(std::int64_t now_ns, std::initializer_list<LogField> fields) {
  if (refused_.take(now_ns)) logEvent(LogLevel::kWarning, kRefused, fields);
}

void LoginLines::mustWait(std::int64_t now_ns, std::initializer_list<LogField> fields) {
  if (must_wait_.take(now_ns)) logEvent(LogLevel::kWarning, kMustWait, fields);
}

void LoginLines::sayLeftOut(std::int64_t now_ns) {
  const auto say = [now_ns](LogBound& bound, const char* event) {
    if (const std::uint64_t count = bound.leftOut(now_ns); count > 0)
      logEvent(LogLevel::kWarning, "logins_left_out", {{"of", event}, {"count", count}});
  };
  say(refused_, kRefused);
  say(must_wait_, kMustWait);
}

}  // namespace needlelab
