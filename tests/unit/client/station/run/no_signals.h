/// For loops that a test does not stop by a signal.
#pragma once

#include <csignal>

namespace needlelab {

/// The empty set: no signal is waited for.
inline sigset_t noSignals() {
  sigset_t none;
  sigemptyset(&none);
  return none;
}

}  // namespace needlelab
