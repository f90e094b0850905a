/// DIR/audit.head: how far the audit log's chain has come, kept outside the database. An attacker who can
/// write the database but has no key cannot remove, truncate or roll back the chain unnoticed.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>

#include "common/base/result.h"
#include "db/audit/audit_chain.h"
#include "db/store/connection.h"

namespace needlelab {

inline constexpr const char* kAuditHeadFile = "audit.head";
/// The head before the newest restore.
inline constexpr const char* kReplacedAuditHeadFile = "audit.head.replaced";

/// The file's contents, protected by a MAC with audit.key. Not in backups: an older database has an older
/// head.
struct StoredAuditHead {
  std::int64_t made_unix_ns = 0;      ///< when the file was created
  std::uint64_t made_position = 0;    ///< the chain's entries at that time; 0: the chain began with the file
  AuditHead head;                     ///< the newest head seen
  std::optional<AuditHead> replaced;  ///< the head of the database that a restore replaced
};

/// Errors: kNotFound; kCorrupt (damaged, or made with none of `keys`). Thread: any.
Result<StoredAuditHead> readStoredAuditHead(const std::filesystem::path& path,
                                            std::span<const AuditKey> keys);

/// Whether the chain has this entry. Thread: as the connection.
Result<bool> chainHas(Connection& connection, const AuditHead& head);

/// At start-up: saves the chain's head. If the saved head is not in the chain, or its file is damaged,
/// unreadable or made with another key, adds a line to the log (kAuditBreak). If the file cannot be written
/// now, the next call retries. Creates the key if necessary. Needs the writer's connection.
Status beginAuditHead(Connection& writer, std::int64_t now_unix_ns);
/// Saves a newer head of committed entries. If the chain does not contain the saved head, leaves the file
/// unchanged, so that the next start detects this. Any connection; one thread at a time.
Status advanceAuditHead(Connection& connection);

}  // namespace needlelab
