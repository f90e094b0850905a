// A wrong wall clock: preloaded (LD_PRELOAD) into a program, it adds NEEDLELAB_CLOCK_AHEAD_S seconds (below
// 0: behind) to the time of day, and to nothing else. Waits until a time of day end as they would without it.
#include <dlfcn.h>
#include <pthread.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <unistd.h>
#include <initializer_list>

#include <cstdlib>
#include <ctime>

namespace {

long aheadSeconds() {
  static const long ahead = [] {
    const char* const text = std::getenv("NEEDLELAB_CLOCK_AHEAD_S");
    return text == nullptr ? 0L : std::strtol(text, nullptr, 10);
  }();
  return ahead;
}

// Steady-clock times are a few years at most: a wait until such a time does not use this clock.
constexpr long kTimeOfDay_s = 1'000'000'000;

timespec trueTime(const timespec& time) {
  timespec until = time;
  if (until.tv_sec > kTimeOfDay_s) until.tv_sec -= aheadSeconds();
  return until;
}

using WaitUntil = int (*)(pthread_cond_t*, pthread_mutex_t*, const timespec*);

// There are two with this name: dlsym would return the one from before glibc 2.3.2.
WaitUntil waitUntil() {
  for (const char* const version : {"GLIBC_2.3.2", "GLIBC_2.17"})
    if (void* const found = ::dlvsym(RTLD_NEXT, "pthread_cond_timedwait", version))
      return reinterpret_cast<WaitUntil>(found);
  return reinterpret_cast<WaitUntil>(::dlsym(RTLD_NEXT, "pthread_cond_timedwait"));
}

}  // namespace

extern "C" {

int clock_gettime(clockid_t id, timespec* now) noexcept {
  const int result = static_cast<int>(::syscall(SYS_clock_gettime, id, now));
  if (result == 0 && (id == CLOCK_REALTIME || id == CLOCK_REALTIME_COARSE)) now->tv_sec += aheadSeconds();
  return result;
}

int gettimeofday(timeval* now, void* zone) noexcept {
  const int result = static_cast<int>(::syscall(SYS_gettimeofday, now, zone));
  if (result == 0) now->tv_sec += aheadSeconds();
  return result;
}

time_t time(time_t* result) noexcept {
  timespec now{};
  if (clock_gettime(CLOCK_REALTIME, &now) != 0) return -1;
  if (result != nullptr) *result = now.tv_sec;
  return now.tv_sec;
}

int pthread_cond_timedwait(pthread_cond_t* condition, pthread_mutex_t* mutex, const timespec* until) {
  static const WaitUntil wait = waitUntil();
  const timespec moved = trueTime(*until);
  return wait(condition, mutex, &moved);
}

}  // extern "C"
