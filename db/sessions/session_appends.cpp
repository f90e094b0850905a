// Stores many chunks with one statement: SessionStore::appendMany.
#include <fmt/core.h>

#include <array>
#include <cassert>
#include <limits>
#include <map>
#include <utility>

#include "common/base/planted_bug.h"
#include "common/gesture/chunk.h"
#include "db/sessions/session_rows.h"
#include "db/sessions/session_store.h"

namespace needlelab {
namespace {

/// Parameters per session: id, station, first seq, number of chunks, samples, bytes; per chunk: the session's
/// place in that list (from 1), seq, samples, CRC, bytes; per session also the claim of its chunks: server
/// and epoch (0: not checked). Stores the chunks of sessions whose next chunk is the first one given and
/// whose claim is the station's newest; returns these sessions' places. Sessions are looked up one by one:
/// for a join PostgreSQL would scan the whole table while it is small (0.16 ms for a thousand). Likewise the
/// counters: the conditions on first, chunks, samples and bytes, true for every row, make PostgreSQL expect
/// one session and look counters up by key.
constexpr const char* kAppendMany =
    "WITH heads AS ("
    "  UPDATE session_progress AS p SET chunks = p.chunks + h.chunks, samples = p.samples + h.samples,"
    "   stored_bytes = p.stored_bytes + h.bytes"
    "  FROM (SELECT g.*, (SELECT s.number FROM sessions s"
    "     WHERE s.id = g.id AND (g.station = '' OR s.station = g.station)"
    "      AND (g.epoch = 0 OR (g.server, g.epoch) = (SELECT l.server, l.epoch FROM station_claims l"
    "       WHERE l.station = g.station))) AS session"
    "    FROM unnest(?1, ?2, ?3, ?4, ?5, ?6, ?12, ?13) WITH ORDINALITY"
    "     AS g (id, station, first, chunks, samples, bytes, server, epoch, place)"
    "    WHERE g.first >= 0 AND g.chunks > 0 AND g.samples > 0 AND g.bytes > 0 OFFSET 0) AS h"
    "  WHERE p.session = h.session AND p.chunks = h.first"
    "  RETURNING p.session, h.place"
    "), added AS ("
    "  INSERT INTO chunks (session, seq, samples, crc, bytes)"
    "  SELECT h.session, c.seq, c.samples, c.crc, c.bytes"
    "  FROM unnest(?7, ?8, ?9, ?10, ?11) AS c (place, seq, samples, crc, bytes)"
    "  JOIN heads h ON h.place = c.place"
    ") SELECT place FROM heads";

/// 0: the claim is not checked.
std::int64_t epochOf(const ArrivedChunk& chunk) {
  return chunk.claim == nullptr || planted(PlantedBug::kTakeoverUnfenced) ? 0 : chunk.claim->epoch;
}

/// The chunks of a session that may be its next ones, by index in the given list.
struct Head {
  std::vector<std::size_t> chunks;
  std::uint64_t samples = 0, bytes = 0;
  bool ended = false;  ///< no later chunk of the session can be taken
};

/// Decides which chunks may be stored at once.
class Heads {
 public:
  using Chunks = std::span<const ArrivedChunk* const>;
  explicit Heads(Chunks chunks) : chunks_(chunks), head_of_(chunks.size(), kNone), samples_(chunks.size()) {
    std::map<Uuid, std::size_t> known;
    for (std::size_t i = 0; i < chunks.size(); ++i) {
      const auto [found, is_new] = known.emplace(chunks[i]->session, heads_.size());
      if (is_new) heads_.emplace_back();
      Head& head = heads_[found->second];
      head.ended = head.ended || !goesOn(head, i);
      if (head.ended) continue;
      head_of_[i] = found->second;
      head.chunks.push_back(i);
      head.samples += samples_[i];
      head.bytes += chunks[i]->bytes.size();
    }
  }

  /// Index of the chunk's session in take()'s result; nothing: use append() for the chunk.
  [[nodiscard]] std::optional<std::size_t> headOf(std::size_t chunk) const {
    return head_of_[chunk] == kNone ? std::nullopt : std::optional(head_of_[chunk]);
  }
  /// Removes the chunk and the later ones of its session.
  void endBefore(std::size_t chunk) {
    assert(head_of_[chunk] < heads_.size());
    Head& head = heads_[head_of_[chunk]];
    while (!head.chunks.empty() && head.chunks.back() >= chunk) {
      assert(head.samples >= samples_[head.chunks.back()]);
      assert(head.bytes >= chunks_[head.chunks.back()]->bytes.size());
      head_of_[head.chunks.back()] = kNone;
      head.samples -= samples_[head.chunks.back()];
      head.bytes -= chunks_[head.chunks.back()]->bytes.size();
      head.chunks.pop_back();
    }
    assert(!head.chunks.empty() || (head.samples == 0 && head.bytes == 0));
  }
  /// Removes all chunks of the session.
  void drop(std::size_t head) {
    if (!heads_[head].chunks.empty()) endBefore(heads_[head].chunks.front());
  }

  /// Stores the chunks; returns for each session whether they were stored.
  Result<std::vector<bool>> take(Connection& connection) const;

 private:
  static constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();

  bool goesOn(const Head& head, std::size_t i) {
    const ArrivedChunk& chunk = *chunks_[i];
    constexpr auto kGreatest = static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max());
    if (chunk.seq >= kGreatest || chunk.bytes.size() > kMaxStoredChunkBytes) return false;
    if (!head.chunks.empty()) {
      const ArrivedChunk& before = *chunks_[head.chunks.back()];
      if (chunk.seq != before.seq + 1 || chunk.station != before.station) return false;
      if (epochOf(chunk) != epochOf(before)) return false;
    }
    if (chunk.samples) {
      samples_[i] = *chunk.samples;
      return true;
    }
    const auto info = checkChunk(chunk.bytes);
    if (info) samples_[i] = info->count;
    return info.ok();
  }

  const Chunks chunks_;
  std::vector<Head> heads_;
  std::vector<std::size_t> head_of_;
  std::vector<std::uint64_t> samples_;
};

Result<std::vector<bool>> Heads::take(Connection& connection) const {
  std::vector<ByteView> ids, bytes;
  std::vector<std::string_view> stations, servers;
  std::vector<std::int64_t> epochs;
  std::array<std::vector<std::int64_t>, 4> of_heads;   // first seq, chunks, samples, bytes
  std::array<std::vector<std::int64_t>, 4> of_chunks;  // session's place, seq, samples, CRC
  std::vector<std::size_t> sent;
  const auto put = [](auto& lists, auto... values) {
    std::size_t at = 0;
    (lists[at++].push_back(static_cast<std::int64_t>(values)), ...);
  };
  for (std::size_t h = 0; h < heads_.size(); ++h) {
    const Head& head = heads_[h];
    if (head.chunks.empty()) continue;
    const ArrivedChunk& first = *chunks_[head.chunks.front()];
    sent.push_back(h);
    ids.emplace_back(first.session);
    stations.push_back(first.station);
    servers.push_back(first.claim != nullptr ? std::string_view(first.claim->server) : std::string_view());
    epochs.push_back(epochOf(first));
    put(of_heads, first.seq, head.chunks.size(), head.samples, head.bytes);
    for (const std::size_t i : head.chunks) {
      put(of_chunks, sent.size(), chunks_[i]->seq, samples_[i], stationCrcOf(chunks_[i]->bytes));
      bytes.push_back(chunks_[i]->bytes);
    }
  }
  assert(ids.size() == sent.size() && bytes.size() <= chunks_.size());
  std::vector<bool> taken(heads_.size());
  if (sent.empty()) return taken;

  std::string sql = kAppendMany;
  if (planted(PlantedBug::kRepeatedChunkOverwrites)) {
    const std::string_view next = "p.chunks = h.first", added = ") SELECT place";
    sql.replace(sql.find(next), next.size(), "p.chunks >= h.first");
    sql.insert(sql.find(added),
               "  ON CONFLICT (session, seq) DO UPDATE SET bytes = excluded.bytes, crc = excluded.crc");
  }
  auto statement = connection.prepare(sql);
  statement.bindList(std::span<const ByteView>(ids)).bindList(std::span<const std::string_view>(stations));
  for (const auto& list : of_heads) statement.bindList(std::span<const std::int64_t>(list));
  for (const auto& list : of_chunks) statement.bindList(std::span<const std::int64_t>(list));
  statement.bindList(std::span<const ByteView>(bytes));
  statement.bindList(std::span<const std::string_view>(servers))
      .bindList(std::span<const std::int64_t>(epochs));
  for (;;) {
    ASSIGN_OR_RETURN(const bool there, statement.step());
    if (!there) return taken;
    const std::uint64_t place = statement.natural(0);
    if (place < 1 || place > sent.size())
      return Error{ErrorCode::kFailed,
                   fmt::format("chunks were stored of session {} of {}", place, sent.size())};
    taken[sent[place - 1]] = true;
  }
}

/// How many of the first chunks go into one statement.
std::size_t batchSize(Heads::Chunks chunks) {
  std::size_t count = 0, bytes = 0;
  for (; count < chunks.size() && count < SessionStore::kMaxTogether; ++count) {
    bytes += chunks[count]->bytes.size();
    if (count > 0 && bytes > SessionStore::kMaxTogetherBytes) break;
  }
  return count;
}

/// Repeats the statement for the chunks that remain after others were refused; they are still next in their
/// sessions.
Status takeAgain(Connection& connection, const Heads& heads,
                 const std::vector<std::optional<Status>>& results) {
  ASSIGN_OR_RETURN(auto savepoint, Savepoint::begin(connection));
  ASSIGN_OR_RETURN(const auto taken, heads.take(connection));
  for (std::size_t i = 0; i < results.size(); ++i) {
    const auto head = heads.headOf(i);
    if (head && !taken[*head])
      return Error{ErrorCode::kFailed, "a chunk that was the next one of its session no longer is"};
  }
  return savepoint.release();
}

}  // namespace

Result<std::vector<std::optional<Status>>> SessionStore::appendMany(
    std::span<const ArrivedChunk* const> chunks) {
  const std::size_t count = batchSize(chunks);
  assert(count <= chunks.size());
  chunks = chunks.first(count);
  std::vector<std::optional<Status>> results(count);
  if (connection_.sqlite() != nullptr) return results;

  Heads heads(chunks);
  bool any_refused = false;
  {
    ASSIGN_OR_RETURN(auto savepoint, Savepoint::begin(connection_));
    ASSIGN_OR_RETURN(const auto taken, heads.take(connection_));
    for (std::size_t i = 0; i < count; ++i) {
      const auto head = heads.headOf(i);
      if (!head) continue;
      if (!taken[*head]) {
        heads.drop(*head);
        continue;
      }
      Appended appended{Appended::Kind::kStored, chunks[i]->seq + 1, {}};
      results[i] = chunks[i]->admit ? chunks[i]->admit(appended) : Status();
      if (results[i]->ok()) {
        assert(chunks[i]->appended != nullptr);
        *chunks[i]->appended = std::move(appended);
      } else {
        heads.endBefore(i);
        any_refused = true;
      }
    }
    if (!any_refused) {
      RETURN_IF_ERROR(savepoint.release());
      return results;
    }
  }
  // do not call admit() again for admitted chunks: it would count them twice
  if (const Status again = takeAgain(connection_, heads, results); !again) {
    for (auto& result : results)
      if (result && result->ok()) result = again;
  }
  return results;
}

}  // namespace needlelab
