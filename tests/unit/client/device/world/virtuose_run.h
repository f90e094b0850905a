/// A lesson with a Virtuose in a simulated world: haptic thread, keep-alive, keeper, the vendor's library
/// with service and device behind it (tests/support/virtuose_standin), the hand, and what goes wrong. Rules
/// that hold in every run are checked all the time.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/device/virtuose/virtuose_device.h"
#include "tests/support/device_world.h"
#include "tests/support/gate_rules.h"
#include "tests/support/haptic_thread.h"
#include "tests/support/virtuose_standin/control.h"

namespace needlelab::test {

enum class VirtuoseTrouble : std::uint8_t {
  kHapticHangs,
  kLinkDown,        ///< nothing arrives, no call is answered
  kServiceStopped,  ///< and is started again
  kSlow,            ///< each call takes `amount` ms, perhaps longer than its time-out
  kReleased,        ///< the dead-man sensor feels no hand
  kEmergencyStop,   ///< afterwards it is released, and the power switch is pressed
  kSwitchedOff,
  kOverheated,
  kFailure,  ///< the device reports one
  kRefused,  ///< one function fails with one code, both chosen by `amount`
  kBadTurn,  ///< quaternions that are no rotations
  kJump,     ///< the handle, by `amount` mm
  kButton,   ///< number 1-3 is pressed: no trouble, but to be reported
};
inline constexpr int kVirtuoseTroubles = 13;

struct PlannedVirtuoseTrouble {
  VirtuoseTrouble what;
  std::int64_t at_ns, lasts_ns;  ///< from the beginning of the lesson
  int amount = 0;
};

/// All numbers of a run. As it is: all is well and nothing is late.
struct VirtuosePlan {
  std::uint64_t seed = 0;
  std::int64_t tick_late_ns = 0, keeper_late_ns = 0;  ///< greatest lateness of each wake-up
  std::int64_t answer_ns = 0;                         ///< time that each call takes
  std::int64_t prepare_ns = 0;                        ///< the device is open, and no loop runs
  std::int64_t lasts_ns = 0;
  std::int64_t acknowledged_every_ns = 0;  ///< by a person; 0: never
  double stroke_s = 1, deepest_m = 0.015;  ///< of the hand, in and out
  bool six_layers = false;
  bool ends_in_trouble = false;  ///< the device is closed as it is
  std::vector<PlannedVirtuoseTrouble> troubles;
};

/// The same seed, the same plan, on any machine.
VirtuosePlan virtuosePlanOf(std::uint64_t seed);
/// For a person.
std::string textOf(const VirtuosePlan& plan);

class VirtuoseRun final : private Device, private Turns {
 public:
  /// `gate_rate_hz`: what the gate takes the rate for; other values than 1000 plant a bug. So does `hides`:
  /// DeviceFlag bits that the device conceals.
  explicit VirtuoseRun(const VirtuosePlan& plan, double gate_rate_hz = 1000, std::uint32_t hides = 0);
  ~VirtuoseRun() override;
  VirtuoseRun(const VirtuoseRun&) = delete;
  VirtuoseRun& operator=(const VirtuoseRun&) = delete;

  /// The whole run: preparation, the lesson with its troubles, recovery, the end.
  void play();

  /// The first broken rule with its time; empty: none.
  [[nodiscard]] const std::string& broken() const { return broken_; }
  /// Of all ticks and tries: equal runs have equal ones.
  [[nodiscard]] std::uint64_t trace() const { return trace_; }
  [[nodiscard]] std::uint64_t ticks() const { return ticks_; }
  /// How often the device was opened anew.
  [[nodiscard]] std::uint64_t reconnections() const { return reconnections_; }

 private:
  // the device, watched from both sides
  [[nodiscard]] const DeviceInfo& info() const override { return device_->info(); }
  Status open(double rate_hz) override { return device_->open(rate_hz); }
  DeviceRead read(DeviceReading& reading) noexcept override;
  void write(const GuardedWrench& at_handle_W) noexcept override;
  void maintain() override;
  [[nodiscard]] std::string status() override { return device_->status(); }
  void close() noexcept override { device_->close(); }
  // each millisecond somebody looks at the device itself
  std::optional<std::int64_t> turn() noexcept override;
  void rest(std::int64_t until_ns) noexcept override { world_.sleepUntilNs(until_ns); }

  void breakRule(const std::string& what);
  void fold(std::uint64_t value);
  void prepare();
  void recover();
  void end();
  void moveHand(bool inwards);
  void begin(const PlannedVirtuoseTrouble& planned);
  void finish(const PlannedVirtuoseTrouble& planned);
  void endTroubles();
  void acknowledge();
  /// A trouble begins or ends.
  void truthChanges();
  [[nodiscard]] std::int64_t now() const { return world_.nowNs(); }
  [[nodiscard]] bool linkIsBroken() const;
  /// The device has cut a silent connection, or is about to.
  [[nodiscard]] bool isCut() const;
  void checkFresh(const DeviceReading& reading, std::int64_t since_ns);
  void checkStale(const DeviceReading& reading, std::int64_t since_ns, bool was_broken);
  void checkTry(std::int64_t since_ns);
  void onTick();

  VirtuosePlan plan_;
  std::uint32_t hides_;
  mutable DeviceWorld world_;  // nowNs is not const
  Random random_;
  Standin standin_;
  SceneModel model_;
  std::unique_ptr<VirtuoseDevice> device_;
  std::unique_ptr<HapticThread> haptic_;
  std::unique_ptr<GateRules> rules_;
  std::unique_ptr<DeviceMaintenance> keeper_;
  std::unique_ptr<RunningTurns> haptic_thread_, observer_;
  bool observer_stops_ = false;

  // the truth
  bool held_ = true, stopped_ = false, has_failure_ = false, service_runs_ = true;
  std::uint32_t buttons_ = 0;
  std::string refused_;  // the function that fails
  std::int64_t answer_ns_, link_back_ns_ = 0;
  std::int64_t maybe_left_open_until_ns_ = 0;  // until then the service may hold an old connection
  std::uint64_t truth_changes_ = 0;
  std::int64_t link_changed_ns_ = 0;

  // what the device said and did
  std::int64_t fresh_in_a_row_ = 0, refused_in_a_row_ = 0;
  bool was_lost_ = false, was_fresh_ = false;
  std::int64_t lost_since_ns_ = 0, last_read_ns_ = 0;
  bool any_try_ = false;
  std::int64_t last_try_end_ns_ = 0;
  std::uint64_t failed_tries_ = 0, reconnections_ = 0;  // the former in a row
  std::array<double, 6> last_wrench_{};                 // that was sent
  std::int64_t last_sent_ns_ = 0;
  // faults
  bool in_fault_ = false, acknowledged_ = false;
  std::uint64_t faults_ = 0;

  std::string broken_;
  std::uint64_t trace_ = 0xcbf29ce484222325ull, ticks_ = 0;
};

}  // namespace needlelab::test
