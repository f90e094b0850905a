/// A test /sys and /dev (umockdev), visible to this process and its children when it runs under
/// `umockdev-wrapper`.
#pragma once

#include <set>
#include <string>

struct _UMockdevTestbed;

namespace needlelab::test {

/// One at a time per process. Create it before libusb is initialised; it must live longer.
class UsbTestbed {
 public:
  UsbTestbed();
  ~UsbTestbed();
  UsbTestbed(const UsbTestbed&) = delete;
  UsbTestbed& operator=(const UsbTestbed&) = delete;

  /// Empty if /sys and /dev are redirected; otherwise the reason and the remedy.
  [[nodiscard]] std::string trouble() const;

  [[nodiscard]] _UMockdevTestbed* get() const { return testbed_; }
  /// The folder that stands for /.
  [[nodiscard]] const std::string& root() const { return root_; }
  /// A free device number on bus 1: the next one, restarting with 2 after 127, as the kernel assigns them.
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

}  // namespace needlelab::test
