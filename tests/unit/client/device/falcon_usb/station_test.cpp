// Tests the station itself with a Falcon, as a child process that inherits the emulated USB.
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>

#include "client/device/falcon/falcon_geometry.h"
#include "common/base/files.h"
#include "common/base/program.h"
#include "tests/integration/process.h"
#include "tests/support/stall_watch.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/client/device/falcon_usb/falcon_on_usb.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;
using Eigen::Vector3d;

constexpr double kSkin_m = 0.010;  // below the middle of the workspace
constexpr double kDeep_m = 0.015;
constexpr char kSilent[] = "the device stopped reporting";  // the watchdog's message

class StationWithFalcon : public FalconOnUsb {
 protected:
  /// A running station; its output goes to a file.
  std::unique_ptr<Process> station(const std::vector<std::string>& arguments,
                                   const std::string& log = "log") {
    return std::make_unique<Process>("needlelab-station", arguments, folder_.path() / log);
  }
  nlohmann::json row() {
    const auto text = readWholeFile(folder_.path() / "out.json");
    EXPECT_TRUE(text.ok());
    return text.ok() ? nlohmann::json::parse(*text)["rows"][0] : nlohmann::json();
  }
  std::vector<std::string> lesson(const std::string& seconds, const std::string& device = "falcon") {
    return {"--device",
            device,
            "--headless",
            "--profile",
            NEEDLELAB_SAMPLES "/shoulder-adult.json",
            "--seconds",
            seconds,
            "--placement",
            "0,0,-0.010,0,0,0,1",
            "--spool",
            folder_.path() / "spool",
            "--json",
            folder_.path() / "out.json"};
  }
  /// `bitten` counts a watchdog trip since the last `begin` and reports whether the machine was the cause.
  /// Not every stall is visible from outside, so one trip proves nothing; `giveUp` judges all trips.
  void begin() {
    (void)watch_.take();
    waited_ = waitedForCores();
  }
  void bitten() {
    const auto late = watch_.take(), waited = waitedForCores() - waited_;
    ++bites_;
    if (late > 0ms || waited > 500ms) ++excused_;
    std::cout << "no force: the machine was late by " << late.count()
              << " ms, our threads waited for a core for " << waited.count() << " ms: again\n";
  }
  /// After many trips: skips the test if the machine stalled in most of them, and fails it otherwise.
  void giveUp() const {
    if (2 * excused_ < bites_) FAIL() << "the watchdog bites, and the machine does not stand still";
    GTEST_SKIP() << "the machine stood still again and again: the watchdog bites after 20 ms";
  }
  /// Returns a station with the trainee's needle in the tissue and force on the hand. If the machine stalls
  /// for 20 ms, the watchdog trips, and this function tries again. Returns null if it never succeeds, after
  /// `giveUp` has judged that.
  std::unique_ptr<Process> stationInMidStroke(const std::vector<std::string>& arguments,
                                              const HandPath& hand) {
    for (int again = 0; again < 8; ++again) {
      begin();
      falcon_.powerCycle(true);
      falcon_.holdRigidly([path = homingPath(0.2)](double t) { return path(std::fmod(t, 0.2)); });
      auto child = station(arguments, "log-" + std::to_string(again));
      if (!waitUntil([this] { return falcon_.homed() == 7; }, 20s)) {
        ADD_FAILURE() << "not homed in 20 s: " << child->said();
        return nullptr;
      }
      falcon_.holdAt({0, 0, falcon::kOrigin_F_m.z});
      waitUntil([] { return false; }, 400ms);
      falcon_.holdRigidly(hand);
      waitUntil([&] { return falcon_.force().norm() > 0.3 || child->wait(0ms); }, 3s);
      if (falcon_.force().norm() > 0.3) return child;
      bitten();
    }
    giveUp();
    return nullptr;
  }
  /// Acts as the person at the station: takes the needle out and acknowledges each reported fault once, and
  /// once more after each "not yet". If the machine stalls for 20 ms, the watchdog can trip at any time, so
  /// there may be several faults. Returns false if a fault remains after `most`.
  bool overcomeFaults(Process& child, std::chrono::milliseconds most = 30s) {
    falcon_.holdAt({0, 0, falcon::kOrigin_F_m.z});
    waitUntil([] { return false; }, 200ms);
    return waitUntil(
        [&] {
          const std::string said = child.said();
          const std::size_t asked = timesIn(said, "FAULT: ") + timesIn(said, "not yet: ");
          if (asked > acknowledged_) child.signal(SIGUSR1);
          acknowledged_ = asked;
          const auto asked_last = std::max(lastIn(said, "FAULT: "), lastIn(said, "not yet: "));
          return std::max(lastIn(said, "the fault is over"), lastIn(said, "a FAULT, which is over")) >
                 asked_last;
        },
        most);
  }
  static std::size_t timesIn(const std::string& text, const std::string& words) {
    std::size_t times = 0;
    for (auto at = text.find(words); at != std::string::npos; at = text.find(words, at + 1)) ++times;
    return times;
  }
  /// Returns the last position of `words`, or −1 if they do not occur.
  static std::ptrdiff_t lastIn(const std::string& text, const std::string& words) {
    const auto at = text.rfind(words);
    return at == std::string::npos ? -1 : static_cast<std::ptrdiff_t>(at);
  }
  // over the skin, in, rest, and out again
  static HandPath stroke() {
    return [](double t) {
      const double down = std::clamp((t - 0.5) / 0.6, 0.0, 1.0), up = std::clamp((t - 1.6) / 0.6, 0.0, 1.0);
      return Vector3d(0, -(kSkin_m + kDeep_m) * (down - up), falcon::kOrigin_F_m.z);
    };
  }

  const TempFolder folder_;
  std::size_t acknowledged_ = 0;
  StallWatch watch_;
  std::chrono::milliseconds waited_{};
  int bites_ = 0, excused_ = 0;
};

TEST_F(StationWithFalcon, aWholeLessonInRealTime) {
  falcon_.plug();
  nlohmann::json summary;
  std::string said;
  double greatest_N = 0;
  // If the machine stalls for 20 ms, the watchdog trips, and the lesson is repeated.
  for (int again = 0;; ++again) {
    begin();
    greatest_N = 0;
    falcon_.powerCycle(true);
    falcon_.holdRigidly([path = homingPath(0.2)](double t) { return path(std::fmod(t, 0.2)); });
    const auto child = station(lesson("4"));
    ASSERT_TRUE(waitUntil([this] { return falcon_.homed() == 7; }, 20s)) << child->said();
    // a hand that gives way
    falcon_.holdAt({0, 0, falcon::kOrigin_F_m.z});
    falcon_.holdSoftly({.mass_kg = 0.25, .stiffness_N_per_m = 400, .damping_Ns_per_m = 10}, stroke());
    while (!child->wait(5ms)) greatest_N = std::max(greatest_N, falcon_.force().norm());
    said = child->said();
    summary = row();
    if (summary["fault"].is_string() && summary["fault"].get<std::string>().find(kSilent) == 0) {
      bitten();
      if (again == 7) return giveUp();
      continue;
    }
    ASSERT_EQ(child->wait(60s), kExitDone) << said;
    break;
  }
  EXPECT_TRUE(summary["fault"].is_null()) << summary["fault"] << said;
  EXPECT_EQ(summary["samples"].get<int>() + summary["missed_ticks"].get<int>(), summary["ticks"].get<int>());
  EXPECT_GE(summary["events"]["entries into the tissue"], 1) << summary;
  // the hand felt the cutting force of the layer
  EXPECT_GT(greatest_N, 0.4);
  EXPECT_LT(greatest_N, falcon::kLimits.peak_force_N);
  // The station reports the effects that this device cannot render; they are not live, and the summary lists
  // them.
  EXPECT_NE(said.find("does not measure how it is turned"), std::string::npos) << said;
  EXPECT_NE(said.find("ORIENTATION_LIMIT is not live"), std::string::npos) << said;
  EXPECT_GE(summary["device_notes"].size(), 2u) << summary["device_notes"];
  for (const auto& effect : summary["live_effects"]) EXPECT_NE(effect, "ORIENTATION_LIMIT");
  // The station leaves the device without torque.
  ASSERT_FALSE(falcon_.history().empty());
  EXPECT_EQ(falcon_.history().back().motors, (std::array<std::int16_t, 3>{}));
  EXPECT_EQ(falcon_.force().norm(), 0);
}

TEST_F(StationWithFalcon, unpluggedInMidStrokeItSaysSoAndGoesOnWhenItIsAcknowledged) {
  falcon_.plug();
  auto arguments = lesson("600");
  arguments.insert(arguments.end(), {"--on-fault", "wait"});
  const auto sink = [](double t) {
    return Vector3d(0, -(kSkin_m + kDeep_m) * std::min(1.0, t / 0.6), falcon::kOrigin_F_m.z);
  };
  const auto child = stationInMidStroke(arguments, sink);
  if (!child) return;

  falcon_.unplug();
  ASSERT_TRUE(waitUntil([&] { return timesIn(child->said(), "FAULT: ") > 0; }, 20s)) << child->said();
  falcon_.plug();
  EXPECT_TRUE(waitUntil([this] { return falcon_.port().openClients() > 0; }, 20s)) << child->said();
  EXPECT_TRUE(
      waitUntil([this, before = falcon_.commands()] { return falcon_.commands() > before + 50; }, 20s));
  EXPECT_EQ(falcon_.force().norm(), 0) << "no force before somebody has seen it";
  bool pushed = false;
  for (int again = 0; !pushed; ++again) {
    if (again == 10) return giveUp();
    begin();
    ASSERT_TRUE(overcomeFaults(*child)) << child->said();
    falcon_.holdRigidly(sink);
    // Only a new fault that is not the device's excuses the missing force.
    const auto faults = timesIn(child->said(), "FAULT: ");
    waitUntil(
        [&] {
          pushed = falcon_.force().norm() > 0.3;
          return pushed || timesIn(child->said(), "FAULT: ") > faults;
        },
        10s);
    if (pushed) break;
    const std::string said = child->said();
    ASSERT_GT(timesIn(said, "FAULT: "), faults) << "no force, and no word of it: " << said;
    ASSERT_EQ(said.find(kSilent, said.rfind("FAULT: ")), said.rfind("FAULT: ") + 7) << said;
    bitten();
  }
  EXPECT_TRUE(pushed) << child->said();

  child->signal(SIGTERM);
  ASSERT_TRUE(child->wait(20s)) << child->said();
  const nlohmann::json summary = row();
  EXPECT_GE(summary["fault_count"], 1) << summary;
  EXPECT_EQ(summary["faults"][0]["acknowledged"], true) << summary["faults"];
  EXPECT_EQ(falcon_.force().norm(), 0);
}

TEST_F(StationWithFalcon, listsWhatIsThere) {
  falcon_.plug();
  const auto child = station({"--list-devices", "--json", folder_.path() / "out.json"});
  ASSERT_EQ(child->wait(30s), kExitDone) << child->said();
  const auto text = readWholeFile(folder_.path() / "out.json");
  ASSERT_TRUE(text.ok());
  EXPECT_NE(text->find("FALCON01"), std::string::npos) << *text;
  EXPECT_EQ(falcon_.commands(), 0u);
}

TEST_F(StationWithFalcon, withoutAFalconItSaysWhatToDo) {
  const auto child = station(lesson("1"));
  EXPECT_EQ(child->wait(30s), kExitFailed) << child->said();
  EXPECT_NE(child->said().find("USB cable"), std::string::npos) << child->said();
}

TEST_F(StationWithFalcon, stoppedInMidStrokeItLeavesNoTorque) {
  falcon_.plug();
  const auto child = stationInMidStroke(lesson("20"), stroke());
  if (!child) return;
  child->signal(SIGTERM);
  ASSERT_TRUE(child->wait(20s)) << child->said();
  EXPECT_EQ(falcon_.force().norm(), 0);
}

TEST_F(StationWithFalcon, crashedInMidStrokeItLeavesNoTorque) {
  falcon_.plug();
  const auto child = stationInMidStroke(lesson("20"), stroke());
  if (!child) return;
  // The main thread must take the signal, not any free thread: the device's own thread could not send its
  // last packet.
  ASSERT_EQ(::syscall(SYS_tgkill, child->pid(), child->pid(), SIGSEGV), 0);
  const auto code = child->wait(20s);
  ASSERT_TRUE(code) << child->said();
  EXPECT_NE(*code, kExitDone);
  EXPECT_EQ(falcon_.force().norm(), 0) << child->said();
}

/// Returns the id of the thread with this name, or −1.
pid_t threadOf(pid_t process, const std::string& name) {
  for (const auto& task : std::filesystem::directory_iterator("/proc/" + std::to_string(process) + "/task")) {
    std::string found;
    std::getline(std::ifstream(task.path() / "comm"), found);
    if (found == name) return static_cast<pid_t>(std::stol(task.path().filename().string()));
  }
  return -1;
}

TEST_F(StationWithFalcon, aCrashOfTheDevicesOwnThreadLeavesNoTorque) {
  falcon_.plug();
  const auto child = stationInMidStroke(lesson("20"), [](double t) {
    return Vector3d(0, -(kSkin_m + kDeep_m) * std::min(1.0, t / 0.6), falcon::kOrigin_F_m.z);
  });
  if (!child) return;
  const pid_t thread = threadOf(child->pid(), "falcon-usb");
  ASSERT_GT(thread, 0);
  const TimePoint crash = Clock::now();
  ASSERT_EQ(::syscall(SYS_tgkill, child->pid(), thread, SIGSEGV), 0);
  const auto code = child->wait(20s);
  ASSERT_TRUE(code) << child->said();
  EXPECT_NE(*code, kExitDone);
  EXPECT_NE(child->said().find("it was told that there is no force"), std::string::npos) << child->said();
  const auto history = falcon_.history();
  ASSERT_FALSE(history.empty());
  EXPECT_EQ(history.back().motors, (std::array<std::int16_t, 3>{}));
  EXPECT_EQ(falcon_.force().norm(), 0);
  // the last packet with a force, and the packet without force from the handler
  const auto last_force = std::find_if(history.rbegin(), history.rend(), [](const CommandSeen& seen) {
    return seen.motors != std::array<std::int16_t, 3>{};
  });
  ASSERT_NE(last_force, history.rend());
  ASSERT_NE(last_force, history.rbegin());
  const TimePoint without = std::prev(last_force)->at;
  std::cout << "no force " << std::chrono::duration<double, std::milli>(without - crash).count()
            << " ms after the crash\n";
  EXPECT_LT(without - crash, 100ms) << "the machine was late by " << watch_.take().count() << " ms";
}

}  // namespace
}  // namespace needlelab::test
