/// Runs a function on a thread that may make no system call but a few, to test that real-time functions make
/// none. Link needlelab::syscall_jail.
#pragma once

#include <functional>
#include <vector>

namespace needlelab::test {

/// How the jailed function fared.
struct JailOutcome {
  bool supported = true;    ///< false: this system takes no filter (or a sanitizer makes calls of its own)
  bool finished = false;    ///< it came to its end
  int forbidden_call = -1;  ///< number of the first system call that it may not make; -1 = none
  int result = 0;           ///< what `verdict` gave
};

/// In a child process: `prepare` (may start threads), then `jailed` on a thread of its own, whose only system
/// calls may be `allowed` (numbers, SYS_…), then `verdict`, whose value (0-100) is handed back. The first
/// forbidden call ends the child. Gives up after 60 s.
JailOutcome runInJail(const std::vector<int>& allowed, const std::function<void()>& prepare,
                      const std::function<void()>& jailed, const std::function<int()>& verdict);

}  // namespace needlelab::test
