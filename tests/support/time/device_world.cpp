#include "tests/support/time/device_world.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <utility>

namespace needlelab::test {
namespace {

/// More turns at one time than any run needs: a thread spins.
constexpr int kMostAtOneTime = 10'000;

[[noreturn]] void fail(const char* what, const std::string& name) {
  std::fprintf(stderr, "device world: %s: %s\n", name.c_str(), what);
  std::abort();
}

}  // namespace

class DeviceWorld::Running final : public RunningTurns {
 public:
  Running(DeviceWorld& world, Thread& thread) : world_(world), thread_(thread) {}
  ~Running() override {
    if (thread_.is_busy) fail("waits for its own end", thread_.name);
    while (!thread_.has_ended)
      if (!world_.next(kNever)) fail("never ends", thread_.name);
    thread_.is_free = true;
  }
  Running(const Running&) = delete;
  Running& operator=(const Running&) = delete;

 private:
  DeviceWorld& world_;
  Thread& thread_;
};

std::unique_ptr<RunningTurns> DeviceWorld::start(Turns& turns, const TurnThread& thread) {
  Thread* place = nullptr;
  for (Thread& old : threads_)
    if (old.is_free && place == nullptr) place = &old;
  if (place == nullptr) place = &threads_.emplace_back();
  *place = Thread{.turns = &turns, .name = thread.name, .due_ns = now_ns_};
  return std::make_unique<Running>(*this, *place);
}

void DeviceWorld::listen(const std::string& name, std::function<std::int64_t()> next_event_ns) {
  events_[name] = std::move(next_event_ns);
}

void DeviceWorld::wakeLate(const std::string& name, std::function<std::int64_t()> late_ns) {
  lateness_[name] = std::move(late_ns);
}

void DeviceWorld::at(std::int64_t due_ns, std::function<void()> happens) {
  once_.emplace(due_ns, std::move(happens));
}

std::int64_t DeviceWorld::wakeNs(const Thread& thread) const {
  std::int64_t due_ns = thread.due_ns;
  if (!thread.is_new)
    if (const auto event = events_.find(thread.name); event != events_.end())
      due_ns = std::min(due_ns, event->second());
  return due_ns > kNever - thread.late_ns ? kNever : due_ns + thread.late_ns;
}

void DeviceWorld::sleepUntilNs(std::int64_t due_ns) noexcept {
  while (next(due_ns)) {
  }
  now_ns_ = std::max(now_ns_, due_ns);
}

// runs the next event if it is due by then
bool DeviceWorld::next(std::int64_t until_ns) {
  std::int64_t first_ns = once_.empty() ? kNever : once_.begin()->first;
  Thread* first = nullptr;
  int equal = 1;
  for (Thread& thread : threads_) {
    if (thread.has_ended || thread.is_busy) continue;
    const std::int64_t wake_ns = std::max(now_ns_, wakeNs(thread));
    if (wake_ns > first_ns || wake_ns == kNever) continue;
    equal = wake_ns < first_ns ? 1 : equal + 1;
    const bool is_chosen =
        wake_ns < first_ns || (is_shuffled_ && order_.below(static_cast<std::uint64_t>(equal)) == 0);
    first_ns = wake_ns;
    if (is_chosen) first = &thread;
  }
  if (first_ns > until_ns || first_ns == kNever) return false;

  at_this_time_ = first_ns > now_ns_ ? 0 : at_this_time_ + 1;
  if (at_this_time_ > kMostAtOneTime) fail("spins", first != nullptr ? first->name : "the test");
  now_ns_ = std::max(now_ns_, first_ns);
  if (first != nullptr) {
    turn(*first);
  } else {
    const auto happens = std::move(once_.begin()->second);
    once_.erase(once_.begin());
    happens();
  }
  return true;
}

void DeviceWorld::turn(Thread& thread) {
  thread.is_busy = true;
  if (!std::exchange(thread.is_new, false)) thread.turns->rest(now_ns_);
  const auto due_ns = thread.turns->turn();
  thread.is_busy = false;
  thread.has_ended = !due_ns;
  if (thread.has_ended) return;
  thread.due_ns = *due_ns;
  const auto late = lateness_.find(thread.name);
  thread.late_ns = late != lateness_.end() ? late->second() : 0;
}

}  // namespace needlelab::test
