#include "common/base/result.h"

#include <gtest/gtest.h>

#include <memory>

#include "common/base/program.h"

namespace needlelab {
namespace {

Result<int> half(int value) {
  if (value % 2 != 0) return Error{ErrorCode::kInvalidInput, "odd"};
  return value / 2;
}

TEST(Result, holdsAValueOrAnError) {
  const auto good = half(8);
  ASSERT_TRUE(good.ok());
  EXPECT_EQ(*good, 4);
  const auto bad = half(7);
  ASSERT_FALSE(bad.ok());
  EXPECT_EQ(bad.error().code, ErrorCode::kInvalidInput);
  EXPECT_EQ(bad.error().message, "odd");
}

TEST(Result, valueOfATemporaryMovesOut) {
  auto made = [] { return Result<std::unique_ptr<int>>(std::make_unique<int>(5)); };
  const std::unique_ptr<int> owned = made().value();
  ASSERT_NE(owned, nullptr);
  EXPECT_EQ(*owned, 5);
}

TEST(Status, isSuccessUnlessGivenAnError) {
  EXPECT_TRUE(Status().ok());
  const Status failed(Error{ErrorCode::kDenied, "no"});
  EXPECT_FALSE(failed.ok());
  EXPECT_EQ(failed.error().code, ErrorCode::kDenied);
}

TEST(ExitCode, onlyInvalidInputIsTwo) {
  EXPECT_EQ(exitCodeOf({ErrorCode::kInvalidInput, ""}), 2);
  for (const auto code :
       {ErrorCode::kNotFound, ErrorCode::kAlreadyExists, ErrorCode::kDenied, ErrorCode::kUnavailable,
        ErrorCode::kCorrupt, ErrorCode::kVersion, ErrorCode::kFailed})
    EXPECT_EQ(exitCodeOf({code, ""}), 1);
}

}  // namespace
}  // namespace needlelab
