#include "common/wire/live_queue.h"

namespace needlelab {

void LiveQueue::push(Frame frame, bool counted, std::int64_t now_ns) {
  dropOverAged(now_ns);
  bytes_ += frame->size();
  items_.push_back({std::move(frame), counted, now_ns});
  // the newest stays, even when it alone is above the bound
  while (bytes_ > max_bytes_ && items_.size() > 1) dropOldest();
}

std::optional<LiveQueue::Item> LiveQueue::pop(std::int64_t now_ns) {
  dropOverAged(now_ns);
  if (items_.empty()) return std::nullopt;
  Item item = std::move(items_.front());
  items_.pop_front();
  bytes_ -= item.frame->size();
  return item;
}

void LiveQueue::clear() {
  items_.clear();
  bytes_ = 0;
}

void LiveQueue::dropOldest() {
  const Item& oldest = items_.front();
  ++(oldest.counted ? dropped_ : dropped_status_);
  bytes_ -= oldest.frame->size();
  items_.pop_front();
}

void LiveQueue::dropOverAged(std::int64_t now_ns) {
  while (!items_.empty() && now_ns - items_.front().pushed_ns > max_age_ns_) dropOldest();
}

}  // namespace needlelab
