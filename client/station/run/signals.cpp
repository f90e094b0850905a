#include "client/station/run/signals.h"

#include <pthread.h>

#include <ctime>

namespace needlelab {

namespace {

pthread_t main_thread;

// in a thread that a library started before `main` (OpenBLAS does) and that blocks nothing: the kernel may
// choose it, and by default such a signal kills the program with its force
void handOver(int signal) {
  ::pthread_kill(main_thread, signal);
}

}  // namespace

sigset_t blockStopSignals() {
  main_thread = ::pthread_self();
  sigset_t stop;
  ::sigemptyset(&stop);
  for (const int signal : {SIGINT, SIGTERM}) ::sigaddset(&stop, signal);
  // what whoever started it wants to be ignored (nohup) stays so
  for (const int signal : {SIGHUP, SIGQUIT}) {
    struct sigaction now {};
    if (::sigaction(signal, nullptr, &now) == 0 && now.sa_handler != SIG_IGN) ::sigaddset(&stop, signal);
  }
  sigset_t blocked = stop;
  ::sigaddset(&blocked, SIGUSR1);
  struct sigaction action {};
  action.sa_handler = handOver;
  action.sa_flags = SA_RESTART;
  ::sigemptyset(&action.sa_mask);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGUSR1})
    if (::sigismember(&blocked, signal) == 1) ::sigaction(signal, &action, nullptr);
  ::pthread_sigmask(SIG_BLOCK, &blocked, nullptr);
  // a reader that is gone, a file beyond the limit of the shell (both come back as errors) and Ctrl-Z must
  // neither end nor stop the program on the spot: the device would keep
  // its last force
  for (const int signal : {SIGPIPE, SIGXFSZ, SIGTSTP, SIGTTIN, SIGTTOU}) ::signal(signal, SIG_IGN);
  return stop;
}

int signalWithin(const sigset_t& signals, std::chrono::milliseconds time) {
  const timespec timeout{time.count() / 1000, (time.count() % 1000) * 1'000'000};
  const int signal = ::sigtimedwait(&signals, nullptr, &timeout);
  return signal > 0 ? signal : 0;
}

}  // namespace needlelab
