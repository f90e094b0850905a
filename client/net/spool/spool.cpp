#include "client/net/spool/spool.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cassert>
#include <cerrno>
#include <cstring>
#include <optional>
#include <utility>

#include "common/base/files/files.h"
#include "common/base/planted_bug.h"

namespace needlelab {
namespace {

namespace fs = std::filesystem;
constexpr std::string_view kRemoving = ".removing";

std::uint64_t bytesIn(const fs::path& folder) {
  std::uint64_t bytes = 0;
  std::error_code error;
  for (auto at = fs::recursive_directory_iterator(folder, error); !error && at != fs::end(at);
       at.increment(error)) {
    std::error_code ignored;
    if (at->is_regular_file(ignored)) bytes += at->file_size(ignored);
  }
  return bytes;
}

// free space for this user; nullopt when the system call fails
std::optional<std::uint64_t> freeBytes(const fs::path& folder) {
  std::error_code error;
  const fs::space_info space = fs::space(folder, error);
  if (error) return std::nullopt;
  return space.available;
}

// renames the folder first, so that a crash in between does not leave half a session; syncs the name before
// removing files, or a power cut could bring the session back with half of its files
void removeFolder(const fs::path& folder) {
  const fs::path removing = folder.string() + std::string(kRemoving);
  std::error_code error;
  fs::rename(folder, removing, error);
  if (!error && syncFolder(folder.parent_path()).ok()) fs::remove_all(removing, error);
}

// ignores the description, which is created first: without other files nothing was recorded
std::uint64_t bytesRecordedIn(const fs::path& folder) {
  std::uint64_t bytes = 0;
  for (const char* name : {"chunks", "tail"}) {
    std::error_code error;
    const auto size = fs::file_size(folder / name, error);
    if (!error) bytes += size;
  }
  return bytes;
}

// ", 100 samples (1 chunk) from tick 100 on are missing"; empty if nothing is
std::string missingText(const SpoolDamage& damage) {
  if (damage.samples == 0 && damage.chunks == 0) return {};
  return fmt::format(", {} samples ({} {}) from tick {} on are missing", damage.samples, damage.chunks,
                     damage.chunks == 1 ? "chunk" : "chunks", damage.from_tick);
}

}  // namespace

Result<std::unique_ptr<Spool>> Spool::open(const fs::path& folder) {
  const auto fail = [&](const std::string& why) {
    return Error{ErrorCode::kUnavailable, "the spool " + folder.string() + " cannot be used: " + why};
  };
  std::error_code error;
  // recordings are private to this user, regardless of the umask
  const auto is_new = makePrivateFolder(folder);
  if (!is_new) return fail(is_new.error().message);
  if (const auto lessons = makePrivateFolder(folder / "lessons"); !lessons)
    return fail(lessons.error().message);
  // the folder's own entry must survive a power cut, too
  if (const auto whole = fs::absolute(folder, error).lexically_normal(); *is_new && !error) {
    const auto parent = whole.has_filename() ? whole.parent_path() : whole.parent_path().parent_path();
    if (auto status = syncFolder(parent); !status.ok()) return fail(status.error().message);
  }
  std::unique_ptr<Spool> spool(new Spool);
  spool->folder_ = folder;
  spool->lock_fd_ = ::open((folder / "lock").c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  if (spool->lock_fd_ < 0) return fail(std::strerror(errno));
  if (::flock(spool->lock_fd_, LOCK_EX | LOCK_NB) != 0)
    return fail(errno == EWOULDBLOCK ? "another station uses it; give each its own --spool"
                                     : std::strerror(errno));

  spool->clock_ = std::make_shared<SpoolClock>(folder / "clock.json");
  // repair sessions after a crash; names sort by time
  std::vector<fs::path> folders;
  for (auto at = fs::directory_iterator(folder, error); !error && at != fs::end(at); at.increment(error))
    if (std::error_code ignored; at->is_directory(ignored)) folders.push_back(at->path());
  if (error) return fail(error.message());
  std::sort(folders.begin(), folders.end());
  for (const fs::path& path : folders) {
    const std::string name = path.filename().string();
    if (name.ends_with(kRemoving)) {
      fs::remove_all(path, error);
      continue;
    }
    if (!parseUuid(name).ok()) continue;
    if (!fs::exists(path / "session.json", error) && bytesRecordedIn(path) == 0) {
      // the program died before the session began: nothing is recorded, and the description may be incomplete
      fs::remove_all(path, error);
      continue;
    }
    auto session = SpoolSession::load(path, spool->clock_);
    if (!session.ok()) {
      spool->notes_.push_back(session.error().message + "; left as it is");
      continue;
    }
    const SpoolContents contents = (*session)->contents();
    if ((*session)->restored())
      spool->notes_.push_back(fmt::format(
          "session {}: its description was damaged and was taken from its copy; nothing of it is lost. See "
          "whether that disk fails",
          name));
    if ((*session)->mended())
      spool->notes_.push_back(fmt::format(
          "session {} was cut off: {} samples in {} chunks were saved{}, it is closed as interrupted", name,
          contents.samples, contents.chunks, missingText(contents.damage)));
    if (auto note = (*session)->lossNote(); !note.empty()) spool->notes_.push_back(std::move(note));
    if (const auto& kept = (*session)->damaged(); !kept.empty())
      spool->notes_.push_back(fmt::format(
          "session {}: its disk has damaged it. {} samples can still be read{}; the server gets what "
          "it lacks of them and is told what is missing. The file as it was is kept in {}. See whether "
          "that disk fails",
          name, contents.samples, missingText(contents.damage), kept.string()));
    spool->sessions_.push_back(std::move(*session));
  }
  if (auto status = syncFolder(folder); !status.ok()) return fail(status.error().message);
  return spool;
}

Spool::~Spool() {
  if (lock_fd_ >= 0) ::close(lock_fd_);
}

Result<std::shared_ptr<SpoolSession>> Spool::create(const pb::SessionDescription& description) {
  assert(lock_fd_ >= 0);
  auto session = SpoolSession::create(folder_, description, clock_);
  if (session.ok()) sessions_.push_back(*session);
  return session;
}

std::vector<std::shared_ptr<SpoolSession>> Spool::unfinished() const {
  std::vector<std::shared_ptr<SpoolSession>> open;
  for (const auto& session : sessions_)
    if (!session->receipt().closed) open.push_back(session);
  return open;
}

std::vector<std::shared_ptr<SpoolSession>> Spool::closedButNotSafe() const {
  std::vector<std::shared_ptr<SpoolSession>> closed;
  for (const auto& session : sessions_) {
    const SpoolReceipt receipt = session->receipt();
    // a session without chunks is never Safe
    if (receipt.closed && receipt.safe < std::max<std::uint64_t>(session->contents().chunks, 1))
      closed.push_back(session);
  }
  return closed;
}

std::vector<std::string> Spool::cleanUp(const SpoolKeep& keep) {
  std::vector<std::string> said;
  std::uint64_t total = bytesIn(folder_);
  // closed sessions use the same disk: removing them makes room for unsent samples
  std::uint64_t free_bytes = freeBytes(folder_).value_or(UINT64_MAX);
  std::erase_if(sessions_, [&](const std::shared_ptr<SpoolSession>& session) {
    const SpoolReceipt receipt = session->receipt();
    if (!receipt.closed) return false;
    const std::int64_t age_s = (clock_->nowNs() - receipt.closed_at_ns) / 1'000'000'000;
    std::string why;
    const auto safe = planted(PlantedBug::kSpoolPurgedAtAck) ? receipt.committed : receipt.safe;
    if (safe >= session->contents().chunks && safe > 0)
      why = "it is in a verified backup of the server";
    else if (age_s > keep.age_s)
      why = fmt::format("the server has had it for {} days", age_s / 86'400);
    else if (total > keep.quota_bytes)
      why = "the spool is over its quota and the server has it";
    else if (free_bytes < keep.min_free_bytes)
      why = "its disk is nearly full and the server has it";
    if (why.empty()) return false;
    const std::uint64_t bytes = bytesIn(session->folder());
    total -= std::min(total, bytes);
    if (free_bytes < keep.min_free_bytes) free_bytes += bytes;
    removeFolder(session->folder());
    said.push_back("session " + session->idText() + " left the spool: " + why);
    return true;
  });
  return said;
}

Result<SpoolUsage> Spool::usage() const {
  SpoolUsage usage;
  for (const auto& session : unfinished()) {
    const SpoolContents contents = session->contents();
    const std::uint64_t committed = session->receipt().committed;
    const std::uint64_t bytes = contents.bytes - std::min(contents.bytes, session->bytesIn(committed));
    if (bytes == 0) continue;
    ++usage.unsent_sessions;
    usage.unsent_bytes += bytes;
    usage.unsent_samples += contents.samples - std::min(contents.samples, session->samplesIn(committed));
  }
  const auto free_bytes = freeBytes(folder_);
  if (!free_bytes)
    return Error{ErrorCode::kUnavailable, "the disk of the spool " + folder_.string() + " cannot be asked"};
  usage.free_bytes = *free_bytes;
  return usage;
}

}  // namespace needlelab
