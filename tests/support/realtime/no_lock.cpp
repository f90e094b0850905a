#include "tests/support/realtime/no_lock.h"

#include <dlfcn.h>
#include <pthread.h>
#include <semaphore.h>

#include <cstdlib>

#include "tests/support/sanitized.h"

namespace {

// trivial types only: these are used before anything is constructed
thread_local bool watching = false;
thread_local std::uint64_t calls_seen = 0;

}  // namespace

#ifndef NEEDLELAB_SANITIZED

namespace {

template <typename Function>
Function* systemsOwn(const char* name) {
  void* found = ::dlsym(RTLD_NEXT, name);
  if (found == nullptr) std::abort();
  return reinterpret_cast<Function*>(found);
}

}  // namespace

// replaces the system's function: counts, then calls the system's
#define NEEDLELAB_WATCH(name, parameters, arguments)            \
  extern "C" int name parameters {                              \
    static auto* const own = systemsOwn<int parameters>(#name); \
    if (watching) ++calls_seen;                                 \
    return own arguments;                                       \
  }

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wpragmas"
#pragma GCC diagnostic ignored "-Wunknown-warning-option"
#pragma GCC diagnostic ignored "-Wexceptions"
NEEDLELAB_WATCH(pthread_mutex_lock, (pthread_mutex_t * m) noexcept, (m))
NEEDLELAB_WATCH(pthread_mutex_trylock, (pthread_mutex_t * m) noexcept, (m))
NEEDLELAB_WATCH(pthread_mutex_timedlock, (pthread_mutex_t * m, const timespec* t) noexcept, (m, t))
NEEDLELAB_WATCH(pthread_rwlock_rdlock, (pthread_rwlock_t * l) noexcept, (l))
NEEDLELAB_WATCH(pthread_rwlock_wrlock, (pthread_rwlock_t * l) noexcept, (l))
NEEDLELAB_WATCH(pthread_spin_lock, (pthread_spinlock_t * l) noexcept, (l))
NEEDLELAB_WATCH(pthread_cond_signal, (pthread_cond_t * c) noexcept, (c))
NEEDLELAB_WATCH(pthread_cond_broadcast, (pthread_cond_t * c) noexcept, (c))
NEEDLELAB_WATCH(sem_post, (sem_t * s) noexcept, (s))
NEEDLELAB_WATCH(sem_wait, (sem_t * s), (s))
#pragma GCC diagnostic pop

#endif

namespace needlelab::test {

NoLockScope::NoLockScope() noexcept {
  calls_seen = 0;
  watching = true;
}
NoLockScope::~NoLockScope() {
  watching = false;
}
std::uint64_t NoLockScope::calls() const noexcept {
  return calls_seen;
}
bool NoLockScope::works() noexcept {
#ifdef NEEDLELAB_SANITIZED
  return false;
#else
  return true;
#endif
}

}  // namespace needlelab::test
