/// Tamper evidence of the audit log: each line has an entry with a MAC over itself and the entry before, by a
/// key that is in no database, backup or export (db/README.md, "Tamper evidence").
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
#include "db/connection.h"

namespace needlelab {

inline constexpr const char* kAuditKeyFile = "audit.key";

/// DIR/audit.key: 32 random bytes, readable only by the server's user (0600), made at the first start.
/// Who has it can forge lines; without it nobody can find forged ones. Thread: immutable.
class AuditKey {
 public:
  using Hash = std::array<std::uint8_t, 32>;
  using Id = std::array<std::uint8_t, 8>;

  /// Reads or makes the key of a data folder. kFailed, kCorrupt (the file is not a key). Thread: any; the
  /// file is made once.
  static Result<AuditKey> ofFolder(const std::filesystem::path& folder);
  /// Reads a key and makes none. kNotFound, kCorrupt.
  static Result<AuditKey> ofFile(const std::filesystem::path& path);
  /// A key from these bytes, for tests.
  explicit AuditKey(const Hash& key);

  /// Keyed BLAKE2b-256.
  [[nodiscard]] Hash macOf(ByteView message) const;
  /// Tells keys apart, and says nothing about the key.
  [[nodiscard]] const Id& id() const { return id_; }

 private:
  Hash key_;
  Id id_;
};

/// The last entry of a chain. Who keeps it elsewhere can tell later whether the log before it was changed.
struct AuditHead {
  std::uint64_t position = 0;  ///< 0: there is no entry
  AuditKey::Hash mac{};
};
/// "audit head 17:" and 64 hexadecimal digits.
std::string auditHeadText(const AuditHead& head);
/// The head whose auditHeadText() is exactly this text; nothing for any other.
std::optional<AuditHead> auditHeadOf(std::string_view text);

/// Does not own the connection. Thread: as its Connection; append() needs the writer's, in the
/// transaction that adds the line. It makes the key when the folder has none.
class AuditChain {
 public:
  explicit AuditChain(Connection& connection) : connection_(connection) {}

  /// For a line that was just inserted into `audit`.
  Status append(std::int64_t line);
  Result<AuditHead> head();
  /// The MAC of the first entry; nothing: there is none.
  Result<std::optional<AuditKey::Hash>> firstMac();

 private:
  /// The entry of a line behind `last`.
  Status entry(const AuditKey& key, const AuditHead& last, std::int64_t line);
  Connection& connection_;
};

/// The action of a line by which a start says that the chain was not the one that was left (audit_head.h).
inline constexpr const char* kAuditBreak = "audit break";
/// The action of a line by which somebody says to have looked into a break. Its subject is
/// acknowledgedSubject(), its detail auditHeadText() of the break's first entry. Behind the break, and
/// proven.
inline constexpr const char* kAuditAcknowledge = "audit acknowledge";
std::string acknowledgedSubject(std::int64_t line);

struct AuditBreak {
  std::int64_t line = 0, unix_ns = 0;
  std::string detail;
  AuditHead entry;                        ///< the line's
  std::string acknowledged_by = {};       ///< empty: by nobody
  std::int64_t acknowledged_unix_ns = 0;  ///< the first time
};

/// A head that was kept elsewhere.
struct AuditAnchor {
  std::string name;  ///< for messages
  AuditHead head;
  std::optional<AuditKey::Hash> first = {};  ///< the MAC of its chain's first entry, where that is known
};

struct AuditVerdict {
  std::uint64_t lines = 0;  ///< with a proof
  std::uint64_t faults = 0;
  std::vector<std::string> texts;  ///< the first faults, at most kMaxAuditFaults
  std::vector<AuditBreak> breaks;  ///< by line; each that nobody has acknowledged is a fault, too
  AuditHead head;                  ///< nothing is promised about lines removed after the newest anchor
  [[nodiscard]] bool ok() const { return faults == 0; }
};
inline constexpr std::size_t kMaxAuditFaults = 100;

/// Finds lines that were changed, reordered, forged or removed (the last ones, where one of `anchors` is
/// newer), and what is foreign in the schema (schemaFaults()). `keys`: the folder's, and earlier ones. One
/// read view; a time proportional to the log. Errors: the database could not be read. Thread: as the
/// connection.
Result<AuditVerdict> verifyAudit(Connection& connection, std::span<const AuditKey> keys,
                                 std::span<const AuditAnchor> anchors);

}  // namespace needlelab
