#include <fcntl.h>
#include <fmt/core.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "common/gesture/recording.h"
#include "common/gesture/recording_format.h"

namespace needlelab {

using namespace recording_format;

Result<RecordingReader> RecordingReader::open(const std::filesystem::path& path) {
  RecordingReader reader;
  reader.path_ = path;
  reader.fd_ = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (reader.fd_ < 0)
    return Error{ErrorCode::kInvalidInput,
                 path.string() + ": cannot open the recording: " + std::strerror(errno)};
  struct stat info {};
  if (::fstat(reader.fd_, &info) != 0 || !S_ISREG(info.st_mode))
    return Error{ErrorCode::kInvalidInput, path.string() + ": is not a regular file"};
  reader.size_ = static_cast<std::uint64_t>(info.st_size);
  RETURN_IF_ERROR(reader.checkStart());
  if (!reader.openByIndex()) RETURN_IF_ERROR(reader.scan());
  return reader;
}

RecordingReader::RecordingReader(RecordingReader&& other) noexcept
    : path_(std::move(other.path_)),
      fd_(std::exchange(other.fd_, -1)),
      size_(other.size_),
      metadata_(std::move(other.metadata_)),
      complete_(other.complete_),
      tail_bytes_(other.tail_bytes_),
      damages_(std::move(other.damages_)),
      entries_(std::move(other.entries_)),
      hash_(other.hash_) {}

RecordingReader& RecordingReader::operator=(RecordingReader&& other) noexcept {
  if (this == &other) return *this;
  if (fd_ >= 0) ::close(fd_);
  path_ = std::move(other.path_);
  fd_ = std::exchange(other.fd_, -1);
  size_ = other.size_;
  metadata_ = std::move(other.metadata_);
  complete_ = other.complete_;
  tail_bytes_ = other.tail_bytes_;
  damages_ = std::move(other.damages_);
  entries_ = std::move(other.entries_);
  hash_ = other.hash_;
  return *this;
}

RecordingReader::~RecordingReader() {
  if (fd_ >= 0) ::close(fd_);
}

// the caller has checked that offset + count is within the file
Status RecordingReader::readAt(std::uint64_t offset, std::size_t count, Bytes& out) const {
  out.resize(count);
  std::size_t done = 0;
  while (done < count) {
    const ssize_t n = ::pread(fd_, out.data() + done, count - done, static_cast<off_t>(offset + done));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0)
      return Error{ErrorCode::kFailed, fmt::format("{}: cannot read at offset {}: {}", path_.string(), offset,
                                                   std::strerror(errno))};
    if (n == 0)
      return Error{ErrorCode::kCorrupt,
                   fmt::format("{}: was truncated while being read, at offset {}", path_.string(), offset)};
    done += static_cast<std::size_t>(n);
  }
  return {};
}

Status RecordingReader::readRecord(std::uint64_t offset, std::uint8_t& kind, Bytes& content) const {
  const auto corrupt = [](const char* why) { return Error{ErrorCode::kCorrupt, why}; };
  if (offset > size_ || size_ - offset < kRecordHeaderBytes + kRecordCrcBytes)
    return corrupt("the file ends before it");
  Bytes head;
  RETURN_IF_ERROR(readAt(offset, kRecordHeaderBytes, head));
  RecordHeader header;
  if (!readRecordHeader(head, header)) return corrupt("its record's header is damaged");
  if (size_ - offset - kRecordHeaderBytes - kRecordCrcBytes < header.length)
    return corrupt("the file ends within it");
  if (header.kind == kMetadata && header.length > kMaxRecordingMetadata)
    return Error{ErrorCode::kCorrupt, fmt::format("it has {} bytes of metadata, at most {} are read",
                                                  header.length, kMaxRecordingMetadata)};
  RETURN_IF_ERROR(readAt(offset + kRecordHeaderBytes, header.length + kRecordCrcBytes, content));
  std::uint32_t stored;
  std::memcpy(&stored, content.data() + header.length, kRecordCrcBytes);
  content.resize(header.length);
  kind = header.kind;
  if (crc32c(content) != stored) return corrupt("the CRC-32C of its record does not agree with the bytes");
  return {};
}

Status RecordingReader::checkStart() {
  Bytes start;
  RETURN_IF_ERROR(readAt(0, std::min<std::uint64_t>(size_, kStartBytes), start));
  if (!std::equal(start.begin(),
                  start.begin() + static_cast<std::ptrdiff_t>(std::min(start.size(), kMagic.size())),
                  kMagic.begin()))
    return Error{ErrorCode::kInvalidInput,
                 path_.string() + ": is not a needlelab recording: it does not start with \\x89NLREC"};
  // a file cut within its first bytes is an empty recording
  if (start.size() < kStartBytes) return {};
  std::uint16_t major;
  std::uint32_t crc;
  std::memcpy(&major, start.data() + 8, 2);
  std::memcpy(&crc, start.data() + 12, 4);
  if (crc != crc32c(ByteView(start).first(12)))
    return Error{ErrorCode::kInvalidInput,
                 path_.string() + ": its first 16 bytes are damaged: their CRC-32C does not agree"};
  if (major != kMajor)
    return Error{ErrorCode::kVersion,
                 fmt::format("{}: is a recording of format {}; this program reads format {}", path_.string(),
                             major, kMajor)};
  return {};
}

bool RecordingReader::openByIndex() {
  // footer
  if (size_ < kStartBytes + kFooterBytes) return false;
  Bytes footer;
  if (!readAt(size_ - kFooterBytes, kFooterBytes, footer).ok()) return false;
  if (std::memcmp(footer.data() + 16, kEndMagic.data(), kEndMagic.size()) != 0) return false;
  ByteReader in(footer);
  const auto index_offset = in.get<std::uint64_t>();
  in.take(4);
  if (in.get<std::uint32_t>() != crc32c(ByteView(footer).first(12))) return false;

  // index; each entry must lie between the file's start and the index, in order
  std::uint8_t kind = 0;
  Bytes content;
  if (!readRecord(index_offset, kind, content).ok() || kind != kIndex) return false;
  ByteReader index(content);
  const auto count = index.get<std::uint64_t>();
  if (count > index.left() / kIndexEntryBytes || index.left() < count * kIndexEntryBytes + hash_.size())
    return false;
  std::vector<RecordingEntry> entries(count);
  std::uint64_t free_from = kStartBytes;
  for (RecordingEntry& entry : entries) {
    entry.offset = index.get<std::uint64_t>();
    entry.bytes = index.get<std::uint32_t>();
    entry.count = index.get<std::uint32_t>();
    entry.first_tick = index.get<std::uint64_t>();
    entry.last_tick = index.get<std::uint64_t>();
    const std::uint64_t length = kRecordHeaderBytes + std::uint64_t{entry.bytes} + kRecordCrcBytes;
    if (entry.offset < free_from || entry.offset > index_offset || index_offset - entry.offset < length)
      return false;
    if (entry.bytes > kMaxChunkBytes || entry.count == 0 || entry.count > kMaxChunkSamples) return false;
    free_from = entry.offset + length;
  }
  const ByteView digest = index.take(hash_.size());
  if (!index.ok()) return false;
  std::memcpy(hash_.data(), digest.data(), hash_.size());

  Bytes text;
  const Status metadata = readRecord(kStartBytes, kind, text);
  if (metadata.ok() && kind == kMetadata)
    metadata_.assign(textOf(text));
  else
    damages_.push_back(
        {kStartBytes, 0,
         "metadata: " + (metadata.ok() ? "is not the first record" : metadata.error().message)});
  entries_ = std::move(entries);
  complete_ = true;
  return true;
}

Result<std::uint64_t> RecordingReader::findRecord(std::uint64_t offset) const {
  // the next record is usually near: long reads for each one could total more than the file's length
  constexpr std::uint64_t kMaxAtOnce = 1u << 20;
  std::uint64_t at_once = 1u << 12;
  Bytes window;
  while (offset + kRecordHeaderBytes <= size_) {
    const auto count = static_cast<std::size_t>(std::min(at_once, size_ - offset));
    RETURN_IF_ERROR(readAt(offset, count, window));
    for (std::size_t at = 0; at + kRecordHeaderBytes <= count; ++at) {
      RecordHeader header;
      if (window[at] == kMarker[0] &&
          readRecordHeader(ByteView(window).subspan(at, kRecordHeaderBytes), header))
        return offset + at;
    }
    // windows overlap by one byte less than a header
    offset += count - (kRecordHeaderBytes - 1);
    at_once = std::min(2 * at_once, kMaxAtOnce);
  }
  return size_;
}

Status RecordingReader::scan() {
  Bytes content;
  std::uint64_t offset = std::min<std::uint64_t>(size_, kStartBytes);
  std::uint64_t good_end = size_ < kStartBytes ? 0 : kStartBytes;  // after the last whole record
  std::size_t good_entries = 0, good_damages = 0;
  std::size_t chunk_damages = 0;  // damages before the last whole chunk
  // merge all damage between two chunks into one entry: otherwise a file of nothing but damage would need
  // more memory than its own length
  const auto addDamage = [&](std::uint64_t bytes, std::string what) {
    if (damages_.size() > chunk_damages)
      damages_.back().bytes = offset + bytes - damages_.back().offset;
    else
      damages_.push_back({offset, bytes, std::move(what)});
  };
  while (offset < size_) {
    Bytes head;
    RecordHeader header;
    const bool enough = size_ - offset >= kRecordHeaderBytes;
    if (enough) RETURN_IF_ERROR(readAt(offset, kRecordHeaderBytes, head));
    if (!enough || !readRecordHeader(head, header)) {
      // not a record: continue at the next record, if any
      ASSIGN_OR_RETURN(const auto next, findRecord(offset + 1));
      addDamage(next - offset,
                fmt::format("between chunk {} and the previous one: no record starts here", entries_.size()));
      offset = next;
      continue;
    }
    const std::uint64_t length = kRecordHeaderBytes + std::uint64_t{header.length} + kRecordCrcBytes;
    std::uint8_t kind = 0;
    const Status status = readRecord(offset, kind, content);
    if (!status.ok() && status.error().code == ErrorCode::kFailed) return status;
    if (!status.ok() && length > size_ - offset) {
      // the file was truncated within this record; if good records follow, bytes are missing in between
      ASSIGN_OR_RETURN(const auto next, findRecord(offset + kRecordHeaderBytes));
      if (next == size_) break;
      addDamage(next - offset,
                fmt::format("a record behind chunk {} reaches beyond the file's end, but others follow it",
                            entries_.size()));
      offset = next;
      continue;
    }
    std::string fault = status.ok() ? "" : status.error().message;
    if (header.kind == kChunk) {
      RecordingEntry entry{offset, header.length, 0, 0, 0};
      if (const auto info = status.ok() ? inspectChunk(content) : Result<ChunkInfo>(status.error());
          info.ok()) {
        entry.count = info->count;
        entry.first_tick = info->first_tick;
        entry.last_tick = info->last_tick;
      } else {
        fault = info.error().message;
      }
      if (!fault.empty()) fault = fmt::format("chunk {}: {}", entries_.size(), fault);
      entries_.push_back(entry);
    } else if (header.kind == kMetadata && status.ok() && entries_.empty()) {
      metadata_.assign(textOf(content));
    }
    if (!fault.empty()) addDamage(length, fault);
    offset += length;
    if (fault.empty()) {
      good_end = offset;
      good_entries = entries_.size();
      good_damages = damages_.size();
      if (header.kind == kChunk) chunk_damages = good_damages;
    }
  }
  // unreadable bytes up to the end mean truncation, not damage in the middle
  entries_.resize(good_entries);
  damages_.resize(good_damages);
  if (!damages_.empty())
    damages_.back().bytes = std::min(damages_.back().bytes, good_end - damages_.back().offset);
  tail_bytes_ = size_ - good_end;
  return {};
}

Error RecordingReader::chunkError(std::size_t index, const std::string& why) const {
  return {ErrorCode::kCorrupt,
          fmt::format("{}: chunk {} at offset {}: {}", path_.string(), index, entries_[index].offset, why)};
}

std::uint64_t RecordingReader::sampleCount() const {
  std::uint64_t sum = 0;
  for (const RecordingEntry& entry : entries_) sum += entry.count;
  return sum;
}

Result<Bytes> RecordingReader::chunkBytes(std::size_t index) const {
  if (index >= entries_.size())
    return Error{ErrorCode::kInvalidInput, fmt::format("{}: there is no chunk {}; the recording has {}",
                                                       path_.string(), index, entries_.size())};
  std::uint8_t kind = 0;
  Bytes content;
  const Status status = readRecord(entries_[index].offset, kind, content);
  if (!status.ok()) return chunkError(index, status.error().message);
  if (kind != kChunk || content.size() != entries_[index].bytes)
    return chunkError(index, "another record stands there than the index says");
  return content;
}

Result<std::vector<GestureSample>> RecordingReader::samples(std::size_t index) const {
  ASSIGN_OR_RETURN(const auto chunk, chunkBytes(index));
  return decoded(index, chunk);
}

Result<std::vector<GestureSample>> RecordingReader::decoded(std::size_t index, ByteView chunk) const {
  auto samples = decodeChunk(chunk);
  if (!samples.ok()) return chunkError(index, samples.error().message);
  if (samples->size() != entries_[index].count)
    return chunkError(
        index, fmt::format("it has {} samples, the index says {}", samples->size(), entries_[index].count));
  return samples;
}

Result<std::vector<GestureSample>> RecordingReader::allSamples() const {
  std::vector<GestureSample> all;
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    ASSIGN_OR_RETURN(auto part, samples(i));
    all.insert(all.end(), part.begin(), part.end());
  }
  return all;
}

Status RecordingReader::verify() const {
  SessionHash hash;
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    ASSIGN_OR_RETURN(const auto chunk, chunkBytes(i));
    RETURN_IF_ERROR(decoded(i, chunk));
    hash.update(chunk);
  }
  if (!damages_.empty())
    return Error{ErrorCode::kCorrupt, fmt::format("{}: at offset {}: {}", path_.string(),
                                                  damages_.front().offset, damages_.front().what)};
  if (complete_ && hash.digest() != hash_)
    return Error{ErrorCode::kCorrupt, path_.string() + ": the hash of its chunks is " + hexOf(hash.digest()) +
                                          ", its index says " + hexOf(hash_)};
  return {};
}

}  // namespace needlelab
