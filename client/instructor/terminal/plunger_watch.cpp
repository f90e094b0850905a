#include "client/instructor/terminal/plunger_watch.h"

#include "client/instructor/terminal/update.h"

namespace needlelab {
namespace {

constexpr std::int64_t kWindow_ns = 200'000'000;
constexpr std::int64_t kStep_ns = 10'000'000;      // denser samples tell no more
constexpr std::int64_t kStale_ns = 2'000'000'000;  // what was before such a gap says nothing of now

}  // namespace

void PlungerWatch::add(const GestureSample& sample) {
  const std::int64_t now_ns = sample.time_ns;
  if (now_ns < newest_.time_ns || now_ns - newest_.time_ns > kStale_ns) kept_.clear();
  newest_ = sample;
  if (kept_.empty() || now_ns - kept_.back().time_ns >= kStep_ns) kept_.push_back(sample);
  while (kept_.size() > 1 && now_ns - kept_[1].time_ns >= kWindow_ns) kept_.pop_front();
}

std::string PlungerWatch::action() const {
  return kept_.empty() ? std::string() : syringeAction(kept_.front(), newest_);
}

}  // namespace needlelab
