/// The sessions that each station is closing: how many.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <unordered_map>

namespace needlelab {

/// Counts the closes of a station that wait or are at work, over all its connections: one that connects again
/// and again has no more of them. Thread: one.
class StationCloses {
 public:
  using Place = std::shared_ptr<const void>;  ///< gives itself back at its end
  explicit StationCloses(std::size_t most) : most_(most) {}

  /// Null: the station has its most.
  Place take(const std::string& station) {
    const auto found = taken_->find(station);
    if ((found == taken_->end() ? 0 : found->second) >= most_) return nullptr;
    ++(*taken_)[station];
    return {taken_.get(), [all = taken_, station](const void*) {
              const auto theirs = all->find(station);
              if (--theirs->second == 0) all->erase(theirs);
            }};
  }
  [[nodiscard]] std::size_t most() const { return most_; }
  /// Stations that are closing sessions.
  [[nodiscard]] std::size_t stations() const { return taken_->size(); }

 private:
  const std::size_t most_;
  // by station, without zeros; shared with the places, which may end last
  std::shared_ptr<std::unordered_map<std::string, std::size_t>> taken_ =
      std::make_shared<std::unordered_map<std::string, std::size_t>>();
};

}  // namespace needlelab
