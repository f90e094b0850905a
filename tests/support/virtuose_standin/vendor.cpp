// The vendor's functions used by the station, with the vendor's rules.
#include <cmath>

#include "tests/support/virtuose_standin/world.h"

namespace standin {
namespace {

constexpr int kIncorrectValue = 9, kWrongMode = 17, kCallTime = 19, kNoMode = 0;

template <typename Use>
auto locked(Use use) {
  const std::scoped_lock lock(worldMutex());
  return use(world());
}

// the connection behind a pointer, after the call's duration; meanwhile other calls may be made
Context* reached(std::unique_lock<std::mutex>& lock, void* pointer, const char* name) {
  World& w = world();
  w.catchUp();
  const Context* context = w.find(pointer);
  if (context == nullptr) return nullptr;
  if (const double wait_s = w.waitOf(*context, name); wait_s > 0) {
    const StandinTime time = w.time();
    lock.unlock();
    time.wait(time.who, wait_s);
    lock.lock();
    w.catchUp();
  }
  return w.find(pointer);
}

// one call: time, link, rule, answer. `rule` returns 0 or the error code of a refused call
template <typename Rule>
int call(void* pointer, const char* name, bool sets, Rule rule) {
  World& w = world();
  std::unique_lock lock(standin::worldMutex());
  Context* context = reached(lock, pointer, name);
  if (context == nullptr) return w.answer(nullptr, name, kInvalidContext, sets);
  int error = w.arrives(*context, name);
  if (error == 0) error = rule(w, *context);
  return w.answer(context, name, error, sets);
}

bool isPositive(float value) {
  return std::isfinite(value) && value > 0;
}

bool isPose(const float* pose) {
  double square = 0;
  for (int i = 0; i < 7; ++i)
    if (!std::isfinite(pose[i])) return false;
  for (int i = 3; i < 7; ++i) square += static_cast<double>(pose[i]) * static_cast<double>(pose[i]);
  return std::abs(std::sqrt(square) - 1) < 1e-3;
}

int good(bool is_good) {
  return is_good ? 0 : kIncorrectValue;
}

int beforeMode(const Context& context, bool is_good) {
  return context.command_type != kNoMode ? kCallTime : good(is_good);
}

template <typename Value, typename Read>
int ask(void* pointer, const char* name, Value* value, Read read) {
  return call(pointer, name, false, [&](World& w, Context&) {
    *value = read(w);
    return 0;
  });
}

}  // namespace
}  // namespace standin

using standin::call;
using standin::Context;
using standin::good;
using standin::World;
using standin::world;

extern "C" {

void* virtOpen(const char* address) {
  World& w = world();
  const std::scoped_lock lock(standin::worldMutex());
  w.catchUp();
  Context* context = address != nullptr ? w.open() : nullptr;
  w.answer(context, "virtOpen", w.openError(), true);
  return context;
}

int virtClose(void* vc) {
  World& w = world();
  std::unique_lock lock(standin::worldMutex());
  Context* context = standin::reached(lock, vc, "virtClose");
  return w.answer(context, "virtClose", context != nullptr ? w.close(*context) : 0, true);
}

int virtGetErrorCode(void* vc) {
  World& w = world();
  const std::scoped_lock lock(standin::worldMutex());
  if (vc == nullptr) return w.openError();
  const Context* context = w.find(vc);
  return context != nullptr ? context->error : standin::kInvalidContext;
}

const char* virtGetErrorMessage(int code) {
  return code >= 0 && code <= 22 ? "one of the vendor's messages" : "a message of a newer library";
}

int virtAPIVersion(int* major, int* minor) {
  *major = 3;
  *minor = 98;
  return 0;
}

int virtGetControlerVersion(void* vc, int* major, int* minor) {
  return call(vc, "virtGetControlerVersion", false, [&](World&, Context&) {
    *major = 3;
    *minor = 98;
    return 0;
  });
}

int virtSetIndexingMode(void* vc, int mode) {
  return call(vc, "virtSetIndexingMode", true, [&](World&, Context& c) {
    c.indexing = mode;
    return good(mode >= 0 && mode <= 7 && mode != 5);
  });
}

int virtSetForceFactor(void* vc, float factor) {
  return call(vc, "virtSetForceFactor", true,
              [&](World&, Context& c) { return standin::beforeMode(c, standin::isPositive(factor)); });
}

int virtSetSpeedFactor(void* vc, float factor) {
  return call(vc, "virtSetSpeedFactor", true,
              [&](World&, Context&) { return good(standin::isPositive(factor)); });
}

int virtSetTimeStep(void* vc, float step_s) {
  return call(vc, "virtSetTimeStep", true, [&](World&, Context& c) {
    return standin::beforeMode(c, std::isfinite(step_s) && step_s > 0.0009999f && step_s < 0.1f);
  });
}

int virtSetTimeoutValue(void* vc, float timeout_s) {
  return call(vc, "virtSetTimeoutValue", true, [&](World&, Context& c) {
    if (standin::isPositive(timeout_s)) c.timeout_s = static_cast<double>(timeout_s);
    return good(standin::isPositive(timeout_s));
  });
}

int virtSetBaseFrame(void* vc, float* pose) {
  return call(vc, "virtSetBaseFrame", true, [&](World&, Context&) { return good(standin::isPose(pose)); });
}

int virtSetObservationFrame(void* vc, float* pose) {
  return call(vc, "virtSetObservationFrame", true,
              [&](World&, Context&) { return good(standin::isPose(pose)); });
}

int virtSetCommandType(void* vc, int type) {
  return call(vc, "virtSetCommandType", true, [&](World& w, Context& c) {
    if (type < 0 || type > 7) return standin::kIncorrectValue;
    c.command_type = type;
    w.startWatching(c);
    return 0;
  });
}

int virtSetPowerOn(void* vc, int on) {
  return call(vc, "virtSetPowerOn", true, [&](World&, Context& c) {
    c.permits_power = on == 1;
    return good(on == 0 || on == 1);
  });
}

int virtSaturateTorque(void* vc, float force_N, float torque_Nm) {
  return call(vc, "virtSaturateTorque", true, [&](World&, Context& c) {
    if (!standin::isPositive(force_N) || !standin::isPositive(torque_Nm)) return standin::kIncorrectValue;
    c.max_force_N = force_N;
    c.max_torque_Nm = torque_Nm;
    return 0;
  });
}

int virtGetPosition(void* vc, float* pose) {
  return call(vc, "virtGetPosition", false, [&](World& w, Context& c) { return w.readPose(c, pose); });
}

int virtGetSpeed(void* vc, float* speed) {
  return call(vc, "virtGetSpeed", false, [&](World& w, Context&) { return w.readSpeed(speed); });
}

int virtSetForce(void* vc, float* wrench) {
  return call(vc, "virtSetForce", true, [&](World& w, Context& c) {
    if (c.command_type != standin::kImpedance) return standin::kWrongMode;
    for (int i = 0; i < 6; ++i)
      if (!std::isfinite(wrench[i])) return standin::kIncorrectValue;
    w.setForce(c, wrench);
    return 0;
  });
}

int virtGetButton(void* vc, int button, int* pressed) {
  return call(vc, "virtGetButton", false, [&](World& w, Context&) {
    if (button < 1 || button > 3) return standin::kIncorrectValue;
    *pressed = w.button(button) ? 1 : 0;
    return 0;
  });
}

int virtGetDeadMan(void* vc, int* held) {
  return standin::ask(vc, "virtGetDeadMan", held, [](World& w) { return w.isHeld() ? 1 : 0; });
}

int virtGetEmergencyStop(void* vc, int* operational) {
  return standin::ask(vc, "virtGetEmergencyStop", operational,
                      [](World& w) { return w.isStopped() ? 0 : 1; });
}

int virtGetPowerOn(void* vc, int* on) {
  return standin::ask(vc, "virtGetPowerOn", on, [](World& w) { return w.isPowered() ? 1 : 0; });
}

int virtGetAlarm(void* vc, unsigned* bits) {
  return standin::ask(vc, "virtGetAlarm", bits, [](World& w) { return w.alarms(); });
}

int virtGetFailure(void* vc, unsigned* bits) {
  return standin::ask(vc, "virtGetFailure", bits, [](World& w) { return w.failures(); });
}

// ---- the test's side

void standin_reset(void) {
  standin::locked([](World& w) { w.reset(); });
}

void standin_virtual_time(int on) {
  standin::locked([on](World& w) { w.useVirtualTime(on != 0); });
}

void standin_time(const StandinTime* time) {
  standin::locked([time](World& w) { w.useTime(*time); });
}

void standin_advance(double seconds) {
  standin::locked([seconds](World& w) { w.advance(seconds); });
}

int standin_command(const char* command) {
  return standin::locked([command](World& w) {
    w.catchUp();
    return w.command(command) ? 0 : -1;
  });
}

int standin_script(const char* text) {
  return standin::locked([text](World& w) {
    w.catchUp();
    return w.script(text);
  });
}

void standin_state(StandinState* state) {
  standin::locked([state](World& w) { w.tell(*state); });
}

const char* standin_calls(void) {
  static thread_local std::string copy;
  return standin::locked([](World& w) { return (copy = w.calls()).c_str(); });
}

const char* standin_complaints(void) {
  static thread_local std::string copy;
  return standin::locked([](World& w) { return (copy = w.complaints()).c_str(); });
}
}
