#include "client/device/falcon/falcon_device.h"

#include <fmt/core.h>
#include <pthread.h>
#include <sched.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <utility>

#include "client/device/falcon/falcon_geometry.h"
#include "client/device/falcon/falcon_link.h"
#include "client/device/falcon/firmware_loader.h"
#include "common/base/clock.h"
#include "common/base/range.h"
#include "common/haptics/device_condition.h"

namespace needlelab {
namespace {

using std::chrono::milliseconds;

constexpr int kFirmwareTries = 3;
constexpr int kRunsTries = 3;  // 50 ms each, before loading the firmware
constexpr milliseconds kLookAgain{500};
constexpr milliseconds kBreath{20};  // pause that limits reopening of a device lost again at once
constexpr std::int64_t kFirstReport_ns = 1'000'000'000;
constexpr std::int64_t kFinalCommand_ns = 100'000'000;
constexpr std::int64_t kStatusEvery_ns = 50'000'000;
/// More ticks without a new report than the drift of two clocks explains.
constexpr std::uint32_t kOverrunTicks = 5;

constexpr const char* kHomingText =
    "the Falcon looks for its zero: pull the grip out all the way, then push it in slowly until the light "
    "turns green";

void useFifo(int priority) noexcept {
  sched_param parameters{};
  parameters.sched_priority = priority;
  // without permission the thread keeps its priority: reports are late on a busy machine
  static_cast<void>(::pthread_setschedparam(::pthread_self(), SCHED_FIFO, &parameters));
}

}  // namespace

Result<FalconOptions> falconOptions(const std::string& rest) {
  FalconOptions options;
  std::string file = rest;
  const std::size_t at = file.rfind('@');
  const std::size_t slash = file.rfind('/');
  if (at != std::string::npos && (slash == std::string::npos || slash < at)) {
    options.which = file.substr(at + 1);
    file.resize(at);
    if (options.which.empty())
      return Error{
          ErrorCode::kInvalidInput,
          "--device falcon" + rest + ": a serial number or bus path follows '@', as in falcon@1-4.2"};
  }
  if (file.empty()) return options;
  if (file[0] != ':' || file.size() == 1)
    return Error{
        ErrorCode::kInvalidInput,
        "--device falcon" + rest + ": the maker's firmware file follows ':', as in falcon:novint.bin"};
  options.firmware_file = file.substr(1);
  return options;
}

std::vector<FoundDevice> listFalcons() {
  const auto bus = falcon::makeUsbBus();
  auto found = bus->list();
  if (!found.ok()) return {{"falcon", "Novint Falcon", found.error().message, false}};
  if (found->empty())
    return {
        {"falcon", "Novint Falcon", "none is plugged in: connect its USB cable and its power supply", false}};
  const char* const firmware = std::getenv("NEEDLELAB_FALCON_FIRMWARE");
  const std::string text = firmware != nullptr && *firmware != '\0'
                               ? "it answers on USB; firmware, if it needs it, from " + std::string(firmware)
                               : "it answers on USB; after its power was off it needs the maker's firmware: "
                                 "falcon:FILE, or NEEDLELAB_FALCON_FIRMWARE";
  for (FoundDevice& device : *found)
    if (device.ready) device.state = text;
  return std::move(*found);
}

FalconDevice::FalconDevice(FalconOptions options) : FalconDevice(std::move(options), falcon::makeUsbBus()) {}

FalconDevice::FalconDevice(FalconOptions options, std::unique_ptr<falcon::FalconBus> bus)
    : options_(std::move(options)), bus_(std::move(bus)) {
  info_.name = "Novint Falcon" + (options_.which.empty() ? "" : " " + options_.which);
  info_.limits = falcon::kLimits;
  info_.renders_torque = false;
  info_.has_orientation = false;
  info_.max_rate_hz = falcon::kMaxRate_hz;
  info_.plunger = PlungerSource::kButtons;
  if (options_.firmware_file.empty())
    if (const char* const file = std::getenv("NEEDLELAB_FALCON_FIRMWARE"); file != nullptr)
      options_.firmware_file = file;
}

Status FalconDevice::open(double rate_hz) {
  close();
  const NumberRange allowed{1, info_.max_rate_hz};
  if (!allowed.contains(rate_hz)) return outOfRange("Falcon: rate in Hz", rate_hz, allowed);

  stop_ = false;
  answered_ = false;
  clamped_ticks_ = 0;
  placed_ = false;
  trail_ = {};
  saturated_ = stale_ticks_ = 0;
  boxes_.condition = kDeviceNotReady;
  ASSIGN_OR_RETURN(auto link, connect());

  thread_ = std::thread([this, opened = std::move(link)]() mutable { run(std::move(opened)); });
  const std::int64_t end_ns = steadyNowNs() + kFirstReport_ns;
  while (!answered_ && steadyNowNs() < end_ns) std::this_thread::sleep_for(milliseconds(1));
  if (answered_) return {};
  close();
  return Error{
      ErrorCode::kUnavailable,
      "Falcon: it does not answer on its serial line; check its power supply, unplug it from power and "
      "USB, and plug in both again"};
}

Result<std::unique_ptr<falcon::FalconLink>> FalconDevice::connect() {
  ASSIGN_OR_RETURN(auto link, bus_->open(options_.which));
  ASSIGN_OR_RETURN(const auto runs, falcon::firmwareRuns(*link, kRunsTries));
  if (!runs) RETURN_IF_ERROR(loadFirmware(*link));
  return link;
}

Status FalconDevice::loadFirmware(falcon::FalconLink& link) {
  if (options_.firmware_file.empty())
    return Error{
        ErrorCode::kInvalidInput,
        "Falcon: it has no firmware (it forgets it when its power goes) and no file is named; give the "
        "maker's firmware as --device falcon:FILE or in NEEDLELAB_FALCON_FIRMWARE. If it has run since "
        "it was plugged in, check its power supply"};
  ASSIGN_OR_RETURN(const auto bytes, falcon::readFirmware(options_.firmware_file));
  Status last;
  for (int i = 0; i < kFirmwareTries; ++i) {
    falcon::FirmwareLoader loader(link, bytes, options_.firmware_file);
    std::size_t told = 101;
    while (loader.step() && !stop_) {
      const std::size_t percent = 100 * loader.sent() / bytes.size();
      if (percent / 5 == told / 5) continue;
      told = percent;
      const std::string text = fmt::format("the Falcon's firmware is loaded: {} %", percent);
      setStatusText(text);
      if (options_.progress) options_.progress(text);
    }
    last = loader.result();
    if (last.ok() || stop_ || link.lost()) break;
  }
  if (last.ok() && stop_)
    return Error{ErrorCode::kUnavailable, "Falcon: closed while its firmware was loaded"};
  return last;
}

void FalconDevice::run(std::unique_ptr<falcon::FalconLink> link) noexcept {
  static_cast<void>(::pthread_setname_np(::pthread_self(), "falcon-usb"));
  useFifo(options_.priority);
  while (!stop_) {
    if (link) {
      runStream(*link);
      link.reset();
      if (stop_) break;
      boxes_.condition.store(kDeviceLost, std::memory_order_release);
      setStatusText("the Falcon was lost: plug in its USB and its power supply");
      bus_->waitForArrival(kBreath);
    }
    auto again = connect();
    if (again.ok()) {
      link = std::move(*again);
      continue;
    }
    setStatusText("the Falcon was lost: " + again.error().message);
    bus_->waitForArrival(kLookAgain);
  }
}

void FalconDevice::runStream(falcon::FalconLink& link) noexcept {
  falcon::Exchange exchange(link, boxes_, steadyNowNs());
  if (!link.startStream(exchange).ok()) return;
  std::int64_t tell_ns = 0;
  while (!stop_ && !link.lost()) {
    const std::int64_t now_ns = steadyNowNs();
    if (exchange.timedOut(now_ns)) break;
    link.wait(exchange.step(now_ns));
    if (exchange.counts().reports > 0) answered_ = true;
    if (now_ns >= tell_ns) {
      tell_ns = now_ns + kStatusEvery_ns;
      updateStatusText(exchange);
    }
  }
  if (!link.lost()) static_cast<void>(exchange.sendFinalCommand(kFinalCommand_ns));
  link.stopStream();
}

void FalconDevice::setStatusText(std::string text) {
  const std::scoped_lock lock(mutex_);
  status_text_ = std::move(text);
}

void FalconDevice::updateStatusText(const falcon::Exchange& exchange) {
  std::string text;
  switch (exchange.trouble()) {
    case falcon::Exchange::Trouble::kBadPackets:
      text = "the Falcon sends what cannot be read (" + std::to_string(exchange.counts().bad_packets) +
             " packets): use another USB cable or port, without a hub";
      break;
    case falcon::Exchange::Trouble::kSilent:
      text = "the Falcon does not answer: check its power supply";
      break;
    case falcon::Exchange::Trouble::kNone:
      if (!exchange.homed()) text = kHomingText;
  }
  // a reader of ordinary priority may hold the lock; the motors must not wait for it
  const std::unique_lock lock(mutex_, std::try_to_lock);
  if (!lock) return;
  status_text_ = std::move(text);
  counts_ = exchange.counts();
}

falcon::ExchangeCounts FalconDevice::counts() {
  const std::scoped_lock lock(mutex_);
  return counts_;
}

std::string FalconDevice::status() {
  const std::scoped_lock lock(mutex_);
  return status_text_;
}

DeviceRead FalconDevice::read(DeviceReading& reading) noexcept {
  falcon::TimedReport seen;
  const bool fresh = boxes_.reports.fetch(seen);
  std::uint32_t condition = boxes_.condition.load(std::memory_order_acquire);
  condition |= saturated_;
  saturated_ = 0;
  if (fresh) {
    stale_ticks_ = 0;
    reading.buttons = seen.report.bits & falcon::kInButtons;
    if ((seen.report.bits & falcon::kInHomed) != falcon::kInHomed) condition |= kDeviceNotReady;
  } else if (++stale_ticks_ > kOverrunTicks) {
    condition |= kDeviceOverrun;
  }
  // a lost device reports no buttons, so that the plunger stops
  if ((condition & (kDeviceLost | kDeviceTrouble)) != 0) reading.buttons = 0;
  reading.condition = condition;
  placed_ = placed_ && (condition & (kDeviceNotReady | kDeviceLost)) == 0;
  // without their zero the encoders give no position
  if (!fresh || (condition & (kDeviceNotReady | kDeviceLost)) != 0) return DeviceRead::kNoUpdate;

  const falcon::LegAngles theta = falcon::anglesOfEncoders(seen.report.encoder);
  const falcon::Place place = falcon::forwardKinematics(theta);
  if (place.flags != 0) clamped_ticks_.fetch_add(1, std::memory_order_relaxed);
  legs_ = falcon::legJacobian(place.p_F_m, theta);
  if (!placed_) trail_ = {};
  placed_ = true;
  reading.X_WH = {falcon::pointToW(place.p_F_m), {}};
  reading.speed_mps = speed(reading.X_WH.p, seen.at_ns);
  return DeviceRead::kFresh;
}

double FalconDevice::speed(Vec3 p_m, std::int64_t at_ns) noexcept {
  // average over eight reports: one encoder step in a single report would look like 0.04 m/s
  double speed_mps = 0;
  if (trail_.used > 0) {
    const std::size_t oldest = trail_.used < Trail::kSteps ? 0 : trail_.next;
    const double elapsed_s = 1e-9 * static_cast<double>(at_ns - trail_.at_ns[oldest]);
    // at least the time of two reports: two simultaneous reports would give an infinite speed
    speed_mps = norm(p_m - trail_.p_m[oldest]) / std::max(elapsed_s, 2e-3);
  }
  trail_.p_m[trail_.next] = p_m;
  trail_.at_ns[trail_.next] = at_ns;
  trail_.next = (trail_.next + 1) % Trail::kSteps;
  trail_.used = std::min(trail_.used + 1, Trail::kSteps);
  return speed_mps;
}

void FalconDevice::write(const GuardedWrench& at_handle_W) noexcept {
  falcon::MotorRequest request;
  if (placed_) {
    const Vec3 f_F_N = falcon::vectorToF(at_handle_W.wrench().force_N);
    const falcon::MotorUnits units = falcon::motorUnits(falcon::torquesForForce(legs_, f_F_N));
    request.motor = units.value;
    constexpr std::uint8_t kLess = falcon::kNearSingular | falcon::kTorqueLimited | falcon::kInputNotFinite;
    if ((units.flags & kLess) != 0 && normSquared(f_F_N) > 0) saturated_ = kDeviceSaturated;
  }
  boxes_.requests.publish(request);
}

void FalconDevice::close() noexcept {
  stop_ = true;
  if (thread_.joinable()) thread_.join();
  setStatusText({});
}

}  // namespace needlelab
