/// Room on the database's disk while the server runs: what is refused when little is left.
#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace needlelab {

/// Bytes that this user may still write on the path's disk; nothing when the system does not tell. Blocks
/// while the disk hangs. Thread: any.
using FreeBytes = std::function<std::optional<std::uint64_t>(const std::filesystem::path&)>;
std::optional<std::uint64_t> freeBytesOf(const std::filesystem::path& path);

/// Reading, log-in, and what is needed then (Storing::kNeeded in db/service/requests.h) go on at every level,
/// the latter down to the last floor.
enum class RoomLevel : std::uint8_t {
  kPlenty,
  kNoNewSessions,  ///< sessions that are open go on; a lesson that has begun is stored to its end
  kNoChunks,       ///< nothing recorded is stored: the stations' spools keep it
};
std::string_view nameOf(RoomLevel level);

/// A write that fails because the disk is full stops the database's writer for good. So the server refuses
/// in time, first what has not begun. Room is what the disk has free, and the free pages in the database's
/// file, which are used before the file grows: retention gives room in this way. Between two looks each byte
/// that was taken counts twice, for the log and the database; so a flood between two looks cannot get below
/// the floor. What turns out not to be stored gives its room back at once: refused requests and chunks that
/// come again keep nobody's lesson from beginning. A level that was reached by what is stored is left only
/// when there is a quarter more than its floor: at the edge, nobody is accepted and refused in turn. Thread:
/// one.
class DiskRoom {
 public:
  struct Look {
    std::uint64_t disk_bytes = 0;  ///< FreeBytes
    std::uint64_t file_bytes = 0;  ///< free pages of the database's file
  };
  /// New sessions need this many floors: an open session of an hour at 1 kHz takes 25 MB.
  static constexpr std::uint64_t kSessionFloors = 4;
  /// The part of the floor that must be free on the disk itself, the last floor: the log may grow. With less,
  /// free pages of the file do not count, no request writes, and a server that starts does not open its
  /// database for writing.
  static constexpr std::uint64_t kDiskShare = 8;

  /// `floor_bytes`: with less, no chunk is stored. 0: nothing is ever refused.
  explicit DiskRoom(std::uint64_t floor_bytes) : floor_bytes_(floor_bytes) {}
  DiskRoom(DiskRoom&&) noexcept = default;
  DiskRoom& operator=(DiskRoom&&) = delete;
  DiskRoom(const DiskRoom&) = delete;
  DiskRoom& operator=(const DiskRoom&) = delete;
  ~DiskRoom() = default;

  /// Takes a look at the disk. It may be older than the newest chunks: what was taken since the look before
  /// counts on.
  void look(const Look& look);
  /// A chunk or a request of `bytes` is perhaps going to be stored: its room is taken until settle().
  void take(std::uint64_t bytes);
  /// What was taken for it is stored, and counts until the looks have seen it; or nothing is, and it is room
  /// again.
  void settle(std::uint64_t bytes, bool stored);
  class Share;
  /// take(), for what has many ends.
  [[nodiscard]] Share share(std::uint64_t bytes);

  [[nodiscard]] RoomLevel level() const { return std::max(reached_, levelAt(leftBytes())); }
  /// True when no request may write any more: less than the floor / kDiskShare is left.
  [[nodiscard]] bool atLastFloor() const { return leftBytes() < floor_bytes_ / kDiskShare; }
  /// What is left, as far as this knows; before the first look, more than anybody has.
  [[nodiscard]] std::uint64_t leftBytes() const;
  /// Why something is refused, and what to do; empty at kPlenty.
  [[nodiscard]] std::string text() const;

 private:
  struct Taken {
    std::uint64_t unsettled_bytes = 0;                  // nobody knows yet whether they are stored
    std::uint64_t stored_bytes = 0, stored_before = 0;  // since the last look; between the two before
  };
  static void settleIn(Taken& taken, std::uint64_t bytes, bool stored);
  [[nodiscard]] RoomLevel levelAt(std::uint64_t left_bytes) const;
  [[nodiscard]] std::uint64_t leftWithout(std::uint64_t taken_bytes) const;

  const std::uint64_t floor_bytes_;
  std::uint64_t seen_bytes_ = UINT64_MAX;                     // at the last look
  std::shared_ptr<Taken> taken_ = std::make_shared<Taken>();  // shared with the shares, which may end last
  RoomLevel reached_ = RoomLevel::kPlenty;                    // at the last look, by what is stored
};

/// Room taken for one thing: settled as not stored by its end, unless it was stored.
class DiskRoom::Share {
 public:
  /// Of nothing.
  Share() = default;
  Share(Share&& other) noexcept = default;
  Share& operator=(Share&& other) noexcept;
  Share(const Share&) = delete;
  Share& operator=(const Share&) = delete;
  ~Share();

  /// What it was taken for is stored. Again: nothing.
  void stored();

 private:
  friend class DiskRoom;
  Share(std::shared_ptr<Taken> taken, std::uint64_t bytes) : taken_(std::move(taken)), bytes_(bytes) {}
  std::shared_ptr<Taken> taken_;  // null: of nothing, settled, or moved from
  std::uint64_t bytes_ = 0;
};

}  // namespace needlelab
