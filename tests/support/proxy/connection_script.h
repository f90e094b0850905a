/// The faults of one connection through the bad network, per direction.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "tests/support/random.h"

namespace needlelab::test {

/// Faults of one direction. Byte counts are of received bytes; all faults can be combined.
struct WayScript {
  std::chrono::milliseconds delay{0};   ///< of every byte
  std::chrono::milliseconds jitter{0};  ///< added, uniform; bytes never overtake each other
  std::uint64_t bytes_per_s = 0;        ///< bandwidth; 0: no limit
  std::size_t piece_bytes = 0;          ///< at most this many in one write (1: single bytes); 0: as they came
  std::uint64_t slow_from = 0;          ///< bandwidth and pieces apply after this many bytes
  std::optional<std::uint64_t> stall_at;    ///< after this many bytes nothing passes for `stall`, once
  std::chrono::milliseconds stall{0};       ///< then it continues
  std::optional<std::uint64_t> corrupt_at;  ///< one bit of this byte is flipped
};

/// How the proxy ends a connection by itself.
enum class Cut : std::uint8_t {
  kFin,     ///< both sides see an orderly end
  kReset,   ///< both sides see RST
  kSilent,  ///< half-open: neither side sees an end, and the proxy discards all further bytes
};

enum class Way : std::uint8_t { kUp, kDown };  ///< client → server, server → client

struct ConnectionScript {
  WayScript up, down;
  bool refuse = false;                  ///< accepted and reset at once
  std::optional<std::uint64_t> cut_at;  ///< after exactly this many bytes passed on `cut_way`
  Way cut_way = Way::kUp;
  Cut cut = Cut::kReset;
  /// Reordering of reconnects: after this many bytes up nothing passes in either direction. The client's
  /// bytes and its end reach the server `late_after` after this proxy accepted the next connection.
  std::optional<std::uint64_t> hold_at;
  std::chrono::milliseconds late_after{0};
  /// Number of extra connections to the server that repeat the client's bytes (a replay that TLS must
  /// refuse).
  unsigned duplicates = 0;

  /// For a message of a failed test.
  [[nodiscard]] std::string text() const;
};

/// A random mix of faults: delays, pieces, stalls, cuts. `span_bytes`: the faults fall within this many
/// bytes.
ConnectionScript randomScript(Random& random, std::uint64_t span_bytes);

}  // namespace needlelab::test
