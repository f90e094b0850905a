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

TEST(AuditStore, usedUpNumbersFailTheItemThatNeedsOneAndNoOther) {
  test::TestDb db;
  ASSERT_OK(
      db.writer.run("INSERT INTO audit (id, unix_ns, who, action, subject, detail)"
                    " VALUES (9223372036854775807, 1, 'x', 'x', '', '')"));
  auto reader = db.reader();
  DbWriter writer(std::move(db.writer), {.window = 30ms}, {});
  // one group: all or nothing, if the writer's transaction were undone
  std::promise<Status> before, full, after;
  const auto tell = [](std::promise<Status>& promise) {
    return [&promise](const Status& status) { promise.set_value(status); };
  };
  const auto addStation = [](const char* name) {
    return [name](Connection& c) { return StationStore(c).add(name, StationKeyBytes{}, 1); };
  };
  ASSERT_OK(writer.post(addStation("a"), tell(before)));
  ASSERT_OK(writer.post(
      [](Connection& c) {
        return AuditStore(c).add({0, 1, "ina", "log-in", "", ""});
      },
      tell(full)));
  ASSERT_OK(writer.post(addStation("b"), tell(after)));
  EXPECT_OK(before.get_future().get());
  EXPECT_OK(after.get_future().get());
  const Status refused = full.get_future().get();
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kFailed);
  EXPECT_NE(refused.error().message.find("'audit' takes no new row"), std::string::npos)
      << refused.error().message;
  EXPECT_FALSE(writer.failed().has_value());
  for (const char* name : {"a", "b"}) EXPECT_TRUE(StationStore(reader).find(name)->has_value()) << name;
}

}  // namespace
}  // namespace needlelab
