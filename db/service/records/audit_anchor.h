/// Heads of the audit log's chain that were kept elsewhere (db/README.md, "Tamper evidence").
#pragma once

#include <filesystem>
#include <vector>

#include "common/base/result.h"
#include "db/audit/audit_chain.h"

namespace needlelab {

/// From a backup: the head of its copy of the chain. From an export of everything: the head in its own audit
/// line, the last record of kind "audit" with the action "export-all"; other records prove nothing. From any
/// other text: the only line that is a head (auditHeadText), alone or after the words "keep elsewhere".
/// kInvalidInput: no head or several, a line of more than 8 MiB, or not a regular file.
Result<AuditAnchor> readAuditAnchor(const std::filesystem::path& path);

/// Same; for a folder, the heads of all its plain backups (backupsIn()). kInvalidInput: it has none.
Result<std::vector<AuditAnchor>> readAuditAnchors(const std::filesystem::path& path);

}  // namespace needlelab
