/// What a bad network does to one connection: set for each connection and each direction.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "tests/support/random.h"

namespace needlelab::test {

/// Of one direction. Byte counts are of what came in on this side; all can be set together.
struct WayScript {
  std::chrono::milliseconds delay{0};     ///< of every byte
  std::chrono::milliseconds jitter{0};    ///< more, uniform; bytes never overtake each other
  std::uint64_t bytes_per_s = 0;          ///< bandwidth; 0: no limit
  std::size_t piece_bytes = 0;            ///< at most so many in one write (1: single bytes); 0: as they came
  std::uint64_t slow_from = 0;            ///< bandwidth and pieces count after so many bytes
  std::optional<std::uint64_t> stall_at;  ///< after so many bytes nothing passes for `stall`, once
  std::chrono::milliseconds stall{0};     ///< then it goes on
  std::optional<std::uint64_t> corrupt_at;  ///< one bit of this byte is flipped
};

/// How the proxy ends a connection by itself.
enum class Cut : std::uint8_t {
  kFin,     ///< both sides see an orderly end
  kReset,   ///< both sides see RST
  kSilent,  ///< half-open: no end is seen by anybody, all bytes are swallowed from then on
};

enum class Way : std::uint8_t { kUp, kDown };  ///< client → server, server → client

struct ConnectionScript {
  WayScript up, down;
  bool refuse = false;                  ///< accepted and reset at once
  std::optional<std::uint64_t> cut_at;  ///< after exactly so many bytes passed on `cut_way`
  Way cut_way = Way::kUp;
  Cut cut = Cut::kReset;
  /// Reordering of reconnects: after so many bytes up nothing passes in either direction. What the client
  /// sent, and its end, reach the server `late_after` the next connection of this proxy was accepted.
  std::optional<std::uint64_t> hold_at;
  std::chrono::milliseconds late_after{0};
  /// So many connections more to the server, which send what the client sent (a replay that TLS must refuse).
  unsigned duplicates = 0;

  /// For a message of a failed test.
  [[nodiscard]] std::string text() const;
};

/// A random mix of faults: delays, pieces, stalls, cuts. `span_bytes`: the faults lie within so many bytes.
ConnectionScript randomScript(Random& random, std::uint64_t span_bytes);

}  // namespace needlelab::test
