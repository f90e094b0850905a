/// Work that waits in fair turns, and threads that do it.
#pragma once

#include <boost/asio/thread_pool.hpp>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

namespace needlelab {

/// Work in the order in which it is to be done. Who it is for is a path of names, from the widest to the
/// narrowest (a network, an address, a name), mostly one. The names of each level take turns, a newcomer
/// last; the pieces of one path are in the order of their arrival. So who asks for one thing waits for at
/// most one piece of each other, however much they have asked for.
///
/// There may be several lines, which take turns as a cycle says; a line where nobody waits gives its turn to
/// the next of the cycle. Thread: one at a time.
class FairQueue {
 public:
  using Work = std::function<void()>;
  using Path = std::vector<std::string>;
  struct Piece {
    std::string who;  ///< the first name of its path
    Work work;        ///< empty: there is none
  };
  using Cycle = std::vector<std::size_t>;
  /// Of four turns the first of three lines has two, and each other one.
  static inline const Cycle kThreeLines = {0, 1, 0, 2};

  explicit FairQueue(Cycle cycle = {0});

  void put(const std::string& who, Work work, std::size_t line = 0) { put(Path{who}, std::move(work), line); }
  /// Returns the piece's number. Different paths of a line have the same length.
  std::uint64_t put(const Path& path, Work work, std::size_t line);
  /// Drops a piece. False: it is not here any more.
  bool remove(const Path& path, std::size_t line, std::uint64_t number);
  /// Drops a piece for a newcomer with this path: the newest of those who have the most, in a later line, or
  /// in the same where somebody has at least two more than the newcomer. False: there is none.
  bool makeRoomFor(const Path& path, std::size_t line);
  /// The next piece; an empty function: there is none.
  Work take();
  /// The next piece of somebody whom `may` accepts; the others keep their places.
  Piece takeOf(const std::function<bool(const std::string& who)>& may);

  [[nodiscard]] std::size_t size() const;
  [[nodiscard]] std::size_t waitingIn(std::size_t line) const { return lines_[line].size; }
  [[nodiscard]] std::size_t waitingOf(const std::string& who, std::size_t line = 0) const;

 private:
  struct Node {
    using Below = std::map<std::string, std::unique_ptr<Node>>;  // without empty ones
    Below below;
    std::list<std::string> turns;                      // the names of below, the next first
    std::list<std::pair<std::uint64_t, Work>> pieces;  // at the end of a path, by number
    std::size_t size = 0;                              // pieces here and below
  };
  static Work takeFrom(Node& node);
  static Work takeBelow(Node& node, std::list<std::string>::iterator turn);
  static bool removeFrom(Node& node, const Path& path, std::size_t level, std::uint64_t number);
  static bool makeRoomIn(Node& node, const Path& path, std::size_t level);
  static void dropNewestOf(Node& node);
  static Node::Below::iterator greediestOf(Node& node);
  static void dropIfEmpty(Node& node, Node::Below::iterator below);

  const Cycle cycle_;
  std::vector<Node> lines_;
  std::size_t next_ = 0;      // turn of the cycle
  std::uint64_t number_ = 0;  // of the last piece
};

/// Runs the work of a FairQueue on a pool. At most `threads` pieces are in the pool at once; the others wait
/// in the queue, so that what is posted to the pool directly waits for few. One person has at most all but
/// one of the threads, even while nobody else asks: who comes then finds one free, however long that person's
/// pieces take. Only of a single thread a person may have all. Thread: any. The pool must be joined before
/// this ends. Work must not throw.
class FairPool {
 public:
  FairPool(boost::asio::thread_pool& pool, std::size_t threads, FairQueue::Cycle cycle = {0})
      : pool_(pool),
        threads_(threads),
        most_of_one_(threads > 1 ? threads - 1 : 1),
        queue_(std::move(cycle)) {}
  FairPool(const FairPool&) = delete;
  FairPool& operator=(const FairPool&) = delete;

  void post(const std::string& who, FairQueue::Work work, std::size_t line = 0);
  /// What of theirs is not in the pool yet. It grows by post() alone.
  [[nodiscard]] std::size_t waitingOf(const std::string& who, std::size_t line = 0);

 private:
  void runNext();

  boost::asio::thread_pool& pool_;
  const std::size_t threads_, most_of_one_;
  std::mutex mutex_;
  FairQueue queue_;          // guarded by mutex_
  std::size_t running_ = 0;  // guarded by mutex_: pieces in the pool
  // guarded by mutex_: pieces at work, by person; without zeros
  std::unordered_map<std::string, std::size_t> at_work_;
};

}  // namespace needlelab
