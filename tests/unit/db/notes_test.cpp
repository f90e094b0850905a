// The small stores: annotations, audit log, meta.
#include "db/annotation_store.h"
#include "db/audit_store.h"
#include "db/meta_store.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

TEST(AnnotationStore, keepsThemByTick) {
  test::TestDb db;
  const Uuid id = makeUuidV7();
  ASSERT_OK(SessionStore(db.writer).open(test::describe(id), 1));
  AnnotationStore notes(db.writer);
  const auto first = notes.add({0, id, 500, "too fast\nhere", "ina", 7});
  ASSERT_OK(first);
  ASSERT_OK(notes.add({0, id, 20, "good angle", "ina", 8}));
  const auto list = notes.list(id);
  ASSERT_OK(list);
  ASSERT_EQ(list->size(), 2u);
  EXPECT_EQ((*list)[0].tick, 20u);
  EXPECT_EQ((*list)[1].id, *first);
  EXPECT_EQ((*list)[1].text, "too fast\nhere");
}

TEST(AnnotationStore, refusesEmptyHugeAndHomelessOnes) {
  test::TestDb db;
  const Uuid id = makeUuidV7();
  ASSERT_OK(SessionStore(db.writer).open(test::describe(id), 1));
  AnnotationStore notes(db.writer);
  EXPECT_FALSE(notes.add({0, id, 1, "", "ina", 1}).ok());
  EXPECT_FALSE(notes.add({0, id, 1, std::string(5'000, 'x'), "ina", 1}).ok());
  EXPECT_FALSE(notes.add({0, id, UINT64_MAX, "x", "ina", 1}).ok());
  EXPECT_EQ(notes.add({0, makeUuidV7(), 1, "x", "ina", 1}).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(notes.list(makeUuidV7()).error().code, ErrorCode::kNotFound);
}

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

TEST(MetaStore, keepsTheNewestValue) {
  test::TestDb db;
  MetaStore meta(db.writer);
  EXPECT_FALSE(meta.get("k")->has_value());
  ASSERT_OK(meta.set("k", "1"));
  ASSERT_OK(meta.set("k", "2"));
  EXPECT_EQ(**meta.get("k"), "2");
}

}  // namespace
}  // namespace needlelab
