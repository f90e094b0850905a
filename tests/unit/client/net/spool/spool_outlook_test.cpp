#include "client/net/spool/spool_outlook.h"

#include <gmock/gmock.h>

#include "common/gesture/chunk.h"
#include "tests/support/temp_folder.h"
#include "tests/support/time/fake_time.h"
#include "tests/unit/client/net/spool/spool_samples.h"

namespace needlelab::test {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
constexpr std::uint64_t kGiB = std::uint64_t{1} << 30;

// 7 bytes per sample at 1 kHz: 25.2 MB per hour
SpoolUsage usage(std::uint64_t unsent, std::uint64_t free_bytes) {
  return {unsent > 0 ? 3u : 0u, unsent, free_bytes, unsent / 7};
}

TEST(SpoolOutlook, anEmptySpoolOnARoomyDiskIsNotWorthAWord) {
  const auto outlook = outlookOf(usage(0, 100 * kGiB), 4 * kGiB, 1000);
  EXPECT_EQ(outlook.level, SpoolLevel::kGood);
  EXPECT_THAT(outlook.text, IsEmpty());
}

TEST(SpoolOutlook, hoursAreRoomOverRate) {
  const auto outlook = outlookOf(usage(3 * kGiB, 100 * kGiB), 4 * kGiB, 1000);
  EXPECT_NEAR(outlook.bytes_per_h, 7.0 * 3'600'000, 1);
  EXPECT_DOUBLE_EQ(outlook.quota_h, static_cast<double>(kGiB) / outlook.bytes_per_h);
  EXPECT_DOUBLE_EQ(outlook.disk_h, 100 * static_cast<double>(kGiB) / outlook.bytes_per_h);
  EXPECT_EQ(outlook.level, SpoolLevel::kUnsent);
  EXPECT_EQ(outlook.text,
            "the spool holds 3.0 GiB in 3 sessions that no server has yet; at 24 MiB an hour 42 hours of "
            "lessons fit "
            "into its quota of 4.0 GiB");
  // four times the rate, a quarter of the time
  EXPECT_DOUBLE_EQ(outlookOf(usage(3 * kGiB, 100 * kGiB), 4 * kGiB, 4000).quota_h, outlook.quota_h / 4);
}

TEST(SpoolOutlook, aFewSamplesAreNotTakenForTheRule) {
  SpoolUsage still = usage(700'000, kGiB);
  still.unsent_samples = 500'000;  // 1.4 bytes each: the hand did not move
  EXPECT_DOUBLE_EQ(outlookOf(still, 4 * kGiB, 1000).bytes_per_h, 8.0 * 3'600'000);
  still.unsent_samples = 700'000;
  EXPECT_DOUBLE_EQ(outlookOf(still, 4 * kGiB, 1000).bytes_per_h, 3'600'000);
}

TEST(SpoolOutlook, aNearlyFullQuotaWarnsWithAdvice) {
  const auto outlook = outlookOf(usage(4 * kGiB - 200'000'000, 100 * kGiB), 4 * kGiB, 1000);
  EXPECT_EQ(outlook.level, SpoolLevel::kWarn);
  EXPECT_THAT(outlook.text,
              HasSubstr("7 hours of lessons fit into its quota of 4.0 GiB: connect to the server, or "
                        "raise --spool-quota"));
}

TEST(SpoolOutlook, overTheQuotaIsUrgentAndNothingIsDeleted) {
  const auto outlook = outlookOf(usage(5 * kGiB, 100 * kGiB), 4 * kGiB, 1000);
  EXPECT_EQ(outlook.level, SpoolLevel::kUrgent);
  EXPECT_EQ(outlook.quota_h, 0);
  EXPECT_THAT(outlook.text, HasSubstr("over its quota of 4.0 GiB, and kept nevertheless"));
  EXPECT_THAT(outlook.text, HasSubstr("days of lessons fit on its disk, which has 100.0 GiB left"));
}

TEST(SpoolOutlook, aDiskThatFillsUpCountsEvenWithoutAnythingUnsent) {
  const auto soon = outlookOf(usage(0, 100'000'000), 4 * kGiB, 1000);
  EXPECT_EQ(soon.level, SpoolLevel::kWarn);
  EXPECT_THAT(soon.text, AllOf(HasSubstr("3 hours of lessons fit on its disk, which has 95 MiB left"),
                               HasSubstr("make room on that disk"), Not(HasSubstr("--spool-quota"))));
  const auto now = outlookOf(usage(kGiB, 10'000'000), 4 * kGiB, 1000);
  EXPECT_EQ(now.level, SpoolLevel::kUrgent);
  EXPECT_THAT(now.text, AllOf(HasSubstr("23 minutes"), HasSubstr("connect to the server, and make room")));
}

TEST(SpoolOutlook, thresholdsAreData) {
  SpoolThresholds thresholds;
  thresholds.warn_h = 100;
  EXPECT_EQ(outlookOf(usage(3 * kGiB, 100 * kGiB), 4 * kGiB, 1000, thresholds).level, SpoolLevel::kWarn);
  thresholds.urgent_h = 50;
  EXPECT_EQ(outlookOf(usage(3 * kGiB, 100 * kGiB), 4 * kGiB, 1000, thresholds).level, SpoolLevel::kUrgent);
}

TEST(SpoolOutlook, sizesAndTimesReadWell) {
  EXPECT_EQ(sizeText(17), "17 bytes");
  EXPECT_EQ(sizeText(800 * 1024), "800 KiB");
  EXPECT_EQ(sizeText(25'200'000), "24 MiB");
  EXPECT_EQ(sizeText(3 * kGiB + kGiB / 10), "3.1 GiB");
  EXPECT_EQ(durationText(0.5), "30 minutes");
  EXPECT_EQ(durationText(12.9), "12 hours");
  EXPECT_EQ(durationText(100), "4 days");
  EXPECT_EQ(durationText(1e9), "years");
}

TEST(SpoolGuard, reportsWaitingDataAtStartAndThenOnlyWorsening) {
  const TempFolder folder;
  auto spool = std::move(*Spool::open(folder.path()));
  auto session = *spool->create(describeSession(makeUuidV7()));
  ASSERT_TRUE(session->appendChunk(encodeChunk(Resolution::standard(), samplesFrom(0, 1000)), 1000).ok());
  ASSERT_TRUE(session->sync().ok());
  std::vector<std::string> said;
  const auto say = [&](const std::string& text) { said.push_back(text); };
  SpoolKeep keep;
  keep.quota_bytes = 1;
  FakeTime time;
  SpoolGuard guard(*spool, keep, 1000, say, {}, time);
  guard.report();
  ASSERT_EQ(said.size(), 1u);
  EXPECT_THAT(said[0], HasSubstr("over its quota of 1 bytes"));
  EXPECT_EQ(guard.trouble(), said[0]) << "the instructor is told as well";
  for (int s = 0; s < 100; ++s) {
    time.advance(1'000'000'000);
    guard.check();
  }
  EXPECT_EQ(said.size(), 1u);
  EXPECT_TRUE(std::filesystem::exists(session->folder() / "chunks"));
  // The server has everything, so there is no message.
  ASSERT_TRUE(session->setReceipt({1, 0, false, 0}).ok());
  guard.report();
  EXPECT_THAT(guard.trouble(), IsEmpty());
  // It checks again after 10 s: if sessions wait again, the message is repeated.
  ASSERT_TRUE(session->setReceipt({0, 0, false, 0}).ok());
  time.advance(9'999'999'999);
  guard.check();
  EXPECT_EQ(said.size(), 1u);
  time.advance(1);
  guard.check();
  EXPECT_EQ(said.size(), 2u);
}

}  // namespace
}  // namespace needlelab::test
