#include <gmock/gmock.h>

#include <cmath>
#include <random>

#include "tests/soak/soak_judge.h"
#include "tests/support/temp_folder.h"

namespace needlelab::test {
namespace {

using testing::EndsWith;
using testing::StartsWith;

std::vector<double> seconds(std::size_t count) {
  std::vector<double> times;
  for (std::size_t i = 0; i < count; ++i) times.push_back(static_cast<double>(i));
  return times;
}

TEST(SoakSlope, aLineIsFoundExactly) {
  const auto times = seconds(3600);
  std::vector<double> values;
  for (const double t : times) values.push_back(1000 + 30 * t / 60);
  const Slope slope = slopeOf(times, values);
  EXPECT_NEAR(slope.per_min, 30, 0.1);
  EXPECT_LT(slope.half_width_per_min, 0.2);
  EXPECT_EQ(slope.blocks, 12u);
}

TEST(SoakSlope, flatWithNoiseAndSpikesIsFlat) {
  std::mt19937 random(3);
  const auto times = seconds(3600);
  int covered = 0;
  for (int round = 0; round < 200; ++round) {
    std::vector<double> values;
    for (std::size_t i = 0; i < times.size(); ++i)
      values.push_back(50'000 + static_cast<double>(random() % 200) + (random() % 500 == 0 ? 100'000 : 0));
    const Slope slope = slopeOf(times, values);
    covered += std::abs(slope.per_min) <= slope.half_width_per_min;
    EXPECT_LT(std::abs(slope.per_min), 2);
  }
  // the interval holds the true slope about 95 times in 100
  EXPECT_GE(covered, 180);
}

TEST(SoakSlope, aStepWidensTheIntervalAndALeakIsAboveIt) {
  const auto times = seconds(3600);
  std::vector<double> step, leak;
  for (const double t : times) {
    step.push_back(t < 1800 ? 10'000 : 10'512);       // a pool that grew once
    leak.push_back(10'000 + std::floor(t / 10) * 8);  // 48 KiB a minute, in the allocator's blocks
  }
  const Slope stepped = slopeOf(times, step), leaking = slopeOf(times, leak);
  EXPECT_GT(stepped.half_width_per_min, 2);
  EXPECT_NEAR(leaking.per_min, 48, 1);
  EXPECT_GT(leaking.per_min - leaking.half_width_per_min, 40);
}

TEST(SoakSlope, tooLittleIsNoSlope) {
  EXPECT_EQ(slopeOf({}, {}).blocks, 0u);
  const std::vector<double> three = {0, 1, 2};
  EXPECT_LT(slopeOf(three, three).blocks, 4u);
}

TEST(SoakQuantile, byRank) {
  EXPECT_TRUE(std::isnan(quantile({}, 0.99)));
  EXPECT_EQ(quantile({3}, 0.99), 3);
  std::vector<double> hundred;
  for (int i = 100; i > 0; --i) hundred.push_back(i);
  EXPECT_EQ(quantile(hundred, 0.99), 99);
  EXPECT_EQ(quantile(hundred, 0.5), 50);
}

// data of a good hour, which the tests then damage
SoakData goodHour() {
  SoakData data;
  for (int i = 0; i < 3600; ++i) {
    SoakRow row;
    row.time_s = i;
    for (ProcessSample& process : row.processes) process = {40'000, 20'000, 20, 5, 0.01 * i};
    data.rows.push_back(row);
  }
  data.summary = {{"samples_lost", 0},  {"samples", 3'599'990}, {"missed_ticks", 10},
                  {"ticks", 3'600'000}, {"spool_left", 0},      {"connections", 1}};
  data.stored_samples = 3'599'990;
  data.stored_state = "SESSION_COMPLETE";
  data.verified = true;
  data.station_code = data.viewer_code = data.server_code = 0;
  return data;
}
SoakOptions hour() {
  SoakOptions options;
  options.seconds = 3600;
  return options;
}

TEST(SoakJudge, aGoodHourIsGoodAndEachFaultIsFound) {
  EXPECT_EQ(verdictOf(judge(goodHour(), hour(), {})), Verdict::kGood)
      << tableText(judge(goodHour(), hour(), {}), SoakForm::kNightly);
  const auto bad = [](const std::function<void(SoakData&)>& spoil) {
    SoakData data = goodHour();
    spoil(data);
    return verdictOf(judge(data, hour(), {}));
  };
  EXPECT_EQ(bad([](SoakData& d) {
              for (SoakRow& row : d.rows)
                row.processes[kServer].rss_KiB += static_cast<std::uint64_t>(row.time_s);
            }),
            Verdict::kBad)
      << "60 KiB a minute";
  EXPECT_EQ(bad([](SoakData& d) {
              for (SoakRow& row : d.rows)
                row.processes[kStation].handles += static_cast<std::uint64_t>(row.time_s / 600);
            }),
            Verdict::kBad);
  EXPECT_EQ(bad([](SoakData& d) {
              for (std::size_t i = 1800; i < d.rows.size(); ++i) ++d.rows[i].processes[kViewer].threads;
            }),
            Verdict::kBad);
  EXPECT_EQ(bad([](SoakData& d) { d.rows.back().processes[kServer].database_handles = 41; }), Verdict::kBad);
  EXPECT_EQ(bad([](SoakData& d) { d.summary["samples_lost"] = 1; }), Verdict::kBad);
  EXPECT_EQ(bad([](SoakData& d) { --d.stored_samples; }), Verdict::kBad);
  EXPECT_EQ(bad([](SoakData& d) { d.verified = false; }), Verdict::kBad);
  EXPECT_EQ(bad([](SoakData& d) { d.summary.erase("spool_left"); }), Verdict::kBad);
  EXPECT_EQ(bad([](SoakData& d) { d.viewer_code = -11; }), Verdict::kBad);
  EXPECT_EQ(bad([](SoakData& d) { d.summary["connections"] = 2; }), Verdict::kBad);
  EXPECT_EQ(bad([](SoakData& d) { d.troubles.push_back("the disk"); }), Verdict::kBad);
  EXPECT_EQ(bad([](SoakData& d) {
              for (SoakRow& row : d.rows) row.processes[kServer].rss_KiB += row.time_s < 200 ? 0 : 30'000;
            }),
            Verdict::kGood)
      << "the warm-up is not judged";
}

TEST(SoakReport, isWrittenAsTables) {
  const TempFolder folder;
  SoakOptions options = hour();
  options.out = folder.path();
  SoakMinutes minutes;
  for (int i = 1; i <= 60; ++i) minutes.push_back({60.0 * i, 60'000, 1, 20, 80, 1, 30});
  const Status written = writeReport(goodHour(), options, minutes, judge(goodHour(), options, minutes));
  ASSERT_TRUE(written.ok()) << written.error().message;
  for (const char* name : {"samples.csv", "minutes.csv", "table.txt"})
    EXPECT_TRUE(std::filesystem::exists(folder.path() / name)) << name;
}

// 60 KiB a minute, in as many seconds as the form has
Finding growing(double run_s, double noise_KiB) {
  SoakOptions options;
  options.seconds = run_s;
  std::mt19937 random(7);
  std::vector<double> rss_KiB;
  const auto times = seconds(static_cast<std::size_t>(run_s));
  for (const double t : times)
    rss_KiB.push_back(40'000 + t + noise_KiB * static_cast<double>(random() % 1000) / 1000);
  return flatMemory("memory of the server", times, rss_KiB, options.form());
}

TEST(SoakForms, theShortFormReportsMemoryAndTheNightlyOneJudgesIt) {
  const Finding brief = growing(599, 0), nightly = growing(600, 0);
  EXPECT_EQ(brief.verdict, Verdict::kGood);
  EXPECT_EQ(brief.limit, "") << "reported, not judged";
  EXPECT_THAT(brief.value, StartsWith("+60.1 ±"));
  EXPECT_THAT(tableText({brief}, SoakForm::kShort),
              EndsWith("\nshort form (losses, handles, threads): good\n"));
  EXPECT_EQ(nightly.verdict, Verdict::kBad);
  EXPECT_EQ(nightly.limit, "< 16 KiB/min");
  EXPECT_THAT(tableText({nightly}, SoakForm::kNightly),
              EndsWith("\nnightly form (losses, handles, threads, memory): BAD\n"));
}

TEST(SoakForms, inTheNightlyFormMemoryMustBeShownToBeFlat) {
  // so noisy that the interval reaches from below the limit to above it
  EXPECT_EQ(growing(600, 20'000).verdict, Verdict::kBad);
  EXPECT_EQ(flatMemory("memory of the server", {}, {}, SoakForm::kNightly).verdict, Verdict::kBad)
      << "no samples";
}

TEST(SoakProcessSample, seesThisProcess) {
  const auto sample = sampleProcess(::getpid());
  ASSERT_TRUE(sample);
  EXPECT_GT(sample->rss_KiB, 1000u);
  EXPECT_LE(sample->anon_KiB, sample->rss_KiB);
  EXPECT_GE(sample->handles, 3u);
  EXPECT_GE(sample->threads, 1u);
  std::vector<char> more(20u << 20, 1);
  EXPECT_GT(sampleProcess(::getpid())->rss_KiB, sample->rss_KiB + 15'000);
  EXPECT_FALSE(sampleProcess(0));
}

// the short form of the whole; deploy/nightly runs the other
TEST(Soak, serverStationAndViewerTogetherLoseNothingAndKeepTheirHandles) {
  const TempFolder folder;
  SoakOptions options;
  options.bin = NEEDLELAB_BIN;
  options.out = folder.path() / "soak";
  options.seconds = 20;
  options.quiet = true;
  const auto data = runSoak(options);
  ASSERT_TRUE(data.ok()) << data.error().message;
  const auto minutes = minutesOf(*data, options);
  ASSERT_TRUE(minutes.ok()) << minutes.error().message;
  const auto findings = judge(*data, options, *minutes);
  const std::string table = tableText(findings, options.form());
  std::cout << table;
  EXPECT_EQ(verdictOf(findings), Verdict::kGood) << data->summary.dump(1);
  const Status written = writeReport(*data, options, *minutes, findings);
  EXPECT_TRUE(written.ok()) << written.error().message;
  for (const char* name : {"samples.csv", "minutes.csv", "table.txt"})
    EXPECT_GT(std::filesystem::file_size(options.out / name), 100u);
  EXPECT_GE(data->rows.size(), 30u);
  std::uint64_t samples = 0;
  for (const SoakMinute& minute : *minutes) {
    samples += minute.samples;
    EXPECT_GT(minute.tick_p99_us, 0);
    EXPECT_GT(minute.live_p99_ms, 0) << "the viewer saw it";
  }
  EXPECT_EQ(samples, data->stored_samples);
}

}  // namespace
}  // namespace needlelab::test
