/// Places for work that holds much memory between its steps: how many are under way at once, and who is next.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <unordered_set>
#include <utility>

#include "common/wire/asio.h"
#include "server/live/fair_pool.h"
#include "server/live/offload.h"

namespace needlelab {

/// Each name has one place at most. Who finds none waits without a thread, each name in turn. Thread: one.
class PlacesInTurn {
 public:
  using Place = std::shared_ptr<const void>;  ///< gives itself back at its end
  PlacesInTurn(asio::any_io_executor executor, std::size_t places)
      : state_(std::make_shared<State>(std::move(executor), places)) {}

  /// Waits for a place.
  Task<Place> take(std::string who) { return takeOf(state_, std::move(who)); }
  /// Who waits.
  [[nodiscard]] std::size_t waiting() const { return state_->waiting.size(); }

 private:
  struct State : std::enable_shared_from_this<State> {
    State(asio::any_io_executor its_executor, std::size_t places)
        : executor(std::move(its_executor)), free(places) {}

    /// Gives free places to those who are next.
    void give() {
      while (free > 0) {
        const FairQueue::Piece next =
            waiting.takeOf([this](const std::string& who) { return !with_place.contains(who); });
        if (!next.work) return;
        --free;
        with_place.insert(next.who);
        next.work();
      }
    }
    Place place(std::string who) {
      return Place(this,
                   [state = shared_from_this(), who = std::move(who)](const void*) { state->giveBack(who); });
    }
    void giveBack(const std::string& who) {
      ++free;
      with_place.erase(who);
      give();
    }

    const asio::any_io_executor executor;
    std::size_t free;
    std::unordered_set<std::string> with_place;
    FairQueue waiting;
  };

  static Task<Place> takeOf(std::shared_ptr<State> state, std::string who) {
    struct Waiting {
      explicit Waiting(const asio::any_io_executor& executor) : given(executor) {}
      Signal given;
      Place place;
    };
    const auto mine = std::make_shared<Waiting>(state->executor);
    // it has the piece: a pointer that counts would keep both for good
    state->waiting.put(who, [mine, its_state = state.get(), who] {
      mine->place = its_state->place(who);
      mine->given.notify();
    });
    state->give();
    while (!mine->place) co_await mine->given.wait();
    co_return std::exchange(mine->place, nullptr);
  }

  std::shared_ptr<State> state_;  // shared with the places, which may end last
};

}  // namespace needlelab
