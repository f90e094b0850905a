#include "common/wire/tls_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <system_error>

#include "common/base/files/files.h"

namespace needlelab {
namespace {

int openFolder(const TlsFiles& files) {
  return ::open(files.ca_certificate.parent_path().c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
}

}  // namespace

TlsFiles tlsFilesIn(const std::filesystem::path& folder) {
  return {folder / "ca.crt",     folder / "ca.key",      folder / "server.crt",
          folder / "server.key", folder / "ca-next.crt", folder / "ca-next.key"};
}

TlsFolderUse::TlsFolderUse(const TlsFiles& files) : fd_(openFolder(files)) {
  if (fd_ < 0) return;
  while (::flock(fd_, LOCK_SH) != 0 && errno == EINTR) {
  }
}

TlsFolderUse::~TlsFolderUse() {
  if (fd_ >= 0) ::close(fd_);
}

Result<std::vector<std::string>> removeTlsLeftovers(const TlsFiles& files) {
  std::vector<std::string> removed;
  const int fd = openFolder(files);
  if (fd < 0) return removed;
  Status status;
  if (::flock(fd, LOCK_EX | LOCK_NB) == 0) {
    const auto folder = files.ca_certificate.parent_path();
    std::vector<std::filesystem::path> leftovers;
    std::error_code error;
    for (std::filesystem::directory_iterator at(folder, error), end; !error && at != end;
         at.increment(error)) {
      std::error_code gone;
      if (!std::filesystem::is_regular_file(at->symlink_status(gone)) || gone) continue;
      const std::string name = at->path().filename().string();
      for (const auto& path : {files.ca_certificate, files.ca_key, files.certificate, files.key,
                               files.next_ca_certificate, files.next_ca_key})
        if (isTemporaryNameOf(path.filename().string(), name)) leftovers.push_back(at->path());
    }
    for (const auto& path : leftovers) {
      if (::unlink(path.c_str()) != 0 && errno != ENOENT) {
        status = systemError(path, "remove");
        break;
      }
      removed.push_back(path.string());
    }
    if (status.ok() && !removed.empty()) status = syncFolder(folder);
  }
  ::close(fd);
  if (!status.ok()) return status.error();
  std::sort(removed.begin(), removed.end());
  return removed;
}

}  // namespace needlelab
