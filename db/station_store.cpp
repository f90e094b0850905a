#include "db/station_store.h"

#include <algorithm>

#include "common/base/text.h"

namespace needlelab {
namespace {

constexpr std::string_view kSelectStations = "SELECT name, key_hash, revoked, created_unix_ns FROM stations ";

Station stationOf(const Statement& row) {
  Station station;
  station.name = row.text(0);
  const ByteView hash = row.bytes(1);
  std::copy_n(hash.begin(), std::min(hash.size(), station.key_hash.size()), station.key_hash.begin());
  station.revoked = row.integer(2) != 0;
  station.created_unix_ns = row.integer(3);
  return station;
}

}  // namespace

Status StationStore::add(std::string_view name, const StationKeyBytes& key_hash, std::int64_t now_unix_ns) {
  if (auto valid = checkName("station name", name); !valid) return valid;
  const auto known = find(name);
  if (!known) return known.error();
  if (!*known) {
    if (auto valid = checkNewName("station name", name); !valid) return valid;
  }
  if (*known && !(*known)->revoked) {
    return Error{ErrorCode::kAlreadyExists, "there is already a station named '" + std::string(name) +
                                                "': revoke it first to give it a new key"};
  }
  if (*known) {
    return connection_.run("UPDATE stations SET key_hash = ?, revoked = 0 WHERE name = ?", ByteView(key_hash),
                           name);
  }
  return connection_.run("INSERT INTO stations (name, key_hash, created_unix_ns) VALUES (?,?,?)", name,
                         ByteView(key_hash), now_unix_ns);
}

Status StationStore::revoke(std::string_view name) {
  if (auto done = connection_.run("UPDATE stations SET revoked = 1 WHERE name = ?", name); !done) return done;
  if (connection_.changes() == 0) {
    return Error{ErrorCode::kNotFound, "there is no station named '" + std::string(name) + "'"};
  }
  return {};
}

Result<std::optional<Station>> StationStore::find(std::string_view name) {
  auto row = connection_.query(std::string(kSelectStations) + "WHERE name = ?", name);
  const auto found = row.step();
  if (!found) return found.error();
  if (!*found) return std::optional<Station>();
  return std::optional(stationOf(row));
}

Result<bool> StationStore::checkKey(std::string_view name, std::string_view key) {
  const auto station = find(name);
  if (!station) return station.error();
  StationKeyBytes given{};
  if (key.size() != given.size()) return false;
  std::copy(key.begin(), key.end(), given.begin());
  // hashed and compared for unknown names as well, so that all take the same time
  const StationKeyBytes stored = *station ? (*station)->key_hash : StationKeyBytes{};
  const bool same = sameHash(hashStationKey(given), stored);
  return same && *station && !(*station)->revoked;
}

Result<std::vector<Station>> StationStore::list() {
  std::vector<Station> stations;
  auto rows = connection_.prepare(std::string(kSelectStations) + "ORDER BY name");
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) return stations;
    stations.push_back(stationOf(rows));
  }
}

}  // namespace needlelab
