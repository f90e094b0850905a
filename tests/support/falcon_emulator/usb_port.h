/// A socket for the emulated Falcon: the kernel's usbfs, and the device's descriptors.
#pragma once

#include <cstdint>
#include <deque>
#include <mutex>
#include <string>
#include <vector>

#include "tests/support/falcon_emulator/ftdi_chip.h"
#include "tests/support/falcon_emulator/usb_testbed.h"

struct _UMockdevIoctlBase;
struct _UMockdevIoctlClient;
struct _UMockdevIoctlData;
struct _GSource;

namespace needlelab::test {

/// Plugs the chip into the testbed and unplugs it. umockdev's own thread answers every ioctl of the host, and
/// a timer ends transfers without data. Call the public functions from the test's thread only.
///
/// The device's node is a kernel terminal, because a test can make it ready (flow on), not ready (flow off)
/// or broken (hung up). poll() then reports the same as for a real usbfs node.
class UsbPort {
 public:
  UsbPort(UsbTestbed& testbed, FtdiChip& chip, std::string serial);
  ~UsbPort();
  UsbPort(const UsbPort&) = delete;
  UsbPort& operator=(const UsbPort&) = delete;

  /// Appears under a new number, like a real device, and notifies udev. Does nothing if already plugged.
  void plug();
  /// Ends transfers in flight with −ESHUTDOWN and later calls with ENODEV; then notifies udev.
  void unplug();

  /// Claiming the interface fails with EBUSY, as if another program held it.
  void setBusy(bool busy);
  /// Permissions of the node, e.g. 0600; kept across replugs.
  void setMode(unsigned mode);
  /// A kernel driver holds the interface from the next plug on, until it is detached.
  void setKernelDriver(const std::string& name);
  [[nodiscard]] bool kernelDriverAttached();

  /// How many programs have the node open.
  [[nodiscard]] int openClients();
  /// Call after changing the device's state.
  void wake();

 private:
  struct Transfer {
    _UMockdevIoctlData* urb = nullptr;
    _UMockdevIoctlClient* client = nullptr;
  };
  /// A bulk transfer to the device whose caller waits in the ioctl.
  struct WaitingWrite {
    _UMockdevIoctlClient* client = nullptr;
    Bytes bytes;
    std::int64_t end_ns = 0;
  };
  struct Glue;  ///< C callbacks of umockdev and GLib

  void attach();
  void detach();
  bool handle(_UMockdevIoctlClient* client);
  bool submit(_UMockdevIoctlClient* client);
  void reap(_UMockdevIoctlClient* client);
  void discard(_UMockdevIoctlClient* client);
  void writeAndWait(_UMockdevIoctlClient* client);
  void control(const Transfer& transfer);
  void finish(const Transfer& transfer, int status, std::size_t actual);
  void pump();
  void armTimer(std::int64_t when_ns);
  void showReadiness();
  void forgetClient(_UMockdevIoctlClient* client);

  UsbTestbed& testbed_;
  FtdiChip& chip_;
  const std::string serial_;
  const int port_;
  std::mutex& mutex_;
  bool plugged_ = false;
  bool gone_ = false;  ///< unplugged while programs still have it open
  bool busy_ = false;
  unsigned mode_ = 0666;
  std::string kernel_driver_;
  bool driver_attached_ = false;
  std::string node_, node_file_, syspath_;
  int device_number_ = 0;
  int terminal_ = -1, terminal_other_end_ = -1;
  int timer_ = -1;
  bool ready_shown_ = false;
  _UMockdevIoctlBase* handler_ = nullptr;
  _GSource* timer_source_ = nullptr;
  std::vector<unsigned long> signals_;
  std::vector<_UMockdevIoctlClient*> clients_;
  _UMockdevIoctlClient* claimed_by_ = nullptr;
  std::deque<Transfer> in_, out_;  ///< in flight
  std::deque<Transfer> finished_;  ///< to be reaped
  std::deque<WaitingWrite> waiting_writes_;
};

/// What udev shows of the device: device and configuration descriptors, in hexadecimal digits.
std::string usbDescriptors();
/// The device's answer to GET_DESCRIPTOR; nothing: stalled.
std::optional<Bytes> usbDescriptor(std::uint16_t value, const std::string& serial);

}  // namespace needlelab::test
