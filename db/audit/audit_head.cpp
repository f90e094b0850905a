#include "db/audit/audit_head.h"

#include <fmt/core.h>
#include <sodium.h>

#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/files/files.h"
#include "common/base/text/text.h"
#include "db/audit/audit.h"

namespace needlelab {
namespace {

constexpr std::string_view kTitle = "needlelab audit head 1";

/// All lines except the MAC.
std::string textOfHead(const StoredAuditHead& kept) {
  return fmt::format("{}\nmade {} {}\n{}\nreplaced {}\n", kTitle, kept.made_unix_ns, kept.made_position,
                     auditHeadText(kept.head), kept.replaced ? auditHeadText(*kept.replaced) : "nothing");
}

std::string sealed(const StoredAuditHead& kept, const AuditKey& key) {
  const std::string text = textOfHead(kept);
  return text + "mac " + hexDigitsOf(textOf(key.macOf(viewOf(text)))) + "\n";
}

/// Does not check the MAC, which guarantees the canonical form.
std::optional<StoredAuditHead> parsed(const std::string& text) {
  std::istringstream lines(text);
  std::string title, word, head, replaced;
  StoredAuditHead kept;
  std::getline(lines, title);
  lines >> word >> kept.made_unix_ns >> kept.made_position >> std::ws;
  std::getline(lines, head);
  lines >> word >> std::ws;
  std::getline(lines, replaced);
  const auto found = auditHeadOf(head);
  if (!lines || !found) return std::nullopt;
  kept.head = *found;
  kept.replaced = auditHeadOf(replaced);
  return kept;
}

Status writeKept(const std::filesystem::path& path, const StoredAuditHead& kept, const AuditKey& key) {
  return writeFileAtomically(path, viewOf(sealed(kept, key)), 0600);
}

}  // namespace

Result<StoredAuditHead> readStoredAuditHead(const std::filesystem::path& path,
                                            std::span<const AuditKey> keys) {
  std::error_code error;
  if (!std::filesystem::exists(path, error))
    return Error{ErrorCode::kNotFound, path.string() + ": is not there"};
  ASSIGN_OR_RETURN(const auto text, readWholeFile(path, 1000));
  if (const auto kept = parsed(text)) {
    // the form is canonical, so the comparison reveals any other content
    for (const AuditKey& key : keys) {
      const std::string right = sealed(*kept, key);
      if (right.size() == text.size() && sodium_memcmp(right.data(), text.data(), text.size()) == 0)
        return *kept;
    }
  }
  return Error{ErrorCode::kCorrupt,
               path.string() + ": is not as a server with this audit.key wrote it (--key: an earlier one)"};
}

Result<bool> chainHas(Connection& connection, const AuditHead& head) {
  if (head.position == 0) return true;
  auto row = connection.query("SELECT 1 FROM audit_chain WHERE position = ? AND mac = ?", head.position,
                              ByteView(head.mac));
  return row.step();
}

Status beginAuditHead(Connection& writer, std::int64_t now_unix_ns) {
  const auto folder = writer.path().parent_path();
  ASSIGN_OR_RETURN(const auto key, AuditKey::ofFolder(folder));
  const std::vector keys{key};
  const auto found = readStoredAuditHead(folder / kAuditHeadFile, keys);
  StoredAuditHead kept{now_unix_ns, 0, {}, {}};
  {
    ASSIGN_OR_RETURN(auto transaction, Transaction::begin(writer, Transaction::Kind::kWrite));
    AuditChain chain(writer);
    ASSIGN_OR_RETURN(const auto before, chain.head());
    const auto add_break = [&](const std::string& detail) {
      return AuditStore(writer).add({0, now_unix_ns, "local", kAuditBreak, "", detail});
    };
    if (found) {
      kept = *found;
      ASSIGN_OR_RETURN(const bool goes_on, chainHas(writer, kept.head));
      if (!goes_on)
        RETURN_IF_ERROR(add_break(fmt::format(
            "the log had {} entries, the last with the MAC {}; this database has {} and not that "
            "one: lines were removed, or an older database was put in its place by hand",
            kept.head.position, hexDigitsOf(textOf(kept.head.mac)).substr(0, 16), before.position)));
    } else {
      kept.made_position = before.position;
      // an existing but unusable file hides how far the log had come
      if (found.error().code != ErrorCode::kNotFound)
        RETURN_IF_ERROR(
            add_break(fmt::format("it is unknown how far the log had come; this database has {} entries, and "
                                  "{} was created again: {}",
                                  before.position, kAuditHeadFile, found.error().message)));
      const auto replaced = readStoredAuditHead(folder / kReplacedAuditHeadFile, keys);
      if (replaced) kept.replaced = replaced->head;
    }
    ASSIGN_OR_RETURN(kept.head, chain.head());
    RETURN_IF_ERROR(transaction.commit());
  }
  (void)writeKept(folder / kAuditHeadFile, kept, key);
  return {};
}

Status advanceAuditHead(Connection& connection) {
  const auto folder = connection.path().parent_path();
  ASSIGN_OR_RETURN(const auto key, AuditKey::ofFile(folder / kAuditKeyFile));
  ASSIGN_OR_RETURN(auto kept, readStoredAuditHead(folder / kAuditHeadFile, std::vector{key}));
  ASSIGN_OR_RETURN(const auto view, Transaction::view(connection));
  ASSIGN_OR_RETURN(const bool goes_on, chainHas(connection, kept.head));
  ASSIGN_OR_RETURN(const auto head, AuditChain(connection).head());
  if (!goes_on || head.position <= kept.head.position) return {};
  kept.head = head;
  return writeKept(folder / kAuditHeadFile, kept, key);
}

}  // namespace needlelab
