/// A lesson with a Falcon in a simulated world: haptic thread, USB thread, keeper, the board behind its
/// serial line, the hand at the grip, and faults. The rules that hold in every run are checked continuously.
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
  kUnplugged,    ///< keeps its power; the haptic thread may hang at the same time
  kPowerCut,     ///< comes back without firmware and without its zero
  kBoardSilent,  ///< receives and answers nothing
  kGarbled,      ///< answers are unreadable
  kLossy,        ///< half of the packets are lost
  kZeroLost,     ///< the encoders lose their zero
  kGripJumps,    ///< the encoders are off by some millimetres
};
inline constexpr int kTroubles = 9;

struct PlannedTrouble {
  Trouble what;
  std::int64_t at_ns, lasts_ns;      ///< at_ns: from the beginning of the lesson
  std::int64_t haptic_hangs_ns = 0;  ///< at the same time
};

/// All numbers of a run.
struct FalconPlan : LessonPlan {
  std::int64_t usb_late_ns = 0;  ///< greatest lateness of the USB thread's wake-ups
  std::int64_t write_ns = 0, reply_ns = 0, reply_spread_ns = 0;
  double lost_share = 0;           ///< of commands, and of answers
  std::int64_t usb_phase_ns = 0;   ///< the haptic thread starts this much after the USB thread
  bool haptic_dies_first = false;  ///< the haptic thread hangs when the device is closed
  std::vector<PlannedTrouble> troubles;
};

/// The same seed gives the same plan on any machine.
FalconPlan falconPlanOf(std::uint64_t seed);
/// Readable text.
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
  /// Plugs the device in again and notifies the host.
  void plugIn();
  /// The hand goes in and out at constant speed, from outside to the deepest point; 0: it stays outside.
  void stroke(double stroke_s, double deepest_m = 0.014);
  /// Shifts the encoders by this many counts; 0: correct again.
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
  std::vector<Sent> sent;      ///< with `keeps_sent`: each command, received or not
  std::int64_t closed_ns = 0;  ///< when the device was closed

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

  // current faults
  bool is_lossy_ = false, is_garbled_ = false;
  std::int16_t jump_counts_ = 0;
  std::int64_t usb_hangs_ns_ = 0, greatest_usb_late_ns_ = 0;
  std::vector<std::int64_t> arrivals_ns_;

  // what the USB thread may know at this time, seen from outside
  bool homed_seen_ = false, any_request_ = false, request_waits_ = false;
  std::int64_t request_taken_ns_ = 0, last_report_ns_ = 0;
  int bad_in_a_row_ = 0, under_way_ = 0;
  std::int64_t last_sent_ns_ = 0;
  bool closing_ = false;
  std::uint64_t sent_at_the_end_ = 0;
  falcon::ExchangeCounts counts_;
};

}  // namespace needlelab::test
