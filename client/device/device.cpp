#include "client/device/device.h"

#include <chrono>
#include <utility>

namespace needlelab {
namespace {

constexpr std::chrono::milliseconds kPause{50};

}  // namespace

DeviceMaintenance::DeviceMaintenance(Device& device) : device_(device), thread_([this] { run(); }) {}

DeviceMaintenance::~DeviceMaintenance() {
  stop_.store(true);
  thread_.join();
}

std::string DeviceMaintenance::status() const {
  const std::scoped_lock lock(mutex_);
  return status_;
}

void DeviceMaintenance::run() {
  while (!stop_.load()) {
    device_.maintain();
    std::string status = device_.status();
    {
      const std::scoped_lock lock(mutex_);
      status_ = std::move(status);
    }
    std::this_thread::sleep_for(kPause);
  }
}

}  // namespace needlelab
