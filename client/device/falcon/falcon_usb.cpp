#include "client/device/falcon/falcon_usb.h"

#include <libusb.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <thread>
#include <utility>

#include "client/device/falcon/falcon_geometry.h"
#include "client/device/falcon/falcon_usb_link.h"
#include "common/base/clock.h"

namespace needlelab::falcon {
namespace {

using DevicePtr = std::unique_ptr<libusb_device, decltype(&libusb_unref_device)>;

std::string busPath(libusb_device* device) {
  std::array<std::uint8_t, 8> ports{};
  const int count = libusb_get_port_numbers(device, ports.data(), static_cast<int>(ports.size()));
  std::string path = std::to_string(libusb_get_bus_number(device)) + "-";
  if (count <= 0) return path + std::to_string(libusb_get_device_address(device));
  for (int i = 0; i < count; ++i)
    path += (i > 0 ? "." : "") + std::to_string(ports[static_cast<std::size_t>(i)]);
  return path;
}

// empty when it has none, or cannot be asked
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
  ~UsbBus() override {
    if (context_ == nullptr) return;
    if (watching_) libusb_hotplug_deregister_callback(context_, watch_);
    libusb_exit(context_);
  }

  Result<std::vector<FoundDevice>> list() override {
    if (Status started = start(); !started.ok()) return started.error();
    auto devices = falcons();
    if (!devices.ok()) return devices.error();
    std::vector<FoundDevice> found;
    for (const DevicePtr& device : *devices) found.push_back(describe(device.get(), devices->size() == 1));
    return found;
  }

  Result<std::unique_ptr<FalconLink>> open(const std::string& which) override {
    if (Status started = start(); !started.ok()) return started.error();
    auto devices = falcons();
    if (!devices.ok()) return devices.error();
    if (devices->empty()) return notFound("no Falcon is plugged in");
    if (which.empty() && devices->size() > 1) {
      std::string all;
      for (const DevicePtr& device : *devices)
        all += (all.empty() ? "falcon@" : ", falcon@") + busPath(device.get());
      return Error{ErrorCode::kInvalidInput,
                   "there are " + std::to_string(devices->size()) + " Falcons; name one of them: " + all};
    }
    std::string refused;
    for (const DevicePtr& device : *devices) {
      const bool by_path = busPath(device.get()) == which;
      libusb_device_handle* handle = nullptr;
      if (const int code = libusb_open(device.get(), &handle); code != 0) {
        if (which.empty() || by_path) return usbError("Falcon at " + busPath(device.get()), code);
        // its serial number cannot be asked
        refused += "; " + usbError("the one at " + busPath(device.get()), code).message;
        continue;
      }
      if (which.empty() || by_path || serialOf(device.get(), handle) == which)
        return UsbLink::claim(context_, handle);
      libusb_close(handle);
    }
    return notFound("no Falcon has the serial number or the bus path '" + which +
                    "' (--list-devices shows those that there are)" + refused);
  }

  void waitForArrival(std::chrono::milliseconds timeout) noexcept override {
    const std::int64_t end_ns = steadyNowNs() + std::chrono::nanoseconds(timeout).count();
    while (context_ != nullptr && !arrived_.exchange(false)) {
      const std::int64_t left_ns = end_ns - steadyNowNs();
      if (left_ns <= 0) return;
      constexpr std::int64_t kMost_ns = 50'000'000;
      timeval wait{0, static_cast<suseconds_t>(std::min(left_ns, kMost_ns) / 1000)};
      // an error that comes at once must not make a thread of high priority spin
      if (libusb_handle_events_timeout_completed(context_, &wait, nullptr) != 0)
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
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
    // without hotplug the list is looked through again and again: slower, but it works
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
    // a program that uses it has claimed it; the kernel's driver would make room
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

  libusb_context* context_ = nullptr;
  libusb_hotplug_callback_handle watch_ = 0;
  bool watching_ = false;
  std::atomic<bool> arrived_{false};
};

}  // namespace

std::unique_ptr<FalconBus> makeUsbBus() {
  return std::make_unique<UsbBus>();
}

}  // namespace needlelab::falcon
