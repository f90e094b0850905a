/// A /sys and /dev of our own (umockdev), seen by this process and by those that it starts, when it runs
/// under `umockdev-wrapper`.
#pragma once

#include <set>
#include <string>

struct _UMockdevTestbed;

namespace needlelab::test {

/// One at a time in a process. Make it before libusb is initialised, and let it live longer.
class UsbTestbed {
 public:
  UsbTestbed();
  ~UsbTestbed();
  UsbTestbed(const UsbTestbed&) = delete;
  UsbTestbed& operator=(const UsbTestbed&) = delete;

  /// Whether /sys and /dev are really redirected: empty, or why not and what to do.
  [[nodiscard]] std::string trouble() const;

  [[nodiscard]] _UMockdevTestbed* get() const { return testbed_; }
  /// The folder that stands for /.
  [[nodiscard]] const std::string& root() const { return root_; }
  /// A number on bus 1 that no device has: the next one, from 127 on again at 2, as the kernel gives them.
  int takeDeviceNumber();
  void giveBackDeviceNumber(int number) { device_numbers_.erase(number); }
  /// A port of the root hub for a new socket: 1, 2, …
  int nextPort() { return next_port_++; }

 private:
  _UMockdevTestbed* testbed_;
  std::string root_;
  std::set<int> device_numbers_;
  int last_device_number_ = 1, next_port_ = 1;
};

/// SCHED_FIFO for the calling thread, below the haptic loop's. A kernel would not be late because others
/// work; without the right the thread stays as it is.
void preferThisThread();

}  // namespace needlelab::test
