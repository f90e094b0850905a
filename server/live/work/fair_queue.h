/// A fair queue, and a pool that works it off.
#pragma once

#include <algorithm>
#include <boost/asio/thread_pool.hpp>
#include <cassert>
#include <cstddef>
#include <deque>
#include <functional>
#include <list>
#include <mutex>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

namespace needlelab {

/// A queue in which names take turns, newcomers last; the items of one name stay in order of arrival. So an
/// item waits for at most one item of each other name, regardless of how many they have queued.
///
/// There is one line, or there are three. Of four turns the first line gets two and the others one each; an
/// empty line passes its turn to the next. Thread: one at a time.
template <typename Item>
class FairQueue {
 public:
  explicit FairQueue(std::size_t lines = 1) : lines_(lines) {}

  void put(const std::string& who, Item item, std::size_t line = 0) {
    assert(line < lines_.size());
    auto& theirs = lines_[line].items[who];
    if (theirs.empty()) lines_[line].turns.push_back(who);
    theirs.push_back(std::move(item));
    ++lines_[line].size;
  }
  struct Taken {
    std::string who;
    Item item;
  };
  /// The next item of a name for which `may` is true; the others keep their places.
  template <typename May>
  std::optional<Taken> take(const May& may) {
    constexpr std::size_t kCycle[] = {0, 1, 0, 2};
    for (std::size_t tried = 0; tried < std::size(kCycle); ++tried) {
      Line& line = lines_[kCycle[next_] % lines_.size()];
      next_ = (next_ + 1) % std::size(kCycle);
      const auto turn = std::find_if(line.turns.begin(), line.turns.end(), may);
      if (turn == line.turns.end()) continue;
      line.turns.splice(line.turns.end(), line.turns, turn);
      const auto theirs = line.items.find(line.turns.back());
      assert(theirs != line.items.end() && !theirs->second.empty());
      Taken taken{theirs->first, std::move(theirs->second.front())};
      theirs->second.pop_front();
      line.removedFrom(theirs);
      return taken;
    }
    return std::nullopt;
  }
  /// Removes a waiting item.
  void remove(const std::string& who, std::size_t line, const Item& item) {
    const auto theirs = lines_[line].items.find(who);
    assert(theirs != lines_[line].items.end());
    std::erase(theirs->second, item);
    lines_[line].removedFrom(theirs);
  }
  /// Removes an item to make room for a newcomer of this name: the newest item of the name with the most
  /// items in the last non-empty line, if that is a later one; otherwise in the same line, if that name has
  /// at least two more. Nothing: no such item.
  std::optional<Item> makeRoomFor(const std::string& who, std::size_t line) {
    std::size_t last = lines_.size() - 1;
    while (last > line && lines_[last].size == 0) --last;
    auto& items = lines_[last].items;
    const auto most = std::max_element(items.begin(), items.end(), [](const auto& a, const auto& b) {
      return a.second.size() < b.second.size();
    });
    if (most == items.end() || (last == line && most->second.size() <= waitingOf(who, line) + 1))
      return std::nullopt;
    Item item = std::move(most->second.back());
    most->second.pop_back();
    lines_[last].removedFrom(most);
    return item;
  }

  [[nodiscard]] std::size_t size() const {
    std::size_t size = 0;
    for (const Line& line : lines_) size += line.size;
    return size;
  }
  [[nodiscard]] std::size_t waitingIn(std::size_t line) const { return lines_[line].size; }
  [[nodiscard]] std::size_t waitingOf(const std::string& who, std::size_t line = 0) const {
    const auto theirs = lines_[line].items.find(who);
    return theirs == lines_[line].items.end() ? 0 : theirs->second.size();
  }

 private:
  struct Line {
    using Items = std::unordered_map<std::string, std::deque<Item>>;
    Items items;                   // empty entries are removed
    std::list<std::string> turns;  // the names in `items`, next one first
    std::size_t size = 0;

    void removedFrom(typename Items::iterator theirs) {
      assert(size > 0);
      --size;
      if (!theirs->second.empty()) return;
      std::erase(turns, theirs->first);
      items.erase(theirs);
    }
  };

  std::vector<Line> lines_;
  std::size_t next_ = 0;  // position in the cycle
};

/// Runs work on a pool in fair turns. At most `threads` pieces are in the pool at once; the others wait in
/// the queue, so that work posted directly to the pool waits only briefly. One person uses at most all
/// threads but one, even when idle, so a newcomer finds one free however long that person's pieces take. With
/// a single thread, one person may use it. Thread: any. The pool must be joined before this ends. Work must
/// not throw.
class FairPool {
 public:
  using Work = std::function<void()>;
  FairPool(boost::asio::thread_pool& pool, std::size_t threads, std::size_t lines = 1)
      : pool_(pool), threads_(threads), max_of_one_(threads > 1 ? threads - 1 : 1), queue_(lines) {}
  FairPool(const FairPool&) = delete;
  FairPool& operator=(const FairPool&) = delete;

  void post(const std::string& who, Work work, std::size_t line = 0);
  /// Number of their pieces that are not in the pool yet. Grows only by post().
  [[nodiscard]] std::size_t waitingOf(const std::string& who, std::size_t line = 0);

 private:
  void runNext();

  boost::asio::thread_pool& pool_;
  const std::size_t threads_, max_of_one_;
  std::mutex mutex_;
  FairQueue<Work> queue_;    // guarded by mutex_
  std::size_t running_ = 0;  // guarded by mutex_: pieces in the pool
  // guarded by mutex_: pieces running, by person; zeros are removed
  std::unordered_map<std::string, std::size_t> at_work_;
};

}  // namespace needlelab
