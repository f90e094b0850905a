/// Goes through folders and those below them, in which others may write, and passes over nothing in silence.
/// Private to this folder.
#pragma once

#include <dirent.h>
#include <sys/types.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace needlelab {

/// Reads the folders one after the other, and watches each (inotify) from before it is read until the end.
/// After them it looks at each name that arrived in one meanwhile: what moves between two folders is told
/// where it arrives. Changes that another machine makes in a network file system are not seen. Memory: for
/// one folder a level, and for kMostWatched paths, whatever lies there. Thread: one at a time.
class FolderWalk {
 public:
  enum class Kind {
    kFile,      ///< a regular one that is not empty
    kUnread,    ///< a folder that cannot be read or watched, is too deep, or goes on changing; an entry that
                ///< stat(2) refuses
    kVanished,  ///< a name that its folder had when it was read
    kPassed,  ///< a folder of which the entries follow, its end, a link, a pipe; what is empty or left again
  };
  struct Entry {
    Kind kind = Kind::kPassed;
    std::filesystem::path path;
    uid_t owner = 0;  ///< this process's user where stat(2) did not tell
  };
  /// `path` may be a link; no link below it is followed. Folders more than `deepest` levels below it are not
  /// read. Where `deepest` is 0 they are none of this walk's, and kPassed.
  struct Root {
    std::filesystem::path path;
    int deepest = 0;
  };

  explicit FolderWalk(std::vector<Root> roots);
  FolderWalk(const std::filesystem::path& root, int deepest) : FolderWalk({Root{root, deepest}}) {}
  FolderWalk(const FolderWalk&) = delete;
  FolderWalk& operator=(const FolderWalk&) = delete;
  ~FolderWalk();

  /// Reads one entry; nothing: there are no more. A folder that vanishes meanwhile ends nothing but itself.
  /// What arrived is told, also again, until it has kMostArrived entries and kMostReadAgain times as many as
  /// the folders had; a folder in which names arrive then is kUnread.
  std::optional<Entry> next();
  /// What next() told last, a kFile or kVanished, is gone: it may have another name now. The walk reads its
  /// folder again, with those below it, so that entries come again: up to kMostReadAgain times, and
  /// kMostReadAgainInAll times in all folders together. A folder of which a name is gone then is kUnread.
  void noteVanished() {
    if (!open_.empty()) open_.back().vanished = true;
  }

  static constexpr int kMostReadAgain = 3, kMostReadAgainInAll = 16;
  static constexpr std::uint64_t kMostArrived = 1000;
  /// Below the 8,192 watches that an older kernel allows a user.
  static constexpr std::size_t kMostWatched = 5000;

 private:
  struct Close {
    void operator()(DIR* entries) const { ::closedir(entries); }
  };
  /// Where a folder lies.
  struct Where {
    std::filesystem::path path;
    std::size_t root = 0;  ///< of roots_
    int level = 0;         ///< below it
  };
  struct Folder {
    Where where;
    std::unique_ptr<DIR, Close> entries;
    bool vanished = false;  ///< noteVanished(), since it was read last
    int read_again = 0;
  };
  /// A name that arrived in a folder; no folder: the kernel lost some.
  struct Arrival {
    const Where* in = nullptr;
    std::string name;
  };

  /// Goes on with the entries of the folder `name` in `in`, a descriptor. False: see errno.
  bool enter(int in, const char* name, Where where, int flags);
  void watch(int folder, const Where& where);
  /// One entry of the open folder.
  Entry readOn();
  /// `name` in `in`, a descriptor of the folder that lies at `where`.
  Entry look(int in, const char* name, const Where& where);
  /// What follows the last name of a folder.
  Entry end(Folder& folder);
  /// Nothing: none that is not told yet.
  std::optional<Arrival> nextArrival();
  Entry lookAt(const Arrival& arrival);
  /// Tells the folders that are not read to their end, or in which names arrived since, and ends.
  void giveUp();

  std::vector<Root> roots_;
  std::size_t next_root_ = 0;
  int left_to_read_again_ = kMostReadAgainInAll;
  std::vector<Folder> open_;   ///< each lies in the one before
  std::deque<Entry> to_tell_;  ///< before all others
  bool is_over_ = false;
  std::uint64_t entries_ = 0, most_entries_ = UINT64_MAX;
  int watches_;                      ///< inotify's descriptor; -1: there is none
  std::map<int, Where> watched_;     ///< by inotify's number
  std::array<char, 4096> events_{};  ///< that were read, and not looked at from event_at_ on
  std::size_t event_at_ = 0, events_end_ = 0;
};

}  // namespace needlelab
