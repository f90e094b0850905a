// What would end or stop the program on the spot, with the device's last force: each in a child process.
#include "client/station/run/signals.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <thread>

namespace needlelab {
namespace {

using namespace std::chrono_literals;

// a program that gets `signal` from outside: what it was told of it (0: nothing), or -1 when it died, -2 when
// it stood still
int told(int signal, void (*before)(int) = SIG_DFL) {
  const pid_t child = ::fork();
  if (child == 0) {
    ::signal(signal, before);  // whatever the one that runs this test has
    const sigset_t stop = blockStopSignals();
    // as everywhere in the station: another thread takes it than the one that waits for it
    std::thread([signal] { ::kill(::getpid(), signal); }).join();
    ::_exit(signalWithin(stop, 0ms));
  }
  int status = 0;
  ::waitpid(child, &status, WUNTRACED);
  const bool stopped = WIFSTOPPED(status);
  if (stopped) {
    ::kill(child, SIGKILL);
    ::waitpid(child, &status, 0);
    return -2;
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

TEST(Signals, whatEndsALessonIsToldAndKillsNothing) {
  EXPECT_EQ(told(SIGINT), SIGINT);
  EXPECT_EQ(told(SIGTERM), SIGTERM);
  EXPECT_EQ(told(SIGHUP), SIGHUP) << "its terminal was closed";
  EXPECT_EQ(told(SIGQUIT), SIGQUIT);
}

TEST(Signals, whatAnotherProgramOrTheTerminalDoesEndsOrStopsNothing) {
  EXPECT_EQ(told(SIGPIPE), 0) << "the program that read its words is gone";
  EXPECT_EQ(told(SIGXFSZ), 0) << "ulimit -f: the writer gets an error";
  EXPECT_EQ(told(SIGTSTP), 0) << "Ctrl-Z";
  EXPECT_EQ(told(SIGTTOU), 0);
  EXPECT_EQ(told(SIGTTIN), 0);
}

TEST(Signals, whatNohupIgnoresStaysIgnored) {
  EXPECT_EQ(told(SIGHUP, SIG_IGN), 0);
  EXPECT_EQ(told(SIGQUIT, SIG_IGN), 0);
}

TEST(Signals, anAcknowledgementIsNoStop) {
  EXPECT_EQ(told(SIGUSR1), 0);
}

}  // namespace
}  // namespace needlelab
