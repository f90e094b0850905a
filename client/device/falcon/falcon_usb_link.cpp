#include "client/device/falcon/falcon_usb_link.h"

#include <poll.h>
#include <sys/ioctl.h>
#include <time.h>

#include <linux/usbdevice_fs.h>

#include <algorithm>
#include <cerrno>

#include "client/device/falcon/falcon_geometry.h"
#include "client/device/last_word.h"
#include "common/base/clock.h"

namespace needlelab::falcon {
namespace {

constexpr int kInterface = 0;
constexpr std::uint8_t kVendorRequest = 0x40;  // out, vendor, to the device
constexpr unsigned kWriteTimeout_ms = 100;
constexpr int kMostFailuresInARow = 10;
constexpr std::int64_t kLastTransfers_ns = 1'000'000'000;

// lights out, zero torque; made before anything can crash
Packet no_force = encodeCommand({});

// In a signal's handler, past libusb, whose state may be broken: the kernel sends it behind whatever is under
// way to the device, and waits until the device has it.
bool sayNoForce(int file) noexcept {
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

}  // namespace

Error usbError(const std::string& doing, int code) {
  const std::string what = doing + ": ";
  switch (code) {
    case LIBUSB_ERROR_ACCESS:
      return {ErrorCode::kDenied,
              what +
                  "this user may not use it; run sudo deploy/realtime USER (it installs the udev rule for "
                  "0403:cb48), log in again, unplug the Falcon and plug it in again"};
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

UsbLink::UsbLink(libusb_context* context, libusb_device_handle* handle)
    : context_(context), handle_(handle) {}

Result<std::unique_ptr<FalconLink>> UsbLink::claim(libusb_context* context, libusb_device_handle* handle) {
  std::unique_ptr<UsbLink> link(new UsbLink(context, handle));
  // 1: one holds it. An error means that it cannot be known: the claim will tell
  if (libusb_kernel_driver_active(handle, kInterface) == 1) {
    const int code = libusb_detach_kernel_driver(handle, kInterface);
    if (code != 0 && code != LIBUSB_ERROR_NOT_FOUND)
      return usbError("Falcon: taking it from the kernel's serial driver", code);
    link->had_kernel_driver_ = code == 0;
  }
  if (const int code = libusb_claim_interface(handle, kInterface); code != 0)
    return usbError("Falcon: claiming it", code);
  link->claimed_ = true;

  // all transfers are made now: none can fail to be there later
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

Status UsbLink::said(const std::string& doing, int code) {
  if (code == LIBUSB_ERROR_NO_DEVICE) lost_ = true;
  return usbError("Falcon: " + doing, code);
}

Status UsbLink::control(std::uint8_t request, std::uint16_t value, std::uint16_t index) {
  constexpr unsigned kTimeout_ms = 500;
  const int code =
      libusb_control_transfer(handle_, kVendorRequest, request, value, index, nullptr, 0, kTimeout_ms);
  return code >= 0 ? Status() : said("setting its serial line", code);
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
    if (code != 0) return said("writing to it", code);
    if (sent <= 0) return said("writing to it", LIBUSB_ERROR_TIMEOUT);
  }
  return {};
}

Result<std::size_t> UsbLink::read(std::span<std::uint8_t> buffer, std::chrono::milliseconds timeout) {
  int got = 0;
  const int code = libusb_bulk_transfer(handle_, kIn, buffer.data(), static_cast<int>(buffer.size()), &got,
                                        static_cast<unsigned>(std::max<std::int64_t>(1, timeout.count())));
  if (code != 0 && code != LIBUSB_ERROR_TIMEOUT) return said("reading from it", code).error();
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
                               steadyNowNs());
      break;
    case LIBUSB_TRANSFER_CANCELLED:
      return;
    case LIBUSB_TRANSFER_NO_DEVICE:
      link.lost_ = true;
      return;
    default:
      if (++link.failures_in_a_row_ >= kMostFailuresInARow) link.lost_ = true;
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
  offerToSayZero();
  if (!lost_) return {};
  stopStream();
  return said("starting to read", LIBUSB_ERROR_NO_DEVICE);
}

void UsbLink::offerToSayZero() const noexcept {
  // libusb waits on usbfs for "can be written", on its own files for "can be read"; this is the one device
  // that it has open
  const auto device = std::find_if(files_.begin(), files_.end(),
                                   [](const pollfd& file) { return (file.events & POLLOUT) != 0; });
  if (device != files_.end()) offerLastWord(&sayNoForce, device->fd);
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
  // libusb waits in whole milliseconds: too coarse for a period of one
  constexpr std::int64_t kRest_ns = 100'000;
  const std::uint64_t before = happened_;
  for (;;) {
    handleEvents(0);
    const std::int64_t left_ns = until_ns - steadyNowNs();
    if (happened_ != before || lost_ || left_ns <= 0) return;
    const timespec left = asTimespec(left_ns);
    for (pollfd& file : files_) file.revents = 0;
    const int ready = ::ppoll(files_.data(), files_.size(), &left, nullptr);
    if (ready <= 0) continue;
    handleEvents(0);
    if (happened_ != before || lost_) return;
    // a file that is ready for nothing, as an emulated device's, must not make this thread spin
    const timespec rest = asTimespec(std::min(kRest_ns, std::max<std::int64_t>(0, until_ns - steadyNowNs())));
    static_cast<void>(::nanosleep(&rest, nullptr));
  }
}

bool UsbLink::anythingPending() const noexcept {
  return write_pending_ ||
         std::any_of(reads_.begin(), reads_.end(), [](const Read& read) { return read.pending; });
}

void UsbLink::stopStream() noexcept {
  stopping_ = true;
  withdrawLastWord();
  for (const Read& read : reads_)
    if (read.pending) static_cast<void>(libusb_cancel_transfer(read.transfer));
  if (write_pending_) static_cast<void>(libusb_cancel_transfer(write_));
  // a transfer may be freed only when it has ended
  const std::int64_t end_ns = steadyNowNs() + kLastTransfers_ns;
  while (anythingPending() && steadyNowNs() < end_ns) handleEvents(10'000);
  listener_ = nullptr;
}

}  // namespace needlelab::falcon
