#include <fcntl.h>
#include <fmt/core.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "common/base/files/files.h"
#include "common/gesture/recording.h"
#include "common/gesture/recording_format.h"

namespace needlelab {

using namespace recording_format;

Result<RecordingWriter> RecordingWriter::create(const std::filesystem::path& path,
                                                std::string_view metadata_json, Mode mode) {
  if (metadata_json.size() > kMaxRecordingMetadata)
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("{}: the metadata has {} bytes, at most {} are allowed", path.string(),
                             metadata_json.size(), kMaxRecordingMetadata)};
  RecordingWriter writer;
  writer.path_ = path;
  if (mode == Mode::kAtomic) {
    auto replaced = replaceableFile(path);
    if (!replaced.ok()) return replaced.error();
    writer.path_ = *std::move(replaced);
  }
  writer.mode_ = mode;
  std::string name = writer.path_.string();
  if (mode == Mode::kAtomic) {
    name += ".XXXXXX";
    writer.fd_ = ::mkostemp(name.data(), O_CLOEXEC);
  } else {
    writer.fd_ = ::open(name.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  }
  if (writer.fd_ < 0) {
    const ErrorCode code = errno == EEXIST ? ErrorCode::kAlreadyExists : ErrorCode::kFailed;
    return Error{code, path.string() + ": cannot create the recording: " + std::strerror(errno)};
  }
  writer.written_path_ = name;

  Bytes start;
  putStart(start);
  putRecord(start, kMetadata, viewOf(metadata_json));
  RETURN_IF_ERROR(writer.writeAll(start));
  if (mode == Mode::kOpenEnded) RETURN_IF_ERROR(syncFolder(path.parent_path()));
  return writer;
}

RecordingWriter::RecordingWriter(RecordingWriter&& other) noexcept
    : path_(std::move(other.path_)),
      written_path_(std::move(other.written_path_)),
      mode_(other.mode_),
      fd_(std::exchange(other.fd_, -1)),
      failed_(other.failed_),
      offset_(other.offset_),
      entries_(std::move(other.entries_)),
      hash_(other.hash_),
      scratch_(std::move(other.scratch_)) {}

RecordingWriter& RecordingWriter::operator=(RecordingWriter&& other) noexcept {
  if (this == &other) return *this;
  abandon();
  path_ = std::move(other.path_);
  written_path_ = std::move(other.written_path_);
  mode_ = other.mode_;
  fd_ = std::exchange(other.fd_, -1);
  failed_ = other.failed_;
  offset_ = other.offset_;
  entries_ = std::move(other.entries_);
  hash_ = other.hash_;
  scratch_ = std::move(other.scratch_);
  return *this;
}

RecordingWriter::~RecordingWriter() {
  abandon();
}

void RecordingWriter::abandon() noexcept {
  if (fd_ < 0) return;
  ::close(fd_);
  fd_ = -1;
  if (mode_ == Mode::kAtomic) ::unlink(written_path_.c_str());
}

Status RecordingWriter::fail(const std::string& what) {
  failed_ = true;
  return Error{ErrorCode::kFailed,
               path_.string() + ": cannot " + what + " the recording: " + std::strerror(errno)};
}

Status RecordingWriter::writeAll(ByteView bytes) {
  if (fd_ < 0 || failed_)
    return Error{
        ErrorCode::kFailed,
        path_.string() + ": the recording is finished, or an earlier write failed; nothing is added"};
  while (!bytes.empty()) {
    const ssize_t n = ::write(fd_, bytes.data(), bytes.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return fail("write");
    offset_ += static_cast<std::uint64_t>(n);
    bytes = bytes.subspan(static_cast<std::size_t>(n));
  }
  return {};
}

Status RecordingWriter::writeRecord(std::uint8_t kind, ByteView content) {
  // one write per record, so that a crash between two calls leaves only whole records
  scratch_.clear();
  putRecord(scratch_, kind, content);
  return writeAll(scratch_);
}

Status RecordingWriter::append(ByteView chunk) {
  const auto info = inspectChunk(chunk);
  if (!info.ok())
    return Error{info.error().code, fmt::format("{}: chunk {} is not written: {}", path_.string(),
                                                entries_.size(), info.error().message)};
  const RecordingEntry entry{offset_, static_cast<std::uint32_t>(chunk.size()), info->count, info->first_tick,
                             info->last_tick};
  RETURN_IF_ERROR(writeRecord(kChunk, chunk));
  entries_.push_back(entry);
  hash_.update(chunk);
  return {};
}

Status RecordingWriter::sync() {
  if (fd_ < 0 || failed_) return writeAll({});
  if (::fdatasync(fd_) != 0) return fail("sync");
  return {};
}

Status RecordingWriter::finish() {
  const std::uint64_t index_offset = offset_;
  Bytes content;
  ByteWriter writer(content);
  writer.put(static_cast<std::uint64_t>(entries_.size()));
  for (const RecordingEntry& entry : entries_) {
    writer.put(entry.offset);
    writer.put(entry.bytes);
    writer.put(entry.count);
    writer.put(entry.first_tick);
    writer.put(entry.last_tick);
  }
  const Digest digest = hash_.digest();
  writer.put(ByteView(digest));
  // omit an index that is too long for a record: such a file is read by scanning
  Bytes footer;
  if (content.size() <= kMaxRecordBytes) {
    RETURN_IF_ERROR(writeRecord(kIndex, content));
    putFooter(footer, index_offset);
  }
  RETURN_IF_ERROR(writeAll(footer));

  // data first, then the name: no reader sees a half-written file
  if (::fsync(fd_) != 0) return fail("sync");
  if (mode_ == Mode::kAtomic) {
    if (::fchmod(fd_, 0600) != 0) return fail("set the permissions of");
    if (::rename(written_path_.c_str(), path_.c_str()) != 0) return fail("rename into place");
  }
  ::close(fd_);
  fd_ = -1;
  return syncFolder(path_.parent_path());
}

}  // namespace needlelab
