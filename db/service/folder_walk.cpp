#include "db/service/folder_walk.h"

#include <fcntl.h>
#include <sys/inotify.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <set>
#include <string_view>
#include <utility>

namespace needlelab {

FolderWalk::FolderWalk(std::vector<Root> roots)
    : roots_(std::move(roots)), watches_(::inotify_init1(IN_NONBLOCK | IN_CLOEXEC)) {}

FolderWalk::~FolderWalk() {
  if (watches_ >= 0) ::close(watches_);
}

std::optional<FolderWalk::Entry> FolderWalk::next() {
  for (;;) {
    if (!to_tell_.empty()) {
      Entry told = std::move(to_tell_.front());
      to_tell_.pop_front();
      return told;
    }
    if (is_over_) return std::nullopt;
    if (entries_ >= most_entries_) {
      giveUp();
      continue;
    }
    if (!open_.empty()) {
      ++entries_;
      return readOn();
    }
    if (next_root_ < roots_.size()) {
      const std::size_t root = next_root_++;
      const std::filesystem::path& path = roots_[root].path;
      if (!enter(AT_FDCWD, path.c_str(), {path, root, 0}, 0) && errno != ENOENT)
        return Entry{Kind::kUnread, path, ::geteuid()};
      continue;
    }
    most_entries_ = std::min(most_entries_, (kMostReadAgain + 1) * entries_ + kMostArrived);
    const auto arrival = nextArrival();
    if (!arrival) {
      is_over_ = true;
    } else if (++entries_; arrival->in != nullptr) {
      return lookAt(*arrival);
    } else {
      next_root_ = 0;
    }
  }
}

FolderWalk::Entry FolderWalk::readOn() {
  Folder& folder = open_.back();
  const dirent* entry = nullptr;
  do {
    errno = 0;
    entry = ::readdir(folder.entries.get());
    if (entry == nullptr) return end(folder);
  } while (std::string_view(entry->d_name) == "." || std::string_view(entry->d_name) == "..");
  // a copy: what is entered may move the open ones
  const Where where = folder.where;
  return look(::dirfd(folder.entries.get()), entry->d_name, where);
}

FolderWalk::Entry FolderWalk::end(Folder& folder) {
  const bool failed = errno != 0;
  if (!failed && folder.vanished && folder.read_again < kMostReadAgain && left_to_read_again_ > 0) {
    ::rewinddir(folder.entries.get());
    folder.vanished = false;
    ++folder.read_again;
    --left_to_read_again_;
    return {Kind::kPassed, folder.where.path, ::geteuid()};
  }
  Entry told{failed || folder.vanished ? Kind::kUnread : Kind::kPassed, folder.where.path, ::geteuid()};
  open_.pop_back();
  return told;
}

bool FolderWalk::enter(int in, const char* name, Where where, int flags) {
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
  watch(fd, where);
  open_.push_back({std::move(where), std::move(entries)});
  return true;
}

void FolderWalk::watch(int folder, const Where& where) {
  const std::string path = "/proc/self/fd/" + std::to_string(folder);
  // a copy is written after it arrived
  const int number = watches_ < 0
                         ? -1
                         : ::inotify_add_watch(watches_, path.c_str(),
                                               IN_CREATE | IN_MOVED_TO | IN_CLOSE_WRITE | IN_ONLYDIR);
  const auto known = watched_.find(number);
  if (number < 0 || (known == watched_.end() && watched_.size() >= kMostWatched)) {
    if (number >= 0) ::inotify_rm_watch(watches_, number);
    to_tell_.push_back({Kind::kUnread, where.path, ::geteuid()});
    return;
  }
  if (known == watched_.end())
    watched_.emplace(number, where);
  else if (roots_[where.root].deepest >= roots_[known->second.root].deepest)
    known->second = where;  // it may have moved
}

FolderWalk::Entry FolderWalk::look(int in, const char* name, const Where& where) {
  const std::filesystem::path path = where.path / name;
  const auto not_read = [&](uid_t owner) {
    return Entry{errno == ENOENT ? Kind::kVanished : Kind::kUnread, path, owner};
  };
  struct stat info {};
  if (::fstatat(in, name, &info, AT_SYMLINK_NOFOLLOW) != 0) return not_read(::geteuid());
  if (S_ISREG(info.st_mode) && info.st_size > 0) return {Kind::kFile, path, info.st_uid};
  const int deepest = roots_[where.root].deepest;
  if (!S_ISDIR(info.st_mode) || deepest == 0) return {Kind::kPassed, path, info.st_uid};
  if (where.level >= deepest) return {Kind::kUnread, path, info.st_uid};
  if (!enter(in, name, {path, where.root, where.level + 1}, O_NOFOLLOW)) return not_read(info.st_uid);
  return {Kind::kPassed, path, info.st_uid};
}

std::optional<FolderWalk::Arrival> FolderWalk::nextArrival() {
  while (watches_ >= 0) {
    if (event_at_ == events_end_) {
      const ssize_t got = ::read(watches_, events_.data(), events_.size());
      if (got <= 0) return std::nullopt;
      event_at_ = 0;
      events_end_ = static_cast<std::size_t>(got);
    }
    inotify_event event{};
    std::memcpy(&event, events_.data() + event_at_, sizeof event);
    const char* const name = events_.data() + event_at_ + sizeof event;
    event_at_ += sizeof event + event.len;
    if ((event.mask & IN_Q_OVERFLOW) != 0) return Arrival{};
    if ((event.mask & IN_IGNORED) != 0) watched_.erase(event.wd);
    const auto in = watched_.find(event.wd);
    if (event.len > 0 && in != watched_.end()) return Arrival{&in->second, name};
  }
  return std::nullopt;
}

FolderWalk::Entry FolderWalk::lookAt(const Arrival& arrival) {
  const Where where = *arrival.in;
  const std::filesystem::path& root = roots_[where.root].path;
  int in = ::open(root.c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC);
  // as enter() does
  for (const auto& name : where.path.lexically_relative(root)) {
    if (in < 0 || name == ".") break;
    const int below = ::openat(in, name.c_str(), O_PATH | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
    const int number = errno;
    ::close(in);
    errno = number;
    in = below;
  }
  if (in < 0) {
    // a folder that moved arrived elsewhere
    const bool gone = errno == ENOENT || errno == ENOTDIR;
    return {gone ? Kind::kPassed : Kind::kUnread, where.path, ::geteuid()};
  }
  Entry told = look(in, arrival.name.c_str(), where);
  ::close(in);
  // so did a file
  if (told.kind == Kind::kVanished) told.kind = Kind::kPassed;
  return told;
}

void FolderWalk::giveUp() {
  is_over_ = true;
  std::set<std::filesystem::path> changing;
  for (const Folder& folder : open_) changing.insert(folder.where.path);
  open_.clear();
  for (; next_root_ < roots_.size(); ++next_root_) changing.insert(roots_[next_root_].path);
  // as many as the kernel keeps by default
  constexpr int kMostLeft = 16384;
  for (int i = 0; i < kMostLeft; ++i) {
    const auto arrival = nextArrival();
    if (!arrival) break;
    if (arrival->in != nullptr)
      changing.insert(arrival->in->path);
    else
      for (const Root& root : roots_) changing.insert(root.path);
  }
  for (const auto& path : changing) to_tell_.push_back({Kind::kUnread, path, ::geteuid()});
}

}  // namespace needlelab
