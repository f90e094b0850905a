/// Limits how many hold a turn at once, in fair order: for password checks and work that needs much memory.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

#include "common/wire/asio.h"
#include "db/service/service.h"
#include "server/live/limits/limits.h"
#include "server/live/work/fair_queue.h"
#include "server/live/work/offload.h"

namespace needlelab {

/// The name used in a FairPool or a TurnQueue; differs for a station and a person of the same name.
std::string turnNameOf(const Principal& who);

/// `at_once` places hold a turn, at most one per name; the others wait in fair order without using a thread.
/// Places are limited, too. When all are taken, a newcomer takes the newest place of a name that has clearly
/// more of them, or is in a later line; without such a name the newcomer is refused. Thread: one.
class TurnQueue {
 public:
  class Place;
  struct Settings {
    std::size_t at_once = 1;
    std::size_t places = SIZE_MAX;                 ///< including those with a turn
    std::size_t places_of_later_lines = SIZE_MAX;  ///< of those, for all lines but the first
    std::size_t lines = 1;
  };
  TurnQueue(asio::any_io_executor executor, Settings settings);

  /// Waits for a turn; null: all places are taken.
  std::unique_ptr<Place> join(const std::string& who, std::size_t line = 0);
  /// For queues with unlimited places: waits until the turn comes.
  Task<std::unique_ptr<Place>> take(std::string who) { return untilTurn(join(who)); }
  /// Including those with a turn.
  [[nodiscard]] std::size_t size() const;
  [[nodiscard]] std::size_t waiting() const;

 private:
  static Task<std::unique_ptr<Place>> untilTurn(std::unique_ptr<Place> place);

  struct State;
  std::shared_ptr<State> state_;  // shared with the places, which may end last
};

/// A place in the queue. Its destruction passes the turn on, whether the work was done, given up or has
/// thrown.
class TurnQueue::Place {
 public:
  Place(const Place&) = delete;
  Place& operator=(const Place&) = delete;
  ~Place();

  [[nodiscard]] bool hasTurn() const { return has_turn_; }
  /// It was given to a newcomer; the turn will not come.
  [[nodiscard]] bool isDisplaced() const { return is_displaced_; }
  /// Waits until any turn has ended or any place was taken away.
  Task<> changed() const;

 private:
  friend class TurnQueue;
  Place(std::shared_ptr<State> state, std::string who, std::size_t line)
      : state_(std::move(state)), who_(std::move(who)), line_(line) {}
  const std::shared_ptr<State> state_;
  const std::string who_;
  const std::size_t line_;
  bool has_turn_ = false, is_displaced_ = false;
};

/// A password check takes 0.1 s of the only thread with memory for argon2, so an address that requests many
/// delays others. Log-ins wait in three lines:
/// - known people: this name has logged in from this address before;
/// - known addresses: someone has logged in from this address before;
/// - strangers.
/// Within a line addresses take turns, and log-ins of one address are in order. So an address that requests
/// many checks only delays its own.
class LoginQueue : public TurnQueue {
 public:
  enum Line : std::size_t { kKnownPerson, kKnownAddress, kStranger };
  using Settings = LoginQueueLimits;

  LoginQueue(asio::any_io_executor executor, const Settings& settings)
      : TurnQueue(std::move(executor), {1, settings.places, settings.places_of_unknown, 3}) {}
  /// `address`: a key (Admission::keyOf).
  std::unique_ptr<Place> join(Line line, const std::string& address) {
    return TurnQueue::join(ownerOf(address), line);
  }
  /// An owner with arbitrarily many addresses counts as one: for an IPv6 key, the first 48 bits.
  static std::string ownerOf(std::string_view address);
};

}  // namespace needlelab
