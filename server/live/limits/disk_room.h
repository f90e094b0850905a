/// Room on the database's disk while the server runs, and what to refuse when little is left.
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

/// Bytes that this user may still write on the path's disk; nothing if the system does not report it. Blocks
/// while the disk hangs. Thread: any.
using FreeBytes = std::function<std::optional<std::uint64_t>(const std::filesystem::path&)>;
std::optional<std::uint64_t> freeBytesOf(const std::filesystem::path& path);

/// Reading, log-in and what they need (Storing::kNeeded in db/service/requests/requests.h) work at every
/// level, the latter down to the last floor.
enum class RoomLevel : std::uint8_t {
  kPlenty,
  kNoNewSessions,  ///< open sessions continue; a lesson that has begun is stored to its end
  kNoChunks,       ///< no recording is stored: it stays in the stations' spools
};
std::string_view nameOf(RoomLevel level);

/// A write that fails because the disk is full stops the database's writer for good. So the server refuses in
/// time, new work first. Room is the free space on the disk plus the free pages in the database's file, which
/// are used before the file grows (retention makes room this way). Between two looks each byte taken counts
/// twice, for the log and the database, so a flood cannot get below the floor. Bytes not stored in the end
/// release their room at once: refused requests and repeated chunks do not prevent a lesson from beginning. A
/// level reached by stored bytes is left only at a quarter above its floor, so that the server does not
/// alternate between accepting and refusing. Thread: one.
class DiskRoom {
 public:
  struct Look {
    std::uint64_t disk_bytes = 0;  ///< FreeBytes
    std::uint64_t file_bytes = 0;  ///< free pages of the database's file
  };
  /// New sessions need this many floors: an open session of an hour at 1 kHz takes 25 MB.
  static constexpr std::uint64_t kSessionFloors = 4;
  /// One part in kDiskShare of the floor, the last floor, must be free on the disk itself, because the log
  /// may grow. With less, free pages of the file do not count, no request writes, and a starting server does
  /// not open its database for writing.
  static constexpr std::uint64_t kDiskShare = 8;

  /// `floor_bytes`: with less, no chunk is stored. 0: never refuses.
  explicit DiskRoom(std::uint64_t floor_bytes) : floor_bytes_(floor_bytes) {}
  DiskRoom(DiskRoom&&) noexcept = default;
  DiskRoom& operator=(DiskRoom&&) = delete;
  DiskRoom(const DiskRoom&) = delete;
  DiskRoom& operator=(const DiskRoom&) = delete;
  ~DiskRoom() = default;

  /// Takes a look at the disk. The look may be older than the newest chunks, so what was taken since the
  /// previous look still counts.
  void look(const Look& look);
  /// A chunk or a request of `bytes` may be stored; takes its room until settle().
  void take(std::uint64_t bytes);
  /// Ends take(). If stored, the bytes count until the looks include them; otherwise their room is free
  /// again.
  void settle(std::uint64_t bytes, bool stored);
  class Share;
  /// take() for work that can end in many places.
  [[nodiscard]] Share share(std::uint64_t bytes);

  [[nodiscard]] RoomLevel level() const { return std::max(reached_, levelAt(leftBytes())); }
  /// True when no request may write any more: less than the floor / kDiskShare is left.
  [[nodiscard]] bool atLastFloor() const { return leftBytes() < floor_bytes_ / kDiskShare; }
  /// Room left, as far as known; huge before the first look.
  [[nodiscard]] std::uint64_t leftBytes() const;
  /// Why something is refused and the remedy; empty at kPlenty.
  [[nodiscard]] std::string text() const;

 private:
  struct Taken {
    std::uint64_t unsettled_bytes = 0;                  // not known yet whether they are stored
    std::uint64_t stored_bytes = 0, stored_before = 0;  // since the last look; between the two previous looks
  };
  static void settleIn(Taken& taken, std::uint64_t bytes, bool stored);
  [[nodiscard]] RoomLevel levelAt(std::uint64_t left_bytes) const;
  [[nodiscard]] std::uint64_t remainingAfter(std::uint64_t taken_bytes) const;

  const std::uint64_t floor_bytes_;
  std::uint64_t seen_bytes_ = UINT64_MAX;                     // at the last look
  std::shared_ptr<Taken> taken_ = std::make_shared<Taken>();  // shared with the shares, which may end last
  RoomLevel reached_ = RoomLevel::kPlenty;                    // at the last look, by stored bytes
};

/// Room taken for one object. On destruction it is settled as not stored, unless stored() was called.
class DiskRoom::Share {
 public:
  /// Empty.
  Share() = default;
  Share(Share&& other) noexcept = default;
  Share& operator=(Share&& other) noexcept;
  Share(const Share&) = delete;
  Share& operator=(const Share&) = delete;
  ~Share();

  /// The object is stored. Further calls do nothing.
  void stored();

 private:
  friend class DiskRoom;
  Share(std::shared_ptr<Taken> taken, std::uint64_t bytes) : taken_(std::move(taken)), bytes_(bytes) {}
  std::shared_ptr<Taken> taken_;  // null: empty, settled, or moved from
  std::uint64_t bytes_ = 0;
};

}  // namespace needlelab
