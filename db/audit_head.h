/// DIR/audit.head: how far the audit log's chain had come, outside of the database. Who can write the
/// database but has no key cannot take the chain away, cut it or put an older one in its place unseen.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>

#include "common/base/result.h"
#include "db/audit_chain.h"
#include "db/connection.h"

namespace needlelab {

inline constexpr const char* kAuditHeadFile = "audit.head";
/// The head from before the newest restore.
inline constexpr const char* kReplacedAuditHeadFile = "audit.head.replaced";

/// The file's contents; a MAC by audit.key holds them. In no backup: an older database has an older head.
struct KeptAuditHead {
  std::int64_t made_unix_ns = 0;      ///< when there was no such file
  std::uint64_t made_position = 0;    ///< entries that the chain had then: 0 where it began with the file
  AuditHead head;                     ///< the newest one that was seen
  std::optional<AuditHead> replaced;  ///< of the database that a restore replaced
};

/// kNotFound: there is none. kCorrupt: it is damaged, or none of `keys` made it. Thread: any.
Result<KeptAuditHead> readKeptAuditHead(const std::filesystem::path& path, std::span<const AuditKey> keys);

/// Whether the chain has this entry. Thread: as the connection.
Result<bool> chainHas(Connection& connection, const AuditHead& head);

/// At the start: keeps the head of the chain. Where the kept head is not in the chain, or its file is there
/// but damaged, unreadable or of another key, adds a line of the log (kAuditBreak). What cannot be written to
/// the file now is written the next time. Makes the key. Writer's connection.
Status beginAuditHead(Connection& writer, std::int64_t now_unix_ns);
/// Keeps a newer head of committed entries; leaves the file alone where the chain does not have the head that
/// it holds, so that the next start finds that. Any connection; one thread at a time.
Status advanceAuditHead(Connection& connection);

}  // namespace needlelab
