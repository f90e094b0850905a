/// Bounds bytes or things that many share: of messages that are parsed and not yet done, of replies that are
/// not read yet, chunks that wait for their commit, closes of sessions.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>

#include "server/live/limits.h"

namespace needlelab {

/// Whose bytes they are: each name has a budget of its own.
struct BudgetOwner {
  std::string name;    ///< of the person or station, on all its connections
  bool person = true;  ///< not a station
};

/// Bytes in use: of a person or station, of all people, of the server. What people leave free is the
/// stations', which open their sessions all at once after an outage. Who finds no room waits, and is not read
/// from meanwhile. Thread: one.
class ByteBudget {
 public:
  using Limits = BudgetLimits;
  class Share;

  /// `freed` is called whenever bytes were given back; it must outlive the last share.
  explicit ByteBudget(const Limits& limits, std::function<void()> freed = {})
      : state_(std::make_shared<State>(State{limits, std::move(freed)})) {}

  /// Takes `bytes` until the share's end. Nothing: at the moment a budget has less room.
  std::optional<Share> take(const BudgetOwner& owner, std::size_t bytes);
  /// For what is in memory already: takes `bytes`, also more than there is room for, until giveBack().
  void add(const BudgetOwner& owner, std::size_t bytes) { state_->add(owner, bytes); }
  void giveBack(const BudgetOwner& owner, std::size_t bytes) { state_->giveBack(owner, bytes); }
  /// From the moment when the server's limit is reached until half of it is left: who waits is woken once,
  /// and not for each piece.
  [[nodiscard]] bool full() const { return state_->full; }
  /// Of a person or station, on all its connections.
  [[nodiscard]] std::size_t takenBy(const std::string& name) const;
  /// What one share may have: more bytes fit never, however long one waits.
  [[nodiscard]] std::size_t mostBytes(const BudgetOwner& owner) const;
  /// Of all.
  [[nodiscard]] std::size_t taken() const { return state_->server; }
  /// The most that was taken at once so far.
  [[nodiscard]] std::size_t mostTaken() const { return state_->most; }

 private:
  struct State {
    Limits limits;
    std::function<void()> freed;
    std::unordered_map<std::string, std::size_t> by_owner = {};  // without zeros
    std::size_t people = 0, server = 0, most = 0;
    bool full = false;

    void add(const BudgetOwner& owner, std::size_t bytes);
    void giveBack(const BudgetOwner& owner, std::size_t bytes);
  };
  std::shared_ptr<State> state_;  // shared with the shares, which may end last
};

/// Gives its bytes back when it ends.
class ByteBudget::Share {
 public:
  Share(Share&& other) noexcept = default;
  Share& operator=(Share&& other) noexcept;
  Share(const Share&) = delete;
  Share& operator=(const Share&) = delete;
  ~Share();

  /// Has `bytes` from now on: gives the others back, or takes more, also than the budget has room for: they
  /// are in memory already, and others wait the longer.
  void become(std::size_t bytes);

 private:
  friend class ByteBudget;
  Share(std::shared_ptr<State> state, BudgetOwner owner, std::size_t bytes)
      : state_(std::move(state)), owner_(std::move(owner)), bytes_(bytes) {}
  std::shared_ptr<State> state_;  // null: moved from
  BudgetOwner owner_;
  std::size_t bytes_;
};

}  // namespace needlelab
