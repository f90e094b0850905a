// A real disk that is full or read-only: a small file system in a mount namespace of its own.
#include <gmock/gmock.h>

#include "common/base/program.h"
#include "tests/integration/lab.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using testing::Not;

// runs a command in its own mount namespace
constexpr const char* kPrivateMounts = NEEDLELAB_SOURCE "/tests/support/private_mounts";

class OfflineDiskTest : public testing::Test {
 protected:
  void SetUp() override {
    Process probe(kPrivateMounts, {"sh", "-c", "mount -t tmpfs tmpfs /mnt && umount /mnt"},
                  lab_.path("probe.log"));
    if (probe.wait() != 0) GTEST_SKIP() << "no mount namespaces here: " << probe.said();
    lab_.startServer();
    std::filesystem::create_directory(lab_.path("disk"));
  }

  // A lesson on a disk of 600 KiB. `script` runs beside it in the same namespace once the session has begun;
  // it may use fill and $disk. At the end the disk's content is copied to left/.
  std::unique_ptr<Process> lessonOnSmallDisk(const std::string& name, const std::string& seconds,
                                             const std::string& script) {
    std::string command = quoted(std::string(NEEDLELAB_BIN) + "/needlelab-station");
    for (const auto& argument :
         lab_.stationArguments({"--exercise", "ball-free-practice", "--seconds", seconds, "--hand-repeat",
                                "0", "--drain", "3", "--json", lab_.path(name + ".json")},
                               lab_.path("disk")))
      command += " " + quoted(argument);
    const std::string shell = "disk=" + quoted(lab_.path("disk")) + "\n" +
                              "mount -t tmpfs -o size=600k tmpfs \"$disk\" || exit 99\n"
                              "fill() { cat /dev/zero >\"$disk/ballast\" 2>/dev/null; }\n" +
                              command +
                              " &\nstation=$!\n"
                              "until cat \"$disk\"/*/tail 2>/dev/null | grep -q .; do sleep 0.05; done\n" +
                              script + "\nwait $station\ncode=$?\nrm -f \"$disk/ballast\"\ncp -r \"$disk\" " +
                              quoted(lab_.path("left")) + "\numount \"$disk\"\nexit $code\n";
    return std::make_unique<Process>(kPrivateMounts, std::vector<std::string>{"/bin/sh", "-c", shell},
                                     lab_.path(name + ".log"));
  }
  static std::string quoted(const std::string& text) {
    std::string out = "'";
    for (const char c : text) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
    return out + "'";
  }
  // the station's trouble texts shown to instructors until it ends
  std::vector<std::string> troublesUntil(Process& station, std::optional<int>& code,
                                         std::chrono::seconds limit) {
    std::vector<std::string> troubles;
    auto viewer = lab_.instructor();
    EXPECT_TRUE(viewer.ok());
    pb::Envelope subscribe;
    subscribe.mutable_subscribe()->set_subscription(1);
    subscribe.mutable_subscribe()->set_station("station-1");
    EXPECT_TRUE(viewer->send(subscribe).ok());
    const auto end = std::chrono::steady_clock::now() + limit;
    while (!(code = station.wait(0ms)) && std::chrono::steady_clock::now() < end) {
      auto got = viewer->receive(50ms);
      if (got.ok() && got->has_station_status() &&
          (troubles.empty() || troubles.back() != got->station_status().trouble()))
        troubles.push_back(got->station_status().trouble());
    }
    return troubles;
  }
  Lab lab_;
};

TEST_F(OfflineDiskTest, aDiskThatIsFullForAWhileLosesNothing) {
  auto station = lessonOnSmallDisk("lesson", "7", "sleep 1; fill; sleep 2.5; rm \"$disk/ballast\"");
  std::optional<int> code;
  const auto troubles = troublesUntil(*station, code, 90s);
  ASSERT_EQ(code, kExitDone) << station->said();
  EXPECT_THAT(station->said(), AllOf(HasSubstr("the spool's disk refuses"), HasSubstr("No space left"),
                                     HasSubstr("the lesson continues"), HasSubstr("takes samples again")));
  EXPECT_THAT(troubles,
              testing::Contains(AllOf(HasSubstr("the spool's disk refuses"), HasSubstr("wait in memory"))))
      << "the instructor sees it";
  const auto summary = lab_.summary("lesson");
  EXPECT_GT(summary["disk_errors"], 0);
  EXPECT_EQ(summary["samples_lost"], 0);
  EXPECT_EQ(summary["state"], "COMPLETE");
  EXPECT_EQ(summary["samples_acked"], summary["samples"]);
  EXPECT_EQ(summary["ticks"], 7000) << "the loop never waited for the disk";
  EXPECT_EQ(summary["fault"], nullptr);
  const StoredSession stored = lab_.stored(summary["session_id"]);
  EXPECT_EQ(stored.samples.size(), summary["samples"]);
  EXPECT_TRUE(lab_.verifies(summary["session_id"]));
}

TEST_F(OfflineDiskTest, samplesLostToAFullDiskAreCountedAndReported) {
  auto station = lessonOnSmallDisk("lesson", "5", "sleep 1.5; fill");
  std::optional<int> code;
  const auto troubles = troublesUntil(*station, code, 90s);
  ASSERT_EQ(code, kExitFailed) << "a loss is not a success\n" << station->said();
  const auto summary = lab_.summary("lesson");
  const std::uint64_t samples = summary["samples"], lost = summary["samples_lost"];
  ASSERT_GT(lost, 1000u);
  ASSERT_LT(lost, samples);
  const std::string loss = std::to_string(lost) + " samples from tick ";
  EXPECT_THAT(station->said(), HasSubstr("LOST         " + loss));
  EXPECT_EQ(summary["ticks"], 5000);
  EXPECT_NE(summary["state"], "COMPLETE");

  // the next start, with free space, uploads the recorded samples; the server knows the missing ones
  const std::string id = summary["session_id"];
  const auto arguments = lab_.stationArguments(
      {"--exercise", "ball-free-practice", "--seconds", "0.3", "--drain", "30"}, lab_.path("left"));
  Process next("needlelab-station", arguments, lab_.path("next.log"));
  ASSERT_EQ(next.wait(), kExitDone) << next.said();
  const StoredSession stored = lab_.stored(id);
  EXPECT_EQ(stored.info.state(), pb::SESSION_INTERRUPTED);
  EXPECT_EQ(stored.samples.size() + lost, samples);
  EXPECT_TRUE(lab_.verifies(id));
  // and `session show` reports it
  ASSERT_EQ(lab_.stopServer(), kExitDone);
  Process show("needlelab-admin", {"--data", lab_.path("data"), "session", "show", id},
               lab_.path("show.log"));
  ASSERT_EQ(show.wait(), kExitDone) << show.said();
  EXPECT_THAT(show.said(), AllOf(HasSubstr("interrupted"), HasSubstr("station station-1"), HasSubstr(loss)));
  // both name the first lost tick: the one after the stored ticks, not counting those that the loop missed
  const std::uint64_t missed = summary["missed_ticks"], next_tick = stored.samples.back().tick + 1;
  for (const std::string& said : {show.said(), station->said()}) {
    const std::uint64_t first_lost = std::stoull(said.substr(said.find(loss) + loss.size()));
    EXPECT_GE(first_lost, next_tick) << said;
    EXPECT_LE(first_lost, next_tick + missed) << said;
  }
}

TEST_F(OfflineDiskTest, anUnwritableSpoolIsReportedBeforeTheLesson) {
  const std::string disk = quoted(lab_.path("disk"));
  Process station(kPrivateMounts,
                  {"/bin/sh", "-c",
                   "mount -t tmpfs -o ro tmpfs " + disk + " && " +
                       quoted(std::string(NEEDLELAB_BIN) + "/needlelab-station") + " --profile " +
                       quoted(NEEDLELAB_SAMPLES "/knee-adult.json") + " --headless --seconds 0.2 --spool " +
                       disk + "/spool; code=$?; umount " + disk + "; exit $code"},
                  lab_.path("readonly.log"));
  EXPECT_EQ(station.wait(), kExitFailed) << station.said();
  EXPECT_THAT(station.said(), AllOf(HasSubstr("spool"), HasSubstr("Read-only file system")));
}

}  // namespace
}  // namespace needlelab::test
