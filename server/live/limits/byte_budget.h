/// Limits shared bytes or objects: messages that are parsed but not done, replies that are not read yet,
/// chunks that wait for their commit, closes of sessions.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>

#include "server/live/limits/limits.h"

namespace needlelab {

/// The owner of bytes; each name has its own budget.
struct BudgetOwner {
  std::string name;    ///< of the person or station, over all connections
  bool person = true;  ///< false: a station
};

/// Bytes in use per person or station, by all people, and by the server. What people leave free is available
/// to stations, which all open their sessions at once after an outage. A connection that finds no room waits
/// and is not read meanwhile. Thread: one.
class ByteBudget {
 public:
  using Limits = BudgetLimits;
  class Share;

  /// `freed` is called whenever bytes are released; it must outlive the last share.
  explicit ByteBudget(const Limits& limits, std::function<void()> freed = {})
      : state_(std::make_shared<State>(State{limits, std::move(freed)})) {}

  /// Takes `bytes` until the share ends. Nothing: a budget has too little room at the moment.
  std::optional<Share> take(const BudgetOwner& owner, std::size_t bytes);
  /// For what is already in memory: takes `bytes` even beyond the limit, until giveBack().
  void add(const BudgetOwner& owner, std::size_t bytes) { state_->add(owner, bytes); }
  void giveBack(const BudgetOwner& owner, std::size_t bytes) { state_->giveBack(owner, bytes); }
  /// True from reaching the server's limit until usage falls to half of it, so that waiting connections are
  /// woken once, not for each piece.
  [[nodiscard]] bool full() const { return state_->full; }
  /// By a person or station over all connections.
  [[nodiscard]] std::size_t takenBy(const std::string& name) const;
  /// Maximum bytes of one share; a larger one never fits.
  [[nodiscard]] std::size_t mostBytes(const BudgetOwner& owner) const;
  /// By all.
  [[nodiscard]] std::size_t taken() const { return state_->server; }
  /// The peak of taken() so far.
  [[nodiscard]] std::size_t mostTaken() const { return state_->most; }

 private:
  struct State {
    Limits limits;
    std::function<void()> freed;
    std::unordered_map<std::string, std::size_t> by_owner = {};  // zeros are removed
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

  /// Resizes the share to `bytes`: releases the difference or takes more, even beyond the limit, because the
  /// bytes are already in memory and others can wait.
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
