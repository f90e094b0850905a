// The pictures of recorded forces are drawn; without recordings, only the pictures that need none.
#include "client/sim/accuracy/recorded.h"

#include <gtest/gtest.h>

#include <cstdlib>

#include "client/sim/tools/gnuplot.h"
#include "tests/support/recordings/recordings.h"
#include "tests/support/temp_folder.h"

namespace needlelab {
namespace {

TEST(RecordedPictures, withoutRecordingsAreThoseThatNeedNone) {
  AccuracyOptions options;
  options.data = "/nonexistent";
  const auto pictures = recordedPictures(options, {});
  ASSERT_TRUE(pictures.ok()) << pictures.error().message;
  ASSERT_EQ(pictures->size(), 2u);
  EXPECT_EQ((*pictures)[0].name, "statistical_draws");
  EXPECT_EQ((*pictures)[1].name, "epidural_table");
}

TEST(RecordedPictures, areDrawnWithTheirTables) {
  AccuracyOptions options;
  options.data = test::preferredRecordings().folder;
  const test::TempFolder temporary;
  // To inspect them: NEEDLELAB_PICTURES=folder.
  const char* keep = std::getenv("NEEDLELAB_PICTURES");
  const std::filesystem::path folder = keep != nullptr ? std::filesystem::path(keep) : temporary.path();
  const auto pictures = recordedPictures(options, {});
  ASSERT_TRUE(pictures.ok()) << pictures.error().message;
  const Status status = drawRecordedPictures(*pictures, folder);
  ASSERT_TRUE(status.ok()) << status.error().message;
  for (const RecordedPicture& picture : *pictures) {
    EXPECT_GT(std::filesystem::file_size(folder / (picture.name + ".csv")), 100u) << picture.name;
    if (hasGnuplot()) {
      EXPECT_GT(std::filesystem::file_size(folder / (picture.name + ".png")), 10'000u) << picture.name;
    }
  }
}

}  // namespace
}  // namespace needlelab
