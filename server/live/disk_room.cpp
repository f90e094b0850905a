#include "server/live/disk_room.h"

#include <fmt/core.h>
#include <sys/statvfs.h>

#include <algorithm>
#include <cerrno>

namespace needlelab {
namespace {

constexpr std::uint64_t kWrites = 2;  // of each byte: to the log, then to the database

}  // namespace

std::optional<std::uint64_t> freeBytesOf(const std::filesystem::path& path) {
  struct statvfs facts {};
  int result = 0;
  do {
    result = ::statvfs(path.c_str(), &facts);
  } while (result != 0 && errno == EINTR);
  if (result != 0) return std::nullopt;
  return static_cast<std::uint64_t>(facts.f_bavail) * facts.f_frsize;
}

std::string_view nameOf(RoomLevel level) {
  switch (level) {
    case RoomLevel::kPlenty:
      return "plenty";
    case RoomLevel::kNoNewSessions:
      return "no_new_sessions";
    case RoomLevel::kNoChunks:
      return "no_chunks";
  }
  return "unknown";
}

RoomLevel DiskRoom::levelAt(std::uint64_t left_bytes) const {
  if (left_bytes < floor_bytes_) return RoomLevel::kNoChunks;
  return left_bytes / kSessionFloors < floor_bytes_ ? RoomLevel::kNoNewSessions : RoomLevel::kPlenty;
}

std::uint64_t DiskRoom::leftBytes() const {
  const std::uint64_t taken = kWrites * (taken_bytes_ + taken_before_);
  return seen_bytes_ - std::min(seen_bytes_, taken);
}

void DiskRoom::look(const Look& look) {
  const bool log_may_grow = look.disk_bytes >= floor_bytes_ / kDiskShare;
  seen_bytes_ = look.disk_bytes + (log_may_grow ? look.file_bytes : 0);
  taken_before_ = taken_bytes_;
  taken_bytes_ = 0;
  const std::uint64_t left = leftBytes();
  // a quarter more than a floor leads out of its level: 4/5 of what is left must reach it
  level_ = std::max(levelAt(left), std::min(level_, levelAt(left / 5 * 4)));
}

void DiskRoom::take(std::uint64_t bytes) {
  taken_bytes_ += bytes;
  level_ = std::max(level_, levelAt(leftBytes()));
}

std::string DiskRoom::text() const {
  switch (level_) {
    case RoomLevel::kPlenty:
      return {};
    case RoomLevel::kNoNewSessions:
      return fmt::format(
          "the server's disk is nearly full: {} MiB are left, and below {} MiB no new session is begun; make "
          "room on it, or let retention delete old recordings; the station keeps its data and tries again by "
          "itself",
          leftBytes() >> 20, kSessionFloors * floor_bytes_ >> 20);
    case RoomLevel::kNoChunks:
      return fmt::format(
          "the server's disk is full: {} MiB are left, and below {} MiB nothing recorded is stored; make "
          "room "
          "on it, or let retention delete old recordings; the station keeps its data and tries again by "
          "itself",
          leftBytes() >> 20, floor_bytes_ >> 20);
  }
  return {};
}

}  // namespace needlelab
