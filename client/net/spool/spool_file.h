/// A file of the spool: records in sequence, each with its own checksum, so that a reader detects a torn end.
///
/// Record (little-endian): magic "NLS1" (4), bytes of data (4), seq (8), part (4), CRC-32C (4) over the 16
/// bytes before it (without the magic) and the data, then the data. In the file `chunks`, seq counts from 0
/// and part is the number of chunks that were synced when this one was written. In the file `tail`, seq is
/// that of the future chunk, and part counts its pieces from 0.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>

#include "common/base/bytes.h"
#include "common/base/result.h"

namespace needlelab {

inline constexpr std::size_t kSpoolRecordHeader = 24;
/// A chunk must fit into one envelope of 1 MiB.
inline constexpr std::size_t kMaxSpoolRecord = (1u << 20) - 256;

/// A record found by a scan. `data` is valid only during the visit.
struct SpoolRecord {
  std::uint64_t offset = 0;  ///< of the record in the file
  std::uint64_t seq = 0;
  std::uint32_t part = 0;
  ByteView data;
};

/// Owns a file descriptor. Thread: one appends; another may call `read`.
class SpoolFile {
 public:
  SpoolFile() = default;
  SpoolFile(SpoolFile&& other) noexcept;
  SpoolFile& operator=(SpoolFile&& other) noexcept;
  ~SpoolFile();

  /// Opens the file for appending and reading, and creates it if missing. Errors: kUnavailable with the
  /// system's reason, or if it is not a regular file.
  static Result<SpoolFile> open(const std::filesystem::path& path);

  /// Visits all valid records in order, including those after damage. The visitor returns whether it accepts
  /// the record. Returns the end of the last accepted record, or 0. Errors: kUnavailable if the disk cannot
  /// be read, or if so many places only look like records that the scan would take more than seconds.
  Result<std::uint64_t> scan(const std::function<bool(const SpoolRecord&)>& visit) const;

  /// Appends a record (at most kMaxSpoolRecord bytes). Errors: kUnavailable if the disk refuses; the file is
  /// then unchanged.
  Status append(std::uint64_t seq, std::uint32_t part, ByteView data);
  /// Returns the data of the record at `offset`, and checks it again. Errors: kCorrupt, kUnavailable.
  [[nodiscard]] Result<Bytes> read(std::uint64_t offset) const;
  /// Writes the same bytes of the record at `offset` again, because a failed sync may have lost them.
  Status writeAgain(std::uint64_t offset);
  /// Cuts the file to `size` bytes.
  Status truncate(std::uint64_t size);
  /// fdatasync.
  Status sync() const;
  [[nodiscard]] std::uint64_t size() const { return size_; }

 private:
  [[nodiscard]] Error systemError(const char* what) const;
  Status writeAt(std::uint64_t offset, ByteView bytes);
  /// The offset of the next magic number from `offset` on; or else the file's size.
  [[nodiscard]] Result<std::uint64_t> nextMagic(std::uint64_t offset) const;
  /// Reads the record at `offset`, its bytes into `data`; false if no valid record begins there.
  Result<bool> readRecord(std::uint64_t offset, SpoolRecord& record, Bytes& data) const;

  std::filesystem::path path_;
  int fd_ = -1;
  std::uint64_t size_ = 0;  ///< offset of the next record; only the appending thread changes it
  Bytes scratch_;
};

}  // namespace needlelab
