/// The last line of an export of records: if it is missing, or has another count or hash, a part is missing.
/// Heads of the audit log's chain that were kept elsewhere, in exports too (db/README.md, "Tamper evidence").
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/gesture/chunk.h"
#include "db/audit/audit_chain.h"

namespace needlelab {

/// {"kind":"end","records":N,"blake2b":"…"} for the preceding lines, each with its line end. Without a line
/// end.
std::string recordsEnd(std::uint64_t records, std::string_view lines);

/// Checks an export while it is read line by line. Thread: a single one.
class RecordsReader {
 public:
  /// A line without its end. False: it is the last line, and it is correct. kInvalidInput: the last line does
  /// not match the earlier ones, or a line follows it.
  Result<bool> take(std::string_view line);
  /// To be called after the last line. kInvalidInput: there was no last line, so a part is missing.
  [[nodiscard]] Status ended() const;

 private:
  SessionHash hash_;
  std::uint64_t records_ = 0;
  bool ended_ = false;
};

/// From a backup: the head of its copy of the chain. From an export of everything: the head in its own audit
/// line, the last record of kind "audit" with the action "export-all"; other records prove nothing. From any
/// other text: the only line that is a head (auditHeadText), alone or after the words "keep elsewhere".
/// kInvalidInput: no head or several, a line of more than 8 MiB, or not a regular file.
Result<AuditAnchor> readAuditAnchor(const std::filesystem::path& path);

/// Same; for a folder, the heads of all its plain backups (backupsIn()). kInvalidInput: it has none.
Result<std::vector<AuditAnchor>> readAuditAnchors(const std::filesystem::path& path);

}  // namespace needlelab
