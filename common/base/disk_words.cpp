#include "common/base/disk_words.h"

#include <cerrno>
#include <cstring>
#include <system_error>

namespace needlelab {
namespace {

/// The nearest folder that is there.
std::filesystem::path nearestFolder(const std::filesystem::path& path) {
  std::error_code error;
  auto folder = std::filesystem::absolute(path, error).parent_path();
  while (!std::filesystem::is_directory(folder, error) && folder.has_relative_path())
    folder = folder.parent_path();
  return folder;
}

std::string roomOn(const std::filesystem::path& folder) {
  std::error_code error;
  const auto space = std::filesystem::space(folder, error);
  if (error) return {};
  return " (" + std::to_string(space.available >> 20) + " MiB free of " +
         std::to_string(space.capacity >> 20) + " MiB)";
}

}  // namespace

std::string diskAdvice(int error_number, const std::filesystem::path& path) {
  const auto folder = nearestFolder(path);
  switch (error_number) {
    case ENOSPC:
    case EDQUOT:
      return "; the disk of " + folder.string() + " is full" + roomOn(folder) +
             ": make room on it, then start again";
    case EROFS:
      return "; the disk of " + folder.string() +
             " is read-only: see why (dmesg tells when a failing disk was made so), mount it for writing, "
             "then "
             "start again";
    case EIO:
      return "; the disk of " + folder.string() +
             " fails: see dmesg and smartctl, move the folder to a good disk or restore a backup, then start "
             "again";
    default:
      return {};
  }
}

Error systemError(const std::filesystem::path& path, const std::string& what) {
  const int number = errno;
  return {ErrorCode::kFailed,
          path.string() + ": cannot " + what + ": " + std::strerror(number) + diskAdvice(number, path)};
}

}  // namespace needlelab
