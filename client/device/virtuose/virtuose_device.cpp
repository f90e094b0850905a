#include "client/device/virtuose/virtuose_device.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "client/device/virtuose/virtuose_errors.h"
#include "common/base/planted_bug.h"
#include "common/haptics/gate/force_gate.h"

namespace needlelab {
namespace {

constexpr std::int64_t kNap_ns = 20'000'000;  // how often the keep-alive thread checks for its end
// tolerance of a unit quaternion's length in floats; the gate handles others
constexpr double kRounding = 1e-3;

Vec3 vectorOf(const float* v) {
  return {static_cast<double>(v[0]), static_cast<double>(v[1]), static_cast<double>(v[2])};
}

Quat rotationOf(const float* q) {
  const Quat raw{static_cast<double>(q[0]), static_cast<double>(q[1]), static_cast<double>(q[2]),
                 static_cast<double>(q[3])};
  const double length = std::sqrt(dot(raw, raw));
  return std::abs(length - 1) <= kRounding ? normalized(raw) : raw;
}

DeviceInfo infoOf(const std::string& address) {
  DeviceInfo info;
  info.name = "Virtuose 6D Desktop at " + address;
  info.limits = DeviceLimits{};  // the defaults are this device's
  info.max_rate_hz = 1000;
  info.has_dead_man = true;
  info.plunger = PlungerSource::kButtons;
  return info;
}

}  // namespace

VirtuoseDevice::VirtuoseDevice(VirtuoseOptions options, TimeSource& time, TurnRunner& threads)
    : options_(std::move(options)), time_(time), threads_(threads), info_(infoOf(options_.address)) {}

Status VirtuoseDevice::open(double rate_hz) {
  close();
  const std::scoped_lock lock(mutex_);
  if (!api_) {
    ASSIGN_OR_RETURN(auto api,
                     options_.library.empty() ? loadVirtuoseApi() : loadVirtuoseApi(options_.library));
    api_ = std::move(api);
  }
  setup_ = {options_.address, rate_hz, info_.limits, options_.timeout_s};
  RETURN_IF_ERROR(connect());
  owner_.store(Owner::kIdle, std::memory_order_release);
  keep_alive_.stop.store(false);
  keep_alive_.last_ns = time_.nowNs();
  keep_alive_thread_ = threads_.start(keep_alive_, {"virtuose-alive", 0});
  return {};
}

// opens the device, and reads once the values that are later read in turn
Status VirtuoseDevice::connect() {
  ASSIGN_OR_RETURN(context_, openVirtuose(*api_, setup_));
  trouble_ = 0;
  ticks_of_trouble_ = 0;
  buttons_ = 0;
  has_button_.fill(false);
  for (int i = 0; i < kButtons; ++i) {
    int pressed = 0;  // the library refuses a missing button; do not query it again
    has_button_[static_cast<std::size_t>(i)] = api_->virtGetButton(context_, i + 1, &pressed) == 0;
  }
  int power = 0, held = 0, operational = 0;
  const char* asked = "virtGetPowerOn";
  bool answered = api_->virtGetPowerOn(context_, &power) == 0;
  const auto ask = [&](const char* call, auto function, auto* answer) {
    if (!answered) return;
    asked = call;
    answered = function(context_, answer) == 0;
  };
  ask("virtGetAlarm", api_->virtGetAlarm, &alarm_);
  ask("virtGetFailure", api_->virtGetFailure, &failure_);
  ask("virtGetDeadMan", api_->virtGetDeadMan, &held);
  ask("virtGetEmergencyStop", api_->virtGetEmergencyStop, &operational);
  if (!answered) {
    const int code = api_->virtGetErrorCode(context_);
    const std::string why = virtuoseErrorText(code, api_->virtGetErrorMessage(code));
    closeVirtuose(*api_, std::exchange(context_, nullptr));
    return Error{ErrorCode::kUnavailable,
                 "Virtuose at " + options_.address + ": " + asked + " failed with " + why};
  }
  power_on_ = power != 0;
  error_code_.store(0, std::memory_order_relaxed);
  seen_alarm_.store(alarm_, std::memory_order_relaxed);
  seen_failure_.store(failure_, std::memory_order_relaxed);
  seen_condition_.store(rememberedCondition() | (operational != 0 ? 0u : kDeviceEmergencyStop) |
                            (held != 0 ? 0u : kDeviceReleased),
                        std::memory_order_relaxed);
  return {};
}

std::optional<std::int64_t> VirtuoseDevice::KeepAlive::turn() noexcept {
  if (stop.load()) return std::nullopt;
  const std::int64_t now_ns = device.time_.nowNs();
  if (now_ns - last_ns >= std::chrono::nanoseconds(device.options_.keep_alive).count() &&
      !planted(PlantedBug::kNoKeepAlive)) {
    last_ns = now_ns;
    device.keepAlive();
  }
  return now_ns + kNap_ns;
}

void VirtuoseDevice::keepAlive() noexcept {
  Owner idle = Owner::kIdle;
  if (!owner_.compare_exchange_strong(idle, Owner::kKeepAlive, std::memory_order_acquire)) return;
  float zero[6] = {};
  if (api_->virtSetForce(context_, zero) != 0) {
    error_code_.store(api_->virtGetErrorCode(context_), std::memory_order_relaxed);
    error_call_.store("virtSetForce", std::memory_order_relaxed);
    owner_.store(Owner::kLost, std::memory_order_release);
  } else {
    owner_.store(Owner::kIdle, std::memory_order_release);
  }
}

// returns true when the haptic thread owns the connection
bool VirtuoseDevice::takeConnection() noexcept {
  Owner owner = owner_.load(std::memory_order_relaxed);
  if (owner == Owner::kLoop) return true;
  owner = Owner::kIdle;
  return owner_.compare_exchange_strong(owner, Owner::kLoop, std::memory_order_acquire);
}

// call this last: afterwards the haptic thread touches neither the connection nor its state
void VirtuoseDevice::giveUpConnection() noexcept {
  link_is_lost_ = false;
  ticks_of_trouble_ = 0;
  owner_.store(Owner::kLost, std::memory_order_release);
}

bool VirtuoseDevice::succeeded(int result, const char* call) noexcept {
  if (result == 0) return true;
  const int code = api_->virtGetErrorCode(context_);
  error_code_.store(code, std::memory_order_relaxed);
  error_call_.store(call, std::memory_order_relaxed);
  trouble_ |= virtuoseConditionOfError(code);
  link_is_lost_ = virtuoseLinkIsLost(code);
  return false;
}

bool VirtuoseDevice::pollNextState() noexcept {
  const int turn = turn_;
  turn_ = (turn_ + 1) % kTurns;
  if (turn == 0) {
    int power = 0;
    if (!succeeded(api_->virtGetPowerOn(context_, &power), "virtGetPowerOn")) return false;
    power_on_ = power != 0;
    return true;
  }
  if (turn == 1) return succeeded(api_->virtGetAlarm(context_, &alarm_), "virtGetAlarm");
  if (turn == 2) return succeeded(api_->virtGetFailure(context_, &failure_), "virtGetFailure");
  const int button = turn - 3;
  if (!has_button_[static_cast<std::size_t>(button)]) return true;
  int pressed = 0;
  if (!succeeded(api_->virtGetButton(context_, button + 1, &pressed), "virtGetButton")) return false;
  const std::uint32_t bit = 1u << button;
  buttons_ = pressed != 0 ? buttons_ | bit : buttons_ & ~bit;
  return true;
}

std::uint32_t VirtuoseDevice::rememberedCondition() const noexcept {
  return (power_on_ ? 0u : kDevicePowerOff) | virtuoseConditionOfAlarm(alarm_) |
         virtuoseConditionOfFailure(failure_);
}

// reopens a device that answers but refuses to work for a whole second
void VirtuoseDevice::countFailure() noexcept {
  if (link_is_lost_ || static_cast<double>(++ticks_of_trouble_) >= setup_.rate_hz) giveUpConnection();
}

DeviceRead VirtuoseDevice::read(DeviceReading& reading) noexcept {
  if (!takeConnection()) {
    const bool is_kept = owner_.load(std::memory_order_relaxed) == Owner::kKeepAlive;
    reading.condition = is_kept ? kDeviceNotReady : kDeviceLost;
    reading.buttons = 0;  // a lost device reports no buttons
    seen_condition_.store(reading.condition, std::memory_order_relaxed);
    return DeviceRead::kNoUpdate;
  }

  // check each answer before the next query: a lost connection is no longer ours
  float pose[7] = {}, speed[6] = {};
  int held = 0, operational = 0;
  const bool answered =
      succeeded(api_->virtGetPosition(context_, pose), "virtGetPosition") &&
      succeeded(api_->virtGetSpeed(context_, speed), "virtGetSpeed") &&
      succeeded(api_->virtGetDeadMan(context_, &held), "virtGetDeadMan") &&
      succeeded(api_->virtGetEmergencyStop(context_, &operational), "virtGetEmergencyStop") &&
      pollNextState();
  reading.condition = std::exchange(trouble_, 0);
  if (!answered) {
    seen_condition_.store(reading.condition, std::memory_order_relaxed);
    countFailure();
    return DeviceRead::kNoUpdate;
  }

  if (reading.condition == 0) ticks_of_trouble_ = 0;
  reading.condition |= rememberedCondition() | (held != 0 ? 0u : kDeviceReleased) |
                       (operational != 0 ? 0u : kDeviceEmergencyStop);
  reading.X_WH = {vectorOf(pose), rotationOf(pose + 3)};
  reading.speed_mps = norm(vectorOf(speed));
  reading.buttons = buttons_;
  seen_condition_.store(reading.condition, std::memory_order_relaxed);
  seen_alarm_.store(alarm_, std::memory_order_relaxed);
  seen_failure_.store(failure_, std::memory_order_relaxed);
  return DeviceRead::kFresh;
}

void VirtuoseDevice::write(const GuardedWrench& at_handle_W) noexcept {
  if (owner_.load(std::memory_order_relaxed) != Owner::kLoop) return;
  const Wrench& wrench = at_handle_W.wrench();
  float six[6] = {static_cast<float>(wrench.force_N.x),   static_cast<float>(wrench.force_N.y),
                  static_cast<float>(wrench.force_N.z),   static_cast<float>(wrench.torque_Nm.x),
                  static_cast<float>(wrench.torque_Nm.y), static_cast<float>(wrench.torque_Nm.z)};
  // the gate already blocks values that are not finite; check again, because this output moves a person's
  // hand
  if (!isFinite(wrench.force_N) || !isFinite(wrench.torque_Nm)) {
    std::fill(std::begin(six), std::end(six), 0.0f);
    trouble_ |= kDeviceTrouble;
  }
  if (!succeeded(api_->virtSetForce(context_, six), "virtSetForce")) countFailure();
}

void VirtuoseDevice::maintain() {
  const std::scoped_lock lock(mutex_);
  if (owner_.load(std::memory_order_acquire) != Owner::kLost || time_.nowNs() < next_try_ns_) return;
  // the device accepts one connection: close the old one first
  if (!planted(PlantedBug::kOldConnectionKept)) closeVirtuose(*api_, std::exchange(context_, nullptr));
  const Status status = connect();
  const bool begins = status.ok() || away_text_.empty() || planted(PlantedBug::kRetryNeverDoubles);
  retry_ = begins ? options_.first_retry : std::min(retry_ * 2, options_.longest_retry);
  next_try_ns_ = time_.nowNs() + std::chrono::nanoseconds(retry_).count();
  away_text_ = status.ok() ? "" : status.error().message;
  if (status.ok()) owner_.store(Owner::kIdle, std::memory_order_release);
}

std::string VirtuoseDevice::status() {
  const std::scoped_lock lock(mutex_);
  const Owner owner = owner_.load(std::memory_order_acquire);
  if (owner == Owner::kClosed) return {};
  const int code = error_code_.load(std::memory_order_relaxed);
  const std::string refused = std::string(error_call_.load(std::memory_order_relaxed)) + " failed with " +
                              virtuoseErrorText(code, api_->virtGetErrorMessage(code));
  if (owner == Owner::kLost) {
    const std::string last =
        away_text_.empty() ? "Virtuose at " + options_.address + ": " + refused : away_text_;
    return "the link is lost and is looked for again. " + last;
  }
  const std::uint32_t condition = seen_condition_.load(std::memory_order_relaxed);
  std::string text = virtuoseStateText(condition, seen_alarm_.load(std::memory_order_relaxed),
                                       seen_failure_.load(std::memory_order_relaxed));
  if (code != 0 && (condition & kDeviceTrouble) != 0) text += (text.empty() ? "" : "; ") + refused;
  return text;
}

void VirtuoseDevice::close() noexcept {
  keep_alive_.stop.store(true);
  keep_alive_thread_.reset();
  const std::scoped_lock lock(mutex_);
  if (owner_.exchange(Owner::kClosed, std::memory_order_acq_rel) == Owner::kClosed) return;
  closeVirtuose(*api_, std::exchange(context_, nullptr));
  next_try_ns_ = 0;
  away_text_.clear();
}

}  // namespace needlelab
