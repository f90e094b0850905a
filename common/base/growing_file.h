/// A file that is written in parts and appears under its name only when it is whole.
#pragma once

#include <filesystem>
#include <string>

#include "common/base/bytes.h"
#include "common/base/result.h"

namespace needlelab {

/// Written beside its path, renamed by finish(); without finish() nothing is left. Thread: one.
class GrowingFile {
 public:
  static Result<GrowingFile> create(const std::filesystem::path& path);
  GrowingFile(GrowingFile&& other) noexcept;
  GrowingFile& operator=(GrowingFile&&) = delete;
  GrowingFile(const GrowingFile&) = delete;
  GrowingFile& operator=(const GrowingFile&) = delete;
  ~GrowingFile();

  Status append(ByteView bytes);
  /// fsync, rename, fsync of the folder.
  Status finish();

 private:
  GrowingFile() = default;
  Error systemError(const std::string& what) const;
  std::filesystem::path path_;
  std::string temporary_;
  int fd_ = -1;
};

}  // namespace needlelab
