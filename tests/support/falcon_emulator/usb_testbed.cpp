#include "tests/support/falcon_emulator/usb_testbed.h"

#include <unistd.h>
#include <csignal>

#include <umockdev.h>

namespace needlelab::test {

UsbTestbed::UsbTestbed() : testbed_(umockdev_testbed_new()) {
  // a terminal represents the device's node: its hang-up must not end a session leader
  if (::getsid(0) == ::getpid()) std::signal(SIGHUP, SIG_IGN);
  gchar* const root = umockdev_testbed_get_root_dir(testbed_);
  root_ = root;
  g_free(root);
  // the hub that devices are attached to: they ask for their parent
  const char* const hub =
      "P: /devices/usb1\n"
      "E: SUBSYSTEM=usb\n"
      "E: DEVTYPE=usb_device\n"
      "E: DRIVER=usb\n"
      "E: BUSNUM=001\n"
      "E: DEVNUM=001\n"
      "E: DEVNAME=/dev/bus/usb/001/001\n"
      "A: bConfigurationValue=1\\n\n"
      "A: busnum=1\\n\n"
      "A: devnum=1\\n\n"
      "A: idVendor=1d6b\\n\n"
      "A: idProduct=0002\\n\n"
      "A: speed=480\\n\n"
      "H: "
      "descriptors=12010002090000406b1d020000060302010109021900010100e0000904000001090000000705810304000c\n";
  umockdev_testbed_add_from_string(testbed_, hub, nullptr);
}

UsbTestbed::~UsbTestbed() {
  g_object_unref(testbed_);
}

std::string UsbTestbed::trouble() const {
  if (umockdev_in_mock_environment() != 0) return {};
  return "not run under umockdev-wrapper, so there is no emulated USB: use ctest, or `umockdev-wrapper "
         "PROGRAM`";
}

int UsbTestbed::takeDeviceNumber() {
  do last_device_number_ = last_device_number_ < 127 ? last_device_number_ + 1 : 2;
  while (!device_numbers_.insert(last_device_number_).second);
  return last_device_number_;
}

}  // namespace needlelab::test
