/// Which core the haptic loop has, and who keeps off it.
#pragma once

#include <sched.h>

#include <optional>

namespace needlelab {

/// `wanted`, or else the last of the cores that this process may use; none when it may use only one.
std::optional<int> coreForLoop(std::optional<int> wanted);

/// Threads that are made while it lives, by the thread that made it, run on the other cores. For threads that
/// wait for the disk: a kernel without preemption (Debian's servers, most virtual machines) finishes a system
/// call before it lets even a FIFO thread run on that core. One late tick a second was seen, of one fdatasync
/// a second. Nothing happens without a core, or when it is the only one. Thread: one.
class KeepOffCore {
 public:
  explicit KeepOffCore(std::optional<int> core);
  ~KeepOffCore();
  KeepOffCore(const KeepOffCore&) = delete;
  KeepOffCore& operator=(const KeepOffCore&) = delete;

 private:
  cpu_set_t before_;
  bool narrowed_ = false;
};

}  // namespace needlelab
