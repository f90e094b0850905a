#include "common/base/clock.h"

#include <time.h>

namespace needlelab {
namespace {

std::int64_t readNs(clockid_t id) noexcept {
  timespec now{};
  clock_gettime(id, &now);
  return static_cast<std::int64_t>(now.tv_sec) * 1'000'000'000 + now.tv_nsec;
}

}  // namespace

std::int64_t steadyNowNs() noexcept {
  return readNs(CLOCK_MONOTONIC);
}
std::int64_t wallNowNs() noexcept {
  return readNs(CLOCK_REALTIME);
}

}  // namespace needlelab
