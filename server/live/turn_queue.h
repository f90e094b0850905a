/// Turns that are given to few at once, in fair order: checks of passwords, work that holds much memory.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

#include "common/wire/asio.h"
#include "server/live/fair_queue.h"
#include "server/live/limits.h"
#include "server/live/offload.h"

namespace needlelab {

/// So many have a turn at once, one of each name at most; the others wait as in a FairQueue, without a
/// thread. The places are bounded, too: when all are taken, a newcomer gets the place of the newest of those
/// who have clearly more of them (or of a later line); if nobody has, the newcomer is refused. Thread: one.
class TurnQueue {
 public:
  class Place;
  struct Settings {
    std::size_t at_once = 1;
    std::size_t places = SIZE_MAX;                 ///< with those that have a turn
    std::size_t places_of_later_lines = SIZE_MAX;  ///< of those: for the lines other than the first
    std::size_t lines = 1;
  };
  TurnQueue(asio::any_io_executor executor, Settings settings);

  /// Waits for a turn; null: all places are taken.
  std::unique_ptr<Place> join(const std::string& who, std::size_t line = 0);
  /// The same where the places have no bound, until the turn comes.
  Task<std::unique_ptr<Place>> take(std::string who) { return untilTurn(join(who)); }
  /// With those that have a turn.
  [[nodiscard]] std::size_t size() const;
  [[nodiscard]] std::size_t waiting() const;

 private:
  static Task<std::unique_ptr<Place>> untilTurn(std::unique_ptr<Place> place);

  struct State;
  std::shared_ptr<State> state_;  // shared with the places, which may end last
};

/// A place in the queue. Its end gives the turn to the next, whether the work has been done, was given up or
/// has thrown.
class TurnQueue::Place {
 public:
  Place(const Place&) = delete;
  Place& operator=(const Place&) = delete;
  ~Place();

  [[nodiscard]] bool hasTurn() const { return has_turn_; }
  /// It was taken away for a newcomer: the turn will not come.
  [[nodiscard]] bool gaveWay() const { return gave_way_; }
  /// Waits until a turn has ended or a place was taken away, perhaps others'.
  Task<> changed() const;

 private:
  friend class TurnQueue;
  Place(std::shared_ptr<State> state, std::string who, std::size_t line)
      : state_(std::move(state)), who_(std::move(who)), line_(line) {}
  const std::shared_ptr<State> state_;
  const std::string who_;
  const std::size_t line_;
  bool has_turn_ = false, gave_way_ = false;
};

/// A check of a password takes 0.1 s of the one thread that has argon2's memory, so who asks for many makes
/// others wait. Log-ins wait in three lines:
/// - known people: this name has logged in from this address before;
/// - known addresses: somebody has;
/// - strangers.
/// Within a line the addresses take turns, at an address the log-ins are in order: an address that asks for
/// many checks waits behind its own.
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
  /// Who has as many addresses as one likes counts as one: of an IPv6 key the first 48 bits.
  static std::string ownerOf(std::string_view address);
};

}  // namespace needlelab
