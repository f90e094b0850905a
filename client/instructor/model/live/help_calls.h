/// Which stations call for help, which did, and what an instructor has seen or put off. Pure; has no clock.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace needlelab {

/// Reasons to look at a station, most urgent first.
enum class Need : std::uint8_t {
  kFault,    ///< the gate removed the force
  kAlarm,    ///< of the gesture (common/scoring/alarms/alarms.h), until acknowledged: also after the lesson
  kHand,     ///< the trainee raised a hand
  kTrouble,  ///< of the station, where it spoils lessons: disk, device, force that stutters
  kLost,     ///< went offline during a lesson
  kWaiting,  ///< online, without a lesson
  kDone,     ///< a lesson ended within kDoneLasts_s
  kPractising,  ///< a lesson without problems
  kOffline,
};
inline constexpr std::size_t kNeedCount = 9;
std::string_view nameOf(Need need);
/// "Help" is kFault … kLost.
inline bool needsHelp(Need need) {
  return need <= Need::kLost;
}

/// One call: a station's need for help, from its beginning to its end.
struct HelpCall {
  std::string station, trainee, words;  ///< the last two: the newest
  Need need = Need::kOffline;
  double since_s = 0, over_s = -1;  ///< of the view's clock; −1: not over
  bool seen = false;                ///< acknowledged
  double quiet_until_s = -1;        ///< put off until then
};

/// Thread: one. All times are the view's clock and ascend.
class HelpCalls {
 public:
  static constexpr std::size_t kMostOver = 200;  ///< the oldest are forgotten

  /// The station's need now, in words. Another need begins another call.
  void note(const std::string& station, const std::string& trainee, Need need, const std::string& words,
            double now_s);
  void acknowledge(const std::string& station);
  /// Puts the station's call off.
  void snooze(const std::string& station, double until_s);
  /// Whether the station calls, and the call was neither seen nor put off.
  [[nodiscard]] bool calls(const std::string& station, double now_s) const;
  /// Those that are not over: first those that call, most urgent first, then the oldest.
  [[nodiscard]] std::vector<const HelpCall*> open(double now_s) const;
  /// Those that are over, the newest first.
  [[nodiscard]] const std::deque<HelpCall>& over() const { return over_; }

 private:
  std::map<std::string, HelpCall> open_;  // by station
  std::deque<HelpCall> over_;
};

/// "12 s", "3 min", "2 h"
std::string agoWords(double seconds);

}  // namespace needlelab
