/// What carries live data between the servers of one lab: core NATS (server/nats), or a test. At most once,
/// perhaps twice, in any order.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace needlelab {

/// What a message is about (proto/needlelab/faculty.proto). Its name is a station's, or of kPresence the
/// sender's, of kAnswer that of the server which had asked.
enum class LivePlane : std::uint8_t { kPresence, kWatch, kLive, kAsk, kAnswer };
inline constexpr std::size_t kLivePlanes = 5;

/// Carries what this server says to the others, and hears all planes; of kLive the stations of listenTo(), of
/// kAnswer those for this server. Hears nothing of its own, and nothing within publish(). Thread: the
/// network's.
class LiveCarrier {
 public:
  /// Longer messages are neither sent nor heard.
  static constexpr std::size_t kMostBytes = 128u << 10;

  struct Counters {
    bool connected = false;
    std::uint64_t connections = 0;  ///< made since the start
    std::uint64_t messages_in = 0, messages_out = 0;
    std::uint64_t bytes_in = 0, bytes_out = 0;
    std::uint64_t dropped_in = 0, dropped_out = 0;  ///< the queue was full, or nobody was connected
    std::uint64_t malformed = 0;                    ///< too long, or to a subject that is none
    std::uint64_t refused = 0;                      ///< the carrier does not permit it
  };

  /// Hears of the carrier. Thread: the network's.
  class Listener {
   public:
    virtual ~Listener() = default;
    virtual void onMessage(LivePlane plane, const std::string& name, std::string_view message) = 0;
    /// The link to the others began, or ended. `why`: for people, of one that ended.
    virtual void onLink(bool up, const std::string& why) = 0;
  };

  virtual ~LiveCarrier() = default;
  /// Never blocks. What cannot be sent is counted and forgotten.
  virtual void publish(LivePlane plane, const std::string& name, std::string message) = 0;
  virtual void listenTo(const std::string& station, bool wanted) = 0;
  [[nodiscard]] virtual Counters counters() const = 0;
};

}  // namespace needlelab
