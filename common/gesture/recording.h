/// Recording files: a metadata text, a gesture's chunks, and an index if the file was closed cleanly.
/// FORMAT.md describes every byte.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/gesture/chunk.h"

namespace needlelab {

inline constexpr std::size_t kMaxRecordingMetadata = 1u << 20;

/// One chunk's place in a recording file.
struct RecordingEntry {
  std::uint64_t offset = 0;  ///< where the chunk's record begins in the file
  std::uint32_t bytes = 0;   ///< length of the chunk itself
  std::uint32_t count = 0;   ///< samples
  std::uint64_t first_tick = 0, last_tick = 0;
};

/// Writes one recording. Thread: one at a time. Movable, not copyable.
class RecordingWriter {
 public:
  enum class Mode {
    kAtomic,     ///< writes to a temporary file beside the path; `finish` renames it, and without `finish`
                 ///< nothing is left
    kOpenEnded,  ///< writes to the path directly, so that a crash leaves a readable, truncated recording
  };
  /// `metadata_json` is opaque here, at most kMaxRecordingMetadata bytes. Errors: kInvalidInput (too long),
  /// kAlreadyExists (kOpenEnded and the path is taken), kFailed with the system's reason.
  static Result<RecordingWriter> create(const std::filesystem::path& path, std::string_view metadata_json,
                                        Mode mode = Mode::kAtomic);
  RecordingWriter(RecordingWriter&& other) noexcept;
  RecordingWriter& operator=(RecordingWriter&& other) noexcept;
  ~RecordingWriter();

  /// Errors: those of inspectChunk (a bad chunk is not written), kFailed (the disk failed; the writer accepts
  /// no more chunks).
  Status append(ByteView chunk);
  /// Calls fdatasync: the appended chunks survive a power cut (in kOpenEnded mode, which also synced the
  /// folder at `create`).
  Status sync();
  /// Writes index and footer, syncs, renames into place (kAtomic) and closes.
  Status finish();

  [[nodiscard]] std::size_t chunks() const { return entries_.size(); }
  [[nodiscard]] std::uint64_t bytes() const { return offset_; }  ///< written so far
  [[nodiscard]] Digest hash() const { return hash_.digest(); }   ///< over the chunks so far

 private:
  RecordingWriter() = default;
  Status writeAll(ByteView bytes);
  Status fail(const std::string& what);
  Status writeRecord(std::uint8_t kind, ByteView content);
  void abandon() noexcept;

  std::filesystem::path path_, written_path_;  ///< final name; name of the file being written
  Mode mode_ = Mode::kAtomic;
  int fd_ = -1;
  bool failed_ = false;
  std::uint64_t offset_ = 0;
  std::vector<RecordingEntry> entries_;
  SessionHash hash_;
  Bytes scratch_;
};

/// Reads a recording one chunk at a time: apart from the index, memory does not grow with the file.
/// Thread: const functions may be called from several. Movable, not copyable.
class RecordingReader {
 public:
  /// An unreadable part in the middle of the file, found at `open`: it spans all unreadable places between
  /// two chunks, and readable records follow. `what` describes the first place.
  struct Damage {
    std::uint64_t offset = 0, bytes = 0;
    std::string what;
  };

  /// Opens a complete file by its index. Scans a file that is truncated or has a damaged index, and finds
  /// every whole chunk. A file truncated before its first chunk also opens, with no chunks. Damage in the
  /// middle is not an error here: see `damages`. Errors: kInvalidInput (cannot be opened, does not start as a
  /// recording), kVersion.
  static Result<RecordingReader> open(const std::filesystem::path& path);
  RecordingReader(RecordingReader&& other) noexcept;
  RecordingReader& operator=(RecordingReader&& other) noexcept;
  ~RecordingReader();

  /// At most kMaxRecordingMetadata bytes; empty when the record is damaged or longer, which counts as damage.
  [[nodiscard]] const std::string& metadata() const { return metadata_; }
  [[nodiscard]] bool complete() const { return complete_; }  ///< the file has a valid index and footer
  [[nodiscard]] std::uint64_t unusableTailBytes() const {
    return tail_bytes_;
  }  ///< bytes after the last whole record of a truncated file
  [[nodiscard]] const std::vector<Damage>& damages() const { return damages_; }
  /// A damaged chunk keeps its entry if its record header is readable, so that chunk numbers do not change.
  [[nodiscard]] const std::vector<RecordingEntry>& entries() const { return entries_; }
  [[nodiscard]] std::uint64_t sampleCount() const;
  [[nodiscard]] const Digest& declaredHash() const { return hash_; }  ///< of a complete file; zeros otherwise

  /// Errors (kCorrupt, kInvalidInput) name file, chunk number and offset; the other chunks stay readable.
  [[nodiscard]] Result<Bytes> chunkBytes(std::size_t index) const;
  [[nodiscard]] Result<std::vector<GestureSample>> samples(std::size_t index) const;
  /// Returns every sample of the recording. Fails at the first unreadable chunk.
  [[nodiscard]] Result<std::vector<GestureSample>> allSamples() const;
  /// Decodes every chunk, and compares the hash of a complete file. Errors: kCorrupt, with chunk and offset
  /// of the first fault.
  [[nodiscard]] Status verify() const;

 private:
  RecordingReader() = default;
  Status readAt(std::uint64_t offset, std::size_t count, Bytes& out) const;
  /// Reads the content of the record at `offset` and checks both CRCs.
  Status readRecord(std::uint64_t offset, std::uint8_t& kind, Bytes& content) const;
  Status checkStart();
  bool openByIndex();
  Status scan();
  /// Returns the offset of the next record header at or after `offset`; the file's size when none follows.
  Result<std::uint64_t> findRecord(std::uint64_t offset) const;
  /// Returns a chunk's samples and checks their number against the entry.
  [[nodiscard]] Result<std::vector<GestureSample>> decoded(std::size_t index, ByteView chunk) const;
  [[nodiscard]] Error chunkError(std::size_t index, const std::string& why) const;

  std::filesystem::path path_;
  int fd_ = -1;
  std::uint64_t size_ = 0;
  std::string metadata_;
  bool complete_ = false;
  std::uint64_t tail_bytes_ = 0;
  std::vector<Damage> damages_;
  std::vector<RecordingEntry> entries_;
  Digest hash_{};
};

}  // namespace needlelab
