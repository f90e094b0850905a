/// Signals that a test sends to itself and receives where the program receives them.
#pragma once

#include <csignal>
#include <ctime>
#include <initializer_list>

namespace needlelab::test {

/// Blocks `signals` in this thread, and in those it starts, during its lifetime; drops those still pending at
/// its end. `raise` then makes one pending for this thread. Thread: one.
class BlockedSignals {
 public:
  BlockedSignals(std::initializer_list<int> signals) {
    sigemptyset(&signals_);
    for (const int signal : signals) sigaddset(&signals_, signal);
    ::pthread_sigmask(SIG_BLOCK, &signals_, &before_);
  }
  ~BlockedSignals() {
    const timespec at_once{};
    while (::sigtimedwait(&signals_, nullptr, &at_once) > 0) {
    }
    ::pthread_sigmask(SIG_SETMASK, &before_, nullptr);
  }
  BlockedSignals(const BlockedSignals&) = delete;
  BlockedSignals& operator=(const BlockedSignals&) = delete;

  [[nodiscard]] const sigset_t& set() const { return signals_; }

 private:
  sigset_t signals_{}, before_{};
};

}  // namespace needlelab::test
