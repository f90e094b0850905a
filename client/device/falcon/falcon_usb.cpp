// Falcons on this computer's USB, through libusb.

#include <fmt/core.h>
#include <libusb.h>
#include <linux/usbdevice_fs.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <time.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "client/device/device.h"
#include "client/device/falcon/falcon_geometry.h"
#include "client/device/falcon/falcon_link.h"
#include "common/base/time/time_source.h"

namespace needlelab::falcon {
namespace {

// Message for a libusb error code, with advice. `doing` is the step that failed.
Error usbError(const std::string& doing, int code);

/// Interface 0 of an opened device, claimed. Returns it to an earlier kernel driver (ftdi_sio) at the end.
class UsbLink final : public FalconLink {
 public:
  /// Owns `handle` from now on, also on failure.
  static Result<std::unique_ptr<FalconLink>> claim(libusb_context* context, libusb_device_handle* handle,
                                                   TimeSource& time);
  ~UsbLink() override;
  UsbLink(const UsbLink&) = delete;
  UsbLink& operator=(const UsbLink&) = delete;

  Status control(std::uint8_t request, std::uint16_t value, std::uint16_t index) override;
  Status write(std::span<const std::uint8_t> bytes, std::chrono::milliseconds timeout) override;
  Result<std::size_t> read(std::span<std::uint8_t> buffer, std::chrono::milliseconds timeout) override;

  Status startStream(LinkListener& listener) override;
  bool send(const Packet& packet) noexcept override;
  void wait(std::int64_t until_ns) noexcept override;
  [[nodiscard]] bool lost() const noexcept override { return lost_; }
  void stopStream() noexcept override;

 private:
  static constexpr std::uint8_t kOut = 0x02, kIn = 0x81;
  static constexpr std::size_t kReads =
      4;  // pending at a time, so that none is missed while one is processed

  struct Read {
    UsbLink* link = nullptr;
    libusb_transfer* transfer = nullptr;
    std::array<std::uint8_t, kUsbPacketBytes> buffer{};
    bool pending = false;
  };

  UsbLink(libusb_context* context, libusb_device_handle* handle, TimeSource& time);
  static void onReadEnd(libusb_transfer* transfer);
  static void onWriteEnd(libusb_transfer* transfer);
  void submit(Read& read) noexcept;
  [[nodiscard]] bool anythingPending() const noexcept;
  void handleEvents(long microseconds) noexcept;
  void registerForCrash() const noexcept;
  Status failure(const std::string& doing, int code);

  libusb_context* context_;
  libusb_device_handle* handle_;
  TimeSource& time_;
  LinkListener* listener_ = nullptr;
  bool claimed_ = false, had_kernel_driver_ = false;
  bool lost_ = false, stopping_ = false;
  std::array<Read, kReads> reads_;
  libusb_transfer* write_ = nullptr;
  Packet write_buffer_{};
  bool write_pending_ = false;
  int failures_in_a_row_ = 0;
  std::uint64_t happened_ = 0;  // transfers that ended
  std::vector<pollfd> files_;   // the files that libusb waits for
};

constexpr int kInterface = 0;
constexpr std::uint8_t kVendorRequest = 0x40;  // out, vendor, to the device
constexpr unsigned kWriteTimeout_ms = 100;
constexpr int kMaxFailuresInARow = 10;
constexpr std::int64_t kLastTransfers_ns = 1'000'000'000;

// zero torque with lights off; built before anything can crash
Packet no_force = encodeCommand({});

// Runs in a signal handler and bypasses libusb, whose state may be corrupt: the kernel sends the packet after
// the pending transfers, and waits until the device has it.
bool sendNoForce(int file) noexcept {
  constexpr unsigned kEndpoint = 0x02, kTimeout_ms = 50;
  usbdevfs_bulktransfer transfer{kEndpoint, kPacketBytes, kTimeout_ms, no_force.data()};
  int sent = -1;
  for (int tries = 0; tries < 2 && sent < 0; ++tries) {
    sent = ::ioctl(file, USBDEVFS_BULK, &transfer);
    if (sent < 0 && errno != EINTR) break;
  }
  return sent == static_cast<int>(kPacketBytes);
}

timespec asTimespec(std::int64_t ns) {
  return {static_cast<std::time_t>(ns / 1'000'000'000), static_cast<long>(ns % 1'000'000'000)};
}

Error usbError(const std::string& doing, int code) {
  const std::string what = doing + ": ";
  switch (code) {
    case LIBUSB_ERROR_ACCESS:
      return {
          ErrorCode::kDenied,
          what +
              "this user may not use it; run sudo usermod -aG needlelab USER, log in again, unplug the Falcon and "
              "plug it in again (without that group see BRINGUP.md, step 2: a udev rule for 0403:cb48)"};
    case LIBUSB_ERROR_BUSY:
      return {
          ErrorCode::kUnavailable,
          what +
              "another program uses it; end that program (another station, a maker's tool), then try again"};
    case LIBUSB_ERROR_NO_DEVICE:
    case LIBUSB_ERROR_NOT_FOUND:
      return {ErrorCode::kUnavailable, what + "it was unplugged; plug in its USB and its power supply"};
    case LIBUSB_ERROR_TIMEOUT:
      return {ErrorCode::kUnavailable, what + "it does not answer; check its power supply"};
    default:
      return {ErrorCode::kUnavailable,
              what + libusb_strerror(code) + " (" + libusb_error_name(code) +
                  "); unplug it and plug it in again, at another port if that does not "
                  "help"};
  }
}

UsbLink::UsbLink(libusb_context* context, libusb_device_handle* handle, TimeSource& time)
    : context_(context), handle_(handle), time_(time) {}

Result<std::unique_ptr<FalconLink>> UsbLink::claim(libusb_context* context, libusb_device_handle* handle,
                                                   TimeSource& time) {
  std::unique_ptr<UsbLink> link(new UsbLink(context, handle, time));
  // 1: a kernel driver holds it. After an error the claim below decides
  if (libusb_kernel_driver_active(handle, kInterface) == 1) {
    const int code = libusb_detach_kernel_driver(handle, kInterface);
    if (code != 0 && code != LIBUSB_ERROR_NOT_FOUND)
      return usbError("Falcon: taking it from the kernel's serial driver", code);
    link->had_kernel_driver_ = code == 0;
  }
  if (const int code = libusb_claim_interface(handle, kInterface); code != 0)
    return usbError("Falcon: claiming it", code);
  link->claimed_ = true;

  // allocate all transfers now, so that no later allocation can fail
  link->write_ = libusb_alloc_transfer(0);
  bool made = link->write_ != nullptr;
  for (Read& read : link->reads_) {
    read.link = link.get();
    read.transfer = libusb_alloc_transfer(0);
    made = made && read.transfer != nullptr;
  }
  if (!made) return usbError("Falcon: making transfers", LIBUSB_ERROR_NO_MEM);
  return std::unique_ptr<FalconLink>(std::move(link));
}

UsbLink::~UsbLink() {
  stopStream();
  if (claimed_) static_cast<void>(libusb_release_interface(handle_, kInterface));
  if (had_kernel_driver_ && !lost_) static_cast<void>(libusb_attach_kernel_driver(handle_, kInterface));
  libusb_close(handle_);
  libusb_free_transfer(write_);
  for (const Read& read : reads_) libusb_free_transfer(read.transfer);
}

Status UsbLink::failure(const std::string& doing, int code) {
  if (code == LIBUSB_ERROR_NO_DEVICE) lost_ = true;
  return usbError("Falcon: " + doing, code);
}

Status UsbLink::control(std::uint8_t request, std::uint16_t value, std::uint16_t index) {
  constexpr unsigned kTimeout_ms = 500;
  const int code =
      libusb_control_transfer(handle_, kVendorRequest, request, value, index, nullptr, 0, kTimeout_ms);
  return code >= 0 ? Status() : failure("setting its serial line", code);
}

Status UsbLink::write(std::span<const std::uint8_t> bytes, std::chrono::milliseconds timeout) {
  std::vector<std::uint8_t> copy(bytes.begin(), bytes.end());
  std::size_t done = 0;
  while (done < copy.size()) {
    int sent = 0;
    const int code =
        libusb_bulk_transfer(handle_, kOut, copy.data() + done, static_cast<int>(copy.size() - done), &sent,
                             static_cast<unsigned>(timeout.count()));
    done += static_cast<std::size_t>(std::max(0, sent));
    if (code != 0) return failure("writing to it", code);
    if (sent <= 0) return failure("writing to it", LIBUSB_ERROR_TIMEOUT);
  }
  return {};
}

Result<std::size_t> UsbLink::read(std::span<std::uint8_t> buffer, std::chrono::milliseconds timeout) {
  int got = 0;
  const int code = libusb_bulk_transfer(handle_, kIn, buffer.data(), static_cast<int>(buffer.size()), &got,
                                        static_cast<unsigned>(std::max<std::int64_t>(1, timeout.count())));
  if (code != 0 && code != LIBUSB_ERROR_TIMEOUT) return failure("reading from it", code).error();
  return static_cast<std::size_t>(std::max(0, got));
}

void UsbLink::submit(Read& read) noexcept {
  libusb_fill_bulk_transfer(read.transfer, handle_, kIn, read.buffer.data(),
                            static_cast<int>(read.buffer.size()), &UsbLink::onReadEnd, &read, 0);
  read.pending = libusb_submit_transfer(read.transfer) == 0;
  if (!read.pending) lost_ = true;
}

void UsbLink::onReadEnd(libusb_transfer* transfer) {
  Read& read = *static_cast<Read*>(transfer->user_data);
  UsbLink& link = *read.link;
  read.pending = false;
  ++link.happened_;
  switch (transfer->status) {
    case LIBUSB_TRANSFER_COMPLETED:
      link.failures_in_a_row_ = 0;
      if (link.listener_ != nullptr && transfer->actual_length > 0)
        link.listener_->onRead({read.buffer.data(), static_cast<std::size_t>(transfer->actual_length)},
                               link.time_.nowNs());
      break;
    case LIBUSB_TRANSFER_CANCELLED:
      return;
    case LIBUSB_TRANSFER_NO_DEVICE:
      link.lost_ = true;
      return;
    default:
      if (++link.failures_in_a_row_ >= kMaxFailuresInARow) link.lost_ = true;
  }
  if (!link.lost_ && !link.stopping_) link.submit(read);
}

void UsbLink::onWriteEnd(libusb_transfer* transfer) {
  UsbLink& link = *static_cast<UsbLink*>(transfer->user_data);
  link.write_pending_ = false;
  ++link.happened_;
  const bool done = transfer->status == LIBUSB_TRANSFER_COMPLETED &&
                    transfer->actual_length == static_cast<int>(kPacketBytes);
  if (transfer->status == LIBUSB_TRANSFER_NO_DEVICE) link.lost_ = true;
  if (link.listener_ != nullptr) link.listener_->onSent(done);
}

Status UsbLink::startStream(LinkListener& listener) {
  listener_ = &listener;
  stopping_ = false;
  failures_in_a_row_ = 0;
  files_.clear();
  const libusb_pollfd** const list = libusb_get_pollfds(context_);
  for (std::size_t i = 0; list != nullptr && list[i] != nullptr; ++i)
    files_.push_back({list[i]->fd, list[i]->events, 0});
  libusb_free_pollfds(list);
  for (Read& read : reads_) submit(read);
  registerForCrash();
  if (!lost_) return {};
  stopStream();
  return failure("starting to read", LIBUSB_ERROR_NO_DEVICE);
}

void UsbLink::registerForCrash() const noexcept {
  // libusb waits on usbfs for "can be written", on its own files for "can be read"; this is the one device
  // that it has open
  const auto device = std::find_if(files_.begin(), files_.end(),
                                   [](const pollfd& file) { return (file.events & POLLOUT) != 0; });
  if (device != files_.end()) registerCrashPacket(&sendNoForce, device->fd);
}

bool UsbLink::send(const Packet& packet) noexcept {
  if (write_pending_ || lost_ || stopping_) return false;
  write_buffer_ = packet;
  libusb_fill_bulk_transfer(write_, handle_, kOut, write_buffer_.data(), static_cast<int>(kPacketBytes),
                            &UsbLink::onWriteEnd, this, kWriteTimeout_ms);
  write_pending_ = libusb_submit_transfer(write_) == 0;
  if (!write_pending_) lost_ = true;
  return write_pending_;
}

void UsbLink::handleEvents(long microseconds) noexcept {
  timeval wait{0, microseconds};
  const int code = libusb_handle_events_timeout_completed(context_, &wait, nullptr);
  if (code == LIBUSB_ERROR_NO_DEVICE) lost_ = true;
}

void UsbLink::wait(std::int64_t until_ns) noexcept {
  // libusb waits in whole milliseconds: too coarse for a period of 1 ms
  constexpr std::int64_t kRest_ns = 100'000;
  const std::uint64_t before = happened_;
  for (;;) {
    handleEvents(0);
    const std::int64_t left_ns = until_ns - time_.nowNs();
    if (happened_ != before || lost_ || left_ns <= 0) return;
    const timespec left = asTimespec(left_ns);
    for (pollfd& file : files_) file.revents = 0;
    const int ready = ::ppoll(files_.data(), files_.size(), &left, nullptr);
    if (ready <= 0) continue;
    handleEvents(0);
    if (happened_ != before || lost_) return;
    // a file with a meaningless ready state, such as an emulated device's, must not make this thread spin
    time_.sleepUntilNs(std::min(until_ns, time_.nowNs() + kRest_ns));
  }
}

bool UsbLink::anythingPending() const noexcept {
  return write_pending_ ||
         std::any_of(reads_.begin(), reads_.end(), [](const Read& read) { return read.pending; });
}

void UsbLink::stopStream() noexcept {
  stopping_ = true;
  unregisterCrashPacket();
  for (const Read& read : reads_)
    if (read.pending) static_cast<void>(libusb_cancel_transfer(read.transfer));
  if (write_pending_) static_cast<void>(libusb_cancel_transfer(write_));
  // a transfer may be freed only after its end
  const std::int64_t end_ns = time_.nowNs() + kLastTransfers_ns;
  while (anythingPending() && time_.nowNs() < end_ns) handleEvents(10'000);
  listener_ = nullptr;
}

using DevicePtr = std::unique_ptr<libusb_device, decltype(&libusb_unref_device)>;

std::string busPath(libusb_device* device) {
  std::array<std::uint8_t, 8> ports{};
  const int count = libusb_get_port_numbers(device, ports.data(), static_cast<int>(ports.size()));
  std::string path = fmt::format("{}-", libusb_get_bus_number(device));
  if (count <= 0) return fmt::format("{}{}", path, libusb_get_device_address(device));
  for (int i = 0; i < count; ++i)
    path += fmt::format("{}{}", i > 0 ? "." : "", ports[static_cast<std::size_t>(i)]);
  return path;
}

// empty when the device has none or it cannot be read
std::string serialOf(libusb_device* device, libusb_device_handle* handle) {
  libusb_device_descriptor descriptor{};
  if (libusb_get_device_descriptor(device, &descriptor) != 0 || descriptor.iSerialNumber == 0) return {};
  std::array<unsigned char, 128> text{};
  const int length = libusb_get_string_descriptor_ascii(handle, descriptor.iSerialNumber, text.data(),
                                                        static_cast<int>(text.size()));
  return length > 0 ? std::string(text.begin(), text.begin() + length) : std::string();
}

class UsbBus final : public FalconBus {
 public:
  explicit UsbBus(TimeSource& time) : time_(time) {}
  ~UsbBus() override {
    if (context_ == nullptr) return;
    if (watching_) libusb_hotplug_deregister_callback(context_, watch_);
    libusb_exit(context_);
  }

  Result<std::vector<FoundDevice>> list() override {
    RETURN_IF_ERROR(start());
    auto devices = falcons();
    if (!devices.ok()) return devices.error();
    std::vector<FoundDevice> found;
    for (const DevicePtr& device : *devices) found.push_back(describe(device.get(), devices->size() == 1));
    return found;
  }

  Result<std::unique_ptr<FalconLink>> open(const std::string& which) override {
    RETURN_IF_ERROR(start());
    ASSIGN_OR_RETURN(auto devices, falcons());
    if (devices.empty()) return notFound("no Falcon is plugged in");
    if (which.empty() && devices.size() > 1) {
      std::string all;
      for (const DevicePtr& device : devices)
        all += (all.empty() ? "falcon@" : ", falcon@") + busPath(device.get());
      return Error{ErrorCode::kInvalidInput,
                   fmt::format("there are {} Falcons; name one of them: {}", devices.size(), all)};
    }
    std::string refused;
    for (const DevicePtr& device : devices) {
      const bool by_path = busPath(device.get()) == which;
      libusb_device_handle* handle = nullptr;
      if (const int code = libusb_open(device.get(), &handle); code != 0) {
        if (which.empty() || by_path) return usbError("Falcon at " + busPath(device.get()), code);
        // its serial number cannot be read
        refused += "; " + usbError("the one at " + busPath(device.get()), code).message;
        continue;
      }
      if (which.empty() || by_path || serialOf(device.get(), handle) == which)
        return UsbLink::claim(context_, handle, time_);
      libusb_close(handle);
    }
    return notFound("no Falcon has the serial number or the bus path '" + which +
                    "' (--list-devices shows those that there are)" + refused);
  }

  void waitForArrival(std::int64_t until_ns) noexcept override {
    while (context_ != nullptr && !arrived_.exchange(false)) {
      const std::int64_t left_ns = until_ns - time_.nowNs();
      if (left_ns <= 0) return;
      constexpr std::int64_t kMax_ns = 50'000'000;
      timeval wait{0, static_cast<suseconds_t>(std::min(left_ns, kMax_ns) / 1000)};
      // an immediate error must not make a high-priority thread spin
      if (libusb_handle_events_timeout_completed(context_, &wait, nullptr) != 0) time_.sleepForNs(10'000'000);
    }
  }

 private:
  Status start() {
    if (context_ != nullptr) return {};
    if (const int code = libusb_init(&context_); code != 0) {
      context_ = nullptr;
      return Error{ErrorCode::kUnavailable, std::string("Falcon: USB cannot be used on this computer: ") +
                                                libusb_strerror(code) + " (" + libusb_error_name(code) + ")"};
    }
    // without hotplug, poll the list: slower, but it works
    if (libusb_has_capability(LIBUSB_CAP_HAS_HOTPLUG) != 0)
      watching_ = libusb_hotplug_register_callback(
                      context_, LIBUSB_HOTPLUG_EVENT_DEVICE_ARRIVED, LIBUSB_HOTPLUG_NO_FLAGS, kUsbVendor,
                      kUsbProduct, LIBUSB_HOTPLUG_MATCH_ANY, &UsbBus::onArrival, this, &watch_) == 0;
    return {};
  }

  static int onArrival(libusb_context* /*context*/, libusb_device* /*device*/, libusb_hotplug_event /*event*/,
                       void* user) {
    static_cast<UsbBus*>(user)->arrived_.store(true);
    return 0;
  }

  Result<std::vector<DevicePtr>> falcons() {
    libusb_device** all = nullptr;
    const ssize_t count = libusb_get_device_list(context_, &all);
    if (count < 0) return usbError("Falcon: looking through the USB devices", static_cast<int>(count));
    std::vector<DevicePtr> found;
    for (ssize_t i = 0; i < count; ++i) {
      libusb_device_descriptor descriptor{};
      if (libusb_get_device_descriptor(all[i], &descriptor) == 0 && descriptor.idVendor == kUsbVendor &&
          descriptor.idProduct == kUsbProduct)
        found.emplace_back(libusb_ref_device(all[i]), &libusb_unref_device);
    }
    libusb_free_device_list(all, 1);
    std::sort(found.begin(), found.end(),
              [](const DevicePtr& a, const DevicePtr& b) { return busPath(a.get()) < busPath(b.get()); });
    return found;
  }

  FoundDevice describe(libusb_device* device, bool only) {
    const std::string path = busPath(device);
    FoundDevice found{only ? "falcon" : "falcon@" + path, "Novint Falcon at USB " + path, "", false};
    libusb_device_handle* handle = nullptr;
    if (const int code = libusb_open(device, &handle); code != 0) {
      found.state = usbError("opening it", code).message;
      return found;
    }
    if (const std::string serial = serialOf(device, handle); !serial.empty())
      found.name += ", serial " + serial;
    // a program that uses it has claimed it; a kernel driver would give way
    if (libusb_kernel_driver_active(handle, 0) != 1) {
      const int code = libusb_claim_interface(handle, 0);
      if (code != 0)
        found.state = usbError("claiming it", code).message;
      else
        static_cast<void>(libusb_release_interface(handle, 0));
    }
    libusb_close(handle);
    found.ready = found.state.empty();
    return found;
  }

  static Error notFound(const std::string& what) {
    return {ErrorCode::kNotFound, what + "; plug in its USB cable and its power supply"};
  }

  TimeSource& time_;
  libusb_context* context_ = nullptr;
  libusb_hotplug_callback_handle watch_ = 0;
  bool watching_ = false;
  std::atomic<bool> arrived_{false};
};

}  // namespace

std::unique_ptr<FalconBus> makeUsbBus(TimeSource& time) {
  return std::make_unique<UsbBus>(time);
}

}  // namespace needlelab::falcon
