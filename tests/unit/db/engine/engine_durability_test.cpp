#include "db/engine/engine.h"

#include <gtest/gtest.h>

namespace needlelab::test {
namespace {

TEST(EngineDurability, followsFromPostgresSettings) {
  struct Case {
    PostgresSettings settings;
    Durability expected;
  };
  using enum Durability;
  const Case cases[] = {
      {{"on", "on", "on", ""}, kPowerCut},
      {{"on", "on", "local", ""}, kPowerCut},
      {{"on", "on", "on", "ANY 1 (b, c)"}, kDiskLoss},
      {{"on", "on", "remote_apply", "FIRST 1 (b)"}, kDiskLoss},
      {{"on", "on", "on", "b"}, kDiskLoss},
      // does not wait for the standby, or not for its disk
      {{"on", "on", "local", "ANY 1 (b, c)"}, kPowerCut},
      {{"on", "on", "remote_write", "ANY 1 (b, c)"}, kPowerCut},
      // any standby
      {{"on", "on", "on", "*"}, kPowerCut},
      {{"on", "on", "on", "ANY 1 (b, *)"}, kPowerCut},
      {{"on", "on", "on", "ANY 1 (\"*\")"}, kPowerCut},
      {{"on", "on", "on", " "}, kPowerCut},
      // the log is not on the disk
      {{"off", "on", "on", "ANY 1 (b, c)"}, kProcess},
      {{"on", "off", "on", "ANY 1 (b, c)"}, kProcess},
      {{"on", "on", "off", "ANY 1 (b, c)"}, kNothing},
      {{"off", "off", "off", ""}, kNothing},
      {{"on", "on", "what a later version may say", "b"}, kNothing},
  };
  for (const Case& one : cases) EXPECT_EQ(durabilityOf(one.settings), one.expected) << one.settings.text();
}

}  // namespace
}  // namespace needlelab::test
