#include "server/live/login/login_state.h"

#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace needlelab {
namespace {

TEST(LoginState, aWatchSeesLaterChangesOfItsOwnAccountOnly) {
  AccessChanges changes;
  changes.changed("anna", false);
  const AccessWatch first = changes.watch("anna", false), second = changes.watch("anna", false);
  EXPECT_FALSE(first.changed());
  changes.changed("bert", false);
  changes.changed("anna", true);
  EXPECT_FALSE(first.changed()) << "another person, and a station of the same name";
  changes.changed("anna", false);
  EXPECT_TRUE(first.changed() && second.changed());
  EXPECT_FALSE(changes.watch("anna", false).changed());
}

TEST(LoginState, unwatchedNamesAreForgotten) {
  AccessChanges changes;
  std::vector<AccessWatch> held;
  for (int i = 0; i < 100; ++i) held.push_back(changes.watch("held " + std::to_string(i), false));
  for (int i = 0; i < 10'000; ++i) (void)changes.watch("guess " + std::to_string(i), false);
  EXPECT_LE(changes.size(), 200u) << "twice as many as are watched";
  changes.changed("held 0", false);
  EXPECT_TRUE(held[0].changed());
  EXPECT_FALSE(held[1].changed());
}

struct Checks {
  AccessChanges changes;
  int changed_in = 0;    ///< the first this many checks: the account changes during them
  bool refuses = false;  ///< each check refuses
  std::string whose = "anna";
  int made = 0;
};

/// One check of anna's; its result is its number.
Task<Result<int>> checkOf(Checks& checks) {
  ++checks.made;
  if (checks.made <= checks.changed_in) checks.changes.changed(checks.whose, false);
  if (checks.refuses) co_return Error{ErrorCode::kDenied, "wrong"};
  co_return checks.made;
}

Task<> runOn(Checks& checks, Result<int>& result) {
  std::function<Task<Result<int>>()> check = [&checks] { return checkOf(checks); };
  auto got = co_await checkUnchanged(checks.changes, "anna", false, std::move(check));
  result = std::move(got);
}

Result<int> resultOf(Checks& checks) {
  asio::io_context io{1};
  Result<int> result = Error{ErrorCode::kFailed, "did not end"};
  asio::co_spawn(io, runOn(checks, result), rethrow);
  io.run();
  return result;
}

TEST(CheckUnchanged, oneCheckIsEnoughWhileOnlyOthersChange) {
  Checks checks;
  checks.changed_in = 1000;
  checks.whose = "bert";
  const auto result = resultOf(checks);
  ASSERT_TRUE(result.ok());
  EXPECT_EQ(checks.made, 1);
}

TEST(CheckUnchanged, anAccountChangedDuringItsCheckIsCheckedAgain) {
  Checks checks;
  checks.changed_in = 1;
  const auto result = resultOf(checks);
  ASSERT_TRUE(result.ok());
  EXPECT_EQ(result.value(), 2);
  EXPECT_EQ(checks.made, 2);
}

TEST(CheckUnchanged, anAccountChangedInEachCheckIsRefusedAfterTwo) {
  Checks checks;
  checks.changed_in = 1000;
  const auto result = resultOf(checks);
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.error().code, ErrorCode::kConflict);
  EXPECT_EQ(checks.made, 2);
}

TEST(CheckUnchanged, whatIsRefusedIsNotCheckedAgain) {
  Checks checks;
  checks.changed_in = 1000;
  checks.refuses = true;
  const auto result = resultOf(checks);
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.error().code, ErrorCode::kDenied);
  EXPECT_EQ(checks.made, 1);
}

}  // namespace
}  // namespace needlelab
