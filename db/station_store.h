/// Stations: name and the hash of a random key. Never deleted, only revoked: sessions name them.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "db/connection.h"
#include "db/password.h"

namespace needlelab {

struct Station {
  std::string name;
  StationKeyBytes key_hash{};
  bool revoked = false;
  std::int64_t created_unix_ns = 0;
};

/// Functions on a connection, which it does not own. Thread: as its Connection; changes need the writer's.
class StationStore {
 public:
  explicit StationStore(Connection& connection) : connection_(connection) {}

  /// Adds a station, or gives a revoked one a new key. Errors: kInvalidInput (name), kAlreadyExists (it is in
  /// use).
  Status add(std::string_view name, const StationKeyBytes& key_hash, std::int64_t now_unix_ns);
  /// kNotFound.
  Status revoke(std::string_view name);
  /// Nothing when there is no such station.
  Result<std::optional<Station>> find(std::string_view name);
  /// True when the station exists, is not revoked, and the key is its key (compared in constant time).
  Result<bool> checkKey(std::string_view name, std::string_view key);
  /// By name.
  Result<std::vector<Station>> list();

 private:
  Connection& connection_;
};

}  // namespace needlelab
