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
    kFile,    ///< a regular one that is not empty
    kUnread,  ///< a folder that cannot be read, or is too deep; an entry that stat(2) refuses
    kPassed,  ///< a folder of which the entries follow, its end, a link, a pipe; what is empty, or vanished
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

 private:
  struct Close {
    void operator()(DIR* entries) const { ::closedir(entries); }
  };
  struct Folder {
    std::filesystem::path path;
    std::unique_ptr<DIR, Close> entries;
  };
  /// Goes on with the entries of the folder `name` in `in`, a descriptor. False: see errno.
  bool enter(int in, const char* name, const std::filesystem::path& path, int flags);
  Entry look(int in, const char* name, const std::filesystem::path& path);

  int deepest_;
  std::vector<Folder> open_;            ///< each lies in the one before
  std::optional<Entry> root_not_read_;  ///< to be told first
};

}  // namespace needlelab
