/// A lesson with a Falcon in a simulated world: haptic thread, USB thread, keeper, the board behind its
/// serial line, the hand at the grip, and what goes wrong. Rules that hold in every run are checked all the
/// time.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/device/falcon/falcon_device.h"
#include "tests/support/falcon_emulator/direct_link.h"
#include "tests/support/falcon_emulator/falcon_grip.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/client/device/world/world_run.h"

namespace needlelab::test {

enum class Trouble : std::uint8_t {
  kHapticHangs,  ///< for `lasts_ns`
  kUsbHangs,     ///< the USB thread, once, for `lasts_ns`
  kUnplugged,    ///< keeps its power; at the same time the haptic thread may hang
  kPowerCut,     ///< comes back without firmware and without its zero
  kBoardSilent,  ///< hears and answers nothing
  kGarbled,      ///< answers cannot be read
  kLossy,        ///< half of the packets are lost
  kZeroLost,     ///< the encoders do not know their zero
  kGripJumps,    ///< the encoders are off by some millimetres
};
inline constexpr int kTroubles = 9;

struct PlannedTrouble {
  Trouble what;
  std::int64_t at_ns, lasts_ns;      ///< from the beginning of the lesson
  std::int64_t haptic_hangs_ns = 0;  ///< at the same time
};

/// All numbers of a run.
struct FalconPlan : LessonPlan {
  std::int64_t usb_late_ns = 0;  ///< greatest lateness of the USB thread's wake-ups
  std::int64_t write_ns = 0, reply_ns = 0, reply_spread_ns = 0;
  double lost_share = 0;           ///< of commands, and of answers
  std::int64_t usb_phase_ns = 0;   ///< the haptic thread begins so much after the USB thread
  bool haptic_dies_first = false;  ///< it hangs when the device is closed
  std::vector<PlannedTrouble> troubles;
};

/// The same seed, the same plan, on any machine.
FalconPlan falconPlanOf(std::uint64_t seed);
/// For a person.
std::string textOf(const FalconPlan& plan);

class FalconRun : public WorldRun {
 public:
  explicit FalconRun(const FalconPlan& plan, double gate_rate_hz = 1000);
  ~FalconRun() override;

  /// Opens the device and starts the threads.
  void begin();
  /// The whole run: the troubles, recovery, the end.
  void play();
  void goOn(std::int64_t for_ns) { world.sleepForNs(for_ns); }
  /// The device is plugged in again, and the host is told.
  void plugIn();
  /// The hand goes in and out at constant speed, from outside to the deepest place; 0: it stays outside.
  void stroke(double stroke_s, double deepest_m = 0.014);
  /// The encoders slip by so much; 0: they are right again.
  void jumpGrip(std::int16_t counts) { jump_counts_ = counts; }
  /// Ends all threads and closes the device.
  void end();

  struct Sent {
    std::int64_t at_ns;
    falcon::Command command;
  };
  std::shared_ptr<DirectFalcon> falcon = std::make_shared<DirectFalcon>();
  FalconGrip hand;
  std::unique_ptr<FalconDevice> device;
  bool keeps_sent = false;
  std::vector<Sent> sent;      ///< with `keeps_sent`: each command, heard or not
  std::int64_t closed_ns = 0;  ///< the device was closed

 private:
  Fate fateOfPacket();
  void trouble(const PlannedTrouble& planned);
  void onStream();
  void onSend(const falcon::Command& command, std::int64_t now_ns);
  void onCommand(const falcon::Command& command, std::int64_t now_ns);
  void onReply(const std::optional<falcon::Report>& report, std::int64_t now_ns);
  void onTick();
  void checkCounts();
  void checkLooks();

  FalconPlan plan_;
  TempFolder folder_;

  // what the run is in
  bool is_lossy_ = false, is_garbled_ = false;
  std::int16_t jump_counts_ = 0;
  std::int64_t usb_hangs_ns_ = 0, greatest_usb_late_ns_ = 0;
  std::vector<std::int64_t> arrivals_ns_;

  // what the USB thread may know at a time, seen from outside
  bool homed_seen_ = false, any_request_ = false, request_waits_ = false;
  std::int64_t request_taken_ns_ = 0, last_report_ns_ = 0;
  int bad_in_a_row_ = 0, under_way_ = 0;
  std::int64_t last_sent_ns_ = 0;
  bool closing_ = false;
  std::uint64_t sent_at_the_end_ = 0;
  falcon::ExchangeCounts counts_;
};

}  // namespace needlelab::test
