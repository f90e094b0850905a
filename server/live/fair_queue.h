/// What waits in fair turns, and threads that do it.
#pragma once

#include <algorithm>
#include <boost/asio/thread_pool.hpp>
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

/// Items in the order in which they are to be taken. The names of a line take turns, a newcomer last; the
/// items of a name are in the order of their arrival. So who asks for one thing waits for at most one of each
/// other name, however much they have asked for.
///
/// There is one line, or there are three: of four turns the first has two and each other one; a line where
/// nobody waits gives its turn to the next. Thread: one at a time.
template <typename Item>
class FairQueue {
 public:
  explicit FairQueue(std::size_t lines = 1) : lines_(lines) {}

  void put(const std::string& who, Item item, std::size_t line = 0) {
    auto& theirs = lines_[line].items[who];
    if (theirs.empty()) lines_[line].turns.push_back(who);
    theirs.push_back(std::move(item));
    ++lines_[line].size;
  }
  struct Taken {
    std::string who;
    Item item;
  };
  /// The next item of a name that `may`; the others keep their places.
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
      Taken taken{theirs->first, std::move(theirs->second.front())};
      theirs->second.pop_front();
      line.removedFrom(theirs);
      return taken;
    }
    return std::nullopt;
  }
  /// Drops an item that waits.
  void remove(const std::string& who, std::size_t line, const Item& item) {
    const auto theirs = lines_[line].items.find(who);
    std::erase(theirs->second, item);
    lines_[line].removedFrom(theirs);
  }
  /// Drops an item for a newcomer with this name: the newest of the name with the most in the last line, if
  /// that is a later one; else in the same, if that name has at least two more. Nothing: there is none.
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
    Items items;                   // without empty ones
    std::list<std::string> turns;  // the names of items, the next first
    std::size_t size = 0;

    void removedFrom(typename Items::iterator theirs) {
      --size;
      if (!theirs->second.empty()) return;
      std::erase(turns, theirs->first);
      items.erase(theirs);
    }
  };

  std::vector<Line> lines_;
  std::size_t next_ = 0;  // turn of the cycle
};

/// Does work on a pool in fair turns. At most `threads` pieces are in the pool at once; the others wait
/// in the queue, so that what is posted to the pool directly waits for few. One person has at most all but
/// one of the threads, even while nobody else asks: who comes then finds one free, however long that person's
/// pieces take. Only of a single thread a person may have all. Thread: any. The pool must be joined before
/// this ends. Work must not throw.
class FairPool {
 public:
  using Work = std::function<void()>;
  FairPool(boost::asio::thread_pool& pool, std::size_t threads, std::size_t lines = 1)
      : pool_(pool), threads_(threads), most_of_one_(threads > 1 ? threads - 1 : 1), queue_(lines) {}
  FairPool(const FairPool&) = delete;
  FairPool& operator=(const FairPool&) = delete;

  void post(const std::string& who, Work work, std::size_t line = 0);
  /// What of theirs is not in the pool yet. It grows by post() alone.
  [[nodiscard]] std::size_t waitingOf(const std::string& who, std::size_t line = 0);

 private:
  void runNext();

  boost::asio::thread_pool& pool_;
  const std::size_t threads_, most_of_one_;
  std::mutex mutex_;
  FairQueue<Work> queue_;    // guarded by mutex_
  std::size_t running_ = 0;  // guarded by mutex_: pieces in the pool
  // guarded by mutex_: pieces at work, by person; without zeros
  std::unordered_map<std::string, std::size_t> at_work_;
};

}  // namespace needlelab
