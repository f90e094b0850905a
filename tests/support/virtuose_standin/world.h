/// The stand-in's device, service and link: the vendor's rules from FACTS.md, in one object.
#pragma once

#include <array>
#include <cstdint>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tests/support/virtuose_standin/plant.h"
#include "tests/support/virtuose_standin/standin.h"

namespace standin {

// the vendor's codes and modes used by both rule files
inline constexpr int kInvalidContext = 3, kImpedance = 3;

/// A connection, as seen by the library and the service.
struct Context {
  enum class State {
    kFree,
    kOpen,
    kCut,
    kLeftOpen
  };  // kLeftOpen: closed here, but the service does not know it yet
  State state = State::kFree;
  int error = 0;
  int indexing = 0, command_type = 0;
  double timeout_s = 1, last_update_s = 0;
  float max_force_N = 15, max_torque_Nm = 1.2f;  // limits of the motors
  bool permits_power = false;
};

/// Allows one exchange per millisecond (5 % more, so that a burst is forgotten), and a short burst so that a
/// late caller can catch up. The tolerance is ours: the vendor only says "one a millisecond at most".
class ExchangeRule {
 public:
  /// False: too fast.
  bool take(double now_s);

 private:
  static constexpr double kMost = 4, kRate_hz = 1050;
  double left_ = kMost, last_s_ = 0;
};

struct Event {
  double time_s;
  std::string command;
};

/// Thread: any, one at a time under `worldMutex`.
class World {
 public:
  void reset();
  void useVirtualTime(bool on);
  void useTime(const StandinTime& time);
  void advance(double seconds);
  bool command(const std::string& line);
  int script(const std::string& text);
  void tell(StandinState& state);
  [[nodiscard]] const std::string& calls() const { return calls_; }
  [[nodiscard]] const std::string& complaints() const { return complaints_; }

  // ---- for the vendor's functions
  /// Advances the time to now.
  void catchUp();
  /// Null with the code in openError().
  Context* open();
  [[nodiscard]] int openError() const { return open_error_; }
  /// The context behind a pointer, or null.
  Context* find(void* pointer);
  /// How long a call waits for its answer, at most its time-out. In virtual time it does not wait.
  [[nodiscard]] double waitOf(const Context& context, const char* call) const;
  /// The time to wait in.
  [[nodiscard]] StandinTime time() const { return time_; }
  /// Checks that the call gets an answer, after its wait: 0 or an error code.
  int arrives(Context& context, const char* call);
  /// Records the call and its result; returns 0 or −1.
  int answer(Context* context, const char* call, int error, bool sets);
  int close(Context& context);
  /// The watchdog runs once a command type is chosen.
  void startWatching(Context& context) const { context.last_update_s = now_s_; }
  void setForce(Context& context, const float wrench[6]);
  /// Both return 0.
  int readPose(const Context& context, float pose[7]);
  int readSpeed(float speed[6]) const;
  [[nodiscard]] bool isPowered() const;
  [[nodiscard]] bool isHeld() const { return sensor_; }
  [[nodiscard]] bool isStopped() const { return stopped_; }
  [[nodiscard]] unsigned alarms() const;
  [[nodiscard]] unsigned failures() const { return failures_; }
  [[nodiscard]] bool button(int number) const { return buttons_[static_cast<std::size_t>(number)]; }

 private:
  void millisecond();
  void watch();
  void render();
  void index();
  void runScript();
  [[nodiscard]] const Context* active() const;
  [[nodiscard]] int refusalOf(const char* call) const;
  void countRead();
  void count(ExchangeRule& rule);
  static void remember(std::string& list, std::string_view word);

  Plant plant_;
  std::array<Context, 64> contexts_{};
  int open_error_ = 0;
  bool virtual_time_ = false, started_ = false;
  StandinTime time_{};
  double start_s_ = 0, now_s_ = 0;
  std::int64_t cycles_ = 0, first_read_cycle_ = -1;
  std::vector<Event> events_;
  std::size_t next_event_ = 0;

  bool switch_ = true, sensor_ = true, stopped_ = false, daemon_ = true, right_version_ = true;
  double link_back_s_ = 0, slow_s_ = 0;
  std::array<bool, 4> buttons_{};
  bool forced_overheat_ = false, hot_ = false, saturated_ = false;
  unsigned more_alarms_ = 0, failures_ = 0;
  double heat_N2_ = 0, overrun_until_s_ = 0;
  double turn_scale_ = 1;
  Vec3 shift_;  // offset of the reported position by indexing
  Vec3 frozen_;
  bool indexing_ = false;

  std::array<double, 6> commanded_{}, next_{}, felt_{};
  ExchangeRule set_rule_, get_rule_;
  long exchanges_ = 0, overruns_ = 0, openings_ = 0;
  std::vector<std::pair<std::string, int>> failing_;
  std::string calls_, complaints_;
};

World& world();
std::mutex& worldMutex();

}  // namespace standin
