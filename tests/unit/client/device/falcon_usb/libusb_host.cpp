#include "tests/unit/client/device/falcon_usb/libusb_host.h"

#include <stdexcept>

namespace needlelab::test {
namespace {

constexpr std::uint16_t kVendor = 0x0403, kProduct = 0xcb48;

bool isFalcon(libusb_device* device) {
  libusb_device_descriptor found{};
  return libusb_get_device_descriptor(device, &found) == 0 && found.idVendor == kVendor &&
         found.idProduct == kProduct;
}

}  // namespace

LibusbHost::LibusbHost() {
  if (libusb_init(&context_) != 0) throw std::runtime_error("libusb does not start");
}

LibusbHost::~LibusbHost() {
  close();
  libusb_exit(context_);
}

std::size_t LibusbHost::count() {
  libusb_device** list = nullptr;
  const ssize_t size = libusb_get_device_list(context_, &list);
  std::size_t falcons = 0;
  for (ssize_t i = 0; i < size; ++i) falcons += isFalcon(list[i]) ? 1 : 0;
  libusb_free_device_list(list, 1);
  return falcons;
}

int LibusbHost::open() {
  libusb_device** list = nullptr;
  const ssize_t size = libusb_get_device_list(context_, &list);
  int error = LIBUSB_ERROR_NO_DEVICE;
  for (ssize_t i = 0; i < size; ++i) {
    if (!isFalcon(list[i])) continue;
    error = libusb_open(list[i], &handle_);
    break;
  }
  libusb_free_device_list(list, 1);
  if (error != 0) return error;
  error = libusb_claim_interface(handle_, 0);
  if (error != 0) close();
  return error;
}

void LibusbHost::close() {
  if (handle_ == nullptr) return;
  libusb_release_interface(handle_, 0);
  libusb_close(handle_);
  handle_ = nullptr;
}

int LibusbHost::request(std::uint8_t number, std::uint16_t value, std::uint16_t index) {
  return libusb_control_transfer(handle_, 0x40, number, value, index, nullptr, 0, 60'000);
}

int LibusbHost::write(const Bytes& data) {
  int sent = 0;
  Bytes copy = data;
  const int error =
      libusb_bulk_transfer(handle_, 0x02, copy.data(), static_cast<int>(copy.size()), &sent, 60'000);
  return error != 0 ? error : sent;
}

Bytes LibusbHost::read(std::size_t count, std::chrono::milliseconds patience) {
  Bytes payload;
  const TimePoint end = Clock::now() + patience;
  while (payload.size() < count && Clock::now() < end) {
    std::array<std::uint8_t, 64> packet{};
    int size = 0;
    const int error = libusb_bulk_transfer(handle_, 0x81, packet.data(), 64, &size, 100);
    if (error != 0 && error != LIBUSB_ERROR_TIMEOUT) break;
    for (int i = 2; i < size; ++i) payload.push_back(packet[static_cast<std::size_t>(i)]);
  }
  return payload;
}

void LibusbHost::settingsForFirmware() {
  request(9, 1);     // latency 1 ms
  request(3, 2);     // 3 MHz / 2: nearest to 1456312
  request(4, 8);     // 8N1
  request(2, 0, 0);  // no flow control
}

void LibusbHost::settingsForBootloader() {
  request(0, 1);  // purge
  request(0, 2);
  request(9, 16);      // latency 16 ms
  request(3, 0x4138);  // 3 MHz / 312.5
  request(4, 8);       // 8N1
  request(2, 0, 0);    // no flow control
  request(1, 0x0200);  // RTS low
  request(1, 0x0100);  // DTR low
  request(1, 0x0101);  // DTR high
}

Bytes packetOf(const std::array<int, 3>& values, unsigned bits) {
  Bytes packet{'<'};
  for (const int value : values)
    for (const unsigned shift : {0u, 4u, 8u, 12u})
      packet.push_back(static_cast<std::uint8_t>(0x41 + ((static_cast<unsigned>(value) >> shift) & 15u)));
  packet.push_back(static_cast<std::uint8_t>(0x41 + bits));
  packet.push_back(0x41);
  packet.push_back('>');
  return packet;
}

std::optional<Answer> answerOf(const Bytes& packet) {
  if (packet.size() != 16 || packet.front() != '<' || packet.back() != '>') return std::nullopt;
  Answer answer;
  for (std::size_t i = 0; i < 3; ++i) {
    unsigned raw = 0;
    for (std::size_t k = 0; k < 4; ++k) raw |= static_cast<unsigned>(packet[1 + 4 * i + k] - 0x41) << (4 * k);
    answer.values[i] = static_cast<std::int16_t>(raw);
  }
  answer.bits = static_cast<unsigned>(packet[13] - 0x41);
  return answer;
}

}  // namespace needlelab::test
