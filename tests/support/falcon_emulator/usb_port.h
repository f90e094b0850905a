/// A socket for an emulated USB device; reimplements the kernel's usbfs.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <mutex>
#include <string>
#include <vector>

#include "tests/support/falcon_emulator/usb_peripheral.h"
#include "tests/support/falcon_emulator/usb_testbed.h"

struct _UMockdevIoctlBase;
struct _UMockdevIoctlClient;
struct _UMockdevIoctlData;
struct _GSource;

namespace needlelab::test {

/// The host's actions, for tests.
struct UsbCounts {
  std::uint64_t ioctls = 0, in_transfers = 0, out_transfers = 0, control_transfers = 0, discarded = 0;
};

/// Plugs `peripheral` into the testbed and unplugs it. umockdev's own thread answers every ioctl of the host
/// and ends transfers by a timer. Call the public functions from the test's thread only.
///
/// The device's node is a kernel terminal, because a test can make it ready (flow on), not ready (flow off)
/// or broken (hung up). poll() then reports the same as for a real usbfs node.
class UsbPort {
 public:
  UsbPort(UsbTestbed& testbed, UsbPeripheral& peripheral);
  ~UsbPort();
  UsbPort(const UsbPort&) = delete;
  UsbPort& operator=(const UsbPort&) = delete;

  /// Appears under a new number, as a real device does, and notifies udev. Does nothing when already plugged.
  void plug();
  /// Ends transfers in flight with −ESHUTDOWN and later calls with ENODEV; then notifies udev.
  void unplug();
  [[nodiscard]] bool plugged() const { return plugged_; }
  /// e.g. "/dev/bus/usb/001/002"; of the last plug().
  [[nodiscard]] const std::string& node() const { return node_; }

  /// Claiming the interface fails with EBUSY, as when another program holds it.
  void setBusy(bool busy);
  /// Rights of the node, e.g. 0600; held through replugs.
  void setMode(unsigned mode);
  /// A kernel driver holds the interface from the next plug on, until it is detached.
  void setKernelDriver(const std::string& name);
  [[nodiscard]] bool kernelDriverAttached();

  [[nodiscard]] UsbCounts counts();
  /// How many programs have the node open, and how many transfers are in flight.
  [[nodiscard]] int openClients();
  [[nodiscard]] int transfersInFlight();

  /// For the peripheral's owner: the port's lock, and a notification after a change of its state.
  [[nodiscard]] std::mutex& mutex() { return mutex_; }
  void wake();

 private:
  struct Transfer {
    _UMockdevIoctlData* urb = nullptr;
    _UMockdevIoctlClient* client = nullptr;
  };
  /// A bulk transfer to the device for which its caller waits in the ioctl.
  struct WaitingWrite {
    _UMockdevIoctlClient* client = nullptr;
    Bytes bytes;
    TimePoint end;
  };
  struct Glue;  ///< C callbacks of umockdev and GLib

  void attach();
  void detach();
  bool handle(_UMockdevIoctlClient* client);
  bool submit(_UMockdevIoctlClient* client);
  void reap(_UMockdevIoctlClient* client);
  void discard(_UMockdevIoctlClient* client);
  void writeAndWait(_UMockdevIoctlClient* client);
  bool controlNow(Transfer& transfer, TimePoint now);
  void finish(const Transfer& transfer, int status, std::size_t actual);
  void pump();
  void armTimer(TimePoint when);
  void showReadiness();
  void forgetClient(_UMockdevIoctlClient* client);

  UsbTestbed& testbed_;
  UsbPeripheral& peripheral_;
  const int port_;
  std::mutex mutex_;
  bool plugged_ = false;
  bool gone_ = false;  ///< unplugged, while programs still have it open
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
  UsbCounts counts_;
};

/// Descriptors of `identity`, as the device itself gives them: one interface, bulk in and out of 64 bytes.
Bytes deviceDescriptor(const UsbIdentity& identity);
Bytes configurationDescriptor(const UsbIdentity& identity);
/// Answers GET_DESCRIPTOR and the like; nothing: stalled.
std::optional<Bytes> standardRequest(const UsbIdentity& identity, const UsbSetup& setup);

}  // namespace needlelab::test
