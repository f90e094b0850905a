#include "station/signals.h"

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
  struct sigaction action {};
  action.sa_handler = handOver;
  action.sa_flags = SA_RESTART;
  ::sigemptyset(&action.sa_mask);
  for (const int signal : {SIGINT, SIGTERM, SIGUSR1}) ::sigaction(signal, &action, nullptr);
  sigset_t signals;
  ::sigemptyset(&signals);
  ::sigaddset(&signals, SIGUSR1);
  ::pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  ::sigemptyset(&signals);
  ::sigaddset(&signals, SIGINT);
  ::sigaddset(&signals, SIGTERM);
  ::pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  return signals;
}

int signalWithin(const sigset_t& signals, std::chrono::milliseconds time) {
  const timespec timeout{time.count() / 1000, (time.count() % 1000) * 1'000'000};
  const int signal = ::sigtimedwait(&signals, nullptr, &timeout);
  return signal > 0 ? signal : 0;
}

}  // namespace needlelab
