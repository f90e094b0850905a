#include "server/live/fair_queue.h"

#include <algorithm>
#include <boost/asio/post.hpp>
#include <utility>

namespace needlelab {

FairQueue::FairQueue(Cycle cycle)
    : cycle_(std::move(cycle)), lines_(*std::max_element(cycle_.begin(), cycle_.end()) + 1) {}

std::uint64_t FairQueue::put(const Path& path, Work work, std::size_t line) {
  Node* node = &lines_[line];
  for (const std::string& name : path) {
    ++node->size;
    std::unique_ptr<Node>& below = node->below[name];
    if (!below) {
      below = std::make_unique<Node>();
      node->turns.push_back(name);
    }
    node = below.get();
  }
  ++node->size;
  node->pieces.emplace_back(++number_, std::move(work));
  return number_;
}

FairQueue::Work FairQueue::takeFrom(Node& node) {
  if (!node.turns.empty()) return takeBelow(node, node.turns.begin());
  --node.size;
  Work work = std::move(node.pieces.front().second);
  node.pieces.pop_front();
  return work;
}

FairQueue::Work FairQueue::takeBelow(Node& node, std::list<std::string>::iterator turn) {
  --node.size;
  std::string name = std::move(*turn);
  node.turns.erase(turn);
  const auto below = node.below.find(name);
  Work work = takeFrom(*below->second);
  if (below->second->size == 0)
    node.below.erase(below);
  else
    node.turns.push_back(std::move(name));
  return work;
}

FairQueue::Work FairQueue::take() {
  return takeOf([](const std::string&) { return true; }).work;
}

FairQueue::Piece FairQueue::takeOf(const std::function<bool(const std::string& who)>& may) {
  for (std::size_t tried = 0; tried < cycle_.size(); ++tried) {
    Node& line = lines_[cycle_[next_]];
    next_ = (next_ + 1) % cycle_.size();
    const auto turn = std::find_if(line.turns.begin(), line.turns.end(), may);
    if (turn == line.turns.end()) continue;
    Piece piece{*turn, {}};
    piece.work = takeBelow(line, turn);
    return piece;
  }
  return {};
}

bool FairQueue::remove(const Path& path, std::size_t line, std::uint64_t number) {
  return removeFrom(lines_[line], path, 0, number);
}

bool FairQueue::removeFrom(Node& node, const Path& path, std::size_t level, std::uint64_t number) {
  bool removed = false;
  if (level == path.size()) {
    removed = std::erase_if(node.pieces, [number](const auto& piece) { return piece.first == number; }) > 0;
  } else if (const auto below = node.below.find(path[level]); below != node.below.end()) {
    removed = removeFrom(*below->second, path, level + 1, number);
    dropIfEmpty(node, below);
  }
  if (removed) --node.size;
  return removed;
}

bool FairQueue::makeRoomFor(const Path& path, std::size_t line) {
  for (std::size_t later = lines_.size() - 1; later > line; --later) {
    if (lines_[later].size == 0) continue;
    dropNewestOf(lines_[later]);
    return true;
  }
  return makeRoomIn(lines_[line], path, 0);
}

bool FairQueue::makeRoomIn(Node& node, const Path& path, std::size_t level) {
  if (node.below.empty()) return false;
  const auto mine = node.below.find(path[level]), most = greediestOf(node);
  const bool is_here = mine != node.below.end();
  if ((is_here ? mine->second->size : 0) + 1 < most->second->size)
    dropNewestOf(*most->second);
  else if (!is_here || !makeRoomIn(*mine->second, path, level + 1))
    return false;
  --node.size;
  return true;
}

void FairQueue::dropNewestOf(Node& node) {
  --node.size;
  if (node.below.empty()) {
    node.pieces.pop_back();
    return;
  }
  const auto most = greediestOf(node);
  dropNewestOf(*most->second);
  dropIfEmpty(node, most);
}

FairQueue::Node::Below::iterator FairQueue::greediestOf(Node& node) {
  return std::max_element(node.below.begin(), node.below.end(),
                          [](const auto& a, const auto& b) { return a.second->size < b.second->size; });
}

void FairQueue::dropIfEmpty(Node& node, Node::Below::iterator below) {
  if (below->second->size > 0) return;
  std::erase(node.turns, below->first);
  node.below.erase(below);
}

std::size_t FairQueue::size() const {
  std::size_t size = 0;
  for (const Node& line : lines_) size += line.size;
  return size;
}

std::size_t FairQueue::waitingOf(const std::string& who, std::size_t line) const {
  const auto theirs = lines_[line].below.find(who);
  return theirs == lines_[line].below.end() ? 0 : theirs->second->size;
}

void FairPool::post(const std::string& who, FairQueue::Work work, std::size_t line) {
  const std::lock_guard lock(mutex_);
  queue_.put(who, std::move(work), line);
  if (running_ == threads_) return;
  ++running_;
  boost::asio::post(pool_, [this] { runNext(); });
}

std::size_t FairPool::waitingOf(const std::string& who, std::size_t line) {
  const std::lock_guard lock(mutex_);
  return queue_.waitingOf(who, line);
}

void FairPool::runNext() {
  FairQueue::Piece piece;
  {
    const std::lock_guard lock(mutex_);
    // few are refused: each of them has threads at work
    piece = queue_.takeOf([this](const std::string& who) {
      const auto theirs = at_work_.find(who);
      return theirs == at_work_.end() || theirs->second < most_of_one_;
    });
    if (!piece.work) {  // another thread was quicker, or only those wait who have their threads
      --running_;
      return;
    }
    ++at_work_[piece.who];
  }
  piece.work();
  piece.work = {};
  const std::lock_guard lock(mutex_);
  const auto theirs = at_work_.find(piece.who);
  if (--theirs->second == 0) at_work_.erase(theirs);
  if (queue_.size() > 0)
    boost::asio::post(pool_, [this] { runNext(); });
  else
    --running_;
}

}  // namespace needlelab
