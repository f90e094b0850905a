/// A database with two trainees, and an erasure of one of them.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <string>

#include "common/base/text/uuid.h"
#include "db/erasure/erasure.h"
#include "db/erasure/retention_store.h"
#include "db/people/people.h"
#include "db/people/person_refs.h"
#include "tests/unit/db/test_db.h"

namespace needlelab::test {

class ErasureTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!*MetaStore(db.writer).get(kLabKey))
      ASSERT_OK(MetaStore(db.writer).set(kLabKey, uuidText(makeUuidV7())));
    ASSERT_OK(PeopleStore(db.writer).add({"anna", pb::TRAINEE, "", false, 1, "Anna Östlund-Berg"}, &anna));
    ASSERT_OK(PeopleStore(db.writer).add({"ben", pb::TRAINEE, "", false, 1}, &ben));
  }
  Uuid session(const std::string& trainee, std::uint64_t chunks, bool closed) {
    const Uuid id = makeUuidV7();
    auto d = describe(id);
    d.set_trainee(trainee);
    EXPECT_OK(SessionStore(db.writer).open(d, 1));
    for (std::uint64_t seq = 0; seq < chunks; ++seq)
      EXPECT_OK(SessionStore(db.writer).append(id, seq, chunkOf(seq)));
    if (closed) EXPECT_OK(SessionStore(db.writer).close(closeOf(id, chunks), 2));
    return id;
  }
  Result<pb::Erasure> erase(const std::string& ref, bool with_waiting = false) {
    return ErasureStore(db.writer).erase(ref, {"@9", "asked for it", kNow_ns, with_waiting});
  }
  std::string traineeOf(const Uuid& id) {
    const auto info = SessionStore(db.writer).info(id);
    return info ? info->description().trainee() : info.error().message;
  }
  std::string nameOf(const std::string& ref) { return *shownName(db.writer, ref); }
  bool waits(const Uuid& id) {
    auto row = db.writer.query(
        "SELECT 1 FROM unknown_trainees WHERE by_whom IS NULL"
        " AND session = (SELECT number FROM sessions WHERE id = ?)",
        ByteView(id));
    return *row.step();
  }
  static constexpr std::int64_t kNow_ns = 1'800'000'000'000'000'000;
  std::string anna, ben;  // refs
  TestDb db;
};

}  // namespace needlelab::test
