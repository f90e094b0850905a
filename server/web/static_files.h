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
  std::string etag;  ///< including its quotes
  std::shared_ptr<const std::string> body;
};

/// Serves requested paths from the files read at the start; a path from the network never reaches the file
/// system. Thread: any, once constructed.
class StaticFiles {
 public:
  /// Loads all regular files of the folder and its subfolders that have a web page's extension and do not
  /// begin with '.' or '_'. A missing folder gives no files. kInvalidInput: more than 16 MiB or 1000 files,
  /// or a file cannot be read.
  static Result<StaticFiles> load(const std::filesystem::path& folder);

  /// Maps "/" to "/index.html". Null for an unknown file.
  [[nodiscard]] const StaticFile* find(const std::string& path) const;
  [[nodiscard]] std::size_t size() const { return files_.size(); }

 private:
  std::map<std::string, StaticFile> files_;  // by path relative to the folder, with a leading '/'
};

}  // namespace needlelab
