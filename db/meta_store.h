/// Facts about the database itself, by key: engine_version, created_unix_ns, backup_unix_ns, backup_path.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "db/connection.h"

namespace needlelab {

/// Functions on a connection, which it does not own. Thread: as its Connection; set() needs the writer's.
class MetaStore {
 public:
  explicit MetaStore(Connection& connection) : connection_(connection) {}
  Status set(std::string_view key, std::string_view value);
  Result<std::optional<std::string>> get(std::string_view key);

 private:
  Connection& connection_;
};

}  // namespace needlelab
