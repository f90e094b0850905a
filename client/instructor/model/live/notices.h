/// Short notices to the instructor at the window's edge: success or failure.
#pragma once

#include <deque>
#include <string>

#include "client/view/model/palette.h"
#include "common/base/text/plain_words.h"

namespace needlelab {

struct Notice {
  std::string text;
  Condition condition = Condition::kGood;
  double until_s = 0;
};

/// Thread: one. Times are the view's clock.
class Notices {
 public:
  void tick(double now_s);
  void good(std::string text) { add(std::move(text), Condition::kGood, 6); }
  /// Shown longer, because the user must read it.
  void trouble(std::string text) { add(std::move(text), Condition::kTrouble, 20); }
  void dismiss() { notices_.clear(); }
  [[nodiscard]] const std::deque<Notice>& all() const { return notices_; }

 private:
  static constexpr std::size_t kMost = 3;  // more would cover the screen
  void add(std::string text, Condition condition, double seconds) {
    text = plainWords(text);
    // a repeated text extends its notice
    std::erase_if(notices_, [&](const Notice& notice) { return notice.text == text; });
    notices_.push_back({std::move(text), condition, now_s_ + seconds});
    if (notices_.size() > kMost) notices_.pop_front();
  }
  double now_s_ = 0;
  std::deque<Notice> notices_;
};

inline void Notices::tick(double now_s) {
  now_s_ = now_s;
  std::erase_if(notices_, [&](const Notice& notice) { return notice.until_s < now_s; });
}

}  // namespace needlelab
