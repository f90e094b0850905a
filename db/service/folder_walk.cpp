#include "db/service/folder_walk.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <string_view>
#include <utility>

namespace needlelab {

FolderWalk::FolderWalk(const std::filesystem::path& root, int deepest) : deepest_(deepest) {
  if (!enter(AT_FDCWD, root.c_str(), root, 0) && errno != ENOENT)
    root_not_read_ = Entry{Kind::kUnread, root, ::geteuid()};
}

std::optional<FolderWalk::Entry> FolderWalk::next() {
  if (root_not_read_) return std::exchange(root_not_read_, std::nullopt);
  while (!open_.empty()) {
    Folder& folder = open_.back();
    errno = 0;
    const dirent* const entry = ::readdir(folder.entries.get());
    if (entry == nullptr) return end(folder);
    const std::string_view name = entry->d_name;
    if (name != "." && name != "..")
      return look(::dirfd(folder.entries.get()), entry->d_name, folder.path / name);
  }
  return std::nullopt;
}

FolderWalk::Entry FolderWalk::end(Folder& folder) {
  const bool failed = errno != 0;
  if (!failed && folder.vanished && folder.read_again < kMostReadAgain && left_to_read_again_ > 0) {
    ::rewinddir(folder.entries.get());
    folder.vanished = false;
    ++folder.read_again;
    --left_to_read_again_;
    return {Kind::kPassed, folder.path, ::geteuid()};
  }
  Entry told{failed || folder.vanished ? Kind::kUnread : Kind::kPassed, folder.path, ::geteuid()};
  open_.pop_back();
  return told;
}

bool FolderWalk::enter(int in, const char* name, const std::filesystem::path& path, int flags) {
  // by its name in the open one: nobody leads this elsewhere by putting a link in a parent's place
  const int fd = ::openat(in, name, O_RDONLY | O_DIRECTORY | O_NONBLOCK | O_CLOEXEC | flags);
  if (fd < 0) return false;
  std::unique_ptr<DIR, Close> entries(::fdopendir(fd));
  if (!entries) {
    const int number = errno;
    ::close(fd);
    errno = number;
    return false;
  }
  open_.push_back({path, std::move(entries)});
  return true;
}

FolderWalk::Entry FolderWalk::look(int in, const char* name, const std::filesystem::path& path) {
  const auto not_read = [&](uid_t owner) {
    return Entry{errno == ENOENT ? Kind::kVanished : Kind::kUnread, path, owner};
  };
  struct stat info {};
  if (::fstatat(in, name, &info, AT_SYMLINK_NOFOLLOW) != 0) return not_read(::geteuid());
  if (S_ISREG(info.st_mode) && info.st_size > 0) return {Kind::kFile, path, info.st_uid};
  if (!S_ISDIR(info.st_mode) || deepest_ == 0) return {Kind::kPassed, path, info.st_uid};
  if (open_.size() > static_cast<std::size_t>(deepest_)) return {Kind::kUnread, path, info.st_uid};
  if (!enter(in, name, path, O_NOFOLLOW)) return not_read(info.st_uid);
  return {Kind::kPassed, path, info.st_uid};
}

}  // namespace needlelab
