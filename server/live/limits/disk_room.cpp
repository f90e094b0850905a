#include "server/live/limits/disk_room.h"

#include <fmt/core.h>
#include <sys/statvfs.h>

#include <algorithm>
#include <cassert>
#include <cerrno>
#include <utility>

namespace needlelab {
namespace {

constexpr std::uint64_t kWrites = 2;  // per byte: to the log, then to the database

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

std::uint64_t DiskRoom::remainingAfter(std::uint64_t taken_bytes) const {
  return seen_bytes_ - std::min(seen_bytes_, kWrites * taken_bytes);
}

std::uint64_t DiskRoom::leftBytes() const {
  return remainingAfter(taken_->stored_bytes + taken_->stored_before + taken_->unsettled_bytes);
}

void DiskRoom::look(const Look& look) {
  Taken& taken = *taken_;
  // ignores unsettled bytes: if refused in the end, they must not have caused a level that is kept
  const RoomLevel before =
      std::max(reached_, levelAt(remainingAfter(taken.stored_bytes + taken.stored_before)));
  const bool log_may_grow = look.disk_bytes >= floor_bytes_ / kDiskShare;
  seen_bytes_ = look.disk_bytes + (log_may_grow ? look.file_bytes : 0);
  taken.stored_before = std::exchange(taken.stored_bytes, 0);
  const std::uint64_t left = remainingAfter(taken.stored_before);
  // a level is left at a quarter above its floor: 4/5 of what is left must reach it
  reached_ = std::max(levelAt(left), std::min(before, levelAt(left / 5 * 4)));
}

void DiskRoom::take(std::uint64_t bytes) {
  taken_->unsettled_bytes += bytes;
}

void DiskRoom::settle(std::uint64_t bytes, bool stored) {
  settleIn(*taken_, bytes, stored);
}

void DiskRoom::settleIn(Taken& taken, std::uint64_t bytes, bool stored) {
  assert(taken.unsettled_bytes >= bytes);
  taken.unsettled_bytes -= bytes;
  if (stored) taken.stored_bytes += bytes;
}

DiskRoom::Share DiskRoom::share(std::uint64_t bytes) {
  take(bytes);
  return {taken_, bytes};
}

DiskRoom::Share& DiskRoom::Share::operator=(Share&& other) noexcept {
  std::swap(taken_, other.taken_);
  std::swap(bytes_, other.bytes_);
  return *this;
}

DiskRoom::Share::~Share() {
  if (taken_) settleIn(*taken_, bytes_, false);
}

void DiskRoom::Share::stored() {
  if (const auto taken = std::exchange(taken_, nullptr)) settleIn(*taken, bytes_, true);
}

std::string DiskRoom::text() const {
  switch (level()) {
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
