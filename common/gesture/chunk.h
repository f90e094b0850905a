/// A chunk: some samples of a gesture as self-contained, self-checking bytes. FORMAT.md describes every byte.
#pragma once

#include <sodium.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/gesture/sample.h"

namespace needlelab {

inline constexpr std::size_t kMaxChunkSamples = 65'536;
/// The maximum length of a chunk with any samples; longer input is refused before any allocation.
inline constexpr std::size_t kMaxChunkBytes = 20u << 20;
/// The maximum length of a chunk's cut memory; the same limit applies in a live frame.
inline constexpr std::size_t kMaxCutMemoryBytes = 4096;
/// The maximum length of a chunk's list of paths in a body; the same limit applies in a live frame.
inline constexpr std::size_t kMaxPathsBytes = 32'768;

/// The contents of a chunk's header.
struct ChunkInfo {
  std::uint8_t version = 0;  ///< 1, 2 with a cut memory, or 3 with paths
  std::uint32_t count = 0;   ///< samples, 1 to kMaxChunkSamples
  std::uint64_t first_tick = 0, last_tick = 0;
  std::int64_t first_time_ns = 0;
  Resolution resolution;  ///< declared by the writer; see `lossless_columns`
  std::uint32_t lossless_columns =
      0;  ///< bit c: column c is stored as raw bits although a step is declared for it,
          ///< because a value was too big for the step, infinite or not a number
};

/// Encodes a chunk. Samples with any values can be decoded again. Columns within ±2³¹ steps are stored to
/// half a step (plus the rounding of a double); a column with a value beyond that, or with an unexpected
/// infinity or NaN, is stored exactly. `samples` must hold 1 to kMaxChunkSamples and `resolution` must be
/// valid (asserted; without asserts, returns empty bytes). `cut_memory`: the cuts after one of the samples
/// (encodeCuts in common/haptics), opaque here, at most kMaxCutMemoryBytes. `paths`: the paths in a body that
/// a reader of these samples needs (appendPath in common/haptics), opaque, at most kMaxPathsBytes. If both
/// are empty, the chunk has version 1; without paths, version 2. Thread: any; uses scratch memory of the
/// calling thread. Not for the haptic thread: it allocates.
Bytes encodeChunk(const Resolution& resolution, std::span<const GestureSample> samples,
                  ByteView cut_memory = {}, ByteView paths = {});

/// Decodes all samples of a chunk. Errors: kCorrupt (not a chunk, cut off, too long, CRC, impossible header),
/// kVersion.
Result<std::vector<GestureSample>> decodeChunk(ByteView chunk);

/// Returns the chunk's cut memory, for decodeCuts, which checks it. Empty if there is none or inspectChunk
/// refuses the chunk.
Bytes cutMemoryOf(ByteView chunk);
/// Returns the chunk's list of paths, for pathsIn, which checks it. Empty if there is none or inspectChunk
/// refuses the chunk.
Bytes pathListOf(ByteView chunk);

/// Checks all that decodeChunk checks, and returns the header: a chunk passes exactly when it can be decoded.
/// Keeps no samples and unpacks only columns that can hold impossible values, so its time is proportional to
/// the number of bytes (plus 4 bytes per 32 samples), not to the number of samples claimed. Errors as
/// decodeChunk.
Result<ChunkInfo> checkChunk(ByteView chunk);

/// Checks the CRC over all bytes of a chunk and returns its header; does not read the columns: for chunks
/// that were already checked. Errors: those of decodeChunk that the header reveals.
Result<ChunkInfo> inspectChunk(ByteView chunk);

/// Returns the number of samples that the header claims, so that a chunk can be refused cheaply: checks no
/// CRC and no columns. Returns nothing when the bytes do not begin like a chunk of a supported version. Safe
/// for any bytes.
std::optional<std::uint32_t> claimedSamples(ByteView chunk);

/// As claimedSamples, but also requires a correct CRC: the bytes are then as their writer made them, even if
/// checkChunk refuses them. Safe for any bytes.
std::optional<std::uint32_t> sealedSamples(ByteView chunk);

// --- the hash that proves that station, server and recording have the same gesture (proto/README.md)

using Digest = std::array<std::uint8_t, 32>;

/// BLAKE2b-256 (RFC 7693, no key) over the chunks' bytes in order. Copyable: a copy continues on its own.
class SessionHash {
 public:
  SessionHash();
  void update(ByteView chunk);
  /// Returns the hash of all bytes so far; more bytes may follow.
  [[nodiscard]] Digest digest() const;

 private:
  crypto_generichash_state state_;
};

/// 64 lower-case hexadecimal digits.
std::string hexOf(const Digest& digest);
/// Errors: kInvalidInput when `hex` is not 64 hexadecimal digits.
Result<Digest> digestFromHex(std::string_view hex);

}  // namespace needlelab
