#include "common/base/files/physical_disks.h"

#include <sys/stat.h>
#include <sys/sysmacros.h>

#include <algorithm>
#include <fstream>
#include <system_error>
#include <utility>

namespace needlelab {
namespace {

namespace fs = std::filesystem;

/// Loop devices on loop devices on RAID: more levels than occur in practice; also ends a cycle.
constexpr int kMaxLevels = 16;

std::optional<dev_t> deviceOf(const fs::path& path, const BlockDevices& where) {
  if (where.device_of) return where.device_of(path);
  struct stat info {};
  if (::stat(path.c_str(), &info) != 0) return std::nullopt;
  return info.st_dev;
}

std::string firstLine(const fs::path& path) {
  std::ifstream in(path);
  std::string line;
  std::getline(in, line);
  return line;
}

class DiskSearch {
 public:
  explicit DiskSearch(const BlockDevices& where) : where_(where) {}

  /// False when something below the device is not known.
  bool addDevice(dev_t device, int level) {
    const fs::path name = std::to_string(major(device)) + ":" + std::to_string(minor(device));
    std::error_code unknown;
    const fs::path folder = fs::canonical(where_.sys / "dev" / "block" / name, unknown);
    return !unknown && addFolder(folder, level);
  }

  std::set<std::string> disks;

 private:
  /// `folder`: a block device's folder in sysfs.
  bool addFolder(const fs::path& folder, int level) {
    if (level > kMaxLevels) return false;
    std::error_code unknown;
    if (fs::exists(folder / "partition", unknown)) return addFolder(folder.parent_path(), level + 1);
    if (fs::exists(folder / "loop", unknown)) {
      // the name of a removed file ends in " (deleted)" and is not found
      const std::string file = firstLine(folder / "loop" / "backing_file");
      const auto below = file.empty() ? std::nullopt : deviceOf(file, where_);
      return below && addDevice(*below, level + 1);
    }
    bool any = false;
    for (auto at = fs::directory_iterator(folder / "slaves", unknown);
         !unknown && at != fs::directory_iterator(); at.increment(unknown)) {
      std::error_code dangling;
      const fs::path slave = fs::canonical(at->path(), dangling);
      if (dangling || !addFolder(slave, level + 1)) return false;
      any = true;
    }
    if (any) return !unknown;
    // a real disk has a driver's device; zram and an empty mapping have none
    std::error_code none;
    const fs::path hardware = fs::canonical(folder / "device", none);
    if (none) return false;
    disks.insert(hardware.string());
    return true;
  }

  const BlockDevices& where_;
};

}  // namespace

std::set<std::string> physicalDisksOf(dev_t device, const BlockDevices& where) {
  DiskSearch search(where);
  if (!search.addDevice(device, 0)) return {};
  return std::move(search.disks);
}

DiskRelation compareDisks(const fs::path& a, const fs::path& b, const BlockDevices& where) {
  const auto device_a = deviceOf(a, where), device_b = deviceOf(b, where);
  if (!device_a || !device_b) return DiskRelation::kUnknown;
  if (*device_a == *device_b) return DiskRelation::kSame;
  const auto disks_a = physicalDisksOf(*device_a, where), disks_b = physicalDisksOf(*device_b, where);
  if (disks_a.empty() || disks_b.empty()) return DiskRelation::kUnknown;
  const bool shared =
      std::any_of(disks_a.begin(), disks_a.end(), [&](const auto& disk) { return disks_b.contains(disk); });
  return shared ? DiskRelation::kSame : DiskRelation::kAnother;
}

}  // namespace needlelab
