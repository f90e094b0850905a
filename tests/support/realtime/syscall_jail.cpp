#include "tests/support/realtime/syscall_jail.h"

#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>
#include <csignal>

#include <atomic>
#include <chrono>
#include <cstddef>
#include <thread>

#include "tests/support/sanitized.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;

constexpr int kNoFilter = 110, kForbidden = 111, kTooLong = 112;  // the child's exit codes

// in the child only
std::atomic<int> forbidden_call{-1};
std::atomic<bool> at_its_end{false}, no_filter{false};

// the jailed thread cannot return from its handler (rt_sigreturn is a system call), so it waits here
void onForbidden(int, siginfo_t* info, void*) {
  forbidden_call.store(info->si_syscall);
  for (;;) {
#if defined(__x86_64__)
    __builtin_ia32_pause();
#endif
  }
}

// for the calling thread only
bool lock(const std::vector<int>& allowed) {
  std::vector<sock_filter> program;
  program.push_back(BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr)));
  for (const int call : allowed) {
    program.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, static_cast<unsigned>(call), 0, 1));
    program.push_back(BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW));
  }
  program.push_back(BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_TRAP));
  sock_fprog filter{static_cast<unsigned short>(program.size()), program.data()};
  return ::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 &&
         ::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &filter) == 0;
}

[[noreturn]] void child(int report, const std::vector<int>& allowed, const std::function<void()>& prepare,
                        const std::function<void()>& jailed, const std::function<int()>& verdict) {
  struct sigaction action {};
  action.sa_sigaction = onForbidden;
  action.sa_flags = SA_SIGINFO;
  ::sigaction(SIGSYS, &action, nullptr);
  prepare();
  std::thread([&] {
    if (!lock(allowed)) {
      no_filter.store(true);
      return;
    }
    jailed();
    at_its_end.store(true);
    // ending a thread also makes system calls, so it waits until the process ends
    for (;;) {
#if defined(__x86_64__)
      __builtin_ia32_pause();
#endif
    }
  }).detach();
  for (int i = 0; i < 60'000; ++i) {
    if (no_filter.load()) ::_exit(kNoFilter);
    if (const int call = forbidden_call.load(); call >= 0)
      ::_exit(::write(report, &call, sizeof call) == sizeof call ? kForbidden : kTooLong);
    if (at_its_end.load()) ::_exit(verdict());
    std::this_thread::sleep_for(1ms);
  }
  ::_exit(kTooLong);
}

}  // namespace

JailOutcome runInJail(const std::vector<int>& allowed, const std::function<void()>& prepare,
                      const std::function<void()>& jailed, const std::function<int()>& verdict) {
  JailOutcome outcome;
#ifdef NEEDLELAB_SANITIZED
  outcome.supported = false;
  static_cast<void>(allowed), static_cast<void>(prepare), static_cast<void>(jailed),
      static_cast<void>(verdict);
  static_cast<void>(&child);
#else
  // a pipe returns the number of a forbidden call: an exit code has only 8 bits
  int ends[2];
  if (::pipe(ends) != 0) return outcome;
  const pid_t pid = ::fork();
  if (pid == 0) {
    child(ends[1], allowed, prepare, jailed, verdict);
  }
  ::close(ends[1]);
  int status = 0;
  ::waitpid(pid, &status, 0);
  if (WIFEXITED(status)) {
    const int code = WEXITSTATUS(status);
    outcome.supported = code != kNoFilter;
    outcome.finished = code <= 100;
    if (outcome.finished) outcome.result = code;
    if (int call = -1; code == kForbidden && ::read(ends[0], &call, sizeof call) == sizeof call)
      outcome.forbidden_call = call;
  }
  ::close(ends[0]);
#endif
  return outcome;
}

}  // namespace needlelab::test
