/// Carries live data between the servers of one lab: core NATS (server/nats), or a test. Messages may be
/// lost, repeated or reordered.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace needlelab {

/// The subject of a message (proto/needlelab/faculty.proto). Its name is that of a station; for kPresence, of
/// the sender; for kAnswer, of the server that asked.
enum class LivePlane : std::uint8_t { kPresence, kWatch, kLive, kAsk, kAnswer };
inline constexpr std::size_t kLivePlanes = 5;

/// Sends this server's messages to the others and receives all planes; of kLive only the stations of
/// listenTo(), of kAnswer only those for this server. Does not receive its own messages, and nothing within
/// publish(). Thread: the network's.
class LiveCarrier {
 public:
  /// Longer messages are neither sent nor received.
  static constexpr std::size_t kMostBytes = 128u << 10;

  struct Counters {
    bool connected = false;
    std::uint64_t connections = 0;  ///< made since the start
    std::uint64_t messages_in = 0, messages_out = 0;
    std::uint64_t bytes_in = 0, bytes_out = 0;
    std::uint64_t dropped_in = 0, dropped_out = 0;  ///< the queue was full or the link down
    std::uint64_t malformed = 0;                    ///< too long, or with an invalid subject
    std::uint64_t refused = 0;                      ///< not permitted by the carrier
  };

  /// Receives messages and the state of the link. Thread: the network's.
  class Listener {
   public:
    virtual ~Listener() = default;
    virtual void onMessage(LivePlane plane, const std::string& name, std::string_view message) = 0;
    /// The link to the others was established or lost. `why`: the reason for a loss, for people.
    virtual void onLink(bool up, const std::string& why) = 0;
  };

  virtual ~LiveCarrier() = default;
  /// Never blocks. What cannot be sent is counted and dropped.
  virtual void publish(LivePlane plane, const std::string& name, std::string message) = 0;
  virtual void listenTo(const std::string& station, bool wanted) = 0;
  [[nodiscard]] virtual Counters counters() const = 0;
};

}  // namespace needlelab
