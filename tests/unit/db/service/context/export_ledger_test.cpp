#include "db/service/context/export_ledger.h"

#include <gtest/gtest.h>

#include <string>

namespace needlelab {
namespace {

constexpr std::int64_t kHour_ns = 3'600LL * 1'000'000'000;
const Principal kIna{"ina", pb::INSTRUCTOR};

TEST(ExportLedger, aReadIsNewOnceAnHourForEachPersonAndSubject) {
  ExportLedger ledger;
  EXPECT_TRUE(ledger.isNew(kIna, "a", 0));
  EXPECT_FALSE(ledger.isNew(kIna, "a", kHour_ns));
  EXPECT_TRUE(ledger.isNew(kIna, "b", 1));
  EXPECT_TRUE(ledger.isNew({"max", pb::INSTRUCTOR}, "a", 2));
  EXPECT_TRUE(ledger.isNew(kIna, "a", kHour_ns + 1));
  EXPECT_FALSE(ledger.isNew(kIna, "a", kHour_ns + 2)) << "the old note's end ends the new one";
}

TEST(ExportLedger, aClockThatIsSetBackMakesAReadNew) {
  ExportLedger ledger;
  EXPECT_TRUE(ledger.isNew(kIna, "a", 2 * kHour_ns));
  EXPECT_TRUE(ledger.isNew(kIna, "a", kHour_ns));
  EXPECT_FALSE(ledger.isNew(kIna, "a", kHour_ns + 1));
}

TEST(ExportLedger, whatWasTakenBackIsNewAgainForThatPersonAlone) {
  ExportLedger ledger;
  const Principal max{"max", pb::INSTRUCTOR};
  ASSERT_TRUE(ledger.isNew(kIna, "a", 0));
  ASSERT_TRUE(ledger.isNew(max, "a", 0));
  ledger.revoke(kIna, "a");
  ledger.revoke(kIna, "never noted");
  EXPECT_TRUE(ledger.isNew(kIna, "a", 1));
  EXPECT_FALSE(ledger.isNew(kIna, "a", 2));
  EXPECT_FALSE(ledger.isNew(max, "a", 2));
}

// invented names fill nothing, and displace the others' notes only one by one
TEST(ExportLedger, beyondTenThousandNotesTheOldestGivesWayAlone) {
  ExportLedger ledger;
  for (std::int64_t i = 0; i < 10'001; ++i) ASSERT_TRUE(ledger.isNew(kIna, std::to_string(i), i)) << i;
  EXPECT_FALSE(ledger.isNew(kIna, "1", 10'001));
  EXPECT_FALSE(ledger.isNew(kIna, "10000", 10'001));
  EXPECT_TRUE(ledger.isNew(kIna, "0", 10'001));
  EXPECT_TRUE(ledger.isNew(kIna, "1", 10'002)) << "0 came again, so 1 was the oldest";
}

}  // namespace
}  // namespace needlelab
