/// A lesson with a Virtuose in a simulated world: haptic thread, keep-alive, keeper, the vendor's library
/// with service and device behind it (tests/support/virtuose_standin), the hand, and troubles. The rules that
/// hold in every run are checked continuously.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/device/virtuose/virtuose_device.h"
#include "tests/support/virtuose_standin/control.h"
#include "tests/unit/client/device/world/virtuose_plan.h"

namespace needlelab::test {

class VirtuoseRun final : public WorldRun, private Device, private Turns {
 public:
  /// `hides` plants a bug: DeviceFlag bits that the device conceals.
  explicit VirtuoseRun(const VirtuosePlan& plan, std::uint32_t hides = 0);
  ~VirtuoseRun() override;

  /// The whole run: preparation, the lesson with its troubles, recovery, the end.
  void play();

  /// How often the device was reopened.
  [[nodiscard]] std::uint64_t reconnections() const { return reconnections_; }

 private:
  // the device, observed from both sides
  [[nodiscard]] const DeviceInfo& info() const override { return device_->info(); }
  Status open(double rate_hz) override { return device_->open(rate_hz); }
  DeviceRead read(DeviceReading& reading) noexcept override;
  void write(const GuardedWrench& at_handle_W) noexcept override;
  void maintain() override;
  [[nodiscard]] std::string status() override { return device_->status(); }
  void close() noexcept override { device_->close(); }
  // looks at the device itself each millisecond
  std::optional<std::int64_t> turn() noexcept override;
  void rest(std::int64_t until_ns) noexcept override { world.sleepUntilNs(until_ns); }

  void prepare();
  void recover();
  void end();
  void moveHand(bool inwards);
  void begin(const PlannedVirtuoseTrouble& planned);
  void finish(const PlannedVirtuoseTrouble& planned);
  void command(const char* commands, const PlannedVirtuoseTrouble& planned);
  /// For troubles that are either on or off.
  void setTruth(VirtuoseTrouble trouble, bool begins);
  void endTroubles();
  void acknowledge() override;
  /// A trouble begins or ends.
  void truthChanges();
  [[nodiscard]] bool linkIsBroken() const;
  /// The device has cut a silent connection, or is about to.
  [[nodiscard]] bool isCut() const;
  void checkFresh(const DeviceReading& reading, std::int64_t since_ns);
  void checkStale(const DeviceReading& reading, std::int64_t since_ns, bool was_broken);
  void checkTry(std::int64_t since_ns);
  void onTick();

  VirtuosePlan plan_;
  std::uint32_t hides_;
  Standin standin_;
  std::unique_ptr<VirtuoseDevice> device_;
  std::unique_ptr<RunningTurns> observer_;
  bool observer_stops_ = false;

  // the true state
  bool held_ = true, stopped_ = false, has_failure_ = false, service_runs_ = true;
  std::uint32_t buttons_ = 0;
  std::string refused_;  // the function that fails
  std::int64_t answer_ns_, link_back_ns_ = 0;
  std::int64_t maybe_left_open_until_ns_ = 0;  // until then the service may hold an old connection
  std::uint64_t truth_changes_ = 0;
  std::int64_t link_changed_ns_ = 0;

  // what the device reported and did
  std::int64_t fresh_in_a_row_ = 0, refused_in_a_row_ = 0;
  bool was_lost_ = false, was_fresh_ = false;
  std::int64_t lost_since_ns_ = 0, last_read_ns_ = 0;
  bool any_try_ = false;
  std::int64_t last_try_end_ns_ = 0;
  std::uint64_t failed_tries_ = 0, reconnections_ = 0;  // failed tries: in a row
  std::array<double, 6> last_wrench_{};                 // the last one sent
  std::int64_t last_sent_ns_ = 0;
  // faults
  bool in_fault_ = false, acknowledged_ = false;
  std::uint64_t faults_ = 0;
};

}  // namespace needlelab::test
