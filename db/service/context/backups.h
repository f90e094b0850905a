/// Allows one backup at a time; holds its encryption key and how to tell disks apart.
#pragma once

#include <atomic>
#include <mutex>
#include <optional>
#include <utility>

#include "common/base/files/physical_disks.h"
#include "db/backup/encrypted_backup.h"

namespace needlelab {

/// Thread: any, once its key and disks are set.
class Backups {
 public:
  /// Makes backups encrypted. Call before the first backup.
  void setKey(BackupKey key) { key_ = std::move(key); }
  /// How to tell whether a backup is on another disk. Call before the first backup.
  void setBlockDevices(BlockDevices devices) { disks_ = std::move(devices); }
  /// Null: backups are not encrypted.
  [[nodiscard]] const BackupKey* key() const { return key_ ? &*key_ : nullptr; }
  [[nodiscard]] const BlockDevices& disks() const { return disks_; }

  /// Permission for one backup; the destructor returns it.
  class Turn {
   public:
    explicit Turn(Backups& of) : of_(of), lock_(of.mutex_, std::try_to_lock) {
      if (lock_) of_.is_under_way_ = true;
    }
    ~Turn() {
      if (lock_) of_.is_under_way_ = false;
    }
    Turn(const Turn&) = delete;
    Turn& operator=(const Turn&) = delete;
    /// False: another backup is in progress.
    [[nodiscard]] bool isMine() const { return lock_.owns_lock(); }

   private:
    Backups& of_;
    const std::unique_lock<std::mutex> lock_;
  };
  /// Runs that change much wait while this is true, because the log cannot be checkpointed.
  [[nodiscard]] bool isUnderWay() const { return is_under_way_.load(std::memory_order_relaxed); }

 private:
  std::mutex mutex_;  // held by the backup in progress
  std::atomic<bool> is_under_way_ = false;
  BlockDevices disks_;
  std::optional<BackupKey> key_;
};

}  // namespace needlelab
