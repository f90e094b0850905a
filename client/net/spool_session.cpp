#include <fcntl.h>
#include <fmt/core.h>
#include <google/protobuf/util/json_util.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <span>
#include <utility>

#include "client/net/spool.h"
#include "client/net/spool_json.h"
#include "common/base/files.h"
#include "common/base/planted_bug.h"
#include "common/gesture/chunk.h"
#include "proto/session_rules.h"

namespace needlelab {
namespace {

constexpr std::size_t kMaxTailSamples =
    4000;  // upper limit per chunk; a lossless chunk of this size fits an envelope

Error broken(const std::filesystem::path& path, const std::string& why) {
  return Error{ErrorCode::kCorrupt, path.string() + ": " + why};
}

}  // namespace

Resolution resolutionOf(const pb::SessionDescription& description) {
  const pb::Resolution& r = description.resolution();
  return {r.length_m(), r.quaternion(), r.force_n(), r.torque_nm(), r.time_s(), r.speed_m_s()};
}

void setResolution(pb::SessionDescription& description, const Resolution& resolution) {
  pb::Resolution& r = *description.mutable_resolution();
  r.set_length_m(resolution.length_m);
  r.set_quaternion(resolution.quaternion);
  r.set_force_n(resolution.force_N);
  r.set_torque_nm(resolution.torque_Nm);
  r.set_time_s(resolution.time_s);
  r.set_speed_m_s(resolution.speed_mps);
}

Result<std::shared_ptr<SpoolSession>> SpoolSession::create(const std::filesystem::path& spool,
                                                           const pb::SessionDescription& description,
                                                           std::shared_ptr<SpoolClock> clock) {
  Uuid id{};
  if (description.session_id().size() != id.size())
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("session_id has {} bytes, 16 are expected", description.session_id().size())};
  std::copy(description.session_id().begin(), description.session_id().end(), id.begin());
  // refuse a description that no server would accept now, not after the lesson; a station without a key has
  // no name yet
  pb::SessionDescription named = description;
  if (named.station().empty()) named.set_station("to be named at the upload");
  RETURN_IF_ERROR(checkDescription(named));
  std::shared_ptr<SpoolSession> session(new SpoolSession);
  session->id_ = id;
  session->clock_ = std::move(clock);
  session->description_ = description;
  session->folder_ = spool / uuidText(id);
  std::error_code error;
  if (!std::filesystem::create_directory(session->folder_, error))
    return Error{ErrorCode::kUnavailable, "cannot make the folder " + session->folder_.string() + ": " +
                                              (error ? error.message() : "it is there already")};

  // write the description first: a folder without one contains no data
  std::string json;
  const auto written = google::protobuf::util::MessageToJsonString(description, &json);
  if (!written.ok())
    return Error{ErrorCode::kFailed,
                 "the session's description cannot be written as JSON: " + written.ToString()};
  auto status = writeFileAtomically(session->folder_ / "session.json", viewOf(sealed(json)), 0600);
  if (!status.ok()) return Error{ErrorCode::kUnavailable, status.error().message};
  ASSIGN_OR_RETURN(auto chunks, SpoolFile::open(session->folder_ / "chunks"));
  session->chunks_ = std::move(chunks);
  ASSIGN_OR_RETURN(auto tail, SpoolFile::open(session->folder_ / "tail"));
  session->tail_ = std::move(tail);
  // reserve its space now: the disk is full when it is needed
  if (status = session->setLoss({}); !status.ok()) return status.error();

  // the new names survive a power cut only when their folders are synced too
  for (const auto& folder : {session->folder_, spool})
    if (status = planted(PlantedBug::kNoSpoolFolderSync) ? Status() : syncFolder(folder); !status.ok())
      return Error{ErrorCode::kUnavailable, status.error().message};
  return session;
}

Result<std::shared_ptr<SpoolSession>> SpoolSession::load(const std::filesystem::path& folder,
                                                         std::shared_ptr<SpoolClock> clock) {
  std::shared_ptr<SpoolSession> session(new SpoolSession);
  session->clock_ = std::move(clock);
  session->folder_ = folder;
  ASSIGN_OR_RETURN(auto id, parseUuid(folder.filename().string()));
  session->id_ = id;
  ASSIGN_OR_RETURN(auto text, readWholeFile(folder / "session.json", 16u << 20));
  const auto json = unsealed(std::move(text));
  if (!json.ok()) return broken(folder / "session.json", json.error().message);
  const auto parsed = google::protobuf::util::JsonStringToMessage(*json, &session->description_);
  if (!parsed.ok()) return broken(folder / "session.json", parsed.ToString());
  if (session->description_.session_id() != std::string(id.begin(), id.end()))
    return broken(folder / "session.json", "names another session than its folder");
  if (auto valid = validate(resolutionOf(session->description_)); !valid.ok())
    return broken(folder / "session.json", valid.error().message);

  session->loadLoss();
  auto receipt = readSpoolJson(folder / "acked.json");
  // an unreadable receipt costs only a question to the server
  if (receipt.ok() && receipt->is_object()) {
    session->receipt_.committed = countAt(*receipt, "committed");
    session->receipt_.safe = countAt(*receipt, "safe");
    session->receipt_.closed = flagAt(*receipt, "closed");
    // missing in a receipt of an earlier version: closed when the spool's clock began
    session->receipt_.closed_at_ns =
        static_cast<std::int64_t>(std::min<std::uint64_t>(countAt(*receipt, "closed_at_ns"), INT64_MAX));
  }
  // ignore a damaged end: the chunks have their own checks, and the session ends as interrupted
  const auto end = readSpoolJson(folder / "end.json");
  const auto has = [&](const char* key) { return end->contains(key); };
  if (end.ok() && end->is_object() && has("chunks") && has("samples") && has("hash") && has("interrupted")) {
    session->ended_ = true;
    session->interrupted_ = flagAt(*end, "interrupted");
    session->ended_contents_.chunks = countAt(*end, "chunks");
    session->ended_contents_.samples = countAt(*end, "samples");
    if (session->receipt_.closed) return session;  // the session is done; its chunks are not needed
  } else {
    session->mended_ = true;
  }
  RETURN_IF_ERROR(session->loadChunks());
  return session;
}

// copies the chunks before truncating them; keeps an existing copy, because it holds more
Status SpoolSession::keepDamaged() {
  const auto copy = folder_ / "chunks.damaged";
  damaged_ = copy;
  std::error_code error;
  if (std::filesystem::exists(copy, error)) return {};
  const auto partial = folder_ / "chunks.damaged.partial";
  std::filesystem::copy_file(folder_ / "chunks", partial, std::filesystem::copy_options::overwrite_existing,
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
  auto good_end = chunks_.scan([&](const SpoolRecord& record) {
    if (record.seq != entries_.size()) return false;
    auto info = inspectChunk(record.data);
    if (!info.ok()) return false;
    const std::scoped_lock lock(mutex_);
    addEntry(record.offset, info->count, record.data.size());
    hash_.update(record.data);
    return true;
  });
  if (!good_end.ok()) return good_end.error();

  if (ended_ && entries_.size() != ended_contents_.chunks) {
    // the session ended well, but the disk has lost a part of it: the readable part becomes an interrupted
    // session, and the damaged file stays for a manual rescue
    RETURN_IF_ERROR(keepDamaged());
    const std::scoped_lock lock(mutex_);
    ended_ = false;
  }
  if (!ended_) {
    // A bad record is a torn end, even with good ones behind it (a power cut keeps an arbitrary part of the
    // unsynced data), unless a later record lists it as synced: that is damage, and the file is kept as found
    auto damaged = chunks_.anyBehind(
        *good_end, [&](const SpoolRecord& record) { return record.part > entries_.size(); });
    if (!damaged.ok()) return damaged.error();
    if (*damaged) RETURN_IF_ERROR(keepDamaged());
    // cut off the torn end: new records must follow the last good one
    if (*good_end < chunks_.size()) RETURN_IF_ERROR(chunks_.truncate(*good_end));
    RETURN_IF_ERROR(recoverTail());
    RETURN_IF_ERROR(sync());
    RETURN_IF_ERROR(end(true));
    return restartTail();
  }
  const std::scoped_lock lock(mutex_);
  synced_ = entries_.size();
  end_hash_ = hash_.digest();
  return {};
}

Status SpoolSession::loadAgain() {
  {
    const std::scoped_lock lock(mutex_);
    if (!entries_.empty() || ended_contents_.chunks == 0) return {};
  }
  return loadChunks();
}

// makes the last chunk from the tail's pieces that are not in a chunk yet
Status SpoolSession::recoverTail() {
  ASSIGN_OR_RETURN(auto tail, SpoolFile::open(folder_ / "tail"));
  tail_ = std::move(tail);
  const std::uint64_t seq = entries_.size();
  std::uint32_t part = 0;
  std::vector<GestureSample> samples;
  // taken from the pieces, which have a checksum; the description has none
  Resolution resolution = resolutionOf(description_);
  auto stopped = tail_.scan([&](const SpoolRecord& record) {
    // already in a chunk: the program died before the tail was emptied
    if (record.seq < seq) return true;
    if (record.seq != seq || record.part != part) return false;
    auto piece = decodeChunk(record.data);
    if (!piece.ok() || samples.size() + piece->size() > kMaxTailSamples) return false;
    if (const auto info = inspectChunk(record.data); info.ok()) resolution = info->resolution;
    samples.insert(samples.end(), piece->begin(), piece->end());
    ++part;
    return true;
  });
  if (!stopped.ok()) return stopped.error();
  if (samples.empty()) return {};
  return appendChunk(encodeChunk(resolution, samples), samples.size());
}

Status SpoolSession::appendPiece(std::uint64_t seq, ByteView piece) {
  if (seq != tail_seq_) {
    tail_seq_ = seq;
    tail_parts_ = 0;
  }
  auto status = tail_.append(seq, tail_parts_, piece);
  if (status.ok()) ++tail_parts_;
  return status;
}

Status SpoolSession::appendChunk(ByteView chunk, std::uint64_t samples) {
  const std::uint64_t offset = chunks_.size();
  std::uint64_t seq = 0, synced = 0;
  {
    const std::scoped_lock lock(mutex_);
    seq = entries_.size();
    synced = synced_;
  }
  RETURN_IF_ERROR(chunks_.append(seq, static_cast<std::uint32_t>(synced), chunk));
  hash_.update(chunk);
  const std::scoped_lock lock(mutex_);
  addEntry(offset, samples, chunk.size());
  return {};
}

void SpoolSession::addEntry(std::uint64_t offset, std::uint64_t samples, std::uint64_t bytes) {
  const Entry before = entries_.empty() ? Entry{} : entries_.back();
  entries_.push_back({offset, before.samples_through + samples, before.bytes_through + bytes});
}

Status SpoolSession::restartTail() {
  tail_parts_ = 0;
  return tail_.truncate(0);
}

Status SpoolSession::sync() {
  std::uint64_t from = 0, to = 0;
  std::vector<Entry> unsynced;
  {
    const std::scoped_lock lock(mutex_);
    from = synced_;
    to = entries_.size();
    if (sync_failed_) unsynced.assign(entries_.begin() + static_cast<std::ptrdiff_t>(from), entries_.end());
  }
  if (from == to) return {};
  // after a failed fsync the kernel may have dropped the pages and call the next fsync a success: write them
  // again
  for (const Entry& entry : unsynced) RETURN_IF_ERROR(chunks_.writeAgain(entry.offset));
  if (auto status = chunks_.sync(); !status.ok()) {
    sync_failed_ = true;
    return status;
  }
  sync_failed_ = false;
  const std::scoped_lock lock(mutex_);
  synced_ = to;
  return {};
}

Status SpoolSession::end(bool interrupted) {
  std::uint64_t chunks = 0, samples = 0, lost = 0;
  {
    const std::scoped_lock lock(mutex_);
    chunks = entries_.size();
    if (chunks > 0) samples = entries_.back().samples_through;
    lost = loss_.samples;
  }
  // without this sync, an ended session could lose its loss record in a power cut and look complete
  if (lost > 0) RETURN_IF_ERROR(syncLoss());
  const Digest hash = hash_.digest();
  if (auto status = writeSpoolJson(
          folder_ / "end.json",
          {{"chunks", chunks}, {"samples", samples}, {"hash", hexOf(hash)}, {"interrupted", interrupted}});
      !status.ok())
    return status;
  const std::scoped_lock lock(mutex_);
  ended_ = true;
  interrupted_ = interrupted;
  end_hash_ = hash;
  return {};
}

Status SpoolSession::setLoss(const SpoolLoss& loss) {
  {
    const std::scoped_lock lock(mutex_);
    loss_ = loss;
  }
  const auto path = folder_ / "lost";
  const auto failed = [&] {
    return Error{ErrorCode::kUnavailable, "cannot write " + path.string() + ": " + std::strerror(errno)};
  };
  const int fd = ::open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
  if (fd < 0) return failed();
  // samples and first tick, in a fixed length
  const std::string text = fmt::format("{:020} {:020}\n", loss.samples, loss.from_tick);
  const ssize_t wrote = ::pwrite(fd, text.data(), text.size(), 0);
  Status status;
  if (wrote != static_cast<ssize_t>(text.size())) status = failed();
  ::close(fd);
  return status;
}

Status SpoolSession::syncLoss() const {
  const auto path = folder_ / "lost";
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
  Status status;
  if (fd < 0 || ::fdatasync(fd) != 0)
    status = Error{ErrorCode::kUnavailable, "cannot sync " + path.string() + ": " + std::strerror(errno)};
  if (fd >= 0) ::close(fd);
  return status;
}

// ignores a missing or unreadable file: then only the gap in the ticks shows the loss
void SpoolSession::loadLoss() {
  std::error_code ignored;
  if (!std::filesystem::exists(folder_ / "lost", ignored)) return;
  const auto text = readWholeFile(folder_ / "lost", 1000);
  unsigned long long samples = 0, from_tick = 0;
  if (text.ok() && std::sscanf(text->c_str(), "%20llu %20llu", &samples, &from_tick) == 2)
    loss_ = {samples, from_tick};
}

SpoolContents SpoolSession::contents() const {
  const std::scoped_lock lock(mutex_);
  if (ended_ && entries_.empty() && receipt_.closed) {
    SpoolContents closed = ended_contents_;
    closed.ended = true;
    closed.interrupted = interrupted_;
    closed.loss = loss_;
    return closed;
  }
  const Entry last = synced_ == 0 ? Entry{} : entries_[synced_ - 1];
  const bool ended = ended_ && synced_ == entries_.size();
  return {synced_, last.samples_through, last.bytes_through, ended, interrupted_, end_hash_, loss_};
}

std::uint64_t SpoolSession::samplesIn(std::uint64_t chunks) const {
  const std::scoped_lock lock(mutex_);
  const std::uint64_t some = std::min<std::uint64_t>(chunks, entries_.size());
  return some == 0 ? 0 : entries_[some - 1].samples_through;
}

std::uint64_t SpoolSession::bytesIn(std::uint64_t chunks) const {
  const std::scoped_lock lock(mutex_);
  const std::uint64_t some = std::min<std::uint64_t>(chunks, entries_.size());
  return some == 0 ? 0 : entries_[some - 1].bytes_through;
}

Result<Bytes> SpoolSession::readChunk(std::uint64_t seq) const {
  std::uint64_t offset = 0;
  {
    const std::scoped_lock lock(mutex_);
    if (seq >= synced_)
      return Error{ErrorCode::kNotFound,
                   fmt::format("session {} has no chunk {} in the spool", idText(), seq)};
    offset = entries_[seq].offset;
  }
  return chunks_.read(offset);
}

SpoolReceipt SpoolSession::receipt() const {
  const std::scoped_lock lock(mutex_);
  return receipt_;
}

Status SpoolSession::setReceipt(const SpoolReceipt& receipt) {
  {
    const std::scoped_lock lock(mutex_);
    if (receipt.committed == receipt_.committed && receipt.safe == receipt_.safe &&
        receipt.closed == receipt_.closed)
      return {};
    receipt_ = receipt;
  }
  return writeSpoolJson(
      folder_ / "acked.json",
      {{"committed", receipt.committed},
       {"safe", receipt.safe},
       {"closed", receipt.closed},
       {"closed_at_ns", static_cast<std::uint64_t>(std::max<std::int64_t>(receipt.closed_at_ns, 0))}});
}

}  // namespace needlelab
