/// Turns that are given to few at once, in fair order: checks of passwords, work that holds much memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "common/wire/asio.h"
#include "server/live/fair_queue.h"
#include "server/live/limits.h"
#include "server/live/offload.h"

namespace needlelab {

/// So many have a turn at once, one of each name at most (the first of its path); the others wait as in a
/// FairQueue. The places are bounded, too: when all are taken, a newcomer gets the place of the newest of
/// those who have clearly more of them (or of a later line); if nobody has, the newcomer is refused. Thread:
/// one.
class TurnQueue {
 public:
  class Place;
  struct Settings {
    std::size_t at_once = 1;
    std::size_t places = SIZE_MAX;                 ///< with those that have a turn
    std::size_t places_of_later_lines = SIZE_MAX;  ///< of those: for the lines other than the first
    FairQueue::Cycle cycle = {0};
  };
  /// `changed` is called when a turn has ended or a place was taken away; it must outlive the last place.
  TurnQueue(Settings settings, std::function<void()> changed);

  /// Waits for a turn; nothing: all places are taken.
  std::optional<Place> join(FairQueue::Path path, std::size_t line = 0);
  /// With those that have a turn.
  [[nodiscard]] std::size_t size() const;
  [[nodiscard]] std::size_t waiting() const;

 private:
  struct Member;  // one that waits or has a turn
  struct State;
  std::shared_ptr<State> state_;  // shared with the places, which may end last
};

/// A place in the queue. Its end gives the turn to the next, whether the work has been done, was given up or
/// has thrown.
class TurnQueue::Place {
 public:
  Place(Place&& other) noexcept = default;
  Place& operator=(Place&&) = delete;
  Place(const Place&) = delete;
  Place& operator=(const Place&) = delete;
  ~Place();

  [[nodiscard]] bool hasTurn() const;
  /// It was taken away for a newcomer: the turn will not come.
  [[nodiscard]] bool gaveWay() const { return member_.expired(); }

 private:
  friend class TurnQueue;
  Place(std::shared_ptr<State> state, std::weak_ptr<const Member> member)
      : state_(std::move(state)), member_(std::move(member)) {}
  std::shared_ptr<State> state_;
  std::weak_ptr<const Member> member_;  // empty: it gave way, or was moved from
};

/// A check of a password takes 0.1 s of the one thread that has argon2's memory, so whoever asks for many
/// makes others wait. Log-ins wait in three lines:
/// - known people: this name has logged in from this address before;
/// - known addresses: somebody has;
/// - strangers.
/// Of four turns the first line has two and each other line one (FairQueue::kThreeLines). Within a line the
/// networks take turns (an IPv4 /24, an IPv6 /48), in a network the addresses, at an address the names, at a
/// name the log-ins in order: an address that asks for many checks waits behind its own.
class LoginQueue : public TurnQueue {
 public:
  enum Line : std::size_t { kKnownPerson, kKnownAddress, kStranger };
  using Settings = LoginQueueLimits;

  explicit LoginQueue(const Settings& settings, std::function<void()> changed = {})
      : TurnQueue({1, settings.places, settings.places_of_unknown, FairQueue::kThreeLines},
                  std::move(changed)) {}
  /// `address`: a key (Admission::keyOf).
  std::optional<Place> join(Line line, const std::string& address, const std::string& name) {
    return TurnQueue::join({networkOf(address), address, name}, line);
  }
  /// "10.1.2.3" → "10.1.2"; the first 48 bits of an IPv6 key; any other text is its own network.
  static std::string networkOf(std::string_view address);
};

/// Places for work that holds much memory between its steps. Who finds none waits without a thread.
class PlacesInTurn : public TurnQueue {
 public:
  using Place = std::shared_ptr<const void>;  ///< gives itself back at its end
  PlacesInTurn(asio::any_io_executor executor, std::size_t places)
      : PlacesInTurn(std::make_shared<Signal>(std::move(executor)), places) {}

  /// Waits for a place.
  Task<Place> take(std::string who) { return takeOf(*this, given_, std::move(who)); }

 private:
  PlacesInTurn(const std::shared_ptr<Signal>& given, std::size_t places)
      : TurnQueue({.at_once = places}, [given] { given->notify(); }), given_(given) {}
  static Task<Place> takeOf(TurnQueue queue, std::shared_ptr<Signal> given, std::string who);

  std::shared_ptr<Signal> given_;
};

}  // namespace needlelab
