#include "client/device/turns.h"

#include <pthread.h>
#include <sched.h>

#include <thread>

namespace needlelab {
namespace {

class MachineThread final : public RunningTurns {
 public:
  MachineThread(Turns& turns, TurnThread thread) : thread_([&turns, thread] { run(turns, thread); }) {}
  ~MachineThread() override { thread_.join(); }
  MachineThread(const MachineThread&) = delete;
  MachineThread& operator=(const MachineThread&) = delete;

 private:
  static void run(Turns& turns, const TurnThread& thread) noexcept {
    static_cast<void>(::pthread_setname_np(::pthread_self(), thread.name));
    if (thread.priority > 0) {
      sched_param parameters{};
      parameters.sched_priority = thread.priority;
      // without permission the thread keeps its priority: it is late on a busy machine
      static_cast<void>(::pthread_setschedparam(::pthread_self(), SCHED_FIFO, &parameters));
    }
    while (const auto next_ns = turns.turn()) turns.rest(*next_ns);
  }

  std::thread thread_;
};

class MachineThreads final : public TurnRunner {
 public:
  std::unique_ptr<RunningTurns> start(Turns& turns, const TurnThread& thread) override {
    return std::make_unique<MachineThread>(turns, thread);
  }
};

}  // namespace

TurnRunner& machineThreads() noexcept {
  // never destroyed: a thread may still start one while the program ends
  static MachineThreads& threads = *new MachineThreads;
  return threads;
}

}  // namespace needlelab
