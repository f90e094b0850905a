#include "client/station/run/black_box_writer.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <chrono>
#include <thread>

#include "client/station/run/black_box_csv.h"
#include "common/base/csv.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/client/station/run/loop_fixture.h"

namespace needlelab::test {
namespace {

using testing::HasSubstr;

class BlackBoxWriterTest : public LoopFixture {
 protected:
  void say(const std::string& text) { said_ += text + "\n"; }  // read when the writer has finished
  BlackBoxWriter writer(BlackBox& box) {
    return BlackBoxWriter(box, folder_.path() / "black-box", "session",
                          [this](const std::string& text) { say(text); });
  }
  TempFolder folder_;
  std::string said_;
};

// silent for 30 ms, and again 1.5 s later; outside the tissue after the first time
FakeDevice::Script twoStops() {
  return [](std::uint64_t tick, DeviceReading& reading) {
    goingDown(0.002, kRate)(tick, reading);
    reading.speed_mps = 0.25;
    if ((tick >= 2500 && tick < 2530) || (tick >= 4000 && tick < 4030)) return DeviceRead::kNoUpdate;
    if (tick >= 2600) reading.X_WH.p.z = 5e-3;
    return DeviceRead::kFresh;
  };
}

TEST_F(BlackBoxWriterTest, theLoopsFaultsBecomeFilesWithEverythingInThem) {
  BlackBox box(kRate);
  auto files = writer(box);
  FakeDevice device(twoStops());
  device.on_write = [&](std::uint64_t tick) {
    if (tick != 2700) return;
    loop_->acknowledge();
    // virtual time is faster than any disk
    for (int i = 0; i < 2000 && files.counts().files == 0; ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
  };
  clock_.read_cost_ns = 1000;
  clock_.late_ns[2400] = 3 * kTick_ns + 1;
  ServoSettings settings{kRate, {}, 5000, FaultPolicy::kWait};
  settings.black_box = &box;
  run(device, settings);
  files.finish();

  EXPECT_EQ(files.counts().files, 2u);
  EXPECT_EQ(files.counts().triggers, 2u);
  EXPECT_EQ(files.counts().not_written + files.counts().not_kept + files.counts().ticks_refused, 0u);
  const auto first = folder_.path() / "black-box" / "session-01.csv";
  EXPECT_THAT(said_, HasSubstr("black box 1: the device stopped reporting its position, at tick 2520"));
  EXPECT_THAT(said_, HasSubstr(first.string()));
  EXPECT_THAT(said_, HasSubstr("black box 2"));

  const auto table =
      readCsv(first, {"tick", "missed_before", "due_ns", "late_ns", "engine_ns", "fresh", "handle_speed_mps",
                      "p_WH_z_m", "p_WT_z_m", "q_WH_x", "wanted_force_W_z_N", "rendered_force_W_z_N",
                      "depth_m", "fault", "flags", "record_ns"});
  ASSERT_TRUE(table.ok()) << table.error().message;
  const auto at = [&](const char* name, std::size_t row) {
    return table->columns[static_cast<std::size_t>(table->find(name))][row];
  };
  // 2 s of ticks that ran, the fault's own, and 50 after it
  ASSERT_EQ(table->rows(), 2051u);
  const std::size_t fault = 2000;
  EXPECT_EQ(at("tick", fault), 2520);
  EXPECT_EQ(at("fault", fault - 1), 0);
  EXPECT_EQ(at("fault", fault), static_cast<double>(Fault::kDeviceSilent));
  EXPECT_EQ(at("fresh", fault), 0);
  EXPECT_EQ(at("handle_speed_mps", 100), 0.25);
  for (std::size_t row = 1; row < table->rows(); ++row)
    ASSERT_EQ(at("tick", row), at("tick", row - 1) + 1 + at("missed_before", row));
  EXPECT_EQ(at("tick", 2000 - 117), 2403);
  EXPECT_EQ(at("missed_before", 2000 - 117), 3);
  EXPECT_GE(at("late_ns", 2000 - 117), 3e6);
  // the same numbers as in the recording, bit by bit
  for (std::size_t row = 0; row < table->rows(); ++row) {
    const auto sample = std::find_if(samples_.begin(), samples_.end(), [&](const GestureSample& s) {
      return static_cast<double>(s.tick) == at("tick", row);
    });
    ASSERT_NE(sample, samples_.end());
    ASSERT_EQ(sample->p_WT_m[2], at("p_WT_z_m", row));
    ASSERT_EQ(sample->force_W_N[2], at("rendered_force_W_z_N", row));
    ASSERT_EQ(static_cast<double>(sample->flags), at("flags", row));
    ASSERT_EQ(static_cast<double>(sample->time_ns), at("due_ns", row));
    ASSERT_EQ(static_cast<double>(sample->engine_ns), at("engine_ns", row));
  }
  // it shows what the engine would have rendered, and what the gate left of it
  EXPECT_GT(at("wanted_force_W_z_N", fault + 30), 0.5);
  EXPECT_EQ(at("rendered_force_W_z_N", fault + 30), 0);
}

TEST_F(BlackBoxWriterTest, aStormOfMissedTicksIsKeptToo) {
  BlackBox box(kRate);
  auto files = writer(box);
  FakeDevice device(goingDown(0.002, kRate));
  clock_.late_ns[500] = 40 * kTick_ns;
  ServoSettings settings{kRate, {}, 1000};
  settings.black_box = &box;
  EXPECT_EQ(run(device, settings).faults, 0u);
  files.finish();
  EXPECT_EQ(files.counts().files, 1u);
  EXPECT_THAT(said_, HasSubstr("20 ms of ticks were missed"));
}

TEST_F(BlackBoxWriterTest, anUnwritableFolderIsSaidAndCountedAndTheLoopGoesOn) {
  folder_.write("black-box", "a file is in the way");
  BlackBox box(kRate);
  auto files = writer(box);
  FakeDevice device(twoStops());
  ServoSettings settings{kRate, {}, 5000, FaultPolicy::kWait};
  settings.black_box = &box;
  EXPECT_EQ(run(device, settings).samples, 5000u);
  files.finish();
  EXPECT_EQ(files.counts().files, 0u);
  EXPECT_EQ(files.counts().not_written, 1u);
  EXPECT_THAT(said_, HasSubstr("it is not kept: "));
}

TEST_F(BlackBoxWriterTest, aStormOfFaultsLosesNothingSilently) {
  // a jump every 60 ms, acknowledged and outside each time: dozens of faults
  FakeDevice device([](std::uint64_t tick, DeviceReading& reading) {
    reading.X_WH = {{0, 0, 5e-3}, {1, 0, 0, 0}};
    reading.speed_mps = tick % 60 == 59 ? 100 : 0;
    return DeviceRead::kFresh;
  });
  device.on_write = [&](std::uint64_t) { loop_->acknowledge(); };
  BlackBox box(kRate, 4);
  auto files = writer(box);
  ServoSettings settings{kRate, {}, 6000, FaultPolicy::kWait};
  settings.black_box = &box;
  const ServoStats& stats = run(device, settings);
  files.finish();
  EXPECT_EQ(stats.faults, 100u);
  const BlackBoxCounts counts = files.counts();
  EXPECT_EQ(counts.triggers, 100u);
  EXPECT_EQ(counts.files, 4u);
  EXPECT_EQ(counts.not_kept, 96u);
  EXPECT_THAT(said_, HasSubstr("96 of 100 faults"));
}

TEST_F(BlackBoxWriterTest, oldBlackBoxesGoAndOthersStay) {
  const auto old = folder_.write("old-01.csv", "x"), fresh = folder_.write("new-01.csv", "x");
  const auto other = folder_.write("notes.txt", "x");
  const auto long_ago = std::filesystem::file_time_type::clock::now() - std::chrono::hours(48);
  std::filesystem::last_write_time(old, long_ago);
  std::filesystem::last_write_time(other, long_ago);
  EXPECT_EQ(removeOldBlackBoxes(folder_.path(), 86'400), 1u);
  EXPECT_FALSE(std::filesystem::exists(old));
  EXPECT_TRUE(std::filesystem::exists(fresh) && std::filesystem::exists(other));
  EXPECT_EQ(removeOldBlackBoxes(folder_.path() / "not there", 0), 0u);
}

}  // namespace
}  // namespace needlelab::test
