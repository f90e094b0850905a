#include "tests/support/falcon_emulator/usb_port.h"

#include <fcntl.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <sys/timerfd.h>
#include <termios.h>
#include <unistd.h>

#include <umockdev.h>

#include <glib-unix.h>
#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <functional>
#include <future>
#include <limits>
#include <stdexcept>
#include <utility>

namespace needlelab::test {
namespace {

std::string threeDigits(int number) {
  std::string text = std::to_string(number);
  return std::string(3 - std::min<std::size_t>(3, text.size()), '0') + text;
}

// GLib hands data over to umockdev's thread, but ThreadSanitizer cannot see how: this lock makes it visible
std::mutex hand_over;

// runs `work` on the thread of `context` and waits for it
void runIn(GMainContext* context, const std::function<void()>& work) {
  struct Call {
    const std::function<void()>* work = nullptr;
    std::promise<void> done;
  } call;
  std::unique_lock lock(hand_over);
  call.work = &work;
  std::future<void> done = call.done.get_future();
  GSource* const source = g_idle_source_new();
  g_source_set_priority(source, G_PRIORITY_HIGH);
  const auto run = [](gpointer data) -> gboolean {
    auto* const asked = static_cast<Call*>(data);
    std::unique_lock own(hand_over);
    (*asked->work)();
    own.unlock();
    asked->done.set_value();
    return G_SOURCE_REMOVE;
  };
  g_source_set_callback(source, run, &call, nullptr);
  g_source_attach(source, context);
  lock.unlock();
  done.wait();
  g_source_unref(source);
}

}  // namespace

// umockdev's signals and the timer, on umockdev's thread
struct UsbPort::Glue {
  static gboolean ioctl(UMockdevIoctlBase*, UMockdevIoctlClient* client, gpointer port) {
    return static_cast<UsbPort*>(port)->handle(client) ? TRUE : FALSE;
  }
  static void connected(UMockdevIoctlBase*, UMockdevIoctlClient* client, gpointer data) {
    auto* const port = static_cast<UsbPort*>(data);
    { const std::lock_guard made(hand_over); }
    const std::lock_guard lock(port->mutex_);
    // umockdev drops a client after its node was closed; this is the only report of the close
    g_object_weak_ref(G_OBJECT(client), Glue::closed, port);
    port->clients_.push_back(client);
    if (port->timer_source_ != nullptr) return;
    // the answering thread owns the timer
    port->timer_source_ = g_unix_fd_source_new(port->timer_, G_IO_IN);
    const GUnixFDSourceFunc fire = [](gint fd, GIOCondition, gpointer self) -> gboolean {
      std::uint64_t times = 0;
      (void)!::read(fd, &times, sizeof times);
      auto* const owner = static_cast<UsbPort*>(self);
      const std::lock_guard timer_lock(owner->mutex_);
      owner->pump();
      return G_SOURCE_CONTINUE;
    };
    g_source_set_callback(port->timer_source_, G_SOURCE_FUNC(fire), port, nullptr);
    GMainContext* const context = g_main_context_ref_thread_default();
    g_source_attach(port->timer_source_, context);
    g_main_context_unref(context);
  }
  static void closed(gpointer port, GObject* client) {
    auto* const self = static_cast<UsbPort*>(port);
    const std::lock_guard lock(self->mutex_);
    self->forgetClient(reinterpret_cast<UMockdevIoctlClient*>(client));
  }
};

UsbPort::UsbPort(UsbTestbed& testbed, FtdiChip& chip, std::string serial)
    : testbed_(testbed),
      chip_(chip),
      serial_(std::move(serial)),
      port_(testbed.nextPort()),
      mutex_(chip.board().mutex),
      timer_(::timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC)),
      handler_(umockdev_ioctl_base_new()) {
  if (timer_ < 0) throw std::runtime_error("no timer for the emulated USB port");
  const std::lock_guard made(hand_over);
  signals_ = {g_signal_connect(handler_, "handle-ioctl", G_CALLBACK(Glue::ioctl), this),
              g_signal_connect(handler_, "client-connected", G_CALLBACK(Glue::connected), this)};
}

UsbPort::~UsbPort() {
  unplug();
  // umockdev's thread must not call this object from now on
  const auto let_go = [this] {
    for (const gulong signal : signals_) g_signal_handler_disconnect(handler_, signal);
    if (timer_source_ != nullptr) g_source_destroy(timer_source_);
    const std::lock_guard lock(mutex_);
    while (!clients_.empty()) {
      g_object_weak_unref(G_OBJECT(clients_.back()), Glue::closed, this);
      forgetClient(clients_.back());
    }
  };
  if (timer_source_ != nullptr)
    runIn(g_source_get_context(timer_source_), let_go);
  else
    let_go();
  if (timer_source_ != nullptr) g_source_unref(timer_source_);
  g_object_unref(handler_);
  ::close(timer_);
}

void UsbPort::attach() {
  device_number_ = testbed_.takeDeviceNumber();
  node_ = "/dev/bus/usb/001/" + threeDigits(device_number_);
  node_file_ = testbed_.root() + node_;
  terminal_ = ::posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
  char name[64] = {};
  if (terminal_ < 0 || ::grantpt(terminal_) != 0 || ::unlockpt(terminal_) != 0 ||
      ::ptsname_r(terminal_, name, sizeof name) != 0)
    throw std::runtime_error("no pseudo terminal for the emulated USB device: is /dev/pts mounted?");
  terminal_other_end_ = ::open(name, O_RDWR | O_NOCTTY | O_CLOEXEC);
  ::chmod(name, mode_);
  std::filesystem::create_directories(std::filesystem::path(node_file_).parent_path());
  std::filesystem::remove(node_file_);
  std::filesystem::create_symlink(name, node_file_);
  ::tcflow(terminal_other_end_, TCOOFF);
  ready_shown_ = false;
}

void UsbPort::plug() {
  if (plugged_) return;
  {
    const std::lock_guard lock(mutex_);
    attach();
    gone_ = false;
    plugged_ = true;
    driver_attached_ = !kernel_driver_.empty();
  }
  GError* error = nullptr;
  if (umockdev_testbed_attach_ioctl(testbed_.get(), node_.c_str(), handler_, &error) == 0)
    throw std::runtime_error("umockdev takes no handler for " + node_);
  // notify udev last, when everything is ready
  const std::string port = "1-" + std::to_string(port_);
  syspath_ = "/devices/usb1/" + port;
  const std::string device =
      "P: " + syspath_ +
      "\nE: SUBSYSTEM=usb\nE: DEVTYPE=usb_device\nE: DRIVER=usb\nE: BUSNUM=001\nE: DEVNUM=" +
      threeDigits(device_number_) + "\nE: DEVNAME=" + node_ +
      "\nE: ID_VENDOR_ID=0403\nE: ID_MODEL_ID=cb48\nA: bConfigurationValue=1\\n\nA: busnum=1\\n\nA: devnum=" +
      std::to_string(device_number_) +
      "\\n\nA: idVendor=0403\\n\nA: idProduct=cb48\\n\nA: manufacturer=FTDI\\n\nA: product=FALCON "
      "HAPTIC\\n\nA: serial=" +
      serial_ + "\\n\nA: speed=12\\n\nH: descriptors=" + usbDescriptors() + "\n";
  if (umockdev_testbed_add_from_string(testbed_.get(), device.c_str(), &error) == 0) {
    const std::string what = error != nullptr ? error->message : "unknown";
    g_clear_error(&error);
    throw std::runtime_error("umockdev takes no such device: " + what);
  }
}

void UsbPort::unplug() {
  if (!plugged_) return;
  {
    const std::lock_guard lock(mutex_);
    plugged_ = false;
    gone_ = true;
    for (std::deque<Transfer>* queue : {&in_, &out_})
      for (; !queue->empty(); queue->pop_front()) finish(queue->front(), -ESHUTDOWN, 0);
    for (; !waiting_writes_.empty(); waiting_writes_.pop_front())
      umockdev_ioctl_client_complete(waiting_writes_.front().client, -1, ENODEV);
    claimed_by_ = nullptr;
    detach();
  }
  umockdev_testbed_detach_ioctl(testbed_.get(), node_.c_str(), nullptr);
  std::filesystem::remove(node_file_);
  const std::string sys = "/sys" + syspath_;
  umockdev_testbed_uevent(testbed_.get(), sys.c_str(), "remove");
  umockdev_testbed_remove_device(testbed_.get(), sys.c_str());
  testbed_.giveBackDeviceNumber(device_number_);
}

// hangs up: a poll of the node reports an error, as after a real unplug
void UsbPort::detach() {
  ::tcflow(terminal_other_end_, TCOON);
  ::close(terminal_other_end_);
  ::close(terminal_);
  terminal_ = terminal_other_end_ = -1;
}

void UsbPort::setBusy(bool busy) {
  const std::lock_guard lock(mutex_);
  busy_ = busy;
}

void UsbPort::setMode(unsigned mode) {
  const std::lock_guard lock(mutex_);
  mode_ = mode;
  if (terminal_other_end_ >= 0) ::fchmod(terminal_other_end_, mode_);
}

void UsbPort::setKernelDriver(const std::string& name) {
  const std::lock_guard lock(mutex_);
  kernel_driver_ = name;
}

bool UsbPort::kernelDriverAttached() {
  const std::lock_guard lock(mutex_);
  return driver_attached_;
}

int UsbPort::openClients() {
  const std::lock_guard lock(mutex_);
  return static_cast<int>(clients_.size());
}

void UsbPort::wake() {
  armTimer(1);
}

void UsbPort::armTimer(std::int64_t when_ns) {
  itimerspec spec{};
  if (when_ns != std::numeric_limits<std::int64_t>::max())
    spec.it_value = {when_ns / 1'000'000'000,
                     std::max<long>(when_ns % 1'000'000'000, 1)};  // all 0 would mean never
  ::timerfd_settime(timer_, TFD_TIMER_ABSTIME, &spec, nullptr);
}

void UsbPort::showReadiness() {
  if (terminal_other_end_ < 0) return;
  const bool ready = !finished_.empty();
  if (ready == ready_shown_) return;
  ::tcflow(terminal_other_end_, ready ? TCOON : TCOOFF);
  ready_shown_ = ready;
}

}  // namespace needlelab::test
