/// A chunk that came from a station, and what became of it.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/base/uuid.h"
#include "db/station_claims.h"

namespace needlelab {

/// The outcome of SessionStore::append(). Only kStored and kRepeated may be acknowledged, and only after the
/// commit.
struct Appended {
  enum class Kind {
    kStored,
    kRepeated,        ///< the same bytes are already stored: acknowledge again
    kGap,             ///< seq is beyond `next_seq`
    kContradiction,   ///< other bytes are stored under this seq, or the session is closed and has no such
                      ///< chunk
    kCorrupt,         ///< not a chunk of our version, or its CRC is wrong: not as its station sealed it
    kUnknownSession,  ///< never opened here, or opened by another station
  };
  Kind kind = Kind::kStored;
  std::uint64_t next_seq = 0;  ///< first missing seq after this call
  std::string text;            ///< for a refusal: the problem and what to do
  bool quarantined = false;    ///< kStored, but the chunk cannot be decoded; `text` says why
  [[nodiscard]] bool taken() const { return kind == Kind::kStored || kind == Kind::kRepeated; }
};

/// What SessionStore::appendMany and DbWriter::postChunk take.
struct ArrivedChunk {
  Uuid session{};
  std::uint64_t seq = 0;
  // the three belong to whoever posts the chunk, and stay until its `done` was called
  ByteView bytes;
  std::string_view station;      ///< the session must be this one's; empty: any
  Appended* appended = nullptr;  ///< where the outcome goes
  /// Asked once the chunk is kStored, before the commit; an error takes the chunk back. May be empty. Must
  /// not throw: those that come with it would be asked again. On the thread that appends.
  std::function<Status(const Appended&)> admit{};
  /// The samples of `bytes`, where they were checked already (checkChunk), and are sound.
  std::optional<std::uint32_t> samples{};
  /// The log-in by which it came, which must be its station's newest (StationClaims::require): else kDeposed.
  /// Null: no other server works on the database. It stays as the three above.
  const StationClaim* claim = nullptr;
};

}  // namespace needlelab
