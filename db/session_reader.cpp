// What reads sessions: list, info, chunks, verify. What changes them is in session_store.cpp.
#include <algorithm>

#include "db/session_row.h"
#include "db/session_store.h"
#include "db/transaction.h"

namespace needlelab {
namespace {

constexpr std::uint32_t kMaxListed = 1000;

constexpr std::string_view kInfoColumns =
    "SELECT description, state, chunks, samples, hash, received_unix_ns, closed_unix_ns, stored_bytes, "
    "clock_offset_ns,"
    " clock_round_trip_ns, profile_json, score_json FROM sessions ";

/// A row of kInfoColumns; `texts`: with profile and score.
Result<pb::SessionInfo> infoOf(const Statement& row, bool texts) {
  pb::SessionInfo info;
  const ByteView description = row.bytes(0);
  if (!info.mutable_description()->ParseFromArray(description.data(), static_cast<int>(description.size()))) {
    return Error{ErrorCode::kCorrupt, "the stored description of a session cannot be read"};
  }
  info.set_state(static_cast<pb::SessionState>(row.integer(1)));
  info.set_chunks(row.natural(2));
  info.set_samples(row.natural(3));
  info.set_hash(row.text(4));
  info.set_received_unix_ns(row.integer(5));
  info.set_closed_unix_ns(row.integer(6));
  info.set_stored_bytes(row.natural(7));
  info.set_clock_offset_ns(row.integer(8));
  info.set_clock_round_trip_ns(row.integer(9));
  if (texts) {
    info.mutable_description()->set_profile_json(row.text(10));
    info.set_score_json(row.text(11));
  }
  return info;
}

}  // namespace

Result<HashedChunks> SessionStore::hashChunks(const Uuid& session, std::uint64_t count) {
  const auto found = findSession(connection_, session);
  if (!found) return found.error();
  if (!*found) return unknownSession(session);
  const std::string name = "session " + uuidText(session);

  HashedChunks result;
  SessionHash hash;
  auto rows = connection_.query(
      "SELECT seq, samples, crc, bytes FROM chunks WHERE session = ? AND seq < ? ORDER BY seq",
      (*found)->number, std::min<std::uint64_t>(count, INT64_MAX));
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) break;
    if (rows.natural(0) != result.chunks) {
      return Error{ErrorCode::kCorrupt, name + ": chunk " + std::to_string(result.chunks) + " is missing"};
    }
    const auto samples =
        checkStoredChunk(name, rows.natural(0), rows.natural(1), rows.integer(2), rows.bytes(3));
    if (!samples) return samples.error();
    hash.update(rows.bytes(3));
    ++result.chunks;
    result.samples += *samples;
  }
  if (result.chunks < count) {
    return Error{ErrorCode::kNotFound, name + " has " + std::to_string(result.chunks) +
                                           " chunks, asked were " + std::to_string(count)};
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
  auto rows =
      connection_.query("SELECT id, chunks FROM sessions WHERE station = ? AND state = ? ORDER BY number",
                        station, static_cast<int>(pb::SESSION_OPEN));
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
  auto row = connection_.query(std::string(kInfoColumns) + "WHERE id = ?", ByteView(session));
  const auto found = row.step();
  if (!found) return found.error();
  if (!*found) return unknownSession(session);
  return infoOf(row, true);
}

Result<std::vector<pb::SessionInfo>> SessionStore::list(std::string_view station, std::string_view trainee,
                                                        std::uint32_t limit) {
  std::vector<pb::SessionInfo> sessions;
  const std::uint32_t most = limit == 0 ? kMaxListed : std::min(limit, kMaxListed);
  auto rows = connection_.query(std::string(kInfoColumns) +
                                    "WHERE (?1 = '' OR station = ?1) AND (?2 = '' OR trainee = ?2)"
                                    " ORDER BY started_unix_ns DESC, number DESC LIMIT ?3",
                                station, trainee, most);
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) return sessions;
    auto info = infoOf(rows, false);
    if (!info) return info.error();
    sessions.push_back(std::move(*info));
  }
}

Result<std::vector<StoredChunk>> SessionStore::readChunks(const Uuid& session, std::uint64_t from_seq,
                                                          std::uint32_t max_chunks, std::size_t max_bytes) {
  const auto found = findSession(connection_, session);
  if (!found) return found.error();
  if (!*found) return unknownSession(session);
  const std::string name = "session " + uuidText(session);

  std::vector<StoredChunk> chunks;
  std::size_t total = 0;
  if (from_seq >= (*found)->chunks) return chunks;
  auto rows = connection_.query(
      "SELECT seq, samples, crc, bytes FROM chunks WHERE session = ? AND seq >= ? ORDER BY seq LIMIT ?",
      (*found)->number, from_seq, max_chunks);
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) return chunks;
    const ByteView bytes = rows.bytes(3);
    if (!chunks.empty() && total + bytes.size() > max_bytes) return chunks;
    const std::uint64_t seq = rows.natural(0);
    if (seq != from_seq + chunks.size()) {
      return Error{ErrorCode::kCorrupt,
                   name + ": chunk " + std::to_string(from_seq + chunks.size()) + " is missing"};
    }
    const auto samples = checkStoredChunk(name, seq, rows.natural(1), rows.integer(2), bytes);
    if (!samples) return samples.error();
    chunks.push_back({seq, *samples, Bytes(bytes.begin(), bytes.end())});
    total += bytes.size();
  }
}

Result<SessionCheck> SessionStore::verify(const Uuid& session) {
  // one unchanging view of the session's row and its chunks
  std::optional<Transaction> view;
  if (!connection_.inTransaction()) {
    auto begun = Transaction::begin(connection_, Transaction::Kind::kRead);
    if (!begun) return begun.error();
    view.emplace(std::move(*begun));
  }
  const auto found = findSession(connection_, session);
  if (!found) return found.error();
  if (!*found) return unknownSession(session);
  const SessionRow& row = **found;

  SessionCheck check;
  const auto bad = [&](const std::string& why) {
    check.text = why;
    return check;
  };
  const std::string name = "session " + uuidText(session);
  const auto hashed = hashChunks(session, row.chunks);
  if (!hashed) {
    // a fault of the data is a finding; a database that cannot be read is an error
    const auto code = hashed.error().code;
    if (code == ErrorCode::kCorrupt || code == ErrorCode::kNotFound) return bad(hashed.error().message);
    return hashed.error();
  }
  check.chunks = hashed->chunks;
  check.samples = hashed->samples;
  check.hash = hashed->hash;
  auto beyond =
      connection_.query("SELECT count(*) FROM chunks WHERE session = ? AND seq >= ?", row.number, row.chunks);
  const auto counted = beyond.step();
  if (!counted) return counted.error();
  if (beyond.integer(0) != 0)
    return bad(name + " has chunks beyond the " + std::to_string(row.chunks) + " noted");
  if (check.samples != row.samples) {
    return bad(name + " holds " + std::to_string(check.samples) + " samples, noted are " +
               std::to_string(row.samples));
  }
  if (row.state != pb::SESSION_OPEN && row.hash != check.hash) {
    return bad(name + ": the hash over its chunks is not the one it was closed with");
  }
  check.ok = true;
  check.text =
      row.state == pb::SESSION_OPEN ? "all chunks so far are sound; the session is still open" : "sound";
  return check;
}

}  // namespace needlelab
