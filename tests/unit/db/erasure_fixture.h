/// A database with two trainees, and an erasure of one of them.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <string>

#include "common/base/uuid.h"
#include "db/erasure.h"
#include "db/people.h"
#include "db/retention_store.h"
#include "tests/unit/db/test_db.h"

namespace needlelab::test {

class ErasureTest : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_OK(PeopleStore(db.writer).add({"anna", pb::TRAINEE, "", false, 1, "Anna Östlund-Berg"}));
    ASSERT_OK(PeopleStore(db.writer).add({"ben", pb::TRAINEE, "", false, 1}));
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
  ErasureLine line(const std::string& name, std::int64_t when) {
    const auto key = PseudonymKey::ofFolder(db.folder.path());
    return {"erased-1234", key->nameHash(name), when};
  }
  Result<pb::Erasure> erase(const std::string& name, std::int64_t when = 1'800'000'000'000'000'000) {
    return ErasureStore(db.writer).erase(name, line(name, when), "ada", "asked for it", when);
  }
  bool waits(const Uuid& id) {
    auto row = db.writer.query(
        "SELECT 1 FROM unknown_trainees WHERE by_whom IS NULL"
        " AND session = (SELECT number FROM sessions WHERE id = ?)",
        ByteView(id));
    return *row.step();
  }
  void removeChunks(const Uuid& id) {
    for (;;) {
      const auto more = RetentionStore(db.writer).removeSome(id, 2);
      ASSERT_OK(more);
      if (!*more) return;
    }
  }
  TestDb db;
};

}  // namespace needlelab::test
