/// Tamper evidence for the audit log: each line has an entry with a MAC over itself and the previous entry.
/// The key is in no database, backup or export (db/README.md, "Tamper evidence").
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "db/store/connection.h"

namespace needlelab {

inline constexpr const char* kAuditKeyFile = "audit.key";

/// DIR/audit.key: 32 random bytes, readable only by the server's user (0600), created at the first start.
/// Anyone with the key can forge lines; without it, forged lines cannot be detected. Thread: immutable.
class AuditKey {
 public:
  using Hash = std::array<std::uint8_t, 32>;
  using Id = std::array<std::uint8_t, 8>;

  /// Reads the data folder's key, or creates it (once). Errors: kFailed, kCorrupt (the file is not a key).
  /// Thread: any.
  static Result<AuditKey> ofFolder(const std::filesystem::path& folder);
  /// Reads a key; never creates one. Errors: kNotFound, kCorrupt.
  static Result<AuditKey> ofFile(const std::filesystem::path& path);
  /// A key from these bytes, for tests.
  explicit AuditKey(const Hash& key);

  /// Keyed BLAKE2b-256.
  [[nodiscard]] Hash macOf(ByteView message) const;
  /// Distinguishes keys without revealing anything about them.
  [[nodiscard]] const Id& id() const { return id_; }

 private:
  Hash key_;
  Id id_;
};

/// The last entry of a chain. A copy kept elsewhere shows later whether the log up to it was changed.
struct AuditHead {
  std::uint64_t position = 0;  ///< 0: no entries
  AuditKey::Hash mac{};
};
/// "audit head 17:" and 64 hexadecimal digits.
std::string auditHeadText(const AuditHead& head);
/// The head whose auditHeadText() is exactly this text; nothing for any other text.
std::optional<AuditHead> auditHeadOf(std::string_view text);

/// Does not own the connection. Thread: as its Connection; append() needs the writer's connection, in the
/// transaction that adds the line. Creates the key if the folder has none.
class AuditChain {
 public:
  explicit AuditChain(Connection& connection) : connection_(connection) {}

  /// For a line that was just inserted into `audit`.
  Status append(std::int64_t line);
  Result<AuditHead> head();
  /// The MAC of the first entry; nothing if there are no entries.
  Result<std::optional<AuditKey::Hash>> firstMac();

 private:
  /// Adds the entry of a line after `last`.
  Status entry(const AuditKey& key, const AuditHead& last, std::int64_t line);
  Connection& connection_;
};

/// The action of the line that a start adds when the chain is not the one it left (audit_head.h).
inline constexpr const char* kAuditBreak = "audit break";
/// The action of the line that records that someone has looked into a break. Its subject is
/// acknowledgedSubject(), its detail the auditHeadText() of the break's first entry. It follows the break and
/// has a proof.
inline constexpr const char* kAuditAcknowledge = "audit acknowledge";
std::string acknowledgedSubject(std::int64_t line);

struct AuditBreak {
  std::int64_t line = 0, unix_ns = 0;
  std::string detail;
  AuditHead entry;                        ///< this line's entry
  std::string acknowledged_by = {};       ///< empty: not acknowledged
  std::int64_t acknowledged_unix_ns = 0;  ///< of the first acknowledgement
};

/// A head kept outside the database.
struct AuditAnchor {
  std::string name;  ///< for messages
  AuditHead head;
  std::optional<AuditKey::Hash> first = {};  ///< the MAC of its chain's first entry, if known
};

struct AuditVerdict {
  std::uint64_t lines = 0;  ///< lines with a proof
  std::uint64_t faults = 0;
  std::vector<std::string> texts;  ///< the first faults, at most kMaxAuditFaults
  std::vector<AuditBreak> breaks;  ///< by line; each unacknowledged one is also a fault
  AuditHead head;                  ///< lines removed after the newest anchor go undetected
  [[nodiscard]] bool ok() const { return faults == 0; }
};
inline constexpr std::size_t kMaxAuditFaults = 100;

/// Finds lines that were changed, reordered, forged or removed (trailing lines only if one of `anchors` is
/// newer), and foreign objects in the schema (schemaFaults()). `keys`: the folder's key and earlier ones.
/// Uses one read view; takes time proportional to the log. Errors: the database could not be read. Thread: as
/// the connection.
Result<AuditVerdict> verifyAudit(Connection& connection, std::span<const AuditKey> keys,
                                 std::span<const AuditAnchor> anchors);

}  // namespace needlelab
