/// Measures the disk's own sync time while a test measures code that waits for syncs: a disk that stalls for
/// a second is not a fault of the program.
#pragma once

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <stdexcept>
#include <thread>

namespace needlelab::test {

/// A thread that writes 4 KiB to its own file every 20 ms and waits for the sync.
class SyncProbe {
 public:
  /// `folder`: a folder on the measured disk; the file is removed at the end.
  explicit SyncProbe(const std::filesystem::path& folder)
      : path_(folder / "sync_probe"),
        fd_(::open(path_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600)) {
    if (fd_ < 0) throw std::runtime_error("cannot write " + path_.string());
    thread_ = std::thread([this] { run(); });
  }
  ~SyncProbe() {
    stop_ = true;
    thread_.join();
    ::close(fd_);
    std::error_code ignored;
    std::filesystem::remove(path_, ignored);
  }
  SyncProbe(const SyncProbe&) = delete;
  SyncProbe& operator=(const SyncProbe&) = delete;

  /// The longest sync that ended since the last call, or the pending one. In ms. Any thread.
  double takeLongest() {
    const std::int64_t began = began_ns_;
    const std::int64_t going_on = began == 0 ? 0 : now() - began;
    return 1e-6 * static_cast<double>(std::max(longest_ns_.exchange(0), going_on));
  }

 private:
  static std::int64_t now() {
    return std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count();
  }
  void run() {
    const std::array<char, 4096> page{};
    while (!stop_) {
      began_ns_ = now();
      if (::pwrite(fd_, page.data(), page.size(), 0) < 0 || ::fdatasync(fd_) != 0) return;
      longest_ns_ = std::max<std::int64_t>(longest_ns_, now() - began_ns_.exchange(0));
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  }

  const std::filesystem::path path_;
  const int fd_;
  std::atomic<bool> stop_{false};
  std::atomic<std::int64_t> longest_ns_{0}, began_ns_{0};
  std::thread thread_;
};

}  // namespace needlelab::test
