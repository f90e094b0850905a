#include "tests/support/virtuose_standin/world.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <sstream>
#include <thread>

namespace standin {
namespace {

constexpr double kWatchdog_s = 2;  // without a command the device cuts force and link
constexpr double kOverrunShown_s = 0.1;
constexpr double kEncoder_m = 10e-6, kEncoder_rad = 100e-6;
// the motors' heat: mean square of the force over 10 s, compared with the continuous 3 N
constexpr double kHeatTime_s = 10, kTooHot_N2 = 3.9 * 3.9, kCool_N2 = 2.7 * 2.7;
constexpr double kHotShare = 0.5;  // a hot device renders less
constexpr int kOutOfMemory = 1, kCommunication = 2, kTimeOut = 6, kIncompatible = 20;
constexpr int kIndexingAll = 0;
constexpr unsigned kOverheat = 0x4000, kSaturation = 0x8000, kOverrun = 0x20000;
constexpr std::size_t kLog = 16'384;  // reserved, because a haptic thread calls this

constexpr double kRounding_s = 1e-9;

double machineTime(void*) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

void machineWait(void*, double time_s) {
  std::this_thread::sleep_for(std::chrono::duration<double>(time_s));
}

bool isServed(const Context& context) {
  return context.state == Context::State::kOpen || context.state == Context::State::kLeftOpen;
}

double onStep(double value, double step) {
  return std::floor(value / step + 0.5) * step;
}

}  // namespace

World& world() {
  static World one;
  return one;
}

std::mutex& worldMutex() {
  static std::mutex one;
  return one;
}

bool ExchangeRule::take(double now_s) {
  left_ = std::min(kMost, left_ + (now_s - last_s_) * kRate_hz);
  last_s_ = now_s;
  // slightly less than one: virtual milliseconds are sums of 0.001
  if (left_ < 1 - 1e-6) return false;
  left_ -= 1;
  return true;
}

void World::reset() {
  *this = World{};
  virtual_time_ = started_ = true;
  time_ = {nullptr, machineTime, machineWait};
  calls_.reserve(kLog);
  complaints_.reserve(kLog);
}

void World::useVirtualTime(bool on) {
  catchUp();
  virtual_time_ = on;
  start_s_ = time_.now_s(time_.who) - now_s_;
}

void World::useTime(const StandinTime& time) {
  catchUp();
  time_ = time;
  useVirtualTime(false);
}

void World::advance(double seconds) {
  now_s_ += seconds;
  catchUp();
}

void World::catchUp() {
  if (!started_) {
    // the first call of a program that does not control the stand-in: real time, and optionally a script
    reset();
    virtual_time_ = false;
    start_s_ = time_.now_s(time_.who);
    if (const char* file = std::getenv("NEEDLELAB_STANDIN_SCRIPT"); file != nullptr && *file != '\0') {
      std::ifstream in(file);
      std::stringstream text;
      text << in.rdbuf();
      const int wrong = in ? script(text.str()) : 0;
      if (!in || wrong != 0) {
        std::fprintf(stderr, "stand-in: %s, line %d: no such command, or no such file\n", file, wrong);
        std::abort();
      }
    }
  }
  if (!virtual_time_) now_s_ = time_.now_s(time_.who) - start_s_;
  while (static_cast<double>(cycles_ + 1) * 1e-3 <= now_s_ + 1e-9) millisecond();
  runScript();
}

void World::millisecond() {
  ++cycles_;
  render();
  plant_.millisecond({felt_[0], felt_[1], felt_[2]}, {felt_[3], felt_[4], felt_[5]});
  next_ = commanded_;
  runScript();
  watch();
  index();
}

// the controller's own cycle: applies the last millisecond's command to the motors
void World::render() {
  const Context* context = active();
  felt_ = isPowered() && context != nullptr && context->command_type == kImpedance ? next_
                                                                                   : std::array<double, 6>{};
  saturated_ = false;
  const auto limit = [&](std::size_t first, double most) {
    const double size = std::hypot(felt_[first], felt_[first + 1], felt_[first + 2]);
    if (size <= most * (1 + 1e-6)) return;
    saturated_ = true;
    for (std::size_t i = first; i < first + 3; ++i) felt_[i] *= most / size;
  };
  if (context != nullptr) {
    limit(0, static_cast<double>(context->max_force_N));
    limit(3, static_cast<double>(context->max_torque_Nm));
  }
  const double square = felt_[0] * felt_[0] + felt_[1] * felt_[1] + felt_[2] * felt_[2];
  heat_N2_ += (square - heat_N2_) * 1e-3 / kHeatTime_s;
  hot_ = heat_N2_ > (hot_ ? kCool_N2 : kTooHot_N2);
  if (hot_ || forced_overheat_)
    for (double& value : felt_) value *= kHotShare;
}

// the service cuts silent connections
void World::watch() {
  const double now_s = static_cast<double>(cycles_) * 1e-3;
  for (Context& context : contexts_) {
    if (!isServed(context) || now_s - context.last_update_s <= kWatchdog_s) continue;
    if (context.state == Context::State::kOpen && context.command_type == 0) continue;
    context.state = context.state == Context::State::kOpen ? Context::State::kCut : Context::State::kFree;
    context.permits_power = false;
    commanded_.fill(0);
    next_.fill(0);
  }
}

// with indexing, the reported position is frozen while the motors are off, and is shifted afterwards
void World::index() {
  const Context* context = active();
  const bool stands = context != nullptr && context->indexing == kIndexingAll && !(sensor_ && switch_);
  if (stands && !indexing_) frozen_ = plant_.pose().p + shift_;
  if (stands) shift_ = frozen_ - plant_.pose().p;
  indexing_ = stands;
}

const Context* World::active() const {
  const auto one = std::find_if(contexts_.begin(), contexts_.end(), isServed);
  return one != contexts_.end() ? &*one : nullptr;
}

bool World::isPowered() const {
  const Context* context = active();
  return context != nullptr && context->permits_power && switch_ && sensor_ && !stopped_ && daemon_;
}

unsigned World::alarms() const {
  return more_alarms_ | (hot_ || forced_overheat_ ? kOverheat : 0u) | (saturated_ ? kSaturation : 0u) |
         (now_s_ < overrun_until_s_ ? kOverrun : 0u);
}

Context* World::open() {
  ++openings_;
  open_error_ = 0;
  if (!daemon_ || now_s_ < link_back_s_) open_error_ = kCommunication;
  if (active() != nullptr) open_error_ = kCommunication;  // one program at a time
  if (open_error_ == 0 && !right_version_) open_error_ = kIncompatible;
  if (open_error_ != 0) return nullptr;
  for (Context& context : contexts_) {
    if (context.state != Context::State::kFree) continue;
    context = {};
    context.state = Context::State::kOpen;
    context.last_update_s = now_s_;
    return &context;
  }
  open_error_ = kOutOfMemory;
  return nullptr;
}

Context* World::find(void* pointer) {
  for (Context& context : contexts_)
    if (&context == pointer && context.state != Context::State::kFree &&
        context.state != Context::State::kLeftOpen)
      return &context;
  return nullptr;
}

int World::refusalOf(const char* call) const {
  for (const auto& [name, code] : failing_)
    if (name == call) return code;
  return 0;
}

double World::waitOf(const Context& context, const char* call) const {
  if (virtual_time_ || context.state == Context::State::kCut || !daemon_ || refusalOf(call) != 0) return 0;
  return std::min(context.timeout_s, std::max(slow_s_, link_back_s_ - now_s_));
}

int World::arrives(Context& context, const char* call) {
  if (const int code = refusalOf(call); code != 0) return code;
  if (context.state == Context::State::kCut) return kCommunication;
  if (!daemon_) {
    context.state = Context::State::kCut;
    return kCommunication;
  }
  return now_s_ < link_back_s_ - kRounding_s || slow_s_ >= context.timeout_s ? kTimeOut : 0;
}

int World::answer(Context* context, const char* call, int error, bool sets) {
  if (context != nullptr)
    context->error = error;
  else if (error == 0)
    error = kInvalidContext;
  if (sets) remember(calls_, call);
  if (error == 0) return 0;
  char word[80];
  std::snprintf(word, sizeof word, "%s:%d", call, error);
  remember(complaints_, word);
  return -1;
}

// skips a repeat of the last word; never exceeds the reserved size
void World::remember(std::string& list, std::string_view word) {
  const bool is_last = list.size() >= word.size() &&
                       list.compare(list.size() - word.size(), word.size(), word) == 0 &&
                       (list.size() == word.size() || list[list.size() - word.size() - 1] == ' ');
  if (is_last || list.size() + word.size() + 1 > list.capacity()) return;
  if (!list.empty()) list += ' ';
  list += word;
}

int World::close(Context& context) {
  const int error = arrives(context, "virtClose");
  // without a message, the service detects the end by the silence
  const bool is_heard = error == 0 || context.state == Context::State::kCut;
  context.state = is_heard ? Context::State::kFree : Context::State::kLeftOpen;
  if (is_heard) {
    context.permits_power = false;
    commanded_.fill(0);
    next_.fill(0);
  }
  return error;
}

void World::setForce(Context& context, const float wrench[6]) {
  for (std::size_t i = 0; i < 6; ++i) commanded_[i] = static_cast<double>(wrench[i]);
  context.last_update_s = now_s_;
  ++exchanges_;
  count(set_rule_);
}

void World::countRead() {
  if (first_read_cycle_ < 0) first_read_cycle_ = cycles_;
  count(get_rule_);
}

void World::count(ExchangeRule& rule) {
  if (rule.take(now_s_)) return;
  ++overruns_;
  overrun_until_s_ = now_s_ + kOverrunShown_s;
}

int World::readPose(const Context& context, float pose[7]) {
  countRead();
  const Pose& X = plant_.pose();
  const Vec3 p = context.indexing == kIndexingAll ? X.p + shift_ : X.p;
  pose[0] = static_cast<float>(onStep(p.x, kEncoder_m));
  pose[1] = static_cast<float>(onStep(p.y, kEncoder_m));
  pose[2] = static_cast<float>(onStep(p.z, kEncoder_m));
  const double half = kEncoder_rad / 2;
  const Quat q =
      normalized(Quat{onStep(X.q.x, half), onStep(X.q.y, half), onStep(X.q.z, half), onStep(X.q.w, half)});
  pose[3] = static_cast<float>(turn_scale_ * q.x);
  pose[4] = static_cast<float>(turn_scale_ * q.y);
  pose[5] = static_cast<float>(turn_scale_ * q.z);
  pose[6] = static_cast<float>(turn_scale_ * q.w);
  return 0;
}

int World::readSpeed(float speed[6]) const {
  const Vec3 v = plant_.velocity(), w = plant_.turning();
  const double values[6] = {v.x, v.y, v.z, w.x, w.y, w.z};
  for (int i = 0; i < 6; ++i) speed[i] = static_cast<float>(values[i]);
  return 0;
}

void World::tell(StandinState& s) {
  catchUp();
  const Pose& X = plant_.pose();
  const Vec3 v = plant_.velocity();
  const Context* context = active();
  s = {{X.p.x, X.p.y, X.p.z},
       {X.q.x, X.q.y, X.q.z, X.q.w},
       {v.x, v.y, v.z},
       {},
       {},
       isPowered(),
       context != nullptr && context->permits_power,
       openings_,
       0,
       alarms(),
       exchanges_,
       overruns_};
  std::copy_n(commanded_.begin(), 6, s.commanded);
  std::copy_n(felt_.begin(), 6, s.felt);
  s.open_contexts = static_cast<int>(std::count_if(contexts_.begin(), contexts_.end(), isServed));
}

}  // namespace standin
