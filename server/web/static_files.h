/// The console's files: read once at the start, served from memory.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>

#include "common/base/result.h"

namespace needlelab {

struct StaticFile {
  std::string type;  ///< Content-Type
  std::string etag;  ///< with its quotes
  std::shared_ptr<const std::string> body;
};

/// A requested path is looked up among the files that were read at the start: a path from the network
/// never reaches the file system. Thread: any, once made.
class StaticFiles {
 public:
  /// Takes all regular files of the folder and its subfolders whose ending is one of a web page and whose
  /// names begin with neither '.' nor '_'. A folder that is not there gives none. kInvalidInput: more than
  /// 16 MiB or 1000 files, or a file cannot be read.
  static Result<StaticFiles> load(const std::filesystem::path& folder);

  /// "/" is "/index.html". Null when no such file was read.
  [[nodiscard]] const StaticFile* find(const std::string& path) const;
  [[nodiscard]] std::size_t size() const { return files_.size(); }

 private:
  std::map<std::string, StaticFile> files_;  // by path from the folder, beginning with '/'
};

}  // namespace needlelab
