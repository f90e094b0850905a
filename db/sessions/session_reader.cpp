// Reads sessions: list, info, chunks, and the search for a moment's chunk. session_store.cpp changes them.
#include <fmt/core.h>

#include <algorithm>
#include <functional>
#include <optional>
#include <utility>
#include <variant>

#include "common/base/text/text.h"
#include "common/gesture/chunk.h"
#include "db/sessions/session_rows.h"
#include "db/sessions/session_store.h"
#include "db/sessions/unknown_trainees.h"
#include "db/store/connection.h"
#include "db/store/rows.h"

namespace needlelab {
namespace {

/// Columns 7 to 10 belong to the original, 11 to 15 to a thinned recording.
/// {}: the profile, or NULL if not wanted (it may be 1 MiB).
constexpr std::string_view kInfoColumns =
    "SELECT s.description, s.state, s.received_unix_ns, s.closed_unix_ns,"
    " s.clock_offset_ns, s.clock_round_trip_ns, s.recording, coalesce(p.chunks,"
    " s.chunks), coalesce(p.samples, s.samples), coalesce(p.stored_bytes,"
    " s.stored_bytes), s.hash, d.chunks, d.samples, d.stored_bytes, d.hash,"
    " d.rate_hz, o.removed_unix_ns, o.deleted_unix_ns, o.reason, s.number,"
    " {}, s.score_json, s.passed, u.given, u.by_whom,"
    " u.code_unchecked = 1 AND u.begin_unsure = 0 AND u.not_assigned = 0 AND"
    " EXISTS (SELECT 1 FROM accounts WHERE ref = s.trainee),"
    " (SELECT count(*) FROM quarantined_chunks WHERE session = s.number), s.id, s.trainee, "
    "s.started_unix_ns, u.begin_unsure,"
    " u.not_assigned = 1 AND EXISTS (SELECT 1 FROM accounts WHERE ref = s.trainee) FROM sessions s"
    " LEFT JOIN session_progress p ON p.session = s.number"
    " LEFT JOIN unknown_trainees u ON u.session = s.number"
    " LEFT JOIN derived_recordings d ON d.session = s.number AND d.complete = 1"
    " LEFT JOIN removed_originals o ON o.session = s.number ";

std::string infoColumns(bool with_profile) {
  return fmt::format(kInfoColumns, with_profile ? "s.profile_json" : "NULL");
}

/// Converts a row of infoColumns().
Result<pb::SessionInfo> infoOf(const Statement& row, bool with_profile) {
  pb::SessionInfo info;
  const ByteView description = row.bytes(0);
  if (!info.mutable_description()->ParseFromArray(description.data(), static_cast<int>(description.size()))) {
    return Error{ErrorCode::kCorrupt, "the stored description of a session cannot be read"};
  }
  info.mutable_description()->set_trainee(row.text(28));
  info.mutable_description()->set_trainee_full_name(row.text(28));
  info.mutable_description()->set_started_unix_ns(row.integer(29));  // a manager may have corrected it
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
  if (!row.isNull(24)) {
    info.set_given_trainee(row.text(23));
  } else if (!row.isNull(23)) {
    info.set_unknown_trainee(true);
    info.set_code_unchecked(row.integer(25) != 0);
    info.set_begin_unsure(row.integer(30) != 0);
    info.set_not_assigned(row.integer(31) != 0);
  }
  info.set_quarantined_chunks(row.natural(26));
  return info;
}

/// A list's conditions with their values; only the given ones, so that SQLite can use an index.
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
  /// Repeats the last value, for a condition that uses it twice.
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

Result<SessionConditions> conditionsOf(const pb::ListSessions& wanted, const std::optional<Uuid>& after,
                                       bool only_counted, std::int64_t held_at_unix_ns) {
  SessionConditions conditions;
  conditions.add("s.station = ?", wanted.station());
  // includes sessions that wait under a typed form of the person's name
  if (only_counted) {
    conditions.add("s.trainee = ?", wanted.trainee());
  } else if (!wanted.trainee().empty()) {
    conditions.add(
        "s.trainee IN (?, (SELECT t.ref FROM called t JOIN called a ON a.folded = t.folded"
        " WHERE t.typed = 1 AND a.ref = ?))",
        wanted.trainee());
    conditions.again();
  }
  conditions.add("s.exercise_id = ?", wanted.exercise_id());
  if (wanted.from_unix_ns() != 0) conditions.add("s.started_unix_ns >= ?", wanted.from_unix_ns());
  if (wanted.to_unix_ns() != 0) conditions.add("s.started_unix_ns < ?", wanted.to_unix_ns());
  const std::string passed =
      held_at_unix_ns == 0
          ? "s.passed"
          : fmt::format(
                "CASE WHEN s.exercise_id IN (SELECT id FROM exercises WHERE results_from_unix_ns > {})"
                " THEN NULL ELSE s.passed END",
                held_at_unix_ns);
  switch (wanted.verdict()) {
    case pb::ListSessions::ANY:
      break;
    case pb::ListSessions::PASSED:
      conditions.push(passed + " = 1");
      break;
    case pb::ListSessions::FAILED:
      conditions.push(passed + " = 0");
      break;
    case pb::ListSessions::NONE:
      conditions.push(passed + " IS NULL");
      break;
    default:
      return Error{ErrorCode::kInvalidInput,
                   fmt::format("verdict: {} is not a verdict that this server knows",
                               static_cast<int>(wanted.verdict()))};
  }
  if (wanted.unknown_trainee()) conditions.push(fmt::format("s.number IN {}", kWaitingSessions));
  if (only_counted) conditions.push("NOT EXISTS (SELECT 1 FROM uncounted_sessions WHERE session = s.number)");
  if (!wanted.search().empty()) {
    RETURN_IF_ERROR(checkText("search", wanted.search(), 1, kMaxNameBytes));
    // an expression, to keep SQLite from using an index on trainees: the newest sessions come first without a
    // sort
    conditions.add(
        "(s.trainee || '' IN (SELECT ref FROM called WHERE instr(lower(name), lower(?)) > 0"
        " OR instr(lower(full_name), lower(?)) > 0"
        " UNION ALL SELECT 'guest' WHERE instr('guest', lower(?)) > 0))",
        wanted.search());
    conditions.again();
    conditions.again();
  }
  if (after)
    conditions.add(
        "(s.started_unix_ns, s.number) < (SELECT started_unix_ns, number FROM sessions WHERE id = ?)",
        *after);
  return conditions;
}

/// One search. Chunks are about equally long, so it interpolates between both ends (one or two guesses
/// suffice). Every other step bisects, so that a recording with gaps needs at most 2·log2 steps.
class Search {
 public:
  Search(Connection& connection, std::string name, const StoredRecording& recording)
      : connection_(connection), name_(std::move(name)), recording_(recording) {}

  Result<SoughtChunk> run(const SeekTo& to) {
    ASSIGN_OR_RETURN(auto first, infoOf(0));
    if (!first)
      return Error{ErrorCode::kCorrupt, name_ + ", chunk 0: is damaged, times cannot be counted from it"};
    SoughtChunk sought;
    sought.recording_first_tick = first->first_tick;
    sought.recording_first_time_ns = first->first_time_ns;
    by_time_ = !to.tick.has_value();
    // relative to the first chunk, so that ticks and times keep their precision
    origin_ = *first;
    target_ =
        by_time_ ? to.seconds * 1e9
                 : (*to.tick >= origin_.first_tick ? static_cast<double>(*to.tick - origin_.first_tick) : -1);

    std::uint64_t low = 0, high = recording_.chunks;
    ChunkInfo at_low = *first;
    double end = -1;  // start of chunk `high`, once known
    if (target_ > 0 && high > 1) {
      ASSIGN_OR_RETURN(const auto last, infoOf(high - 1));
      if (last) {
        const double begin = beginOf(*last);
        if (target_ >= begin) {
          low = high - 1;
          at_low = *last;
        } else {
          high = high - 1;
          end = begin;
        }
      }
    }
    bool guess = true;
    while (target_ > 0 && high - low > 1) {
      if (!by_time_ && *to.tick >= at_low.first_tick && *to.tick <= at_low.last_tick) break;
      std::uint64_t middle = low + (high - low) / 2;
      if (guess && end > beginOf(at_low)) {
        const double share = (target_ - beginOf(at_low)) / (end - beginOf(at_low));
        middle = low + static_cast<std::uint64_t>(share * static_cast<double>(high - low));
        middle = std::clamp(middle, low + 1, high - 1);
      }
      guess = !guess || high - low <= 4;
      ASSIGN_OR_RETURN(const auto info, infoOf(middle));
      // on a damaged chunk, continue before it: the result is never too late
      if (!info || beginOf(*info) > target_) {
        high = middle;
        if (info) end = beginOf(*info);
      } else {
        low = middle;
        at_low = *info;
      }
    }
    sought.seq = low;
    sought.first_tick = at_low.first_tick;
    sought.first_time_ns = at_low.first_time_ns;
    sought.chunks_read = read_;
    return sought;
  }

 private:
  [[nodiscard]] double beginOf(const ChunkInfo& info) const {
    if (by_time_) return static_cast<double>(info.first_time_ns - origin_.first_time_ns);
    return info.first_tick >= origin_.first_tick ? static_cast<double>(info.first_tick - origin_.first_tick)
                                                 : 0;
  }

  /// The header of a chunk with correct CRCs; nothing if it is damaged.
  Result<std::optional<ChunkInfo>> infoOf(std::uint64_t seq) {
    ++read_;
    ChunkScan scan(connection_, name_, recording_, seq, seq + 1);
    ASSIGN_OR_RETURN(const auto item, scan.next());
    if (!item || item->fault) return std::optional<ChunkInfo>();
    const auto info = inspectChunk(item->bytes);
    return info ? std::optional(*info) : std::optional<ChunkInfo>();
  }

  Connection& connection_;
  const std::string name_;
  const StoredRecording recording_;
  ChunkInfo origin_;
  bool by_time_ = false;
  double target_ = 0;
  std::uint32_t read_ = 0;
};

}  // namespace

Result<HashedChunks> SessionStore::hashChunks(const Uuid& session, std::uint64_t count) {
  HashSoFar all;
  RETURN_IF_ERROR(hashOn(session, count, UINT64_MAX, all));
  return all.result();
}

Status SessionStore::hashOn(const Uuid& session, std::uint64_t count, std::uint64_t most_bytes,
                            HashSoFar& so_far) {
  ASSIGN_OR_RETURN(const SessionRow row, requireSession(connection_, session));
  const std::string name = "session " + uuidText(session);
  if (row.recording != StoredRecording::Kind::kOriginal) {
    const auto why = removalText(connection_, row);
    return why ? Error{ErrorCode::kNotFound, name + ": " + *why} : why.error();
  }
  if (row.chunks < count) {
    return Error{ErrorCode::kNotFound,
                 fmt::format("{} has {} chunks, asked were {}", name, row.chunks, count)};
  }
  static_assert(kHashedChunkBytes == ChunkScan::kChunkCost);
  ChunkScan scan(connection_, name, {row.recording, row.number, row.chunks}, so_far.chunks, count,
                 most_bytes);
  for (std::uint64_t read = 0; read < most_bytes;) {
    ASSIGN_OR_RETURN(const auto item, scan.next());
    if (!item) break;
    if (item->damaged()) return *item->fault;
    so_far.hash.update(item->bytes);
    ++so_far.chunks;
    so_far.samples += item->samples;
    so_far.bytes += item->bytes.size();
    read += item->bytes.size() + kHashedChunkBytes;
  }
  return {};
}

Result<std::uint64_t> SessionStore::nextSeq(const Uuid& session) {
  ASSIGN_OR_RETURN(const SessionRow row, requireSession(connection_, session));
  return row.chunks;
}

Result<std::uint64_t> SessionStore::safeSeqs(const Uuid& session) {
  auto query = connection_.query("SELECT safe_chunks FROM sessions WHERE id = ?", ByteView(session));
  ASSIGN_OR_RETURN(const bool found, query.step());
  if (!found) return unknownSession(session);
  return query.natural(0);
}

Result<std::uint64_t> SessionStore::mostSafeSeqs(const Uuid& session) {
  ASSIGN_OR_RETURN(const auto first,
                   connection_
                       .query("SELECT q.seq FROM quarantined_chunks q JOIN sessions s ON s.number = q.session"
                              " WHERE s.id = ? ORDER BY q.seq LIMIT 1",
                              ByteView(session))
                       .first([](const Statement& row) { return row.natural(0); }));
  return first.value_or(UINT64_MAX);
}

Result<std::uint64_t> SessionStore::unsafeChunks(bool acks_are_safe) {
  auto row = connection_.prepare(
      acks_are_safe
          ? "SELECT coalesce(sum(max(coalesce(p.chunks, s.chunks) - max(s.safe_chunks, q.first_seq), 0)), 0)"
            " FROM (SELECT session, min(seq) AS first_seq FROM quarantined_chunks GROUP BY session) q"
            " JOIN sessions s ON s.number = q.session LEFT JOIN session_progress p ON p.session = s.number"
          : "SELECT coalesce(sum(max(coalesce(p.chunks, s.chunks) - s.safe_chunks, 0)), 0) FROM sessions s"
            " LEFT JOIN session_progress p ON p.session = s.number");
  ASSIGN_OR_RETURN(const bool there, row.step());
  return there ? row.natural(0) : 0;
}

Result<std::vector<pb::Welcome::OpenSession>> SessionStore::openSessions(std::string_view station) {
  const auto sessionOf = [](const Statement& row) {
    pb::Welcome::OpenSession session;
    session.set_session_id(row.text(0));
    session.set_next_seq(row.natural(1));
    return session;
  };
  auto rows = connection_.query(
      "SELECT o.id, coalesce(p.chunks, 0) FROM (SELECT number, id FROM sessions"
      " WHERE station = ? AND state = ? ORDER BY number DESC LIMIT ?) o"
      " LEFT JOIN session_progress p ON p.session = o.number ORDER BY o.number",
      station, static_cast<int>(pb::SESSION_OPEN), kMaxWelcomed);
  return rows.all(sessionOf);
}

Result<pb::SessionInfo> SessionStore::info(const Uuid& session) {
  auto row = connection_.query(infoColumns(true) + "WHERE s.id = ?", ByteView(session));
  ASSIGN_OR_RETURN(const bool found, row.step());
  if (!found) return unknownSession(session);
  return infoOf(row, true);
}

Result<std::vector<pb::SessionInfo>> SessionStore::list(const pb::ListSessions& wanted,
                                                        const std::optional<Uuid>& after, bool only_counted,
                                                        const std::function<bool(pb::SessionInfo&)>& take,
                                                        std::int64_t held_at_unix_ns) {
  const std::size_t most = wanted.limit() == 0 ? kMaxListed : std::min(wanted.limit(), kMaxListed);
  // SQLite returns row by row, and might sort again for each statement
  const bool in_pieces = connection_.sqlite() == nullptr;
  std::vector<pb::SessionInfo> sessions;
  std::optional<Uuid> last = after;
  for (RowsAtOnce at_once(kBytesOfPage); sessions.size() < most;) {
    at_once.goOn();
    ASSIGN_OR_RETURN(const auto conditions, conditionsOf(wanted, last, only_counted, held_at_unix_ns));
    auto rows = connection_.query(infoColumns(false) + conditions.text() +
                                  " ORDER BY s.started_unix_ns DESC, s.number DESC LIMIT ?");
    conditions.bindTo(rows);
    const auto left = static_cast<std::int64_t>(most - sessions.size());
    rows.bind(in_pieces ? std::min(left, at_once.count()) : left);
    for (bool all = false; !all && sessions.size() < most;) {
      ASSIGN_OR_RETURN(auto session, rows.first([](const Statement& row) { return infoOf(row, false); }));
      if (!session) return sessions;
      last = uuidOf(rows.text(27));
      if (!last) return Error{ErrorCode::kCorrupt, "a stored session has no id of 16 bytes"};
      all = at_once.took(session->ByteSizeLong()) && in_pieces;
      if (take && !take(*session)) return sessions;
      sessions.push_back(*std::move(session));
    }
  }
  return sessions;
}

Result<ChunksAround> SessionStore::readAround(const Uuid& session, std::uint64_t from_seq,
                                              std::uint32_t max_chunks, std::size_t max_bytes) {
  // one view: retention may switch to a thinned recording meanwhile
  ASSIGN_OR_RETURN(const auto view, Transaction::view(connection_));
  ASSIGN_OR_RETURN(const auto recording, readableRecording(connection_, session));
  const std::string name = "session " + uuidText(session);

  ChunksAround read;
  read.next_seq = from_seq;
  std::size_t total = 0;
  const std::uint64_t to = from_seq + std::min<std::uint64_t>(max_chunks, UINT64_MAX - from_seq);
  ChunkScan scan(connection_, name, recording, from_seq, to, max_bytes);
  for (std::uint32_t taken = 0; taken < max_chunks; ++taken) {
    ASSIGN_OR_RETURN(auto item, scan.next());
    if (!item) return read;
    ChunkScan::Item& chunk = *item;
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
  ASSIGN_OR_RETURN(auto read, readAround(session, from_seq, max_chunks, max_bytes));
  if (!read.damaged.empty()) return Error{ErrorCode::kCorrupt, read.damaged.front().text};
  return std::move(read.chunks);
}

Result<SoughtChunk> SessionStore::seek(const Uuid& session, const SeekTo& to) {
  ASSIGN_OR_RETURN(const auto view, Transaction::view(connection_));
  ASSIGN_OR_RETURN(const auto recording, readableRecording(connection_, session));
  const std::string name = "session " + uuidText(session);
  if (recording.chunks == 0) return Error{ErrorCode::kNotFound, name + " has no samples to seek in"};
  return Search(connection_, name, recording).run(to);
}

}  // namespace needlelab
