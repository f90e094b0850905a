/// What an ack survives.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace needlelab {

/// What a successful commit survives, and with it every ack. Each level includes the previous ones.
enum class Durability : std::uint8_t {
  kNothing,   ///< the last moments are lost when the database's process ends
  kProcess,   ///< the end of any process, but not a power cut
  kPowerCut,  ///< a power cut
  kDiskLoss,  ///< the loss of a disk: a named standby has the data on its own
};

/// "the loss of a disk".
std::string_view durabilityText(Durability durability);

/// Settings of PostgreSQL, as SHOW prints them.
struct PostgresSettings {
  std::string fsync, full_page_writes, synchronous_commit, synchronous_standby_names;
  /// "fsync = on, …": the settings that decide.
  [[nodiscard]] std::string text() const;
  bool operator==(const PostgresSettings&) const = default;
};

/// Durability of a COMMIT without a warning under these settings, by PostgreSQL's documentation
/// (runtime-config-wal, runtime-config-replication). Standbys count only if all are named (`*` accepts any
/// that connects, even one on the primary's own disk), and only if they have written to disk: remote_write is
/// not enough.
Durability durabilityOf(const PostgresSettings& settings);

}  // namespace needlelab
