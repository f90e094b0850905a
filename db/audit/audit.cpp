#include "db/audit/audit.h"

#include <fmt/core.h>

#include <algorithm>

#include "common/base/text/text.h"
#include "db/audit/audit_chain.h"

namespace needlelab {
namespace {

constexpr std::uint32_t kMaxLines = 1000;
constexpr std::size_t kMaxBytes = 1000;

/// Replaces text that is not UTF-8, or that contains a NUL byte, with a note: PostgreSQL would reject it, and
/// the audit log must always be written.
void replaceInvalidText(std::string& text) {
  if (!isUtf8(text) || text.find('\0') != std::string::npos)
    text = fmt::format("({} bytes that are not text)", text.size());
}

/// Truncates the text at a character boundary.
std::string shown(const std::string& text) {
  if (text.size() <= kMaxBytes) return text;
  std::size_t end = kMaxBytes;
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xc0) == 0x80) --end;
  return text.substr(0, end) + "…";
}

}  // namespace

Status AuditStore::add(const AuditRow& line) {
  AuditRow row = line;
  for (std::string* field : {&row.who, &row.action, &row.subject, &row.detail}) replaceInvalidText(*field);
  ASSIGN_OR_RETURN(
      const auto id,
      connection_.insert(
          "INSERT INTO audit (unix_ns, who, action, subject, detail) VALUES (?,?,?,?,?) RETURNING id",
          row.unix_ns, shown(row.who), shown(row.action), shown(row.subject), shown(row.detail)));
  return AuditChain(connection_).append(id);
}

Result<std::vector<AuditRow>> AuditStore::list(std::uint32_t limit, std::uint64_t before_id,
                                               std::string_view who, std::string_view action) {
  const std::uint32_t most = limit == 0 ? kMaxLines : std::min(limit, kMaxLines);
  return connection_
      .query(
          "SELECT id, unix_ns, who, action, subject, detail FROM audit WHERE (?1 = 0"
          " OR id < ?1) AND (?2 = '' OR who = ?2) AND (?3 = '' OR action = ?3"
          " OR substr(action, 1, length(?3) + 1) = ?3 || ' ') ORDER BY id DESC"
          " LIMIT ?4",
          before_id, who, action, most)
      .all([](const Statement& row) {
        return AuditRow{row.natural(0), row.integer(1), row.text(2), row.text(3), row.text(4), row.text(5)};
      });
}

}  // namespace needlelab
