#include "client/net/link_clock.h"

#include <algorithm>

#include "common/base/clock.h"

namespace needlelab {

std::int64_t LinkClock::unixNs() const {
  return wallNowNs();
}

Task<> LinkClock::wait(asio::steady_timer& timer, std::chrono::milliseconds time, LinkWait /*what*/) {
  timer.expires_after(time);
  co_await timer.async_wait(kUseTuple);
}

void LinkClock::runOne(asio::io_context& io, std::int64_t due_ns) {
  constexpr std::int64_t kLongest_ns = 1'000'000'000;  // a time beyond all times must not overflow
  io.run_one_for(std::chrono::nanoseconds(std::min(due_ns - steadyNs(), kLongest_ns)));
}

}  // namespace needlelab
