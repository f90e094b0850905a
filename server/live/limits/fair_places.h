/// Places, their owners, and which place is given up when all are taken.
#pragma once

#include <algorithm>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <unordered_map>

namespace needlelab {

/// The places of each owner in the order of their last use. Memory: in proportion to the places held. Thread:
/// one.
template <typename Owner>
class FairPlaces {
 public:
  using Id = std::uint64_t;

  void add(const Owner& owner, Id id) {
    assert(!places_.contains(id));
    places_.emplace(id, Place{owner, ++turn_});
    owners_[owner].emplace(turn_, id);
  }
  /// The owner's other places now give way before it.
  void use(Id id) {
    const auto place = places_.find(id);
    if (place == places_.end()) return;
    auto& theirs = owners_.at(place->second.owner);
    theirs.erase(place->second.used);
    place->second.used = ++turn_;
    theirs.emplace(turn_, id);
  }
  /// Ignores unknown ids.
  void remove(Id id) {
    const auto place = places_.find(id);
    if (place == places_.end()) return;
    const auto theirs = owners_.find(place->second.owner);
    assert(theirs != owners_.end() && theirs->second.contains(place->second.used));
    theirs->second.erase(place->second.used);
    if (theirs->second.empty()) owners_.erase(theirs);
    places_.erase(place);
  }
  /// Null if the id is unknown.
  [[nodiscard]] const Owner* ownerOf(Id id) const {
    const auto place = places_.find(id);
    return place == places_.end() ? nullptr : &place->second.owner;
  }
  [[nodiscard]] std::size_t size() const { return places_.size(); }
  /// Ordered by owner; each with its places by the turn of their last use.
  [[nodiscard]] const std::map<Owner, std::map<std::uint64_t, Id>>& owners() const { return owners_; }
  [[nodiscard]] std::size_t of(const Owner& owner) const {
    const auto theirs = owners_.find(owner);
    return theirs == owners_.end() ? 0 : theirs->second.size();
  }
  /// The owner's least recently used place.
  [[nodiscard]] std::optional<Id> oldestOf(const Owner& owner) const {
    const auto theirs = owners_.find(owner);
    return theirs == owners_.end() ? std::nullopt : std::optional(theirs->second.begin()->second);
  }
  /// The owner's most recently used place.
  [[nodiscard]] std::optional<Id> newestOf(const Owner& owner) const {
    const auto theirs = owners_.find(owner);
    return theirs == owners_.end() ? std::nullopt : std::optional(theirs->second.rbegin()->second);
  }
  /// The oldest place of the owner with the most places, if it has more than `most`. Only owners for which
  /// `may` is true.
  template <typename May>
  [[nodiscard]] std::optional<Id> oldestOfTheGreediest(std::size_t most, const May& may) const {
    std::optional<Id> oldest;
    for (const auto& [owner, theirs] : owners_) {
      if (theirs.size() <= most || !may(owner)) continue;
      most = theirs.size();
      oldest = theirs.begin()->second;
    }
    return oldest;
  }

 private:
  struct Place {
    Owner owner;
    std::uint64_t used = 0;  // turn of the last use
  };
  std::unordered_map<Id, Place> places_;
  std::map<Owner, std::map<std::uint64_t, Id>> owners_;  // by the turn of the last use; without empty entries
  std::uint64_t turn_ = 0;
};

}  // namespace needlelab
