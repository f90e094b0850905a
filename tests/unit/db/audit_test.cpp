#include "db/audit.h"

#include <future>

#include "db/db_writer.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

using namespace std::chrono_literals;

TEST(AuditStore, listsNewestFirstAndIsNeverStoppedByItsText) {
  test::TestDb db;
  AuditStore audit(db.writer);
  ASSERT_OK(audit.add({0, 10, "bea", "user add", "anna", "trainee"}));
  ASSERT_OK(audit.add({0, 20, "\xff\xfe", "x", std::string(999, 'a') + "é and more", "z"}));
  const auto list = audit.list(0);
  ASSERT_OK(list);
  ASSERT_EQ(list->size(), 2u);
  EXPECT_EQ((*list)[0].who, "(2 bytes that are no text)");
  EXPECT_EQ((*list)[0].subject, std::string(999, 'a') + "…");  // cut before the character that did not fit
  EXPECT_EQ((*list)[1].detail, "trainee");
  EXPECT_EQ(audit.list(1)->size(), 1u);
}

}  // namespace
}  // namespace needlelab
