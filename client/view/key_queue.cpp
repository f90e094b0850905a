#include "client/view/key_queue.h"

#include <algorithm>

namespace needlelab {

std::vector<KeyEvent> KeyQueue::take() {
  std::vector<KeyEvent> seen;
  while (!waiting_.empty()) {
    const KeyEvent& next = waiting_.front();
    const bool has_room = std::none_of(seen.begin(), seen.end(), [&](const KeyEvent& event) {
      return event.key == next.key || (event.down && next.down);
    });
    if (!has_room) break;
    seen.push_back(next);
    waiting_.pop_front();
  }
  return seen;
}

}  // namespace needlelab
