/// The first bytes of a backup, which distinguish a folder's old backups from other files.
#pragma once

#include <string>
#include <string_view>

namespace needlelab::test {

/// For an encrypted backup or a plain one (https://sqlite.org/fileformat.html, 1.3), by the end of its name.
inline std::string startOfBackup(std::string_view name) {
  if (name.ends_with(".nlbk")) return "NLBACKUP";
  std::string start(100, '\0');
  start.replace(0, 15, "SQLite format 3").replace(68, 4, "nlab");
  return start;
}

}  // namespace needlelab::test
