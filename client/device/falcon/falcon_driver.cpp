#include "client/device/falcon/falcon_driver.h"

#include <fmt/core.h>

#include <cstdlib>
#include <utility>

#include "client/device/falcon/firmware_loader.h"
#include "common/base/planted_bug.h"
#include "common/haptics/gate/force_gate.h"

namespace needlelab::falcon {
namespace {

constexpr int kFirmwareTries = 3;
constexpr int kRunsTries = 3;  // 50 ms each, before loading the firmware
constexpr std::int64_t kStatusEvery_ns = 50'000'000;

constexpr const char* kHomingText =
    "the Falcon looks for its zero: pull the grip out all the way, then push it in slowly until the light "
    "turns green";

}  // namespace

FalconDriver::FalconDriver(FalconOptions options, std::unique_ptr<FalconBus> bus, TimeSource& time)
    : options_(std::move(options)), bus_(std::move(bus)), time_(time) {
  if (options_.firmware_file.empty())
    if (const char* const file = std::getenv("NEEDLELAB_FALCON_FIRMWARE"); file != nullptr)
      options_.firmware_file = file;
}

Status FalconDriver::open() {
  stop_ = false;
  answered_ = false;
  closing_ = false;
  boxes_.condition = kDeviceNotReady;
  ASSIGN_OR_RETURN(link_, connect());
  return {};
}

Result<std::unique_ptr<FalconLink>> FalconDriver::connect() {
  ASSIGN_OR_RETURN(auto link, bus_->open(options_.which));
  ASSIGN_OR_RETURN(const auto runs, firmwareRuns(*link, kRunsTries, time_));
  if (!runs) RETURN_IF_ERROR(loadFirmware(*link));
  return link;
}

Status FalconDriver::loadFirmware(FalconLink& link) {
  if (options_.firmware_file.empty())
    return Error{
        ErrorCode::kInvalidInput,
        "Falcon: it has no firmware (it forgets it when its power goes) and no file is named; give the "
        "maker's firmware as --device falcon:FILE or in NEEDLELAB_FALCON_FIRMWARE. If it has run since "
        "it was plugged in, check its power supply"};
  ASSIGN_OR_RETURN(const auto bytes, readFirmware(options_.firmware_file));
  Status last;
  for (int i = 0; i < kFirmwareTries; ++i) {
    FirmwareLoader loader(link, bytes, options_.firmware_file, time_);
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

std::optional<std::int64_t> FalconDriver::turn() noexcept {
  if (exchange_) return stream(time_.nowNs());
  if (link_) return beginStream();
  if (stop_) return std::nullopt;
  return look();
}

void FalconDriver::rest(std::int64_t until_ns) noexcept {
  if (exchange_)
    link_->wait(until_ns);
  else
    bus_->waitForArrival(until_ns);
}

std::optional<std::int64_t> FalconDriver::look() noexcept {
  auto again = connect();
  if (again.ok()) {
    link_ = std::move(*again);
    return beginStream();
  }
  if (stop_) return std::nullopt;
  setStatusText("the Falcon was lost: " + again.error().message);
  return time_.nowNs() + (planted(PlantedBug::kRescanTooLate) ? 2 * kRescan_ns : kRescan_ns);
}

std::optional<std::int64_t> FalconDriver::beginStream() noexcept {
  const std::int64_t now_ns = time_.nowNs();
  exchange_.emplace(*link_, boxes_, now_ns);
  closing_ = false;
  tell_ns_ = 0;
  if (!link_->startStream(*exchange_).ok()) return endStream();
  return stream(now_ns);
}

std::optional<std::int64_t> FalconDriver::stream(std::int64_t now_ns) noexcept {
  if (exchange_->counts().reports > 0) answered_ = true;
  if (!closing_ && (stop_ || exchange_->timedOut(now_ns))) {
    if (stop_ && planted(PlantedBug::kNoLastCommand)) return endStream();
    closing_ = true;
    exchange_->startFinalCommand(now_ns, kFinalCommand_ns);
  }
  if (link_->lost() || (closing_ && exchange_->finalCommandOver(now_ns))) return endStream();
  const std::int64_t next_ns = exchange_->step(now_ns);
  if (!closing_ && now_ns >= tell_ns_) {
    tell_ns_ = now_ns + kStatusEvery_ns;
    updateStatusText();
  }
  return next_ns;
}

std::optional<std::int64_t> FalconDriver::endStream() noexcept {
  link_->stopStream();
  exchange_.reset();
  link_.reset();
  if (stop_) return std::nullopt;
  boxes_.condition.store(kDeviceLost, std::memory_order_release);
  setStatusText("the Falcon was lost: plug in its USB and its power supply");
  // limits how often a device that is lost again at once is opened
  return time_.nowNs() + kBreath_ns;
}

void FalconDriver::setStatusText(std::string text) {
  const std::scoped_lock lock(mutex_);
  status_text_ = std::move(text);
}

void FalconDriver::updateStatusText() {
  std::string text;
  switch (exchange_->trouble()) {
    case Exchange::Trouble::kBadPackets:
      text = fmt::format(
          "the Falcon sends what cannot be read ({} packets): use another USB cable or port, without a hub",
          exchange_->counts().bad_packets);
      break;
    case Exchange::Trouble::kSilent:
      text = "the Falcon does not answer: check its power supply";
      break;
    case Exchange::Trouble::kNone:
      if (!exchange_->homed()) text = kHomingText;
  }
  // a reader of ordinary priority may hold the lock; the motors must not wait for it
  const std::unique_lock lock(mutex_, std::try_to_lock);
  if (!lock) return;
  status_text_ = std::move(text);
  counts_ = exchange_->counts();
}

ExchangeCounts FalconDriver::counts() {
  const std::scoped_lock lock(mutex_);
  return counts_;
}

std::string FalconDriver::statusText() {
  const std::scoped_lock lock(mutex_);
  return status_text_;
}

}  // namespace needlelab::falcon
