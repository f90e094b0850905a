/// A file of the spool: records appended one after the other, each with its own check, so that a torn end is
/// recognised.
///
/// Record (little-endian): magic "NLS1" (4), bytes of data (4), seq (8), part (4), CRC-32C (4) over the 16
/// bytes before it (without the magic) and the data, then the data. In the file `chunks` seq counts from 0
/// and part says how many chunks were surely on disk when this one was written; in the file `tail` seq is
/// that of the chunk to be, and part counts its pieces from 0.
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

/// One record as found by a scan. `data` is valid during the visit only.
struct SpoolRecord {
  std::uint64_t offset = 0;  ///< of the record in the file
  std::uint64_t seq = 0;
  std::uint32_t part = 0;
  ByteView data;
};

/// Owns a file descriptor. Thread: one appends; `read` may be called from another.
class SpoolFile {
 public:
  SpoolFile() = default;
  SpoolFile(SpoolFile&& other) noexcept;
  SpoolFile& operator=(SpoolFile&& other) noexcept;
  ~SpoolFile();

  /// Opens for appending and reading; makes it when it is not there. Errors: kUnavailable with the system's
  /// reason.
  static Result<SpoolFile> open(const std::filesystem::path& path);

  /// Visits the good records from the start. Stops at the first one that is cut off or fails its check, or
  /// when the visitor returns false; gives the offset where it stopped. Errors: kUnavailable when the disk
  /// cannot be read.
  Result<std::uint64_t> scan(const std::function<bool(const SpoolRecord&)>& visit) const;

  /// Whether any good record that begins after `offset` is as asked. Errors: kUnavailable.
  [[nodiscard]] Result<bool> anyBehind(std::uint64_t offset,
                                       const std::function<bool(const SpoolRecord&)>& is) const;

  /// Appends a record (at most kMaxSpoolRecord bytes). When the disk refuses, the file is as it was:
  /// kUnavailable.
  Status append(std::uint64_t seq, std::uint32_t part, ByteView data);
  /// The data of the record at `offset`, checked again. Errors: kCorrupt, kUnavailable.
  [[nodiscard]] Result<Bytes> read(std::uint64_t offset) const;
  /// Writes the record at `offset` once more, the same bytes: what a failed sync may have lost on the way to
  /// the disk.
  Status writeAgain(std::uint64_t offset);
  /// Cuts the file to `size` bytes.
  Status truncate(std::uint64_t size);
  /// fdatasync.
  Status sync() const;
  [[nodiscard]] std::uint64_t size() const { return size_; }

 private:
  [[nodiscard]] Error systemError(const char* what) const;
  /// Data of the record at `offset` into `data`; false when no good record begins there.
  Status writeAt(std::uint64_t offset, ByteView bytes);
  Result<bool> readRecord(std::uint64_t offset, SpoolRecord& record, Bytes& data) const;

  std::filesystem::path path_;
  int fd_ = -1;
  std::uint64_t size_ = 0;  ///< where the next record goes; kept by the appending thread
  Bytes scratch_;
};

}  // namespace needlelab
