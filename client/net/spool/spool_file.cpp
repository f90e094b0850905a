#include "client/net/spool/spool_file.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cassert>
#include <cerrno>
#include <cstring>
#include <string>
#include <utility>

#include "common/base/bytes.h"

namespace needlelab {
namespace {

constexpr std::uint32_t kMagic = 0x31534C4E;  // "NLS1"

// Limit for bytes read in vain during a scan, beyond four times the file: a second's work. A place that only
// looks like a record costs the length that it states and the search for the next one. Disk damage causes a
// few of them; a malicious file has one every eight bytes.
constexpr std::uint64_t kMaxInVain = std::uint64_t{1} << 30;
constexpr std::size_t kSearchBlock = 64 * 1024;

// reads all of it, through interruptions; returns the number of bytes
Result<std::size_t> readFully(int fd, std::uint8_t* to, std::size_t count, std::uint64_t offset) {
  std::size_t done = 0;
  while (done < count) {
    const ssize_t got = ::pread(fd, to + done, count - done, static_cast<off_t>(offset + done));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return Error{ErrorCode::kUnavailable, std::strerror(errno)};
    if (got == 0) break;
    done += static_cast<std::size_t>(got);
  }
  return done;
}

}  // namespace

SpoolFile::SpoolFile(SpoolFile&& other) noexcept
    : path_(std::move(other.path_)),
      fd_(std::exchange(other.fd_, -1)),
      size_(other.size_),
      scratch_(std::move(other.scratch_)) {}

SpoolFile& SpoolFile::operator=(SpoolFile&& other) noexcept {
  if (this != &other) {
    if (fd_ >= 0) ::close(fd_);
    path_ = std::move(other.path_);
    fd_ = std::exchange(other.fd_, -1);
    size_ = other.size_;
    scratch_ = std::move(other.scratch_);
  }
  return *this;
}

SpoolFile::~SpoolFile() {
  if (fd_ >= 0) ::close(fd_);
}

Error SpoolFile::systemError(const char* what) const {
  return Error{ErrorCode::kUnavailable,
               std::string(what) + " " + path_.string() + ": " + std::strerror(errno)};
}

Result<SpoolFile> SpoolFile::open(const std::filesystem::path& path) {
  SpoolFile file;
  file.path_ = path;
  file.fd_ = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0600);
  if (file.fd_ < 0) return file.systemError("cannot open");
  struct stat info {};
  if (::fstat(file.fd_, &info) != 0) return file.systemError("cannot look at");
  if (!S_ISREG(info.st_mode))
    return Error{ErrorCode::kUnavailable,
                 path.string() + ": is not a regular file, and no station made it; remove it"};
  file.size_ = static_cast<std::uint64_t>(info.st_size);
  return file;
}

Result<bool> SpoolFile::readRecord(std::uint64_t offset, SpoolRecord& record, Bytes& data) const {
  std::uint8_t header[kSpoolRecordHeader];
  auto got = readFully(fd_, header, sizeof header, offset);
  if (!got.ok()) return got.error();
  if (*got < sizeof header) return false;
  ByteReader reader({header, sizeof header});
  const auto magic = reader.get<std::uint32_t>();
  const auto length = reader.get<std::uint32_t>();
  record.offset = offset;
  record.seq = reader.get<std::uint64_t>();
  record.part = reader.get<std::uint32_t>();
  const auto crc = reader.get<std::uint32_t>();
  // do not trust the length before the checksum: limit it before allocating
  if (magic != kMagic || length > kMaxSpoolRecord) return false;
  data.resize(length);
  got = readFully(fd_, data.data(), length, offset + sizeof header);
  if (!got.ok()) return got.error();
  if (*got < length) return false;
  if (crc32c(data, crc32c({header + 4, 16})) != crc) return false;
  record.data = data;
  return true;
}

Result<std::uint64_t> SpoolFile::scan(const std::function<bool(const SpoolRecord&)>& visit) const {
  const auto unreadable = [this](const Error& why) {
    return Error{ErrorCode::kUnavailable, "cannot read " + path_.string() + ": " + why.message};
  };
  std::uint64_t offset = 0, end = 0, in_vain = 0;
  SpoolRecord record;
  Bytes data;
  while (offset < size_) {
    auto good = readRecord(offset, record, data);
    if (!good.ok()) return unreadable(good.error());
    if (*good) {
      offset += kSpoolRecordHeader + data.size();
      if (visit(record)) end = offset;
      continue;
    }
    in_vain += data.size() + kSearchBlock;
    data.clear();
    if (in_vain > kMaxInVain + 4 * size_)
      return unreadable(
          {ErrorCode::kUnavailable,
           fmt::format(
               "too many places only look like records, up to byte {} of {}; no station wrote this file",
               offset, size_)});
    const auto next = nextMagic(offset + 1);
    if (!next.ok()) return unreadable(next.error());
    offset = *next;
  }
  return end;
}

Result<std::uint64_t> SpoolFile::nextMagic(std::uint64_t offset) const {
  Bytes block(kSearchBlock);
  while (offset + kSpoolRecordHeader <= size_) {
    ASSIGN_OR_RETURN(const auto got, readFully(fd_, block.data(), block.size(), offset));
    if (got < sizeof kMagic) break;
    for (std::size_t i = 0; i + sizeof kMagic <= got; ++i)
      if (std::memcmp(block.data() + i, &kMagic, sizeof kMagic) == 0) return offset + i;
    // blocks overlap by three bytes, so that no magic number straddles two of them
    offset += got - (sizeof kMagic - 1);
  }
  return size_;
}

namespace {

void encodeRecord(Bytes& out, std::uint64_t seq, std::uint32_t part, ByteView data) {
  out.clear();
  ByteWriter writer(out);
  writer.put(kMagic);
  writer.put(static_cast<std::uint32_t>(data.size()));
  writer.put(seq);
  writer.put(part);
  writer.put(crc32c(data, crc32c(ByteView(out).subspan(4))));
  writer.put(data);
  assert(out.size() == kSpoolRecordHeader + data.size());
}

}  // namespace

Status SpoolFile::writeAt(std::uint64_t offset, ByteView bytes) {
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t wrote =
        ::pwrite(fd_, bytes.data() + done, bytes.size() - done, static_cast<off_t>(offset + done));
    if (wrote < 0 && errno == EINTR) continue;
    if (wrote <= 0) return systemError("cannot write to");
    done += static_cast<std::size_t>(wrote);
  }
  return {};
}

Status SpoolFile::append(std::uint64_t seq, std::uint32_t part, ByteView data) {
  if (data.size() > kMaxSpoolRecord)
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("a record of {} bytes is too long for the spool; at most {}", data.size(),
                             kMaxSpoolRecord)};
  assert(fd_ >= 0);
  // header and data in one write, to reduce the risk of torn records
  encodeRecord(scratch_, seq, part, data);
  if (auto status = writeAt(size_, scratch_); !status.ok()) {
    // a partial record would hide later ones; if even truncation fails, the next append overwrites it
    [[maybe_unused]] const int cut = ::ftruncate(fd_, static_cast<off_t>(size_));
    return status;
  }
  size_ += scratch_.size();
  return {};
}

Status SpoolFile::writeAgain(std::uint64_t offset) {
  SpoolRecord record;
  Bytes data, bytes;
  ASSIGN_OR_RETURN(auto good, readRecord(offset, record, data));
  if (!good)
    return Error{
        ErrorCode::kCorrupt,
        fmt::format("{}: the record at byte {} was lost before it reached the disk", path_.string(), offset)};
  encodeRecord(bytes, record.seq, record.part, data);
  return writeAt(offset, bytes);
}

Result<Bytes> SpoolFile::read(std::uint64_t offset) const {
  SpoolRecord record;
  Bytes data;
  auto good = readRecord(offset, record, data);
  if (!good.ok())
    return Error{ErrorCode::kUnavailable, "cannot read " + path_.string() + ": " + good.error().message};
  if (!*good)
    return Error{ErrorCode::kCorrupt,
                 fmt::format("{}: the record at byte {} fails its check", path_.string(), offset)};
  return data;
}

Status SpoolFile::truncate(std::uint64_t size) {
  if (::ftruncate(fd_, static_cast<off_t>(size)) != 0) return systemError("cannot shorten");
  size_ = size;
  return {};
}

Status SpoolFile::sync() const {
  if (::fdatasync(fd_) != 0) return systemError("cannot sync");
  return {};
}

}  // namespace needlelab
