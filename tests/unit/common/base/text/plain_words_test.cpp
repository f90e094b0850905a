#include "common/base/text/plain_words.h"

#include <gtest/gtest.h>

namespace needlelab {
namespace {

TEST(PlainWords, anIdAnEnumeratorAndALongNumberBecomeWords) {
  const struct {
    const char *said, *shown;
  } rows[] = {
      {"there is no session 019aa0c3-7c1e-7b3a-9d5e-0123456789ab", "there is no such session"},
      {"session 019aa0c3-7c1e-7b3a-9d5e-0123456789ab: is open.", "this session: is open."},
      {"lab:7750: the peer refused (LOGIN): wrong", "lab:7750: wrong"},
      {"unscored 019aa0c3-7c1e-7b3a-9d5e-0123456789ab", "unscored"},
      {"refused (NOT_FOUND), for a CURRICULUM_MANAGER", "refused (not found), for a curriculum manager"},
      {"2.86478897565 to 85.9436692696.", "2.86479 to 85.9437."},
      {"0.25 m in UTF-8, server-2, 10.0.0.7, 1.2.3456789",
       "0.25 m in UTF-8, server-2, 10.0.0.7, 1.2.3456789"},
      {"", ""},
  };
  for (const auto& row : rows) EXPECT_EQ(plainWords(row.said), row.shown);
}

}  // namespace
}  // namespace needlelab
