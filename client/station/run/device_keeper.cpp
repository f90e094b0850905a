#include "client/station/run/device_keeper.h"

#include <chrono>
#include <utility>

namespace needlelab {
namespace {

constexpr std::chrono::milliseconds kPause{50};

}  // namespace

DeviceKeeper::DeviceKeeper(Device& device) : device_(device), thread_([this] { run(); }) {}

DeviceKeeper::~DeviceKeeper() {
  stop_.store(true);
  thread_.join();
}

std::string DeviceKeeper::words() const {
  const std::scoped_lock lock(mutex_);
  return words_;
}

void DeviceKeeper::run() {
  while (!stop_.load()) {
    device_.maintain();
    std::string words = device_.status();
    {
      const std::scoped_lock lock(mutex_);
      words_ = std::move(words);
    }
    std::this_thread::sleep_for(kPause);
  }
}

}  // namespace needlelab
