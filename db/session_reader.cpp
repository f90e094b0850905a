// What reads sessions: list, info, chunks, verify. What changes them is in session_store.cpp.
#include <algorithm>
#include <variant>

#include "common/base/text.h"
#include "db/chunk_scan.h"
#include "db/session_row.h"
#include "db/session_store.h"
#include "db/transaction.h"

namespace needlelab {
namespace {

/// What can be read stands in the first columns: of the thinned recording where there is one.
constexpr std::string_view kInfoColumns =
    "SELECT s.description, s.state, s.received_unix_ns, s.closed_unix_ns, s.clock_offset_ns,"
    " s.clock_round_trip_ns, s.recording, coalesce(p.chunks, s.chunks), coalesce(p.samples, s.samples),"
    " coalesce(p.stored_bytes, s.stored_bytes), s.hash,"
    " d.chunks, d.samples, d.stored_bytes, d.hash, d.rate_hz,"
    " o.removed_unix_ns, o.deleted_unix_ns, o.reason, s.number, s.profile_json, s.score_json, s.passed FROM "
    "sessions s"
    " LEFT JOIN session_progress p ON p.session = s.number"
    " LEFT JOIN derived_recordings d ON d.session = s.number AND d.complete = 1"
    " LEFT JOIN removed_originals o ON o.session = s.number ";

/// A row of kInfoColumns.
Result<pb::SessionInfo> infoOf(const Statement& row, bool with_profile) {
  pb::SessionInfo info;
  const ByteView description = row.bytes(0);
  if (!info.mutable_description()->ParseFromArray(description.data(), static_cast<int>(description.size()))) {
    return Error{ErrorCode::kCorrupt, "the stored description of a session cannot be read"};
  }
  info.set_state(static_cast<pb::SessionState>(row.integer(1)));
  info.set_received_unix_ns(row.integer(2));
  info.set_closed_unix_ns(row.integer(3));
  info.set_clock_offset_ns(row.integer(4));
  info.set_clock_round_trip_ns(row.integer(5));
  const auto kind = static_cast<StoredRecording::Kind>(row.integer(6));
  const auto counts = [&row](auto& target, int first) {
    target.set_chunks(row.natural(first));
    target.set_samples(row.natural(first + 1));
    target.set_stored_bytes(row.natural(first + 2));
    target.set_hash(row.text(first + 3));
  };
  if (kind == StoredRecording::Kind::kOriginal) {
    counts(info, 7);
  } else {
    auto* removed = info.mutable_removed_original();
    counts(*removed, 7);
    if (kind == StoredRecording::Kind::kThinned) {
      counts(info, 11);
      removed->set_thinned_rate_hz(row.real(15));
    }
    removed->set_fate(kind == StoredRecording::Kind::kThinned ? pb::RemovedOriginal::THINNED
                                                              : pb::RemovedOriginal::DELETED);
    removed->set_removed_unix_ns(row.integer(16));
    removed->set_deleted_unix_ns(row.integer(17));
    removed->set_reason(row.text(18));
  }
  if (with_profile) info.mutable_description()->set_profile_json(row.text(20));
  info.set_score_json(row.text(21));
  if (!row.isNull(22)) info.set_passed(row.integer(22) != 0);
  return info;
}

/// SessionConditions of a list, each with its value; only those that are asked for, so that an index may
/// serve them.
class SessionConditions {
 public:
  void add(std::string condition, std::string_view text) {
    if (text.empty()) return;
    push(std::move(condition));
    values_.emplace_back(std::string(text));
  }
  void add(std::string condition, std::int64_t number) {
    push(std::move(condition));
    values_.emplace_back(number);
  }
  void add(std::string condition, const Uuid& id) {
    push(std::move(condition));
    values_.emplace_back(id);
  }
  void push(std::string condition) { text_ += (text_.empty() ? "WHERE " : " AND ") + std::move(condition); }
  /// The last value stands in its condition twice.
  void again() { values_.push_back(values_.back()); }
  [[nodiscard]] const std::string& text() const { return text_; }
  void bindTo(Statement& query) const {
    for (const auto& value : values_) {
      if (const auto* const id = std::get_if<Uuid>(&value)) query.bind(ByteView(*id));
      if (const auto* const text = std::get_if<std::string>(&value)) query.bind(*text);
      if (const auto* const number = std::get_if<std::int64_t>(&value)) query.bind(*number);
    }
  }

 private:
  std::string text_;
  std::vector<std::variant<std::int64_t, std::string, Uuid>> values_;
};

Result<SessionConditions> conditionsOf(const pb::ListSessions& wanted, const std::optional<Uuid>& after) {
  SessionConditions conditions;
  conditions.add("s.station = ?", wanted.station());
  conditions.add("s.trainee = ?", wanted.trainee());
  conditions.add("s.exercise_id = ?", wanted.exercise_id());
  if (wanted.from_unix_ns() != 0) conditions.add("s.started_unix_ns >= ?", wanted.from_unix_ns());
  if (wanted.to_unix_ns() != 0) conditions.add("s.started_unix_ns < ?", wanted.to_unix_ns());
  switch (wanted.verdict()) {
    case pb::ListSessions::ANY:
      break;
    case pb::ListSessions::PASSED:
      conditions.push("s.passed = 1");
      break;
    case pb::ListSessions::FAILED:
      conditions.push("s.passed = 0");
      break;
    case pb::ListSessions::NONE:
      conditions.push("s.passed IS NULL");
      break;
    default:
      return Error{ErrorCode::kInvalidInput,
                   "verdict: " + std::to_string(wanted.verdict()) + " is no verdict that this server knows"};
  }
  if (!wanted.search().empty()) {
    if (auto valid = checkText("search", wanted.search(), 1, kMaxNameBytes); !valid) return valid.error();
    // somebody whom people do not list may have sessions, too: from a station that was away
    conditions.add(
        "(instr(lower(s.trainee), lower(?)) > 0 OR s.trainee IN (SELECT name FROM people WHERE"
        " instr(lower(full_name), lower(?)) > 0))",
        wanted.search());
    conditions.again();
  }
  if (after)
    conditions.add(
        "(s.started_unix_ns, s.number) < (SELECT started_unix_ns, number FROM sessions WHERE id = ?)",
        *after);
  return conditions;
}

}  // namespace

Result<HashedChunks> SessionStore::hashChunks(const Uuid& session, std::uint64_t count) {
  const auto found = findSession(connection_, session);
  if (!found) return found.error();
  if (!*found) return unknownSession(session);
  const SessionRow& row = **found;
  const std::string name = "session " + uuidText(session);
  if (row.recording != StoredRecording::Kind::kOriginal) {
    const auto why = removalText(connection_, row);
    return why ? Error{ErrorCode::kNotFound, name + ": " + *why} : why.error();
  }
  if (row.chunks < count) {
    return Error{ErrorCode::kNotFound, name + " has " + std::to_string(row.chunks) + " chunks, asked were " +
                                           std::to_string(count)};
  }
  HashedChunks result;
  SessionHash hash;
  ChunkScan scan(connection_, name, {row.recording, row.number, row.chunks}, 0, count);
  for (;;) {
    const auto item = scan.next();
    if (!item) return item.error();
    if (!*item) break;
    if ((*item)->fault) return *(*item)->fault;
    hash.update((*item)->bytes);
    ++result.chunks;
    result.samples += (*item)->samples;
  }
  result.hash = hash.digest();
  return result;
}

Result<std::uint64_t> SessionStore::nextSeq(const Uuid& session) {
  const auto found = findSession(connection_, session);
  if (!found) return found.error();
  if (!*found) return unknownSession(session);
  return (*found)->chunks;
}

Result<std::uint64_t> SessionStore::safeSeqs(const Uuid& session) {
  auto query = connection_.query("SELECT safe_chunks FROM sessions WHERE id = ?", ByteView(session));
  const auto found = query.step();
  if (!found) return found.error();
  if (!*found) return unknownSession(session);
  return query.natural(0);
}

Result<std::vector<pb::Welcome::OpenSession>> SessionStore::openSessions(std::string_view station) {
  std::vector<pb::Welcome::OpenSession> sessions;
  auto rows = connection_.query(
      "SELECT o.id, coalesce(p.chunks, 0) FROM (SELECT number, id FROM sessions WHERE station = ? AND state"
      " = ? ORDER BY number DESC LIMIT ?) o LEFT JOIN session_progress p ON p.session = o.number"
      " ORDER BY o.number",
      station, static_cast<int>(pb::SESSION_OPEN), kMaxWelcomed);
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) return sessions;
    auto& session = sessions.emplace_back();
    session.set_session_id(rows.text(0));
    session.set_next_seq(rows.natural(1));
  }
}

Result<pb::SessionInfo> SessionStore::info(const Uuid& session) {
  auto row = connection_.query(std::string(kInfoColumns) + "WHERE s.id = ?", ByteView(session));
  const auto found = row.step();
  if (!found) return found.error();
  if (!*found) return unknownSession(session);
  return infoOf(row, true);
}

Result<std::vector<pb::SessionInfo>> SessionStore::list(const pb::ListSessions& wanted,
                                                        const std::optional<Uuid>& after) {
  const auto conditions = conditionsOf(wanted, after);
  if (!conditions) return conditions.error();
  const std::uint32_t most = wanted.limit() == 0 ? kMaxListed : std::min(wanted.limit(), kMaxListed);
  auto rows = connection_.query(std::string(kInfoColumns) + conditions->text() +
                                " ORDER BY s.started_unix_ns DESC, s.number DESC LIMIT ?");
  conditions->bindTo(rows);
  rows.bind(most);
  std::vector<pb::SessionInfo> sessions;
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) return sessions;
    auto info = infoOf(rows, false);
    if (!info) return info.error();
    sessions.push_back(std::move(*info));
  }
}

Result<ChunksAround> SessionStore::readAround(const Uuid& session, std::uint64_t from_seq,
                                              std::uint32_t max_chunks, std::size_t max_bytes) {
  // one view: retention may put a thinned recording in the original's place meanwhile
  const auto view = Transaction::view(connection_);
  if (!view) return view.error();
  const auto recording = readableRecording(connection_, session);
  if (!recording) return recording.error();
  const std::string name = "session " + uuidText(session);

  ChunksAround read;
  read.next_seq = from_seq;
  std::size_t total = 0;
  ChunkScan scan(connection_, name, *recording, from_seq, UINT64_MAX);
  for (std::uint32_t taken = 0; taken < max_chunks; ++taken) {
    auto item = scan.next();
    if (!item) return item.error();
    if (!*item) return read;
    ChunkScan::Item& chunk = **item;
    if (chunk.fault) {
      read.damaged.push_back({chunk.seq, std::move(chunk.fault->message)});
    } else {
      if (!read.chunks.empty() && total + chunk.bytes.size() > max_bytes) return read;
      total += chunk.bytes.size();
      read.chunks.push_back({chunk.seq, chunk.samples, Bytes(chunk.bytes.begin(), chunk.bytes.end())});
    }
    read.next_seq = chunk.seq + 1;
  }
  return read;
}

Result<std::vector<StoredChunk>> SessionStore::readChunks(const Uuid& session, std::uint64_t from_seq,
                                                          std::uint32_t max_chunks, std::size_t max_bytes) {
  auto read = readAround(session, from_seq, max_chunks, max_bytes);
  if (!read) return read.error();
  if (!read->damaged.empty()) return Error{ErrorCode::kCorrupt, read->damaged.front().text};
  return std::move(read->chunks);
}

}  // namespace needlelab
