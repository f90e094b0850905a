// Recovers a session after a crash or disk damage: reads on past damage, counts what is missing, and numbers
// what remains.

#include <fmt/core.h>
#include <google/protobuf/util/json_util.h>

#include <algorithm>
#include <cassert>
#include <span>
#include <string_view>
#include <utility>

#include "client/net/spool/spool.h"
#include "client/net/spool/spool_json.h"
#include "common/gesture/chunk.h"

namespace needlelab {
namespace {

// upper limit per chunk; a lossless chunk of this size fits an envelope
constexpr std::size_t kMaxTailSamples = 4000;
constexpr std::uint64_t kMaxMissing = 1u << 20;  // chunks between two readable ones: 12 days at 1 kHz
// a tail has the pieces of one chunk (after a power cut, two); each is synced before the next, some 20 ms
constexpr std::size_t kMaxTailChunks = 8;

/// Whether the numbers in this object (chunks, samples, ticks) are possible for a session.
bool arePossible(const nlohmann::json& of, const pb::SessionDescription& description) {
  const double most = kLongestSession_s * std::max(1000.0, description.rate_hz());
  return std::all_of(of.begin(), of.end(), [&](const nlohmann::json& value) {
    if (value.is_object()) return arePossible(value, description);
    return !value.is_number_unsigned() || value.get<double>() <= most;
  });
}

std::uint64_t samplesOfASecond(const pb::SessionDescription& description) {
  return static_cast<std::uint64_t>(std::clamp(std::round(description.rate_hz()), 1.0, 1000.0));
}

void addDamage(SpoolDamage& sum, const SpoolDamage& part) {
  if (part.samples == 0) return;
  if (sum.samples == 0) sum.from_tick = part.from_tick;
  sum.samples += part.samples;
}

Result<pb::SessionDescription> descriptionIn(const std::filesystem::path& file, const Uuid& id) {
  const auto broken = [&](const std::string& why) {
    return Error{ErrorCode::kCorrupt, file.string() + ": " + why};
  };
  ASSIGN_OR_RETURN(const auto text, readSpoolText(file, 16u << 20));
  // a technician who corrects a description removes the checksum line
  const Result<std::string> json = hasSeal(text) ? unsealed(text) : text;
  if (!json.ok()) return broken(json.error().message);
  pb::SessionDescription description;
  const auto parsed = google::protobuf::util::JsonStringToMessage(*json, &description);
  if (!parsed.ok()) return broken(parsed.ToString());
  if (description.session_id() != std::string(id.begin(), id.end()))
    return broken("names another session than its folder");
  if (const auto valid = validate(resolutionOf(description)); !valid.ok())
    return broken(valid.error().message);
  // if too long for a message, it would end each connection, and later sessions would never be delivered
  if (const auto valid = checkSpoolDescription(description); !valid.ok())
    return broken(valid.error().message);
  return description;
}

/// "5,000 samples in 5 chunks and 3 pieces": the readable part of a session without its description.
std::string readableText(const std::filesystem::path& folder) {
  std::uint64_t samples = 0, chunks = 0, pieces = 0;
  for (const char* name : {"chunks", "tail"}) {
    std::error_code error;
    if (!std::filesystem::exists(folder / name, error)) continue;
    const auto file = SpoolFile::open(folder / name);
    if (!file.ok()) continue;
    std::uint64_t& records = std::string_view(name) == "tail" ? pieces : chunks;
    (void)file->scan([&](const SpoolRecord& record) {
      const auto info = inspectChunk(record.data);
      if (!info.ok()) return true;
      ++records;
      samples += info->count;
      return true;
    });
  }
  return fmt::format("{} samples in {} chunks and {} pieces of a tail", samples, chunks, pieces);
}

/// Reads the chunks formed by a tail's pieces, in order. Reads each piece only once.
class TailReader {
 public:
  struct Chunk {
    std::uint64_t seq = 0;
    std::vector<GestureSample> samples;
    Resolution resolution;
    SpoolDamage missing;  // between its pieces, and before the first
    Bytes cut_memory;     // of the first piece that has one
    Bytes paths;          // of all pieces
  };
  TailReader(const pb::SessionDescription& of, const SpoolFile& file) : description(of), tail(file) {}

  /// Finds the pieces. Call before the first read().
  Status look() {
    const auto scanned = tail.scan([&](const SpoolRecord& record) {
      const auto info = inspectChunk(record.data);
      if (info.ok()) pieces_.push_back({record.seq, record.part, record.offset, *info});
      return info.ok();
    });
    if (!scanned.ok()) return scanned.error();
    std::stable_sort(pieces_.begin(), pieces_.end(),
                     [](const Piece& a, const Piece& b) { return a.seq < b.seq; });
    return {};
  }

  /// Returns the next chunk; nothing at the end, or after kMaxTailChunks.
  Result<std::optional<Chunk>> read() {
    while (at_ < pieces_.size() && read_ < kMaxTailChunks) {
      const std::uint64_t seq = pieces_[at_].seq;
      if (seq >= next && seq - next > kMaxMissing) break;
      const std::size_t first = at_;
      while (at_ < pieces_.size() && pieces_[at_].seq == seq) ++at_;
      if (seq < next) continue;
      ASSIGN_OR_RETURN(auto chunk, chunkOf(seq, std::span(pieces_).subspan(first, at_ - first)));
      if (chunk.samples.empty()) continue;
      next = seq + 1;
      behind_tail = true;
      ++read_;
      return std::optional<Chunk>(std::move(chunk));
    }
    return std::optional<Chunk>();
  }

  /// The samples of the pieces not read by read(), in chunks that may belong to this session.
  [[nodiscard]] SpoolDamage rest() const {
    SpoolDamage left;
    std::uint64_t from = tick;
    for (std::size_t i = at_; i < pieces_.size(); ++i) {
      const Piece& piece = pieces_[i];
      if (piece.seq < next || piece.seq - next > kMaxMissing || piece.info.first_tick < from) continue;
      addDamage(left, {0, piece.info.count, piece.info.first_tick});
      from = piece.info.last_tick + 1;
    }
    return left;
  }

  const pb::SessionDescription& description;
  const SpoolFile& tail;
  std::uint64_t next = 0;    // after the last known chunk
  std::uint64_t tick = 0;    // after the last known sample
  bool behind_tail = false;  // the last chunk was made from pieces, so its end may be missing

 private:
  struct Piece {
    std::uint64_t seq = 0;
    std::uint32_t part = 0;
    std::uint64_t offset = 0;
    ChunkInfo info;
  };

  /// The chunk formed by the pieces of its number, in file order. Without samples if none of them fits.
  Result<Chunk> chunkOf(std::uint64_t seq, std::span<const Piece> pieces) {
    // take the resolution from the pieces, which have a checksum; a corrected description has none
    Chunk chunk{seq, {}, resolutionOf(description), {}, {}, {}};
    std::uint32_t part = 0;
    for (const Piece& one : pieces) {
      if (one.part < part || one.info.first_tick < tick ||
          chunk.samples.size() + one.info.count > kMaxTailSamples)
        continue;
      const auto data = tail.read(one.offset);
      if (!data.ok() && data.error().code != ErrorCode::kCorrupt) return data.error();
      const auto piece = data.ok() ? decodeChunk(*data) : Result<std::vector<GestureSample>>(data.error());
      if (!piece.ok()) continue;
      const std::uint64_t first = piece->front().tick;
      if (const auto lost = missingBefore(chunk, one.part, part, *piece); lost > 0)
        addDamage(chunk.missing, {0, lost, first - lost});
      chunk.resolution = one.info.resolution;
      if (chunk.cut_memory.empty()) chunk.cut_memory = cutMemoryOf(*data);
      const Bytes paths = pathListOf(*data);
      if (chunk.paths.size() + paths.size() <= kMaxPathsBytes)
        chunk.paths.insert(chunk.paths.end(), paths.begin(), paths.end());
      chunk.samples.insert(chunk.samples.end(), piece->begin(), piece->end());
      tick = chunk.samples.back().tick + 1;
      part = one.part + 1;
    }
    return chunk;
  }

  /// Excludes the samples of whole missing chunks before the piece, which are counted with those chunks.
  [[nodiscard]] std::uint64_t missingBefore(const Chunk& chunk, std::uint32_t part, std::uint32_t expected,
                                            const std::vector<GestureSample>& piece) const {
    const std::uint64_t ticks = piece.front().tick - tick;
    if (!chunk.samples.empty()) return part > expected ? ticks : 0;
    if (chunk.seq == next) return part > 0 || behind_tail ? ticks : 0;
    const std::uint64_t second = samplesOfASecond(description);
    const std::uint64_t whole = std::min(ticks, (chunk.seq - next) * second);
    return std::min(ticks - whole, part * piece.size() + (behind_tail ? second : 0));
  }

  std::vector<Piece> pieces_;  // by the number of their chunk, then in file order
  std::size_t at_ = 0;         // index of the next piece to look at
  std::size_t read_ = 0;       // chunks read so far
};

}  // namespace

// replaces a damaged description by the copy
Status SpoolSession::loadDescription() {
  auto own = descriptionIn(folder_ / "session.json", id_);
  if (own.ok()) {
    description_ = std::move(*own);
    return {};
  }
  auto copy = descriptionIn(folder_ / kDescriptionCopy, id_);
  if (!copy.ok()) {
    std::error_code error;
    const bool has_copy = std::filesystem::exists(folder_ / kDescriptionCopy, error);
    return Error{
        ErrorCode::kCorrupt,
        fmt::format("{}. {}, so the server cannot be told whose session it is. {} of it can be read. For "
                    "a technician: copy the folder {} elsewhere, correct session.json in an editor (it is "
                    "text), remove its last line (crc32c …) and start the station again",
                    own.error().message, has_copy ? "Its copy is damaged, too" : "There is no copy of it",
                    readableText(folder_), folder_.string())};
  }
  description_ = std::move(*copy);
  restored_ = true;
  ASSIGN_OR_RETURN(const auto text, readSpoolText(folder_ / kDescriptionCopy, 16u << 20));
  // if the disk refuses, the copy is used again at the next start
  (void)writeSpoolText(folder_ / "session.json", text);
  return {};
}

// ignores an end that is damaged or has impossible numbers: the chunks have their own checksums, and the
// session ends as interrupted
void SpoolSession::loadEnd() {
  const auto end = readSpoolJson(folder_ / "end.json");
  const auto has = [&](const char* key) { return end->contains(key); };
  if (!end.ok() || !end->is_object() || !has("chunks") || !has("samples") || !has("hash") ||
      !has("interrupted") || !arePossible(*end, description_)) {
    mended_ = true;
    return;
  }
  const auto numbers = [](const nlohmann::json& of) {
    End read{countAt(of, "chunks"), countAt(of, "samples"), {}, flagAt(of, "interrupted")};
    const auto hash = of.find("hash");
    const auto digest = hash != of.end() && hash->is_string() ? digestFromHex(hash->get<std::string>())
                                                              : Result<Digest>(Error{});
    if (digest.ok()) read.hash = *digest;
    return std::pair{read, digest.ok()};
  };
  const auto damageAt = [&](const char* key) {
    const nlohmann::json of = end->value(key, nlohmann::json::object());
    return SpoolDamage{countAt(of, "chunks"), countAt(of, "samples"), countAt(of, "from_tick")};
  };
  const auto [last, hash_read] = numbers(*end);
  ended_ = true;
  interrupted_ = last.interrupted;
  ended_contents_.chunks = last.chunks;
  ended_contents_.samples = last.samples;
  if (hash_read) ended_contents_.hash = last.hash;
  ended_contents_.damage = damageAt("damage");
  ended_records_ = has("records") ? countAt(*end, "records") : last.chunks;
  tail_damage_ = damageAt("tail_damage");
  if (has("settled")) settled_ = countAt(*end, "settled");
  if (has("whole"))
    if (const auto [whole, sound] = numbers((*end)["whole"]); sound) whole_ = whole;
}

// copies the file, `chunks` or `tail`, before it is truncated; keeps an existing copy, because it has more
Status SpoolSession::keepDamaged(const std::string& name) {
  const auto copy = folder_ / (name + ".damaged");
  if (damaged_.empty()) damaged_ = copy;
  std::error_code error;
  if (std::filesystem::exists(copy, error)) return {};
  const auto partial = folder_ / (name + ".damaged.partial");
  std::filesystem::copy_file(folder_ / name, partial, std::filesystem::copy_options::overwrite_existing,
                             error);
  if (!error) std::filesystem::rename(partial, copy, error);
  if (!error) return {};
  return Error{ErrorCode::kUnavailable, folder_.string() +
                                            ": some of its chunks cannot be read, and no copy of them can be "
                                            "kept (" +
                                            error.message() + "): make room on that disk"};
}

Status SpoolSession::loadChunks() {
  ASSIGN_OR_RETURN(auto chunks, SpoolFile::open(folder_ / "chunks"));
  chunks_ = std::move(chunks);
  std::uint64_t listed_as_synced = 0;
  auto good_end = chunks_.scan([&](const SpoolRecord& record) {
    const auto info = inspectChunk(record.data);
    if (!info.ok()) return false;
    listed_as_synced = std::max<std::uint64_t>(listed_as_synced, record.part);
    const std::scoped_lock lock(mutex_);
    if (record.seq < next_seq_ || record.seq - next_seq_ > kMaxMissing) return false;
    // after damage: an old record that the disk brought back does not belong to this session
    if (record.seq > next_seq_ && !entries_.empty() && info->first_tick <= entries_.back().last_tick)
      return false;
    addEntry({record.offset, record.seq, 0, 0, info->first_tick, info->last_tick}, info->count,
             record.data.size());
    hash_.update(record.data);
    return true;
  });
  if (!good_end.ok()) return good_end.error();

  if (ended_ && !agreesWithEnd()) {
    // the session ended properly, but the disk has lost or changed part of it: the readable part becomes an
    // interrupted session, and the damaged file is kept for manual rescue
    RETURN_IF_ERROR(keepDamaged("chunks"));
    const std::scoped_lock lock(mutex_);
    assert(synced_ == 0 && "nothing counts as synced until it agrees with the end");
    const SpoolContents& said = ended_contents_;
    if (!whole_ && said.hash && said.damage == SpoolDamage{})
      whole_ = End{said.chunks, said.samples, *said.hash, interrupted_};
    ended_ = false;
  }
  if (!ended_) {
    // Data missing before a valid record was torn by a power cut, which keeps an arbitrary part of the
    // unsynced data. But if a later record lists it as synced, it is damage, and the file is kept as found
    std::uint64_t hole = 0;
    {
      const std::scoped_lock lock(mutex_);
      hole = firstHole();
    }
    if (hole < listed_as_synced) RETURN_IF_ERROR(keepDamaged("chunks"));
    // cut off the torn end: new records must follow the last valid one
    if (*good_end < chunks_.size()) RETURN_IF_ERROR(chunks_.truncate(*good_end));
    RETURN_IF_ERROR(recoverTail());
    RETURN_IF_ERROR(sync());
    RETURN_IF_ERROR(end(true));
    return restartTail();
  }
  return {};
}

// whether the data read matches the end; if so, it counts as synced
bool SpoolSession::agreesWithEnd() {
  const std::scoped_lock lock(mutex_);
  if (entries_.size() != ended_records_) return false;
  synced_ = entries_.size();
  end_hash_ = hash_.digest();
  const SpoolContents now = contentsNow();
  const bool agrees = now.samples == ended_contents_.samples && now.hash == ended_contents_.hash;
  if (!agrees) synced_ = 0;
  return agrees;
}

Status SpoolSession::reload() {
  {
    const std::scoped_lock lock(mutex_);
    if (!entries_.empty() || ended_contents_.chunks == 0) return {};
  }
  return loadChunks();
}

// Makes the last chunks from the tail's pieces that are not in a chunk yet. There are two after a power cut
// that left pieces of an emptied tail between those of the next one. A tail with pieces of many more was not
// written by a station: the first ones become chunks, the rest is damage, and the file is kept as found.
Status SpoolSession::recoverTail() {
  ASSIGN_OR_RETURN(auto tail, SpoolFile::open(folder_ / "tail"));
  tail_ = std::move(tail);
  TailReader reader(description_, tail_);
  // for a second crash after the tail became a chunk and before the end was written
  nlohmann::json list = nlohmann::json::array();
  {
    const std::scoped_lock lock(mutex_);
    reader.next = next_seq_;
    if (!entries_.empty()) reader.tick = entries_.back().last_tick + 1;
    const auto counted = readSpoolJson(folder_ / "tail.json");
    if (counted.ok() && counted->contains("chunks") && (*counted)["chunks"].is_array())
      for (const auto& of : (*counted)["chunks"])
        if (of.is_object() && arePossible(of, description_) && countAt(of, "seq") < next_seq_)
          list.push_back(of);
    if (!list.empty()) tail_damage_ = {};
    for (const auto& of : list) {
      addDamage(tail_damage_, {0, countAt(of, "samples"), countAt(of, "from_tick")});
      reader.behind_tail |= countAt(of, "seq") + 1 == next_seq_;
    }
  }
  RETURN_IF_ERROR(reader.look());
  const bool counted_before = !list.empty();
  std::vector<TailReader::Chunk> made;
  bool missing = false;
  SpoolDamage left;
  while (true) {
    ASSIGN_OR_RETURN(auto chunk, reader.read());
    if (!chunk) break;
    missing |= chunk->missing.samples > 0;
    list.push_back(
        {{"seq", chunk->seq}, {"samples", chunk->missing.samples}, {"from_tick", chunk->missing.from_tick}});
    made.push_back(std::move(*chunk));
  }
  // nothing is left of a station's own tail
  if (const SpoolDamage rest = reader.rest(); rest.samples > 0) {
    RETURN_IF_ERROR(keepDamaged("tail"));
    left = rest;
  }
  if (missing || made.size() > 1 || (counted_before && !made.empty()))
    RETURN_IF_ERROR(writeSpoolJson(folder_ / "tail.json", {{"chunks", list}}));
  for (const auto& chunk : made) {
    {
      const std::scoped_lock lock(mutex_);
      assert(!chunk.samples.empty() && chunk.seq >= next_seq_);
      next_seq_ = chunk.seq;
      addDamage(tail_damage_, chunk.missing);
    }
    RETURN_IF_ERROR(appendChunk(encodeChunk(chunk.resolution, chunk.samples, chunk.cut_memory, chunk.paths),
                                chunk.samples.size()));
    {
      const std::scoped_lock lock(mutex_);
      entries_.back().first_tick = chunk.samples.front().tick;
      entries_.back().last_tick = chunk.samples.back().tick;
    }
    // before the next one, so that a power cut cannot leave only that one
    RETURN_IF_ERROR(sync());
  }
  const std::scoped_lock lock(mutex_);
  addDamage(tail_damage_, left);
  return {};
}

// --- chunk numbers after damage

// includes those that the disk lost
std::uint64_t SpoolSession::recordedChunks() const {
  return std::max(next_seq_, whole_ ? whole_->chunks : 0);
}

// recordedChunks() if none is missing
std::uint64_t SpoolSession::firstHole() const {
  assert(entries_.size() <= recordedChunks());
  if (entries_.size() == recordedChunks()) return entries_.size();
  const auto moved = std::partition_point(entries_.begin(), entries_.end(), [&](const Entry& entry) {
    return entry.seq == static_cast<std::uint64_t>(&entry - entries_.data());
  });
  return static_cast<std::uint64_t>(moved - entries_.begin());
}

// chunks 0 … n−1 keep their numbers; later ones close up
std::uint64_t SpoolSession::kept() const {
  return settled_ ? std::min(*settled_, recordedChunks()) : firstHole();
}

std::size_t SpoolSession::entriesBefore(std::uint64_t seq) const {
  const auto at = std::partition_point(entries_.begin(), entries_.end(),
                                       [seq](const Entry& entry) { return entry.seq < seq; });
  return static_cast<std::size_t>(at - entries_.begin());
}

// how many of the server's first chunks are on disk
std::size_t SpoolSession::entriesAmong(std::uint64_t chunks) const {
  const std::uint64_t settled = kept();
  if (chunks <= settled) return entriesBefore(chunks);
  const std::size_t before = entriesBefore(settled);
  return before +
         static_cast<std::size_t>(std::min<std::uint64_t>(chunks - settled, entries_.size() - before));
}

std::uint64_t SpoolSession::chunksNow() const {
  if (firstHole() == recordedChunks()) return synced_;
  const std::uint64_t settled = kept();
  assert(entriesBefore(settled) <= settled);
  return settled + (entries_.size() - entriesBefore(settled));
}

SpoolDamage SpoolSession::damageFrom(std::uint64_t seq) const {
  SpoolDamage damage;
  const std::uint64_t chunk_samples = samplesOfASecond(description_);
  std::uint64_t next = 0, tick = 0, found = 0;
  std::optional<std::uint64_t> gap;  // the first tick that no chunk has
  const auto upTo = [&](std::uint64_t end, std::uint64_t end_tick) {
    const std::uint64_t from = std::max(next, seq);
    if (end <= from) return;
    if (damage.chunks == 0) damage.from_tick = tick;
    damage.chunks += end - from;
    const std::uint64_t ticks = end_tick > tick ? end_tick - tick : 0;
    damage.samples += std::min(ticks, (end - from) * chunk_samples);
  };
  for (const Entry& entry : entries_) {
    upTo(entry.seq, entry.first_tick);
    if (!gap && entry.first_tick > tick) gap = tick;
    next = entry.seq + 1;
    tick = entry.last_tick + 1;
    found = entry.samples_through;
  }
  upTo(recordedChunks(), UINT64_MAX);
  // the end has the true count, even if all chunks are there and one has fewer samples than it had
  const bool all_there = entries_.size() == recordedChunks();
  if (whole_ && (damage.chunks > 0 || all_there) && seq <= firstHole()) {
    damage.samples = whole_->samples - std::min(whole_->samples, found);
    if (all_there && damage.samples > 0) damage.from_tick = gap.value_or(tick);
  }
  if (tail_damage_.samples > 0 && damage.samples == 0) damage.from_tick = tail_damage_.from_tick;
  damage.samples += tail_damage_.samples;
  return damage;
}

}  // namespace needlelab
