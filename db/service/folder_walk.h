/// Goes through a folder and those below it, in which others may write, and passes over nothing in silence.
/// Private to this folder.
#pragma once

#include <dirent.h>
#include <sys/types.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

namespace needlelab {

/// Memory: for one folder a level, whatever lies there. Thread: one at a time.
class FolderWalk {
 public:
  enum class Kind {
    kFile,      ///< a regular one that is not empty
    kUnread,    ///< a folder that cannot be read, is too deep, or changes; an entry that stat(2) refuses
    kVanished,  ///< a name that its folder had when it was read
    kPassed,    ///< a folder of which the entries follow, its end, a link, a pipe; what is empty
  };
  struct Entry {
    Kind kind = Kind::kPassed;
    std::filesystem::path path;
    uid_t owner = 0;  ///< this process's user where stat(2) did not tell
  };

  /// `root` may be a link; no link below it is followed. Folders more than `deepest` levels below it are not
  /// read. Where `deepest` is 0 they are none of this walk's, and kPassed.
  FolderWalk(const std::filesystem::path& root, int deepest);

  /// Reads one entry; nothing: there are no more. A folder that vanishes meanwhile ends nothing but itself.
  std::optional<Entry> next();
  /// What next() told last, a kFile or kVanished, is gone: it may have another name now. The walk reads its
  /// folder again, with those below it, so that entries come again: up to kMostReadAgain times, and
  /// kMostReadAgainInAll times in all folders together. A folder of which a name is gone then is kUnread.
  void noteVanished() { open_.back().vanished = true; }

  static constexpr int kMostReadAgain = 3, kMostReadAgainInAll = 16;

 private:
  struct Close {
    void operator()(DIR* entries) const { ::closedir(entries); }
  };
  struct Folder {
    std::filesystem::path path;
    std::unique_ptr<DIR, Close> entries;
    bool vanished = false;  ///< noteVanished(), since it was read last
    int read_again = 0;
  };
  /// Goes on with the entries of the folder `name` in `in`, a descriptor. False: see errno.
  bool enter(int in, const char* name, const std::filesystem::path& path, int flags);
  Entry look(int in, const char* name, const std::filesystem::path& path);
  /// What follows the last name of a folder.
  Entry end(Folder& folder);

  int deepest_;
  int left_to_read_again_ = kMostReadAgainInAll;
  std::vector<Folder> open_;            ///< each lies in the one before
  std::optional<Entry> root_not_read_;  ///< to be told first
};

}  // namespace needlelab
