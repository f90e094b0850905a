// Faults of a Falcon: one row per fault, with what the device layer must do and by when, exact to the tick in
// a simulated world where nothing else is late. The rules of FalconRun and of the gate hold in every row.
#include <gmock/gmock.h>

#include <algorithm>
#include <ostream>

#include "client/device/falcon/falcon_geometry.h"
#include "common/haptics/gate/force_gate.h"
#include "tests/unit/client/device/world/falcon_run.h"

namespace needlelab::test {
namespace {

using Sent = FalconRun::Sent;
using testing::HasSubstr;

// the USB thread sends on the whole millisecond, the haptic thread ticks in the middle; an answer arrives 0.3
// ms after its command
FalconPlan exactPlan() {
  FalconPlan plan;
  plan.usb_phase_ns = kMs / 2;
  plan.write_ns = kMs / 10;
  plan.reply_ns = 3 * kMs / 10;
  return plan;
}

bool torque(const Sent& sent) {
  return sent.command.motor != Motors{};
}

/// A lesson where the hand has pushed the needle in at 35 mm/s and continues for another 0.3 s. From now on
/// each millisecond has one command and one tick.
struct FalconLesson : FalconRun {
  explicit FalconLesson(const FalconPlan& plan = exactPlan()) : FalconRun(plan) {
    keeps_sent = true;
    falcon->buttons = 1;
    begin();
    goOn(kMs / 4);
    stroke(1.6, 0.020);
    goOn(450 * kMs);
    EXPECT_GT(haptic->force_N(), 0.5);
    sent.clear();
    falcon->looks.clear();
    since_ns = world.nowNs();
  }
  ~FalconLesson() override {
    end();
    EXPECT_EQ(broken(), "");
  }
  [[nodiscard]] std::uint32_t condition() const { return haptic->reading().condition; }
  [[nodiscard]] Fault fault() const { return haptic->gate().fault(); }
  [[nodiscard]] std::int64_t msSince(std::int64_t at_ns) const { return (at_ns - since_ns + kMs - 1) / kMs; }

  std::int64_t since_ns;
};

Fate answered(std::int64_t reply_ns = 3 * kMs / 10) {
  Fate fate;
  fate.reply_ns = reply_ns;
  return fate;
}
Fate garbled() {
  Fate fate = answered();
  fate.is_garbled = true;
  return fate;
}
Fate torn() {
  Fate fate = answered();
  fate.is_torn = true;
  return fate;
}
Fate lostIf(bool is_lost) {
  Fate fate = answered();
  fate.arrives = !is_lost;
  return fate;
}

constexpr std::int64_t kNot = -1;

using Happens = std::function<void(FalconLesson&)>;

struct FalconFault {
  const char* name;
  std::int64_t lasts_ms;
  Happens begins, ends;
  // during the fault
  std::uint32_t condition = 0;    ///< of the reading at its end; without kDeviceOverrun
  std::int64_t said_ms = kNot;    ///< the first tick whose reading has the condition
  Fault fault = Fault::kNone;     ///< of the gate
  std::int64_t fault_ms = kNot;   ///< its first tick
  std::int64_t torque_ms = kNot;  ///< the last command with torque; kNot: torque continues
  const char* words = "";         ///< of the status
  const char* looks_ms = "";      ///< when it looks for a lost device
  // afterwards
  std::int64_t fresh_ms = 1;  ///< the first tick with a position
  int loads = 0, opened = 0;  ///< loads of the firmware; links opened
};

Happens fates(const std::function<Fate(int n)>& fate_of) {
  return [fate_of](FalconLesson& run) {
    run.falcon->fate = [fate_of, n = 0]() mutable { return fate_of(++n); };
  };
}
Happens silent(bool is_silent) {
  return [is_silent](FalconLesson& run) { run.falcon->silent = is_silent; };
}
Happens homed(std::uint8_t bits) {
  return [bits](FalconLesson& run) { run.falcon->homed = bits; };
}
Happens writes(std::int64_t write_ns) {
  return [write_ns](FalconLesson& run) { run.falcon->write_ns = write_ns; };
}
Happens slips(std::int16_t counts) {
  return [counts](FalconLesson& run) { run.jumpGrip(counts); };
}
void unplugs(FalconLesson& run) {
  run.falcon->unplug();
}
void plugsIn(FalconLesson& run) {
  run.plugIn();
}
void losesPower(FalconLesson& run) {
  run.falcon->unplug();
  run.falcon->forgetFirmware();
  run.falcon->homed = 0;
}

constexpr const char* kZeroWords = "pull the grip out";

void findsItsZeroAgain(FalconLesson& run) {
  run.plugIn();
  run.goOn(300 * kMs);
  EXPECT_EQ(run.condition(), std::uint32_t{kDeviceNotReady});
  EXPECT_THAT(run.device->status(), HasSubstr(kZeroWords));
  EXPECT_EQ(run.sent.back().command, (falcon::Command{{}, falcon::kOutHome | falcon::kOutRed}));
  run.falcon->homed = falcon::kInHomed;
}

std::vector<FalconFault> falconFaults() {
  const Happens answers = fates([](int) { return answered(); });
  const char* const half_seconds = "20 520 1020 1520 2020";
  const auto unsaid = [](FalconLesson& run) { run.falcon->plugged = true; };
  const auto hangs = [](FalconLesson& run) { run.haptic->hangUntil(run.since_ns + 200 * kMs); };
  const auto countedBad = [answers](FalconLesson& run) {
    EXPECT_GT(run.device->counts().bad_packets, 20u);
    answers(run);
  };
  const auto countedSilence = [](FalconLesson& run) {
    EXPECT_GT(run.device->counts().unanswered, 10u);
    EXPECT_NE(run.condition() & kDeviceOverrun, 0u);
    run.falcon->silent = false;
  };
  const auto starvedOnce = [](FalconLesson& run) { EXPECT_EQ(run.device->counts().starved_times, 1u); };
  // faults that must not be noticed: no fault, no message, the torque continues
  const auto unnoticed = [&](const char* name, Happens begins, std::int64_t fresh_ms = 1) {
    FalconFault fault{name, 60, std::move(begins), answers};
    fault.fresh_ms = fresh_ms;
    return fault;
  };
  const auto losesZeroBehindLateAnswers = [](FalconLesson& run) {
    run.falcon->homed = 0x30;
    run.falcon->fate = [] { return answered(4 * kMs); };
  };
  const auto findsZeroInTime = [answers](FalconLesson& run) {
    run.falcon->homed = falcon::kInHomed;
    answers(run);
  };
  // without an answer, two commands are sent every 7 ms
  std::vector<FalconFault> rows = {
      unnoticed("answers come in two pieces", fates([](int) { return torn(); })),
      unnoticed("answers come 1.2 ms late", fates([](int) { return answered(1'200'000); })),
      unnoticed("answers come 4 ms late", fates([](int) { return answered(4 * kMs); }), 5),
      unnoticed("each third command is lost", fates([](int n) { return lostIf(n % 3 == 0); }), 7),
      {"a write takes 3 ms", 60, writes(3 * kMs), writes(kMs / 10), 0, kNot, Fault::kNone, kNot, kNot, "", "",
       4},
      {"19 answers in a row cannot be read", 66,
       fates([](int n) { return n <= 19 ? garbled() : answered(); }), answers, 0, kNot, Fault::kDeviceSilent,
       21, 37},
      {"none can be read", 140, fates([](int) { return garbled(); }), countedBad, kDeviceTrouble, 65,
       Fault::kDeviceSilent, 21, 37, "cannot be read", "", 7},
      {"an encoder loses its zero behind late answers", 60, losesZeroBehindLateAnswers, findsZeroInTime,
       kDeviceNotReady, 5, Fault::kNone, kNot, 2, kZeroWords, "", 6},
      {"it falls silent", 400, silent(true), countedSilence, kDeviceTrouble, 106, Fault::kDeviceSilent, 21,
       37, "does not answer", "", 7},
      {"it stays silent", 1'110, silent(true), silent(false), kDeviceLost, 1'102, Fault::kDeviceSilent, 21,
       37, "plug in", "", 14, 0, 1},
      {"unplugged with its power on", 2'200, unplugs, plugsIn, kDeviceLost, 1, Fault::kDeviceLost, 1, 0,
       "plug in", half_seconds, 3, 0, 1},
      {"unplugged and its return is not said", 2'100, unplugs, unsaid, kDeviceLost, 1, Fault::kDeviceLost, 1,
       0, "plug in", half_seconds, 423, 0, 1},
      {"its power is cut", 100, losesPower, findsItsZeroAgain, kDeviceLost, 1, Fault::kDeviceLost, 1, 0,
       "plug in", "20", 2, 1, 1},
      {"the haptic thread hangs", 199, hangs, starvedOnce, 0, kNot, Fault::kNone, kNot, 21},
      {"the encoders slip by 20 mm", 60, slips(1400), slips(0), 0, kNot, Fault::kTipTooFast, 6, 25},
  };
  for (const auto& [name, bits] : {std::pair{"encoder 2 loses its zero", 0x30},
                                   {"encoder 0 does", 0x60},
                                   {"encoders 1 and 2 do", 0x10},
                                   {"all do", 0}})
    rows.push_back({name, 60, homed(static_cast<std::uint8_t>(bits)), homed(falcon::kInHomed),
                    kDeviceNotReady, 1, Fault::kNone, kNot, 1, kZeroWords});
  return rows;
}

// names a row in the list of tests
std::ostream& operator<<(std::ostream& out, const FalconFault& row) {
  return out << row.name;
}

class FalconFaults : public testing::TestWithParam<FalconFault> {};
INSTANTIATE_TEST_SUITE_P(Rows, FalconFaults, testing::ValuesIn(falconFaults()), [](const auto& row) {
  std::string name;
  for (const char c : std::string(row.param.name))
    if (std::isalnum(static_cast<unsigned char>(c)) != 0) name += c;
  return name;
});

TEST_P(FalconFaults, areReportedAndRepairedInTime) {
  const FalconFault& row = GetParam();
  FalconLesson run;
  row.begins(run);
  const int opened = run.falcon->opened;
  std::int64_t said_ms = kNot, fault_ms = kNot;
  for (std::int64_t ms = 1; ms <= row.lasts_ms; ++ms) {
    run.goOn(kMs);
    if (said_ms == kNot && row.condition != 0 && (run.condition() & row.condition) == row.condition)
      said_ms = ms;
    if (said_ms != kNot) ASSERT_EQ(run.condition() & row.condition, row.condition) << ms << ": it stays so";
    if (fault_ms == kNot && run.fault() != Fault::kNone) fault_ms = ms;
  }
  EXPECT_EQ(said_ms, row.said_ms);
  EXPECT_EQ(run.condition() & ~kDeviceOverrun, row.condition);
  EXPECT_EQ(fault_ms, row.fault_ms);
  EXPECT_EQ(run.fault(), row.fault);
  const auto last = std::find_if(run.sent.rbegin(), run.sent.rend(), torque);
  const std::int64_t last_ms = last == run.sent.rend() ? 0 : run.msSince(last->at_ns);
  if (row.torque_ms == kNot)
    EXPECT_GT(last_ms, row.lasts_ms - 10);
  else
    EXPECT_EQ(last_ms, row.torque_ms);
  const std::string words = run.device->status();
  EXPECT_THAT(words, HasSubstr(row.words));
  EXPECT_FALSE(words.ends_with('.')) << "the station continues with \": no force\"";
  const bool is_blind = (row.condition & (kDeviceLost | kDeviceTrouble)) != 0;
  EXPECT_EQ(run.haptic->reading().buttons, is_blind ? 0u : 1u) << "the plunger stops";
  std::string looks_ms;
  for (const Look& look : run.falcon->looks)
    looks_ms += (looks_ms.empty() ? "" : " ") + std::to_string(run.msSince(look.at_ns));
  EXPECT_EQ(looks_ms, row.looks_ms);

  run.sent.clear();
  row.ends(run);
  std::int64_t fresh_ms = 0;
  do run.goOn(kMs), ++fresh_ms;
  while (!run.haptic->fresh() && fresh_ms < 2'000);
  EXPECT_LE(fresh_ms, row.fresh_ms);
  EXPECT_EQ(run.falcon->loads, row.loads);
  run.goOn(50 * kMs);
  if (run.fault() != Fault::kNone)
    EXPECT_TRUE(std::none_of(run.sent.begin(), run.sent.end(), torque)) << "without an acknowledgement";
  // the hand goes outside, a person acknowledges, and the hand pushes in again
  run.stroke(0);
  run.goOn(400 * kMs);
  run.haptic->acknowledge();
  run.goOn(5 * kMs);
  EXPECT_EQ(run.fault(), Fault::kNone);
  EXPECT_EQ(run.condition() & ~kDeviceOverrun, 0u);
  EXPECT_EQ(run.device->status(), "");
  EXPECT_EQ(run.falcon->opened - opened, row.opened);
  EXPECT_EQ(run.sent.back().command.bits, falcon::kOutGreen);
  run.stroke(1.6, 0.020);
  run.goOn(500 * kMs);
  EXPECT_GT(run.haptic->force_N(), 0.3);
  EXPECT_TRUE(torque(run.sent.back()));
}

// ---- exact times

TEST(FalconWorld, oneCommandAndOneTickEveryMillisecondToTheNanosecond) {
  FalconLesson run;
  const std::uint64_t ticks = run.ticks();
  run.goOn(1'000 * kMs);
  EXPECT_EQ(run.ticks() - ticks, 1'000u);
  ASSERT_EQ(run.sent.size(), 1'000u);
  for (std::size_t i = 1; i < run.sent.size(); ++i) ASSERT_EQ(run.sent[i].at_ns - run.sent[i - 1].at_ns, kMs);
  // a thread that wakes 0.4 ms late keeps the phase
  run.sent.clear();
  run.world.wakeLate("falcon-usb", [n = 0]() mutable { return n++ < 4 ? 4 * kMs / 10 : 0; });
  run.goOn(6 * kMs);
  for (const Sent& sent : run.sent) {
    const std::int64_t phase_ns = (sent.at_ns - run.since_ns + 3 * kMs / 4) % kMs;
    EXPECT_TRUE(phase_ns == 0 || phase_ns == 4 * kMs / 10) << phase_ns;
  }
  EXPECT_EQ(run.sent.size(), 6u);
}

// ---- the end

TEST(FalconWorld, theEndAwaitsTheReplyToOneZeroTorqueCommand) {
  for (const std::int64_t reply_ns : {3 * kMs / 10, 18 * kMs / 10}) {
    FalconPlan plan = exactPlan();
    plan.reply_ns = reply_ns;
    FalconLesson run(plan);
    run.end();
    const auto isLast = [](const Sent& sent) { return sent.command == falcon::Command{}; };
    EXPECT_EQ(std::count_if(run.sent.begin(), run.sent.end(), isLast), 1);
    EXPECT_TRUE(isLast(run.sent.back()));
    EXPECT_EQ(run.closed_ns, run.sent.back().at_ns + reply_ns);
    EXPECT_EQ(run.hand.motors, Motors{});
  }
}

TEST(FalconWorld, aDeafDeviceGetsRepeatedZeroCommandsForATenthSecond) {
  FalconLesson run;
  run.falcon->silent = true;
  run.end();
  std::vector<std::int64_t> said_ns;
  for (const Sent& sent : run.sent)
    if (sent.command == falcon::Command{}) said_ns.push_back(sent.at_ns);
  ASSERT_EQ(said_ns.size(), 17u);
  for (std::size_t i = 1; i < said_ns.size(); ++i) EXPECT_EQ(said_ns[i] - said_ns[i - 1], 6 * kMs);
}

TEST(FalconWorld, endingAnUnpluggedDeviceIsImmediate) {
  FalconLesson run;
  run.falcon->silent = true;
  std::int64_t unplugged_ns = 0;
  const std::function<void()> unplugs_late = [&] {
    if (run.sent.empty() || run.sent.back().command != falcon::Command{})
      return run.world.at(run.world.nowNs() + kMs, unplugs_late);
    unplugged_ns = run.world.nowNs();
    run.falcon->unplug();
  };
  unplugs_late();
  run.end();
  EXPECT_GT(unplugged_ns, 0);
  EXPECT_EQ(run.closed_ns, unplugged_ns);
}

}  // namespace
}  // namespace needlelab::test
