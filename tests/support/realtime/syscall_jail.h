/// Runs a function on a thread with only a few permitted system calls, to test that real-time functions make
/// no others. Link needlelab::syscall_jail.
#pragma once

#include <functional>
#include <vector>

namespace needlelab::test {

/// The result of the jailed function.
struct JailOutcome {
  bool supported = true;    ///< false: this system accepts no filter (or a sanitizer makes its own calls)
  bool finished = false;    ///< it reached its end
  int forbidden_call = -1;  ///< number of the first forbidden system call; -1 = none
  int result = 0;           ///< value of `verdict`
};

/// In a child process: runs `prepare` (may start threads), then `jailed` on its own thread, which may make
/// only the `allowed` system calls (numbers, SYS_…), then `verdict`, and returns the verdict's value (0-100).
/// The first forbidden call ends the child. Gives up after 60 s.
JailOutcome runInJail(const std::vector<int>& allowed, const std::function<void()>& prepare,
                      const std::function<void()>& jailed, const std::function<int()>& verdict);

}  // namespace needlelab::test
