#include "db/audit/audit_chain.h"

#include <fmt/core.h>
#include <sodium.h>

#include <algorithm>
#include <charconv>
#include <map>
#include <mutex>
#include <tuple>
#include <unordered_set>
#include <utility>

#include "common/base/files/files.h"
#include "common/base/text/text.h"
#include "db/store/schema.h"

namespace needlelab {
namespace {

constexpr std::string_view kHeadWords = "audit head ";

/// The part of a line that its entry proves.
struct ProvenLine {
  std::int64_t id = 0, unix_ns = 0;
  std::string who, action, subject, detail;
};

/// Columns of `audit` in the order of lineAt().
constexpr std::string_view kLineColumns = "a.id, a.unix_ns, a.who, a.action, a.subject, a.detail";

ProvenLine lineAt(const Statement& row, int at) {
  return {row.integer(at),  row.integer(at + 1), row.text(at + 2),
          row.text(at + 3), row.text(at + 4),    row.text(at + 5)};
}

/// Length-prefixed, so that no two lines give the same bytes.
void putText(ByteWriter& writer, std::string_view text) {
  writer.put(static_cast<std::uint64_t>(text.size()));
  writer.put(viewOf(text));
}

AuditKey::Hash plainHash(ByteView message) {
  AuditKey::Hash hash{};
  crypto_generichash(hash.data(), hash.size(), message.data(), message.size(), nullptr, 0);
  return hash;
}

/// The "previous MAC" of the first entry.
AuditKey::Hash startOfChain() {
  return plainHash(viewOf("needlelab audit chain"));
}

Bytes messageOf(std::uint64_t position, const ProvenLine& line, ByteView before) {
  Bytes message;
  ByteWriter writer(message);
  putText(writer, "needlelab audit entry");
  writer.put(position);
  writer.put(line.id);
  writer.put(line.unix_ns);
  for (const std::string* text : {&line.who, &line.action, &line.subject, &line.detail})
    putText(writer, *text);
  writer.put(before);
  return message;
}

/// A MAC of the wrong length (from tampering) is truncated or zero-padded.
AuditHead headOf(std::uint64_t position, ByteView mac) {
  AuditHead head{position, {}};
  std::copy_n(mac.begin(), std::min(mac.size(), head.mac.size()), head.mac.begin());
  return head;
}

bool sameBytes(ByteView a, ByteView b) {
  return a.size() == b.size() && sodium_memcmp(a.data(), b.data(), a.size()) == 0;
}

}  // namespace

AuditKey::AuditKey(const Hash& key) : key_(key), id_{} {
  const Hash hash = macOf(viewOf("needlelab audit key"));
  std::copy_n(hash.begin(), id_.size(), id_.begin());
}

AuditKey::Hash AuditKey::macOf(ByteView message) const {
  Hash mac{};
  crypto_generichash(mac.data(), mac.size(), message.data(), message.size(), key_.data(), key_.size());
  return mac;
}

Result<AuditKey> AuditKey::ofFile(const std::filesystem::path& path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error))
    return Error{ErrorCode::kNotFound,
                 path.string() + ": does not exist; without the key, changes cannot be detected"};
  ASSIGN_OR_RETURN(const auto bytes, readWholeFile(path, 1000));
  Hash key{};
  if (bytes.size() != key.size())
    return Error{
        ErrorCode::kCorrupt,
        fmt::format("{}: has {} bytes, a key has 32: put back the right file; with a new key the lines "
                    "so far can be proven only by the old one",
                    path.string(), bytes.size())};
  std::copy(bytes.begin(), bytes.end(), key.begin());
  return AuditKey(key);
}

Result<AuditKey> AuditKey::ofFolder(const std::filesystem::path& folder) {
  static std::mutex one_at_a_time;
  const std::scoped_lock lock(one_at_a_time);
  const auto path = folder / kAuditKeyFile;
  auto found = ofFile(path);
  if (found || found.error().code != ErrorCode::kNotFound) return found;
  if (sodium_init() < 0) return Error{ErrorCode::kFailed, "the system has no source of random numbers"};
  Hash key{};
  randombytes_buf(key.data(), key.size());
  RETURN_IF_ERROR(writeFileAtomically(path, key, 0600));
  return AuditKey(key);
}

std::string auditHeadText(const AuditHead& head) {
  return fmt::format("{}{}:{}", kHeadWords, head.position, hexDigitsOf(textOf(head.mac)));
}

std::optional<AuditHead> auditHeadOf(std::string_view text) {
  constexpr std::size_t kMaxDigits = 18;
  const std::size_t colon = text.find(':');
  if (!text.starts_with(kHeadWords) || colon > kHeadWords.size() + kMaxDigits) return std::nullopt;
  AuditHead head;
  const auto mac = bytesOfHex(text.substr(colon + 1));
  if (!mac || mac->size() != head.mac.size()) return std::nullopt;
  std::from_chars(text.data() + kHeadWords.size(), text.data() + colon, head.position);
  std::copy(mac->begin(), mac->end(), head.mac.begin());
  // numbers and hex digits have several spellings; a head has only one
  return auditHeadText(head) == text ? std::optional(head) : std::nullopt;
}

std::string acknowledgedSubject(std::int64_t line) {
  return fmt::format("line {}", line);
}

Result<AuditHead> AuditChain::head() {
  ASSIGN_OR_RETURN(const auto head,
                   connection_.prepare("SELECT position, mac FROM audit_chain ORDER BY position DESC LIMIT 1")
                       .first([](const Statement& row) { return headOf(row.natural(0), row.bytes(1)); }));
  return head.value_or(AuditHead{});
}

Result<std::optional<AuditKey::Hash>> AuditChain::firstMac() {
  return connection_.prepare("SELECT mac FROM audit_chain ORDER BY position LIMIT 1")
      .first([](const Statement& row) { return headOf(0, row.bytes(0)).mac; });
}

Status AuditChain::entry(const AuditKey& key, const AuditHead& last, std::int64_t line_id) {
  ASSIGN_OR_RETURN(
      const auto line,
      connection_.query(fmt::format("SELECT {} FROM audit a WHERE a.id = ?", kLineColumns), line_id)
          .first([](const Statement& row) { return lineAt(row, 0); }));
  if (!line)
    return Error{ErrorCode::kNotFound, fmt::format("the audit log has no line {} to prove", line_id)};
  AuditHead next{last.position + 1, {}};
  next.mac = key.macOf(messageOf(next.position, *line, last.mac));
  return connection_.run("INSERT INTO audit_chain (position, line, key_id, mac) VALUES (?,?,?,?)",
                         next.position, line_id, ByteView(key.id()), ByteView(next.mac));
}

Status AuditChain::append(std::int64_t line) {
  ASSIGN_OR_RETURN(auto last, head());
  if (last.position == 0) last.mac = startOfChain();
  ASSIGN_OR_RETURN(const auto key, AuditKey::ofFolder(connection_.path().parent_path()));
  return entry(key, last, line);
}

namespace {

/// One walk over the chain.
class ChainWalk {
 public:
  ChainWalk(std::span<const AuditKey> keys, std::span<const AuditAnchor> anchors)
      : keys_(keys), anchors_(anchors) {}

  void fault(std::string text) {
    ++verdict_.faults;
    if (verdict_.texts.size() < kMaxAuditFaults) verdict_.texts.push_back(std::move(text));
  }

  /// `row`: position, key_id, mac, line, then the line's columns (NULL if the line is missing).
  void take(const Statement& row) {
    const std::uint64_t position = row.natural(0), faults_before = verdict_.faults;
    if (position > verdict_.head.position + 1)
      fault(fmt::format("entries {} to {} are missing: lines were removed", verdict_.head.position + 1,
                        position - 1));
    else if (position <= verdict_.head.position)
      fault("an entry has no number: it was put in");
    const ByteView key_id = row.bytes(1), mac = row.bytes(2);
    ++verdict_.lines;
    if (row.isNull(4)) {
      fault(fmt::format("line {} was removed", row.integer(3)));
    } else {
      const ProvenLine line = lineAt(row, 4);
      const auto key = std::find_if(keys_.begin(), keys_.end(),
                                    [&](const auto& one) { return sameBytes(one.id(), key_id); });
      if (key == keys_.end())
        fault(
            fmt::format("line {}: is of another key ({}…): give the key of that time, or somebody forged it",
                        line.id, hexDigitsOf(textOf(key_id)).substr(0, 8)));
      else if (!sameBytes(mac, key->macOf(messageOf(position, line, before_))))
        fault(fmt::format("line {}: is not as it was written, or not in its place", line.id));
      const bool sound = verdict_.faults == faults_before;
      if (line.action == kAuditBreak)
        breaks_.try_emplace(line.id, AuditBreak{line.id, line.unix_ns, line.detail, headOf(position, mac)});
      if (line.action == kAuditAcknowledge && sound) acknowledge(line);
    }
    verdict_.head = headOf(position, mac);
    if (position == 1) first_ = verdict_.head.mac;
    before_ = verdict_.head.mac;
    for (const AuditAnchor& anchor : anchors_) {
      if (position == 1 && isOfAnotherChain(anchor))
        fault(fmt::format(
            "{}: this chain begins after it: the one that it has, of {} entries, was removed, and "
            "lines may be gone with it (or it is another server's)",
            anchor.name, anchor.head.position));
      else if (anchor.head.position == position && !isOfAnotherChain(anchor) &&
               !sameBytes(anchor.head.mac, mac))
        fault(fmt::format("{}: entry {} is another one now: the log before it was changed", anchor.name,
                          position));
    }
  }

  AuditVerdict end() {
    for (const AuditAnchor& anchor : anchors_) {
      if (anchor.head.position > verdict_.head.position && !isOfAnotherChain(anchor))
        fault(fmt::format(
            "{}: the log ends with entry {}, and had {}: lines were removed, or an older backup was "
            "restored",
            anchor.name, verdict_.head.position, anchor.head.position));
    }
    for (auto& [line, found] : breaks_) {
      if (found.acknowledged_by.empty()) fault(fmt::format("line {}: {}", line, found.detail));
      verdict_.breaks.push_back(std::move(found));
    }
    return std::move(verdict_);
  }

 private:
  /// A restarted chain has a different first entry: of another line or another time.
  [[nodiscard]] bool isOfAnotherChain(const AuditAnchor& anchor) const {
    return first_ && anchor.first && *first_ != *anchor.first;
  }

  /// An acknowledgement applies only to the break it names, and only if the break precedes it.
  void acknowledge(const ProvenLine& line) {
    for (auto& [number, found] : breaks_) {
      if (found.acknowledged_by.empty() && line.subject == acknowledgedSubject(number) &&
          line.detail == auditHeadText(found.entry))
        std::tie(found.acknowledged_by, found.acknowledged_unix_ns) = std::tie(line.who, line.unix_ns);
    }
  }

  std::span<const AuditKey> keys_;
  std::span<const AuditAnchor> anchors_;
  AuditKey::Hash before_ = startOfChain();
  std::optional<AuditKey::Hash> first_;        ///< the first entry's MAC
  std::map<std::int64_t, AuditBreak> breaks_;  ///< by line
  AuditVerdict verdict_;
};

/// Calls `take` with each row in ascending order of the number `by`, the row's first column. `sql` ends with
/// the condition that the number is at least ?. Reads in pieces, because an engine may load a whole result.
template <typename Take>
Status eachFrom(Connection& connection, const std::string& sql, std::string_view by, const Take& take) {
  constexpr int kAtOnce = 1024;
  const std::string some = fmt::format("{} ORDER BY {} LIMIT ?", sql, by);
  for (std::int64_t from = INT64_MIN;;) {
    auto rows = connection.query(some, from, kAtOnce);
    for (int taken = 0; taken < kAtOnce; ++taken) {
      ASSIGN_OR_RETURN(const bool more, rows.step());
      if (!more) return {};
      take(std::as_const(rows));
      const std::int64_t number = rows.integer(0);
      if (number == INT64_MAX) return {};
      from = number + 1;
    }
  }
}

}  // namespace

Result<AuditVerdict> verifyAudit(Connection& connection, std::span<const AuditKey> keys,
                                 std::span<const AuditAnchor> anchors) {
  ASSIGN_OR_RETURN(const auto view, Transaction::view(connection));
  ChainWalk walk(keys, anchors);
  // anything that could change or swallow a line before it is proven
  ASSIGN_OR_RETURN(const auto foreign, schemaFaults(connection));
  for (const std::string& text : foreign) walk.fault(text);
  // read the tables directly: index entries may have been added or removed
  std::unordered_set<std::int64_t> proven;
  RETURN_IF_ERROR(eachFrom(connection,
                           fmt::format("SELECT c.position, c.key_id, c.mac, c.line, {}"
                                       " FROM audit_chain c NOT INDEXED LEFT JOIN audit a ON a.id = c.line"
                                       " WHERE c.position >= ?",
                                       kLineColumns),
                           "c.position", [&](const Statement& row) {
                             walk.take(row);
                             proven.insert(row.integer(3));
                           }));
  RETURN_IF_ERROR(
      eachFrom(connection, "SELECT id FROM audit NOT INDEXED WHERE id >= ?", "id", [&](const Statement& row) {
        if (!proven.contains(row.integer(0)))
          walk.fault(fmt::format("line {}: nothing proves it: it was put in, or its proof was removed",
                                 row.integer(0)));
      }));
  return walk.end();
}

}  // namespace needlelab
