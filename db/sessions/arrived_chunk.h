/// A chunk received from a station, and the outcome of storing it.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/base/text/uuid.h"
#include "db/sessions/station_claims.h"

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
    kCorrupt,         ///< not a chunk of our version, or a wrong CRC: not what the station sealed
    kUnknownSession,  ///< never opened here, or opened by another station
  };
  Kind kind = Kind::kStored;
  std::uint64_t next_seq = 0;  ///< first missing seq after this call
  std::string text;            ///< for a refusal: the problem and what to do
  bool quarantined = false;    ///< kStored, but the chunk cannot be decoded; `text` says why
  [[nodiscard]] bool taken() const { return kind == Kind::kStored || kind == Kind::kRepeated; }
};

/// Input of SessionStore::appendMany and DbWriter::postChunk.
struct ArrivedChunk {
  Uuid session{};
  std::uint64_t seq = 0;
  // these three belong to the poster and must stay valid until `done` was called
  ByteView bytes;
  std::string_view station;      ///< the session must belong to it; empty: any
  Appended* appended = nullptr;  ///< receives the outcome
  /// Called once the chunk is kStored, before the commit; an error removes the chunk again. May be empty.
  /// Must not throw: that would repeat the calls for the other chunks of the batch. Thread: the appending
  /// one.
  std::function<Status(const Appended&)> admit{};
  /// Number of samples in `bytes`, if they were already checked (checkChunk) and are sound.
  std::optional<std::uint32_t> samples{};
  /// The log-in that sent it; must be its station's newest (StationClaims::require), else kDeposed. Null: no
  /// other server works on the database. Lifetime as for the three above.
  const StationClaim* claim = nullptr;
};

}  // namespace needlelab
