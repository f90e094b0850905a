#include <fmt/core.h>
#include <google/protobuf/util/json_util.h>
#include <sys/stat.h>

#include <algorithm>
#include <cassert>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <span>
#include <utility>

#include "client/net/spool/spool.h"
#include "client/net/spool/spool_json.h"
#include "common/base/files/files.h"
#include "common/base/planted_bug.h"
#include "common/gesture/chunk.h"
#include "proto/session_rules.h"

namespace needlelab {

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

Status checkSpoolDescription(const pb::SessionDescription& description) {
  pb::SessionDescription named = description;
  if (named.station().empty()) named.set_station("to be named at the upload");
  return checkDescription(named);
}

Result<std::shared_ptr<SpoolSession>> SpoolSession::create(const std::filesystem::path& spool,
                                                           const pb::SessionDescription& description,
                                                           std::shared_ptr<SpoolClock> clock) {
  Uuid id{};
  if (description.session_id().size() != id.size())
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("session_id has {} bytes, 16 are expected", description.session_id().size())};
  std::copy(description.session_id().begin(), description.session_id().end(), id.begin());
  // check now, not after the lesson
  RETURN_IF_ERROR(checkSpoolDescription(description));
  std::shared_ptr<SpoolSession> session(new SpoolSession);
  session->id_ = id;
  session->clock_ = std::move(clock);
  session->description_ = description;
  session->folder_ = spool / uuidText(id);
  // do not create a missing spool, e.g. on a removed disk
  if (::mkdir(session->folder_.c_str(), 0700) != 0)
    return Error{ErrorCode::kUnavailable,
                 "cannot make the folder " + session->folder_.string() + ": " + std::strerror(errno)};

  // write the description first: a folder without one contains no data
  std::string json;
  const auto written = google::protobuf::util::MessageToJsonString(description, &json);
  if (!written.ok())
    return Error{ErrorCode::kFailed,
                 "the session's description cannot be written as JSON: " + written.ToString()};
  // two copies: without it the chunks cannot be assigned to anyone
  Status status;
  for (const char* name : {"session.json", kDescriptionCopy})
    if (status = writeSpoolText(session->folder_ / name, sealed(json)); !status.ok()) return status.error();
  ASSIGN_OR_RETURN(auto chunks, SpoolFile::open(session->folder_ / "chunks"));
  session->chunks_ = std::move(chunks);
  ASSIGN_OR_RETURN(auto tail, SpoolFile::open(session->folder_ / "tail"));
  session->tail_ = std::move(tail);
  // reserve its space now, because it is needed when the disk is full. Synced, so that a session with chunks
  // always has it
  if (status = session->setLoss({}); !status.ok()) return status.error();
  if (status = session->syncLoss(); !status.ok()) return status.error();

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
  RETURN_IF_ERROR(session->loadDescription());

  session->loadLoss();
  auto receipt = readSpoolJson(folder / "acked.json");
  // an unreadable receipt costs only a question to the server
  if (receipt.ok() && receipt->is_object()) {
    session->receipt_.committed = countAt(*receipt, "committed");
    session->receipt_.safe = countAt(*receipt, "safe");
    session->receipt_.closed = flagAt(*receipt, "closed");
    session->receipt_.closed_at_ns =
        static_cast<std::int64_t>(std::min<std::uint64_t>(countAt(*receipt, "closed_at_ns"), INT64_MAX));
  }
  session->loadEnd();
  // the chunks of a closed session are not needed
  if (session->ended_ && session->receipt_.closed) return session;
  RETURN_IF_ERROR(session->loadChunks());
  return session;
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
    seq = next_seq_;
    synced = synced_;
  }
  RETURN_IF_ERROR(chunks_.append(seq, static_cast<std::uint32_t>(synced), chunk));
  hash_.update(chunk);
  const std::scoped_lock lock(mutex_);
  addEntry({offset, seq}, samples, chunk.size());
  return {};
}

void SpoolSession::addEntry(const Entry& entry, std::uint64_t samples, std::uint64_t bytes) {
  assert(entries_.empty() || (entry.seq > entries_.back().seq && entry.offset > entries_.back().offset));
  const Entry before = entries_.empty() ? Entry{} : entries_.back();
  entries_.push_back(entry);
  entries_.back().samples_through = before.samples_through + samples;
  entries_.back().bytes_through = before.bytes_through + bytes;
  next_seq_ = entry.seq + 1;
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
  // after a failed fsync the kernel may have dropped the pages and report success for the next fsync, so
  // write them again
  for (const Entry& entry : unsynced) RETURN_IF_ERROR(chunks_.writeAgain(entry.offset));
  if (auto status = chunks_.sync(); !status.ok()) {
    sync_failed_ = true;
    return status;
  }
  sync_failed_ = false;
  const std::scoped_lock lock(mutex_);
  assert(synced_ == from && to <= entries_.size());
  synced_ = to;
  return {};
}

Status SpoolSession::end(bool interrupted) {
  bool lost = false;
  {
    const std::scoped_lock lock(mutex_);
    assert(synced_ == entries_.size() && "sync() comes before the end");
    lost = loss_.samples > 0;
  }
  // without this sync, an ended session could lose its loss record in a power cut and look complete
  if (lost) RETURN_IF_ERROR(syncLoss());
  const Digest hash = hash_.digest();
  {
    const std::scoped_lock lock(mutex_);
    end_hash_ = hash;
  }
  RETURN_IF_ERROR(writeEnd(interrupted));
  const std::scoped_lock lock(mutex_);
  ended_ = true;
  interrupted_ = interrupted;
  return {};
}

Status SpoolSession::writeEnd(bool interrupted) {
  nlohmann::json json;
  const auto damageText = [](const SpoolDamage& of) {
    return nlohmann::json{{"chunks", of.chunks}, {"samples", of.samples}, {"from_tick", of.from_tick}};
  };
  {
    const std::scoped_lock lock(mutex_);
    const SpoolContents now = contentsNow();
    json = {{"chunks", now.chunks},
            {"samples", now.samples},
            {"hash", now.hash ? hexOf(*now.hash) : std::string()},
            {"interrupted", interrupted}};
    if (entries_.size() != now.chunks) json["records"] = entries_.size();
    if (now.damage != SpoolDamage{}) json["damage"] = damageText(now.damage);
    if (tail_damage_ != SpoolDamage{}) json["tail_damage"] = damageText(tail_damage_);
    if (settled_) json["settled"] = *settled_;
    if (whole_)
      json["whole"] = {{"chunks", whole_->chunks},
                       {"samples", whole_->samples},
                       {"hash", hexOf(whole_->hash)},
                       {"interrupted", whole_->interrupted}};
  }
  return writeSpoolJson(folder_ / "end.json", json);
}

Status SpoolSession::settle(std::uint64_t next_seq) {
  bool interrupted = false;
  {
    const std::scoped_lock lock(mutex_);
    if (settled_ || firstHole() == recordedChunks()) return {};
    assert(firstHole() < recordedChunks());
    settled_ = std::clamp(next_seq, firstHole(), recordedChunks());
    interrupted = interrupted_;
  }
  // write it before the first chunk gets another number
  const Status written = writeEnd(interrupted);
  if (written.ok()) return {};
  const std::scoped_lock lock(mutex_);
  settled_.reset();
  return written;
}

SpoolContents SpoolSession::contents() const {
  const std::scoped_lock lock(mutex_);
  return contentsNow();
}

SpoolContents SpoolSession::contentsNow() const {
  assert(synced_ <= entries_.size());
  SpoolContents now;
  if (ended_ && entries_.empty() && receipt_.closed) {
    now = ended_contents_;
    now.ended = true;
    now.interrupted = interrupted_ || lossUnknown(now.chunks);
    now.loss = loss_;
    return now;
  }
  const bool holes = firstHole() < recordedChunks();
  now.chunks = chunksNow();
  const std::size_t count = holes ? entries_.size() : static_cast<std::size_t>(synced_);
  const Entry last = count == 0 ? Entry{} : entries_[count - 1];
  now.samples = last.samples_through;
  now.bytes = last.bytes_through;
  now.ended = ended_ && synced_ == entries_.size();
  now.interrupted = interrupted_ || holes || lossUnknown(now.chunks);
  now.loss = loss_;
  now.damage = holes || whole_ ? damageFrom(kept()) : tail_damage_;
  if (kept() <= firstHole()) {
    now.hash = end_hash_;
  } else if (whole_ && now.damage == SpoolDamage{}) {
    // the server has everything that the disk lost
    now.samples = whole_->samples;
    now.hash = whole_->hash;
    now.interrupted = whole_->interrupted || lossUnknown(now.chunks);
  }
  return now;
}

bool SpoolSession::allOnDisk() const {
  const std::scoped_lock lock(mutex_);
  return kept() <= firstHole();
}

std::uint64_t SpoolSession::samplesIn(std::uint64_t chunks) const {
  const std::scoped_lock lock(mutex_);
  const std::size_t some = entriesAmong(chunks);
  assert(some <= entries_.size());
  return some == 0 ? 0 : entries_[some - 1].samples_through;
}

std::uint64_t SpoolSession::bytesIn(std::uint64_t chunks) const {
  const std::scoped_lock lock(mutex_);
  const std::size_t some = entriesAmong(chunks);
  assert(some <= entries_.size());
  return some == 0 ? 0 : entries_[some - 1].bytes_through;
}

Result<Bytes> SpoolSession::readChunk(std::uint64_t seq) const {
  std::uint64_t offset = 0;
  {
    const std::scoped_lock lock(mutex_);
    if (seq >= chunksNow())
      return Error{ErrorCode::kNotFound,
                   fmt::format("session {} has no chunk {} in the spool", idText(), seq)};
    const std::size_t at = entriesAmong(seq);
    if (seq < kept() && (at == entries_.size() || entries_[at].seq != seq))
      return Error{ErrorCode::kCorrupt,
                   fmt::format("{}: chunk {} is damaged; only the server had it", folder_.string(), seq)};
    assert(at < entries_.size());
    offset = entries_[at].offset;
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
