#include "client/device/device.h"

#include <utility>

namespace needlelab {
namespace {

constexpr std::int64_t kPause_ns = 50'000'000;

}  // namespace

DeviceMaintenance::DeviceMaintenance(Device& device, TimeSource& time, TurnRunner& threads)
    : device_(device), time_(time), running_(threads.start(*this, {"maintenance", 0})) {}

DeviceMaintenance::~DeviceMaintenance() {
  stop_.store(true);
  running_.reset();
}

std::string DeviceMaintenance::status() const {
  const std::scoped_lock lock(mutex_);
  return status_;
}

std::optional<std::int64_t> DeviceMaintenance::turn() noexcept {
  if (stop_.load()) return std::nullopt;
  device_.maintain();
  std::string status = device_.status();
  {
    const std::scoped_lock lock(mutex_);
    status_ = std::move(status);
  }
  return time_.nowNs() + kPause_ns;
}

}  // namespace needlelab
