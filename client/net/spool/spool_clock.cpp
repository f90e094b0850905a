#include "client/net/spool/spool_clock.h"

#include <fmt/core.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "client/net/spool/spool_json.h"

namespace needlelab {
namespace {

constexpr std::int64_t kWriteEvery_ns = 60'000'000'000;
constexpr std::int64_t kMaxSeen_ns = INT64_MAX / 2;  // 146 years

std::int64_t timeAt(const nlohmann::json& json, const char* key, std::int64_t most) {
  return static_cast<std::int64_t>(std::min(countAt(json, key), static_cast<std::uint64_t>(most)));
}

}  // namespace

SpoolClock::SpoolClock(std::filesystem::path file) : file_(std::move(file)) {
  const auto json = readSpoolJson(file_);
  if (!json.ok() || !json->is_object()) return;
  seen_ns_ = timeAt(*json, "seen_ns", kMaxSeen_ns);
  server_unix_ns_ = timeAt(*json, "server_unix_ns", INT64_MAX);
}

void SpoolClock::note(std::int64_t server_unix_ns, std::int64_t steady_ns) {
  if (server_unix_ns <= 0) return;
  const std::scoped_lock lock(mutex_);
  const std::int64_t step_ns = server_unix_ns_ == 0 ? 0 : server_unix_ns - server_unix_ns_;
  // a short step is left for the next log-in
  if (server_unix_ns_ != 0 && step_ns > -kWriteEvery_ns && step_ns < kWriteEvery_ns) return;
  const std::int64_t passed_here_ns = steady_ns - steady_ns_;
  const bool known = steady_ns_ != 0 && passed_here_ns >= 0;
  const std::int64_t max_ns = known ? std::min(passed_here_ns, kMaxStep_ns) : kMaxStep_ns;
  seen_ns_ = std::min(seen_ns_ + std::clamp<std::int64_t>(step_ns, 0, max_ns), kMaxSeen_ns);
  assert(seen_ns_ >= 0);
  server_unix_ns_ = server_unix_ns;
  steady_ns_ = steady_ns;
  static_cast<void>(writeSpoolJson(file_, {{"seen_ns", static_cast<std::uint64_t>(seen_ns_)},
                                           {"server_unix_ns", static_cast<std::uint64_t>(server_unix_ns_)}}));
}

std::int64_t SpoolClock::lastServerUnixNs() const {
  const std::scoped_lock lock(mutex_);
  return server_unix_ns_;
}

std::string clockOffText(std::int64_t ahead_ns) {
  const double seconds = std::abs(1e-9 * static_cast<double>(ahead_ns));
  if (seconds < 60) return {};
  const std::string off = seconds < 3600      ? fmt::format("{:.0f} min", seconds / 60)
                          : seconds < 172'800 ? fmt::format("{:.1f} h", seconds / 3600)
                                              : fmt::format("{:.0f} days", seconds / 86'400);
  return fmt::format("this computer's clock is {} {} the server's", off,
                     ahead_ns > 0 ? "ahead of" : "behind");
}

std::int64_t SpoolClock::nowNs() const {
  const std::scoped_lock lock(mutex_);
  return seen_ns_;
}

}  // namespace needlelab
