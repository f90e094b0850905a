/// A Falcon opened through libusb. Used by falcon_usb.cpp alone.
#pragma once

#include <libusb.h>
#include <poll.h>

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "client/device/falcon/falcon_link.h"

namespace needlelab::falcon {

/// Words for a libusb error code, with what to do. `doing` says what was tried.
Error usbError(const std::string& doing, int code);

/// Interface 0 of an opened device, claimed. A kernel driver that held it (ftdi_sio) gets it back at the end.
class UsbLink final : public FalconLink {
 public:
  /// Takes `handle` over, whatever comes of it.
  static Result<std::unique_ptr<FalconLink>> claim(libusb_context* context, libusb_device_handle* handle);
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
  static constexpr std::size_t kReads = 4;  // pending at a time: none is missed while one is handed on

  struct Read {
    UsbLink* link = nullptr;
    libusb_transfer* transfer = nullptr;
    std::array<std::uint8_t, kUsbPacketBytes> buffer{};
    bool pending = false;
  };

  UsbLink(libusb_context* context, libusb_device_handle* handle);
  static void onReadEnd(libusb_transfer* transfer);
  static void onWriteEnd(libusb_transfer* transfer);
  void submit(Read& read) noexcept;
  [[nodiscard]] bool anythingPending() const noexcept;
  void handleEvents(long microseconds) noexcept;
  void offerToSayZero() const noexcept;
  Status said(const std::string& doing, int code);

  libusb_context* context_;
  libusb_device_handle* handle_;
  LinkListener* listener_ = nullptr;
  bool claimed_ = false, had_kernel_driver_ = false;
  bool lost_ = false, stopping_ = false;
  std::array<Read, kReads> reads_;
  libusb_transfer* write_ = nullptr;
  Packet write_buffer_{};
  bool write_pending_ = false;
  int failures_in_a_row_ = 0;
  std::uint64_t happened_ = 0;  // transfers that ended
  std::vector<pollfd> files_;   // what libusb waits for
};

}  // namespace needlelab::falcon
