#include "common/base/secret.h"

#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <gtest/gtest.h>

namespace needlelab {
namespace {

/// A process's limits after keepOutOfCoreDumps().
struct Limits {
  rlim_t soft = 0, hard = 0;
  int dumpable = -1;
};

/// Runs keepOutOfCoreDumps() with this limit in a child process that may not raise limits.
Limits afterwards(const rlimit& before) {
  int pipe[2] = {-1, -1};
  EXPECT_EQ(::pipe(pipe), 0);
  const pid_t child = ::fork();
  if (child == 0) {
    // root may raise a hard limit; another user may not. Changing the user makes a process not dumpable.
    if (::setrlimit(RLIMIT_CORE, &before) != 0) ::_exit(1);
    if (::geteuid() == 0 && ::setuid(65534) != 0) ::_exit(2);
    if (::prctl(PR_SET_DUMPABLE, 1, 0, 0, 0) != 0) ::_exit(3);
    keepOutOfCoreDumps();
    rlimit now{};
    if (::getrlimit(RLIMIT_CORE, &now) != 0) ::_exit(4);
    const Limits limits{now.rlim_cur, now.rlim_max, ::prctl(PR_GET_DUMPABLE, 0, 0, 0, 0)};
    ::_exit(::write(pipe[1], &limits, sizeof limits) == sizeof limits ? 0 : 5);
  }
  ::close(pipe[1]);
  Limits limits;
  EXPECT_EQ(::read(pipe[0], &limits, sizeof limits), static_cast<ssize_t>(sizeof limits));
  ::close(pipe[0]);
  int status = -1;
  EXPECT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_EQ(status, 0);
  return limits;
}

TEST(Secret, setsTheCoreLimitToOneByte) {
  rlimit own{};
  ASSERT_EQ(::getrlimit(RLIMIT_CORE, &own), 0);
  ASSERT_GE(own.rlim_max, 1u) << "these tests want a hard limit for core files above 0: ulimit -Hc";
  for (const rlim_t soft : {rlim_t{0}, own.rlim_max}) {
    const Limits limits = afterwards({soft, own.rlim_max});
    EXPECT_EQ(limits.soft, 1u) << soft;
    EXPECT_EQ(limits.hard, 1u) << soft;
    EXPECT_EQ(limits.dumpable, 1) << "a program that needs no more stays visible in /proc";
  }
}

TEST(Secret, makesTheProgramUndumpableIfTheHardLimitIsZero) {
  const Limits limits = afterwards({0, 0});
  EXPECT_EQ(limits.soft, 0u);
  EXPECT_EQ(limits.hard, 0u);
  EXPECT_EQ(limits.dumpable, 0);
}

}  // namespace
}  // namespace needlelab
