// A session's check: every chunk, the counters, the hash, and the rows that belong to it.
#include <fmt/core.h>

#include <algorithm>
#include <iterator>
#include <optional>
#include <utility>

#include "db/sessions/session_rows.h"
#include "db/sessions/session_store.h"
#include "db/store/connection.h"

namespace needlelab {
namespace {

/// Stored facts about the session's recording.
struct Noted {
  StoredRecording recording;
  std::uint64_t samples = 0;
  std::uint64_t stored_bytes = 0;
  std::optional<Digest> hash;           ///< nothing while the session is open
  std::optional<Digest> original_hash;  ///< thinned recordings: the stored hash of the original
  std::string remark;                   ///< set if the recording is intact
};

Result<std::uint64_t> count(Connection& connection, std::string_view sql, std::int64_t session,
                            std::uint64_t from) {
  auto rows = connection.query(sql, session, from);
  RETURN_IF_ERROR(rows.step());
  return rows.natural(0);
}

/// Faults in the rows that belong to the session: wrong counters, missing or superfluous retention rows.
Result<std::vector<std::string>> bookFaults(Connection& connection, const std::string& name,
                                            const SessionRow& row) {
  std::vector<std::string> faults;
  const bool open = row.state == pb::SESSION_OPEN;
  if (open && !row.counting) faults.push_back(name + " is open, but its counters are not there");
  if (!open && row.counting) faults.push_back(name + " is closed, but has the counters of an open one");
  auto query = connection.query(
      "SELECT leftover, length(crcs), (SELECT complete FROM derived_recordings"
      " WHERE session = ?1) FROM removed_originals WHERE session = ?1",
      row.number);
  ASSIGN_OR_RETURN(const bool there, query.step());
  const bool original = row.recording == StoredRecording::Kind::kOriginal;
  if (original && there) faults.push_back(name + " has its original, but it is noted as removed");
  if (!original && !there) faults.push_back(name + " has lost its original, but no note says when and why");
  if (original || !there) return faults;
  if (query.natural(1) != 4 * row.chunks)
    faults.push_back(fmt::format("{}: the CRCs of {} removed chunks are noted, there were {}", name,
                                 query.natural(1) / 4, row.chunks));
  // while an original is being removed, remaining rows are not a fault
  if (query.integer(0) == 1) return faults;
  ASSIGN_OR_RETURN(
      const auto left,
      count(connection, "SELECT count(*) FROM chunks WHERE session = ? AND seq >= ?", row.number, 0));
  if (left != 0)
    faults.push_back(fmt::format("{} holds {} chunks of an original that was removed", name, left));
  return faults;
}

Result<Noted> notedOf(Connection& connection, const std::string& name, const SessionRow& row) {
  Noted noted;
  ASSIGN_OR_RETURN(const auto recording, recordingOf(connection, name, row));
  noted.recording = recording;
  if (row.recording == StoredRecording::Kind::kOriginal) {
    noted.samples = row.samples;
    noted.stored_bytes = row.stored_bytes;
    noted.hash = row.hash;
    noted.remark =
        row.state == pb::SESSION_OPEN ? "all chunks so far are sound; the session is still open" : "sound";
    return noted;
  }
  ASSIGN_OR_RETURN(const auto why, removalText(connection, row));
  noted.remark = "sound; " + why;
  if (row.recording == StoredRecording::Kind::kDeleted) return noted;
  auto query = connection.query(
      "SELECT samples, hash, original_hash, stored_bytes FROM derived_recordings WHERE session = ?",
      row.number);
  RETURN_IF_ERROR(query.step());
  noted.samples = query.natural(0);
  noted.hash = digestOf(query.bytes(1));
  noted.original_hash = digestOf(query.bytes(2));
  noted.stored_bytes = query.natural(3);
  return noted;
}

}  // namespace

Result<SessionCheck> SessionStore::verify(const Uuid& session) {
  SessionCheckSoFar so_far;
  ASSIGN_OR_RETURN(auto check, verifyOn(session, UINT64_MAX, so_far));
  return *std::move(check);
}

Result<std::optional<SessionCheck>> SessionStore::verifyOn(const Uuid& session, std::uint64_t most_bytes,
                                                           SessionCheckSoFar& so_far) {
  // one unchanging view of the session's row and its chunks
  ASSIGN_OR_RETURN(const auto view, Transaction::view(connection_));
  ASSIGN_OR_RETURN(const SessionRow row, requireSession(connection_, session));
  const std::string name = "session " + uuidText(session);

  const bool begins = so_far.recording != static_cast<int>(row.recording);
  if (begins) so_far = {};
  so_far.recording = static_cast<int>(row.recording);
  SessionCheck& check = so_far.check;
  const auto bad = [&](std::string why) {
    if (check.faults.size() < kMaxFaults) check.faults.push_back(std::move(why));
  };
  // a fault in the data is a finding; a database that cannot be read is an error
  const auto finding = [&](const Error& error) {
    if (error.code == ErrorCode::kCorrupt) bad(name + ": " + error.message);
    return error.code == ErrorCode::kCorrupt;
  };
  const auto finished = [&] {
    check.ok = check.faults.empty() && check.undecodable.empty();
    if (!check.undecodable.empty())
      check.text = fmt::format(
          "{} cannot be decoded and {} kept as {} came; the first: {}",
          check.undecodable_chunks == 1 ? "a chunk" : fmt::format("{} chunks", check.undecodable_chunks),
          check.undecodable_chunks == 1 ? "is" : "are", check.undecodable_chunks == 1 ? "it" : "they",
          check.undecodable.front().text);
    if (!check.faults.empty()) check.text = check.faults.front();
    return std::optional(std::move(check));
  };
  if (begins) {
    auto books = bookFaults(connection_, name, row);
    if (!books && !finding(books.error())) return books.error();
    if (books) {
      for (std::string& fault : *books) bad(std::move(fault));
    }
  }
  const auto noted = notedOf(connection_, name, row);
  if (!noted && !finding(noted.error())) return noted.error();
  if (!noted) return finished();

  ChunkScan scan(connection_, name, noted->recording, so_far.next_seq, UINT64_MAX, most_bytes);
  for (std::uint64_t read = 0; check.faults.size() < kMaxFaults;) {
    if (read >= most_bytes) return std::optional<SessionCheck>();
    ASSIGN_OR_RETURN(const auto item, scan.next());
    if (!item) break;
    read += item->bytes.size() + kHashedChunkBytes;
    so_far.next_seq = item->seq + 1;
    if (item->damaged()) {
      bad(item->fault->message);
      continue;
    }
    so_far.hash.update(item->bytes);
    so_far.bytes += item->bytes.size();
    so_far.samples += item->samples;
    if (item->undecodable) {
      if (check.undecodable.size() < kMaxFaults)
        check.undecodable.push_back({item->seq, item->fault->message});
      ++check.undecodable_chunks;
      continue;
    }
    ++check.chunks;
    check.samples += item->samples;
  }
  check.hash = so_far.hash.digest();
  // after a bad chunk the sums add nothing
  if (!check.faults.empty()) return finished();
  if (row.recording == StoredRecording::Kind::kDeleted) {
    check.text = noted->remark;
    return finished();
  }
  const auto beyond = count(
      connection_,
      "SELECT count(*) FROM " + std::string(noted->recording.table()) + " WHERE session = ? AND seq >= ?",
      row.number, noted->recording.chunks);
  if (!beyond && !finding(beyond.error())) return beyond.error();
  if (beyond && *beyond != 0)
    bad(fmt::format("{} has chunks beyond the {} noted", name, noted->recording.chunks));
  if (so_far.samples != noted->samples) {
    bad(fmt::format("{} holds {} samples, noted are {}", name, so_far.samples, noted->samples));
  }
  if (so_far.bytes != noted->stored_bytes) {
    bad(fmt::format("{} holds {} bytes, noted are {}", name, so_far.bytes, noted->stored_bytes));
  }
  if (row.state != pb::SESSION_OPEN && noted->hash != check.hash)
    bad(name + ": the hash over its chunks is not the one it was closed with");
  if (noted->original_hash && noted->original_hash != row.hash)
    bad(name + ": its thinned recording names another original than the session's");
  check.text = noted->remark;
  return finished();
}

}  // namespace needlelab
