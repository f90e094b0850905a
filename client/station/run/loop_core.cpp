#include "client/station/run/loop_core.h"

#include <pthread.h>

namespace needlelab {
namespace {

// the cores that the calling thread may use; empty when the system does not say
cpu_set_t coresOfThisThread() {
  cpu_set_t cores;
  CPU_ZERO(&cores);
  if (::pthread_getaffinity_np(::pthread_self(), sizeof cores, &cores) != 0) CPU_ZERO(&cores);
  return cores;
}

}  // namespace

std::optional<int> coreForLoop(std::optional<int> wanted) {
  if (wanted) return wanted;
  const cpu_set_t cores = coresOfThisThread();
  if (CPU_COUNT(&cores) < 2) return std::nullopt;
  int last = CPU_SETSIZE - 1;
  while (!CPU_ISSET(last, &cores)) --last;
  return last;
}

KeepOffCore::KeepOffCore(std::optional<int> core) : before_(coresOfThisThread()) {
  if (!core || *core < 0 || *core >= CPU_SETSIZE || !CPU_ISSET(*core, &before_)) return;
  cpu_set_t others = before_;
  CPU_CLR(*core, &others);
  if (CPU_COUNT(&others) == 0) return;
  narrowed_ = ::pthread_setaffinity_np(::pthread_self(), sizeof others, &others) == 0;
}

KeepOffCore::~KeepOffCore() {
  if (narrowed_) ::pthread_setaffinity_np(::pthread_self(), sizeof before_, &before_);
}

}  // namespace needlelab
