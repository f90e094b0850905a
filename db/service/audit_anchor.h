/// Heads of the audit log's chain that were kept elsewhere (db/README.md, "Tamper evidence").
#pragma once

#include <filesystem>
#include <vector>

#include "common/base/result.h"
#include "db/audit_chain.h"

namespace needlelab {

/// Of a backup: the head that its copy of the chain has. Of an export of everything: the head in its own line
/// of the log, the last record of kind "audit" with the action "export-all"; other records prove nothing. Of
/// another text: its only line that is a head (auditHeadText), alone or behind the words "keep elsewhere".
/// kInvalidInput: it has none, or several, or a line of more than 8 MiB, or is no regular file.
Result<AuditAnchor> readAuditAnchor(const std::filesystem::path& path);

/// The same; of a folder each of its plain backups (backupsIn()). kInvalidInput: it has none.
Result<std::vector<AuditAnchor>> readAuditAnchors(const std::filesystem::path& path);

}  // namespace needlelab
