#include "client/device/falcon/falcon_device.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <utility>

#include "client/device/falcon/falcon_geometry.h"
#include "client/device/falcon/falcon_link.h"
#include "common/base/range.h"
#include "common/haptics/gate/force_gate.h"

namespace needlelab {
namespace {

constexpr std::int64_t kFirstReport_ns = 1'000'000'000;
/// More ticks without a new report than the drift of two clocks explains.
constexpr std::uint32_t kOverrunTicks = 5;

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

FalconDevice::FalconDevice(FalconOptions options, std::unique_ptr<falcon::FalconBus> bus, TimeSource& time,
                           TurnRunner& threads)
    : priority_(options.priority), time_(time), threads_(threads), driver_(options, std::move(bus), time) {
  info_.name = "Novint Falcon" + (options.which.empty() ? "" : " " + options.which);
  info_.limits = falcon::kLimits;
  info_.renders_torque = false;
  info_.has_orientation = false;
  info_.max_rate_hz = falcon::kMaxRate_hz;
  info_.plunger = PlungerSource::kButtons;
}

Status FalconDevice::open(double rate_hz) {
  close();
  const NumberRange allowed{1, info_.max_rate_hz};
  if (!allowed.contains(rate_hz)) return outOfRange("Falcon: rate in Hz", rate_hz, allowed);

  clamped_ticks_ = 0;
  placed_ = false;
  trail_ = {};
  saturated_ = stale_ticks_ = 0;
  RETURN_IF_ERROR(driver_.open());

  running_ = threads_.start(driver_, {"falcon-usb", priority_});
  const std::int64_t end_ns = time_.nowNs() + kFirstReport_ns;
  while (!driver_.answered() && time_.nowNs() < end_ns) time_.sleepForNs(1'000'000);
  if (driver_.answered()) return {};
  close();
  return Error{
      ErrorCode::kUnavailable,
      "Falcon: it does not answer on its serial line; check its power supply, unplug it from power and "
      "USB, and plug in both again"};
}

DeviceRead FalconDevice::read(DeviceReading& reading) noexcept {
  falcon::TimedReport seen;
  const bool fresh = driver_.boxes().reports.fetch(seen);
  std::uint32_t condition = driver_.boxes().condition.load(std::memory_order_acquire);
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
  driver_.boxes().requests.publish(request);
}

void FalconDevice::close() noexcept {
  driver_.stop();
  running_.reset();
  driver_.setStatusText({});
}

}  // namespace needlelab
