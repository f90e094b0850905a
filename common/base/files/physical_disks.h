/// Finds the physical disks on which a file lies, so that a copy can be told from a copy on another disk.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <functional>
#include <optional>
#include <set>
#include <string>

namespace needlelab {

/// Where block devices are looked up. Tests pass a folder and files of their own.
struct BlockDevices {
  std::filesystem::path sys = "/sys";  ///< sysfs: `dev/block/MAJOR:MINOR`, `loop`, `slaves`, `partition`
  /// Returns the device on which a file lies (stat's st_dev), or nothing when unknown. Empty: uses stat(2).
  std::function<std::optional<dev_t>(const std::filesystem::path&)> device_of{};
};

/// Returns the hardware under a block device: the disk of a partition, the disk below a loop device's file,
/// all disks of a device-mapper or RAID device. Empty when any part of it is unknown: memory (tmpfs, zram), a
/// network file system, btrfs and ZFS (which have device numbers of their own), a container's overlay. Two
/// namespaces of one NVMe controller are one piece of hardware. The disks of a virtual machine count as
/// different ones, because the machine cannot see what is below them. Thread: any.
std::set<std::string> physicalDisksOf(dev_t device, const BlockDevices& where);

enum class DiskRelation {
  kAnother,  ///< both are known and have no hardware in common
  kSame,     ///< they share a disk
  kUnknown,  ///< the hardware of at least one is unknown: treat as the same
};
/// Compares the disks of two files or folders that exist. Thread: any.
DiskRelation compareDisks(const std::filesystem::path& a, const std::filesystem::path& b,
                          const BlockDevices& where);

}  // namespace needlelab
