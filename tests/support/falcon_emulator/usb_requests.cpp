// The usbfs ioctls and the transfers they start and end; the rest of UsbPort is in usb_port.cpp.
#include <sys/ioctl.h>

#include <fmt/core.h>
#include <linux/usbdevice_fs.h>
#include <umockdev.h>

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <limits>

#include "common/base/time/time_source.h"
#include "tests/support/falcon_emulator/usb_port.h"

namespace needlelab::test {
namespace {

constexpr std::uint8_t kIn = 0x81, kOut = 0x02;  // endpoints
// USB 2.0, FTDI's number for the Falcon, strings for maker, product and serial number
const Bytes kDevice{18, 1, 0, 2, 0, 0, 0, 8, 0x03, 0x04, 0x48, 0xcb, 0, 4, 1, 2, 3, 1};
// 32 bytes in total; one interface of vendor-specific class, bulk in and out of 64 bytes
const Bytes kConfiguration{9,    2, 32, 0, 1,   1, 0,  0xA0, 45, 9, 4, 0,    0, 2,  0xFF, 0xFF,
                           0xFF, 2, 7,  5, kIn, 2, 64, 0,    0,  7, 5, kOut, 2, 64, 0,    0};

usbdevfs_urb& urbOf(UMockdevIoctlData* data) {
  return *reinterpret_cast<usbdevfs_urb*>(data->data);
}

}  // namespace

std::string usbDescriptors() {
  std::string text;
  for (const Bytes* bytes : {&kDevice, &kConfiguration})
    for (const std::uint8_t byte : *bytes) text += fmt::format("{:02x}", byte);
  return text;
}

std::optional<Bytes> usbDescriptor(std::uint16_t value, const std::string& serial) {
  switch (value) {
    case 0x0100:
      return kDevice;
    case 0x0200:
      return kConfiguration;
    case 0x0300:
      return Bytes{4, 3, 0x09, 0x04};  // English
    case 0x0303: {
      Bytes bytes{static_cast<std::uint8_t>(2 + 2 * serial.size()), 3};
      for (const char c : serial) bytes.insert(bytes.end(), {static_cast<std::uint8_t>(c), 0});
      return bytes;
    }
    default:
      return std::nullopt;
  }
}

void UsbPort::finish(const Transfer& transfer, int status, std::size_t actual) {
  usbdevfs_urb& urb = urbOf(transfer.urb);
  urb.status = status;
  urb.actual_length = static_cast<int>(actual);
  finished_.push_back(transfer);
}

// ends all bulk transfers that can end now, then sleeps until the next one can
void UsbPort::pump() {
  if (gone_) return;
  const std::int64_t now_ns = machineTime().nowNs();
  while (!out_.empty()) {
    const usbdevfs_urb& urb = urbOf(out_.front().urb);
    const std::size_t size = static_cast<std::size_t>(urb.buffer_length);
    if (!chip_.out({static_cast<const std::uint8_t*>(urb.buffer), size}, now_ns)) break;
    finish(out_.front(), 0, size);
    out_.pop_front();
  }
  // after the earlier submissions
  while (out_.empty() && !waiting_writes_.empty()) {
    const WaitingWrite& call = waiting_writes_.front();
    const bool taken = chip_.out(call.bytes, now_ns);
    if (!taken && now_ns < call.end_ns) break;
    umockdev_ioctl_client_complete(call.client, taken ? static_cast<glong>(call.bytes.size()) : -1,
                                   taken ? 0 : ETIMEDOUT);
    waiting_writes_.pop_front();
  }
  while (!in_.empty()) {
    usbdevfs_urb& urb = urbOf(in_.front().urb);
    const auto data = chip_.in(static_cast<std::size_t>(urb.buffer_length), now_ns);
    if (!data) break;
    std::copy(data->begin(), data->end(), static_cast<std::uint8_t*>(urb.buffer));
    finish(in_.front(), 0, data->size());
    in_.pop_front();
  }
  showReadiness();
  std::int64_t next_ns = in_.empty() ? std::numeric_limits<std::int64_t>::max() : chip_.deadlineNs();
  if (!waiting_writes_.empty()) next_ns = std::min(next_ns, waiting_writes_.front().end_ns);
  armTimer(next_ns);
}

void UsbPort::control(const Transfer& transfer) {
  usbdevfs_urb& urb = urbOf(transfer.urb);
  auto* const bytes = static_cast<std::uint8_t*>(urb.buffer);
  const auto word = [bytes](int at) {
    return static_cast<std::uint16_t>(bytes[at] | static_cast<unsigned>(bytes[at + 1]) << 8);
  };
  constexpr std::uint8_t kVendorsOut = 0x40, kGetDescriptor = 6;
  std::optional<Bytes> reply;
  if (bytes[0] == kVendorsOut && chip_.control(bytes[1], word(2), word(4))) reply.emplace();
  if (bytes[0] == 0x80 && bytes[1] == kGetDescriptor) reply = usbDescriptor(word(2), serial_);
  if (!reply) return finish(transfer, -EPIPE, 0);
  const std::size_t size = std::min(reply->size(), static_cast<std::size_t>(urb.buffer_length - 8));
  std::copy_n(reply->begin(), size, bytes + 8);
  finish(transfer, 0, size);
}

bool UsbPort::submit(_UMockdevIoctlClient* client) {
  UMockdevIoctlData* const argument = umockdev_ioctl_client_get_arg(client);
  UMockdevIoctlData* const urb_data = umockdev_ioctl_data_resolve(argument, 0, sizeof(usbdevfs_urb), nullptr);
  if (urb_data == nullptr) return false;
  const usbdevfs_urb& urb = urbOf(urb_data);
  if (urb.buffer_length > 0) {
    UMockdevIoctlData* const buffer = umockdev_ioctl_data_resolve(
        urb_data, offsetof(usbdevfs_urb, buffer), static_cast<gsize>(urb.buffer_length), nullptr);
    if (buffer != nullptr) umockdev_ioctl_data_unref(buffer);  // the transfer owns it
  }
  const Transfer transfer{urb_data, client};
  int error = 0;
  if (urb.type == USBDEVFS_URB_TYPE_CONTROL && urb.buffer_length >= 8)
    control(transfer);
  else if (urb.type != USBDEVFS_URB_TYPE_BULK)
    error = EINVAL;
  else if (claimed_by_ != client)
    error = busy_ || claimed_by_ != nullptr ? EBUSY : EINVAL;  // stricter than the kernel, which claims it
  else if (urb.endpoint == kIn)
    in_.push_back(transfer);
  else if (urb.endpoint == kOut)
    out_.push_back(transfer);
  else
    error = ENOENT;
  if (error != 0) {
    umockdev_ioctl_data_unref(urb_data);
    umockdev_ioctl_client_complete(client, -1, error);
    return true;
  }
  umockdev_ioctl_client_complete(client, 0, 0);
  pump();
  return true;
}

void UsbPort::writeAndWait(_UMockdevIoctlClient* client) {
  UMockdevIoctlData* const call = umockdev_ioctl_data_resolve(umockdev_ioctl_client_get_arg(client), 0,
                                                              sizeof(usbdevfs_bulktransfer), nullptr);
  if (call == nullptr) {
    umockdev_ioctl_client_complete(client, -1, EFAULT);
    return;
  }
  const auto& asked = *reinterpret_cast<const usbdevfs_bulktransfer*>(call->data);
  UMockdevIoctlData* const data =
      umockdev_ioctl_data_resolve(call, offsetof(usbdevfs_bulktransfer, data), asked.len, nullptr);
  if (data == nullptr || claimed_by_ != client || asked.ep != kOut) {
    umockdev_ioctl_client_complete(client, -1, data == nullptr ? EFAULT : EINVAL);
  } else {
    waiting_writes_.push_back({client, Bytes(data->data, data->data + asked.len),
                               machineTime().nowNs() + 1'000'000 * static_cast<std::int64_t>(asked.timeout)});
    pump();
  }
  if (data != nullptr) umockdev_ioctl_data_unref(data);
  umockdev_ioctl_data_unref(call);
}

void UsbPort::reap(_UMockdevIoctlClient* client) {
  const auto done = std::find_if(finished_.begin(), finished_.end(),
                                 [client](const Transfer& one) { return one.client == client; });
  if (done != finished_.end()) {
    UMockdevIoctlData* const urb = done->urb;
    finished_.erase(done);
    UMockdevIoctlData* const pointer =
        umockdev_ioctl_data_resolve(umockdev_ioctl_client_get_arg(client), 0, sizeof(gpointer), nullptr);
    umockdev_ioctl_data_set_ptr(pointer, 0, urb);
    umockdev_ioctl_data_unref(pointer);
    umockdev_ioctl_data_unref(urb);
    umockdev_ioctl_client_complete(client, 0, 0);
    showReadiness();
    return;
  }
  const bool gone = gone_ || node_ != umockdev_ioctl_client_get_devnode(client);
  umockdev_ioctl_client_complete(client, -1, gone ? ENODEV : EAGAIN);
}

void UsbPort::discard(_UMockdevIoctlClient* client) {
  gulong address = 0;
  std::memcpy(&address, umockdev_ioctl_client_get_arg(client)->data, sizeof address);
  for (std::deque<Transfer>* queue : {&in_, &out_}) {
    const auto found = std::find_if(queue->begin(), queue->end(), [&](const Transfer& one) {
      return one.client == client && one.urb->client_addr == address;
    });
    if (found == queue->end()) continue;
    finish(*found, -ENOENT, 0);
    queue->erase(found);
    umockdev_ioctl_client_complete(client, 0, 0);
    pump();
    return;
  }
  umockdev_ioctl_client_complete(client, -1, EINVAL);
}

bool UsbPort::handle(_UMockdevIoctlClient* client) {
  const std::lock_guard lock(mutex_);
  const gulong request = umockdev_ioctl_client_get_request(client);
  UMockdevIoctlData* const argument = umockdev_ioctl_client_get_arg(client);
  const auto answer = [client](int error) {
    umockdev_ioctl_client_complete(client, error == 0 ? 0 : -1, error);
    return true;
  };
  // passes `size` bytes of the caller to `use`
  const auto with = [argument](std::size_t size, const auto& use) {
    UMockdevIoctlData* const data = umockdev_ioctl_data_resolve(argument, 0, size, nullptr);
    if (data == nullptr) return;
    use(data->data);
    umockdev_ioctl_data_unref(data);
  };

  // an unplugged device still returns transfers in flight; reaping never blocks here, because libusb does not
  // need that
  if (request == USBDEVFS_REAPURB || request == USBDEVFS_REAPURBNDELAY) {
    reap(client);
    return true;
  }
  if (gone_ || node_ != umockdev_ioctl_client_get_devnode(client)) return answer(ENODEV);

  switch (request) {
    case USBDEVFS_GET_CAPABILITIES:
      with(sizeof(guint32), [](guint8* data) {
        const guint32 abilities = USBDEVFS_CAP_ZERO_PACKET | USBDEVFS_CAP_NO_PACKET_SIZE_LIM |
                                  USBDEVFS_CAP_BULK_CONTINUATION | USBDEVFS_CAP_REAP_AFTER_DISCONNECT;
        std::memcpy(data, &abilities, sizeof abilities);
      });
      return answer(0);
    case USBDEVFS_CLAIMINTERFACE:
      if (busy_ || driver_attached_ || (claimed_by_ != nullptr && claimed_by_ != client))
        return answer(EBUSY);
      claimed_by_ = client;
      return answer(0);
    case USBDEVFS_RELEASEINTERFACE:
      if (claimed_by_ != client) return answer(EINVAL);
      claimed_by_ = nullptr;
      return answer(0);
    case USBDEVFS_GETDRIVER: {
      if (!driver_attached_) return answer(ENODATA);
      with(sizeof(usbdevfs_getdriver), [this](guint8* data) {
        auto* const asked = reinterpret_cast<usbdevfs_getdriver*>(data);
        std::strncpy(asked->driver, kernel_driver_.c_str(), sizeof asked->driver - 1);
      });
      return answer(0);
    }
    case USBDEVFS_IOCTL: {
      int code = 0;
      with(sizeof(usbdevfs_ioctl),
           [&code](guint8* data) { code = reinterpret_cast<usbdevfs_ioctl*>(data)->ioctl_code; });
      if (code == static_cast<int>(USBDEVFS_DISCONNECT)) {
        if (!driver_attached_) return answer(ENODATA);
        driver_attached_ = false;
        return answer(0);
      }
      if (code == static_cast<int>(USBDEVFS_CONNECT)) {
        if (kernel_driver_.empty() || driver_attached_ || claimed_by_ != nullptr) return answer(EBUSY);
        driver_attached_ = true;
        return answer(0);
      }
      return answer(ENOTTY);
    }
    case USBDEVFS_SUBMITURB:
      return submit(client);
    case USBDEVFS_DISCARDURB:
      discard(client);
      return true;
    case USBDEVFS_BULK:
      writeAndWait(client);
      return true;
    default:
      return answer(ENOTTY);
  }
}

// like the kernel when a node is closed: drops transfers in flight and releases claims
void UsbPort::forgetClient(_UMockdevIoctlClient* client) {
  const auto known = std::find(clients_.begin(), clients_.end(), client);
  if (known == clients_.end()) return;
  for (std::deque<Transfer>* queue : {&in_, &out_, &finished_}) {
    for (const Transfer& one : *queue)
      if (one.client == client) umockdev_ioctl_data_unref(one.urb);
    std::erase_if(*queue, [client](const Transfer& one) { return one.client == client; });
  }
  std::erase_if(waiting_writes_, [client](const WaitingWrite& one) { return one.client == client; });
  if (claimed_by_ == client) claimed_by_ = nullptr;
  clients_.erase(known);
  showReadiness();
}

}  // namespace needlelab::test
