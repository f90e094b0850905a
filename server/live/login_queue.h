/// The order in which log-ins with a password are checked: one at a time, in fair turns.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

namespace needlelab {

/// A check takes 0.1 s of the one thread that has argon2's memory, so whoever asks for many makes others
/// wait. Log-ins wait in three lines:
/// - known people: this name has logged in from this address before;
/// - known addresses: somebody has;
/// - strangers.
/// Of four turns the first line has two and each other line one; a line where nobody waits gives its turns
/// to the next. Within a line the networks take turns (an IPv4 /24, an IPv6 /48), in a network the addresses,
/// at an address the names, at a name the log-ins in order: an address that asks for many checks waits behind
/// its own. The places are bounded, too: when all are taken, a newcomer gets the place of the newest log-in
/// of whoever has clearly more of them (or of a worse line); if nobody has, the newcomer is refused. Thread:
/// one.
class LoginQueue {
 public:
  enum class Line : std::uint8_t { kKnownPerson, kKnownAddress, kStranger };
  static constexpr std::size_t kLines = 3;
  struct Settings {
    std::size_t places = 64;
    std::size_t places_of_unknown = 48;  ///< of those: for the lines other than known people
  };
  class Place;

  /// `changed` is called when a turn has ended or a place was taken away; it must outlive the last place.
  explicit LoginQueue(Settings settings, std::function<void()> changed = {});

  /// Waits for a turn; nothing: all places are taken. `address`: a key (Admission::keyOf).
  std::optional<Place> join(Line line, const std::string& address, const std::string& name);
  /// With the one whose turn it is.
  [[nodiscard]] std::size_t size() const;

  /// "10.1.2.3" → "10.1.2"; the first 48 bits of an IPv6 key; any other text is its own network.
  static std::string networkOf(std::string_view address);

 private:
  struct State;
  std::shared_ptr<State> state_;  // shared with the places, which may end last
};

/// A place in the queue. Its end gives the turn to the next, whether the check has been made, was given up or
/// has thrown.
class LoginQueue::Place {
 public:
  Place(Place&& other) noexcept;
  Place& operator=(Place&&) = delete;
  Place(const Place&) = delete;
  Place& operator=(const Place&) = delete;
  ~Place();

  [[nodiscard]] bool hasTurn() const;
  /// It was taken away for a newcomer: the turn will not come.
  [[nodiscard]] bool gaveWay() const;

 private:
  friend class LoginQueue;
  Place(std::shared_ptr<State> state, std::uint64_t id);
  std::shared_ptr<State> state_;  // null: moved from
  std::uint64_t id_;
};

}  // namespace needlelab
