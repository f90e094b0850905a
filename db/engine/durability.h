/// What an ack survives.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace needlelab {

/// What a commit that returned success survives, and with it every ack. Each has those before it.
enum class Durability : std::uint8_t {
  kNothing,   ///< the last moments are lost when the database's program ends
  kProcess,   ///< the end of every program, but no power cut
  kPowerCut,  ///< a power cut
  kDiskLoss,  ///< the loss of a disk: a named standby has it on its own
};

/// "the loss of a disk".
std::string_view durabilityText(Durability durability);

/// Settings of PostgreSQL, as SHOW prints them.
struct PostgresSettings {
  std::string fsync, full_page_writes, synchronous_commit, synchronous_standby_names;
  /// "fsync = on, …", of those that decide.
  [[nodiscard]] std::string text() const;
  bool operator==(const PostgresSettings&) const = default;
};

/// Of a COMMIT without a warning under these settings, by PostgreSQL's documentation (runtime-config-wal,
/// runtime-config-replication). A standby counts only where all are named: `*` takes any that connects, also
/// one beside the primary's own disk; and only where it has written to its disk: remote_write is not enough.
Durability durabilityOf(const PostgresSettings& settings);

}  // namespace needlelab
