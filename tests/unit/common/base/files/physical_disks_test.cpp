// The test's own sysfs, laid out like the kernel's: devices/…, and links in dev/block and slaves.
#include <gtest/gtest.h>
#include <sys/sysmacros.h>

#include <fstream>
#include <map>

#include "common/base/files/physical_disks.h"
#include "tests/support/temp_folder.h"

namespace needlelab {
namespace {

namespace fs = std::filesystem;

class PhysicalDisks : public testing::Test {
 protected:
  void SetUp() override {
    fs::create_directories(sys_ / "dev" / "block");
    where_.sys = sys_;
    where_.device_of = [this](const fs::path& path) -> std::optional<dev_t> {
      const auto found = files_.find(path.string());
      return found == files_.end() ? std::nullopt : std::optional(found->second);
    };
  }
  /// A block device in devices/`folder`, with its link in dev/block.
  fs::path block(const std::string& folder, unsigned number) {
    const fs::path made = sys_ / "devices" / folder;
    fs::create_directories(made);
    fs::create_symlink(made, sys_ / "dev" / "block" / ("8:" + std::to_string(number)));
    return made;
  }
  fs::path disk(const std::string& name, unsigned number) {
    const fs::path hardware = sys_ / "devices" / ("pci-" + name);
    const fs::path made = block("pci-" + name + "/block/" + name, number);
    fs::create_symlink(hardware, made / "device");
    return made;
  }
  void partition(const std::string& of, const std::string& name, unsigned number) {
    write(block("pci-" + of + "/block/" + of + "/" + name, number) / "partition", "1\n");
  }
  fs::path mapped(const std::string& name, unsigned number, const std::vector<fs::path>& slaves) {
    const fs::path made = block("virtual/block/" + name, number);
    fs::create_directories(made / "slaves");
    for (const fs::path& slave : slaves) fs::create_symlink(slave, made / "slaves" / slave.filename());
    return made;
  }
  void loop(const std::string& name, unsigned number, const std::string& file) {
    const fs::path made = block("virtual/block/" + name, number);
    fs::create_directories(made / "loop");
    fs::create_directories(made / "slaves");
    write(made / "loop" / "backing_file", file + "\n");
  }
  static void write(const fs::path& path, const std::string& text) { std::ofstream(path) << text; }
  void fileOn(const std::string& path, unsigned number) { files_[path] = makedev(8, number); }
  DiskRelation relation(unsigned a, unsigned b) {
    fileOn("/a", a);
    fileOn("/b", b);
    const DiskRelation there = compareDisks("/a", "/b", where_);
    EXPECT_EQ(compareDisks("/b", "/a", where_), there) << "the same in either direction";
    return there;
  }

  test::TempFolder folder_;
  fs::path sys_ = folder_.path() / "sys";
  BlockDevices where_;
  std::map<std::string, dev_t> files_;
};

TEST_F(PhysicalDisks, partitionsOfADiskAreTheSameDisk) {
  disk("sda", 0);
  partition("sda", "sda1", 1);
  partition("sda", "sda2", 2);
  disk("sdb", 16);
  partition("sdb", "sdb1", 17);
  EXPECT_EQ(relation(1, 1), DiskRelation::kSame);
  EXPECT_EQ(relation(1, 2), DiskRelation::kSame);
  EXPECT_EQ(relation(0, 2), DiskRelation::kSame);
  EXPECT_EQ(relation(1, 17), DiskRelation::kAnother);
  EXPECT_EQ(relation(0, 16), DiskRelation::kAnother);
  EXPECT_EQ(physicalDisksOf(makedev(8, 2), where_),
            (std::set<std::string>{(sys_ / "devices" / "pci-sda").string()}));
}

TEST_F(PhysicalDisks, aLoopDeviceLiesOnTheDiskOfItsFile) {
  disk("sda", 0);
  partition("sda", "sda1", 1);
  disk("sdb", 16);
  loop("loop0", 30, "/images/backup.img");
  fileOn("/images/backup.img", 1);
  EXPECT_EQ(relation(1, 30), DiskRelation::kSame);
  EXPECT_EQ(relation(16, 30), DiskRelation::kAnother);
  // also its partitions, and a loop device on a file of a loop device
  write(block("virtual/block/loop0/loop0p1", 31) / "partition", "1\n");
  loop("loop1", 32, "/in/loop0p1.img");
  fileOn("/in/loop0p1.img", 31);
  EXPECT_EQ(relation(0, 32), DiskRelation::kSame);
  EXPECT_EQ(relation(16, 32), DiskRelation::kAnother);
}

TEST_F(PhysicalDisks, mappedAndRaidDevicesLieOnAllTheirDisks) {
  const fs::path sda = disk("sda", 0), sdb = disk("sdb", 16), sdc = disk("sdc", 32);
  partition("sdb", "sdb1", 17);
  const fs::path raid = mapped("md0", 40, {sda, sys_ / "devices/pci-sdb/block/sdb/sdb1"});
  mapped("dm-0", 41, {raid});  // an encrypted volume on the RAID
  EXPECT_EQ(physicalDisksOf(makedev(8, 41), where_).size(), 2u);
  EXPECT_EQ(relation(41, 0), DiskRelation::kSame);
  EXPECT_EQ(relation(41, 17), DiskRelation::kSame);
  EXPECT_EQ(relation(41, 32), DiskRelation::kAnother);
}

TEST_F(PhysicalDisks, namespacesOfOneControllerAreOnePiece) {
  const fs::path first = block("nvme0/nvme0n1", 50), second = block("nvme0/nvme0n2", 51);
  for (const fs::path& one : {first, second}) fs::create_symlink(sys_ / "devices" / "nvme0", one / "device");
  EXPECT_EQ(relation(50, 51), DiskRelation::kSame);
}

TEST_F(PhysicalDisks, whatIsNotKnownIsNeverAnotherDisk) {
  const fs::path sda = disk("sda", 0);
  block("virtual/block/zram0", 60);  // memory: no driver's device
  mapped("dm-1", 61, {});            // a mapping without a device below
  const fs::path zram = sys_ / "devices/virtual/block/zram0";
  mapped("dm-2", 62, {sda, zram});  // partly known
  loop("loop2", 63, "/images/gone.img (deleted)");
  loop("loop3", 64, "/images/itself.img");  // a cycle
  fileOn("/images/itself.img", 64);
  loop("loop4", 65, "");
  for (const unsigned number : {60u, 61u, 62u, 63u, 64u, 65u, 99u}) {
    EXPECT_EQ(relation(0, number), DiskRelation::kUnknown) << number;
    EXPECT_EQ(relation(number, number), DiskRelation::kSame) << number;
    EXPECT_TRUE(physicalDisksOf(makedev(8, number), where_).empty()) << number;
  }
  fileOn("/a", 0);
  EXPECT_EQ(compareDisks("/a", "/no such file", where_), DiskRelation::kUnknown);
}

TEST_F(PhysicalDisks, findsTheDiskOfAFolderOnThisMachine) {
  const BlockDevices here;
  EXPECT_EQ(compareDisks(folder_.path(), folder_.path(), here), DiskRelation::kSame);
  EXPECT_EQ(compareDisks(folder_.path(), folder_.path() / "none", here), DiskRelation::kUnknown);
}

}  // namespace
}  // namespace needlelab
