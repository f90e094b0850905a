// The retention policies and the steps of retention, one by one.
#include "db/erasure/retention_store.h"

#include <functional>

#include "db/backup/check.h"
#include "db/sessions/seen_time.h"
#include "db/sessions/session_results.h"
#include "db/store/schema.h"
#include "tests/support/time_zone.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

using test::chunkOf;
using test::closeOf;

class RetentionStoreTest : public testing::Test {
 protected:
  /// Adds a session of `chunks` chunks, closed on `day` unless the day is negative.
  Uuid add(const std::string& exercise, std::int64_t day, std::uint64_t chunks = 3, bool safe = true) {
    const Uuid id = makeUuidV7();
    auto d = test::describe(id);
    d.set_exercise_id(exercise);
    EXPECT_OK(sessions.open(d, 1));
    for (std::uint64_t seq = 0; seq < chunks; ++seq) EXPECT_OK(sessions.append(id, seq, chunkOf(seq)));
    if (day >= 0) EXPECT_OK(sessions.close(closeOf(id, chunks), day * test::kDay_ns));
    if (safe) EXPECT_OK(sessions.markSafe(id, chunks));
    return id;
  }
  static pb::RetentionPolicy policy(const std::string& exercise, int thin_days, int delete_days) {
    pb::RetentionPolicy p;
    p.set_exercise_id(exercise);
    if (thin_days >= 0) {
      p.set_thin_after_days(static_cast<std::uint32_t>(thin_days));
      p.set_thin_rate_hz(100);
    }
    if (delete_days >= 0) p.set_delete_after_days(static_cast<std::uint32_t>(delete_days));
    p.set_by("mia");
    p.set_changed_unix_ns(5);
    return p;
  }
  /// Returns the actions that are due on a day, as "id action" in the order of due().
  std::vector<std::string> dueOn(std::int64_t day) {
    const auto due = store.due(day * test::kDay_ns);
    EXPECT_OK(due);
    std::vector<std::string> texts;
    for (const auto& one : *due)
      texts.push_back(uuidText(one.session) + (one.clock_was_behind   ? " left"
                                               : one.waits_for_backup ? " waits"
                                               : one.deletes          ? " delete"
                                                                      : " thin"));
    return texts;
  }
  static Bytes crcsOf(std::uint64_t chunks) {
    Bytes crcs;
    for (std::uint64_t seq = 0; seq < chunks; ++seq) {
      const Bytes chunk = chunkOf(seq);
      crcs.insert(crcs.end(), chunk.end() - 4, chunk.end());
    }
    return crcs;
  }
  DueRecording dueOf(const Uuid& id, bool deletes) {
    DueRecording due;
    due.session = id;
    due.exercise_id = sessions.info(id)->description().exercise_id();
    // the policy in force, or a default that keeps everything
    auto policies = *store.policies();
    if (policies.empty()) {
      EXPECT_OK(store.setPolicy(policy("", -1, -1)));
      policies = *store.policies();
    }
    due.policy = policies.back().exercise_id() == due.exercise_id ? policies.back() : policies.front();
    due.deletes = deletes;
    due.reason = "a reason";
    return due;
  }
  /// Thins step by step: the thinned recording is chunk 7.
  Status thin(const Uuid& id) {
    if (auto done = store.beginDerived(id, 100, 50); !done) return done;
    if (auto done = store.appendDerived(id, 0, chunkOf(7)); !done) return done;
    const auto sums = store.sums(id);
    if (!sums) return sums.error();
    return store.switchToDerived(dueOf(id, false), *sums, crcsOf(3), {"retention"}, 100 * test::kDay_ns);
  }
  bool sound() {
    const auto check = checkDatabase(db.writer);
    EXPECT_OK(check);
    for (const auto& fault : check->faults) ADD_FAILURE() << fault;
    return check->ok();
  }
  test::TestDb db;
  SessionStore sessions{db.writer};
  RetentionStore store{db.writer};
};

TEST_F(RetentionStoreTest, withoutAPolicyNothingIsEverDue) {
  add("knee-1", 0);
  EXPECT_TRUE(dueOn(30'000).empty());
  ASSERT_OK(store.setPolicy(policy("", -1, -1)));
  EXPECT_TRUE(dueOn(30'000).empty());
}

TEST_F(RetentionStoreTest, theExercisesPolicyComesBeforeTheDefault) {
  const std::string knee = uuidText(add("knee-1", 10)), wrist = uuidText(add("wrist", 10)),
                    kept = uuidText(add("kept", 10));
  ASSERT_OK(store.setPolicy(policy("", -1, 30)));
  ASSERT_OK(store.setPolicy(policy("knee-1", 5, 50)));
  ASSERT_OK(store.setPolicy(policy("kept", -1, -1)));
  using Texts = std::vector<std::string>;
  EXPECT_EQ(dueOn(14), Texts{});
  EXPECT_EQ(dueOn(15), (Texts{knee + " thin"}));
  EXPECT_EQ(dueOn(39), (Texts{knee + " thin"}));
  EXPECT_EQ(dueOn(40), (Texts{knee + " thin", wrist + " delete"}));
  EXPECT_EQ(dueOn(60), (Texts{knee + " delete", wrist + " delete"}));
  ASSERT_OK(store.removePolicy("knee-1"));
  EXPECT_EQ(store.removePolicy("knee-1").error().code, ErrorCode::kNotFound);
  EXPECT_EQ(dueOn(39), Texts{});
  ASSERT_EQ(store.policies()->size(), 2u);
  EXPECT_EQ(store.policies()->front().delete_after_days(), 30u);
}

TEST_F(RetentionStoreTest, openAndUncoveredSessionsAreNotTouched) {
  add("knee-1", -1);
  const Uuid unsafe = add("knee-1", 10, 3, false);
  ASSERT_OK(store.setPolicy(policy("knee-1", 5, -1)));
  EXPECT_EQ(dueOn(100), (std::vector<std::string>{uuidText(unsafe) + " waits"}));
  // nor by a caller that forgets to check
  ASSERT_OK(store.beginDerived(unsafe, 100, 1));
  ASSERT_OK(store.appendDerived(unsafe, 0, chunkOf(7)));
  EXPECT_EQ(
      store.switchToDerived(dueOf(unsafe, false), *store.sums(unsafe), crcsOf(3), {"x"}, 1).error().code,
      ErrorCode::kUnavailable);
  EXPECT_EQ(store.markDeleted(dueOf(unsafe, true), crcsOf(3), {"x"}, 1).error().code,
            ErrorCode::kUnavailable);
  auto told = policy("knee-1", 5, -1);
  told.set_without_backup(true);
  ASSERT_OK(store.setPolicy(told));
  EXPECT_EQ(dueOn(100), (std::vector<std::string>{uuidText(unsafe) + " thin"}));
  const Uuid open = add("knee-1", -1);
  EXPECT_FALSE(store.beginDerived(open, 100, 1).ok());
  EXPECT_FALSE(store.markDeleted(dueOf(open, true), crcsOf(3), {"x"}, 1).ok());
}

// the server's clock showed day 10 when the sessions were closed; each has one witness for day 100
TEST_F(RetentionStoreTest, theAgeCountsFromTheNewestKnownPastTime) {
  ASSERT_OK(store.setPolicy(policy("", 20, 30)));
  const Uuid received = add("received", 10), started = add("started", 10), seen = add("seen", 10);
  const std::int64_t day_100 = 100 * test::kDay_ns;
  const auto set = [&](const char* column, const Uuid& id) {
    ASSERT_OK(db.writer.run("UPDATE sessions SET " + std::string(column) + " = ? WHERE id = ?", day_100,
                            ByteView(id)));
  };
  set("received_unix_ns", received);
  set("started_unix_ns", started);
  ASSERT_OK(SeenTimeStore(db.writer).confirm(day_100));
  ASSERT_OK(SeenTimeStore(db.writer).noteClose(seen, 10 * test::kDay_ns));
  const auto all = [&](const char* action) {
    std::vector<std::string> texts;
    for (const Uuid& id : {received, seen, started}) texts.push_back(uuidText(id) + action);
    return texts;
  };
  // until then the witness is ignored: its clock may be ahead
  EXPECT_EQ(dueOn(99), all(" delete"));
  EXPECT_EQ(dueOn(100), all(" left"));
  EXPECT_EQ(dueOn(119), all(" left"));
  EXPECT_EQ(dueOn(120), all(" thin"));
  EXPECT_EQ(dueOn(129), all(" thin"));
  EXPECT_EQ(dueOn(130), all(" delete"));
  const auto due = store.due(100 * test::kDay_ns);
  ASSERT_OK(due);
  for (const auto& one : *due) {
    EXPECT_NE(one.reason.find("1970-01-11 00:00:00 UTC"), std::string::npos) << one.reason;
    EXPECT_NE(one.reason.find("1970-04-11 00:00:00 UTC"), std::string::npos) << one.reason;
  }
}

TEST_F(RetentionStoreTest, whatWasClosedBeforeTheDatabaseWasMadeCountsFromThen) {
  ASSERT_OK(store.setPolicy(policy("", -1, 30)));
  const std::string before = uuidText(add("knee-1", 10)), after = uuidText(add("knee-1", 105));
  ASSERT_OK(MetaStore(db.writer).set("created_unix_ns", std::to_string(100 * test::kDay_ns)));
  EXPECT_EQ(dueOn(129), (std::vector<std::string>{before + " left"}));
  EXPECT_EQ(dueOn(130), (std::vector<std::string>{before + " delete"}));
  EXPECT_EQ(dueOn(135), (std::vector<std::string>{before + " delete", after + " delete"}));
}

TEST_F(RetentionStoreTest, aPolicyChangedDuringTheRunStopsIt) {
  const Uuid id = add("knee-1", 10), uncovered = add("knee-1", 10, 3, false);
  auto told = policy("knee-1", -1, 5);
  told.set_without_backup(true);
  ASSERT_OK(store.setPolicy(told));
  const auto due = store.due(100 * test::kDay_ns);
  ASSERT_OK(due);
  ASSERT_EQ(due->size(), 2u);
  // --without-backup is revoked, then --keep, then the exercise follows a default
  std::vector<std::function<Status()>> changes{
      [&] { return store.setPolicy(policy("knee-1", -1, 5)); },
      [&] { return store.setPolicy(policy("knee-1", -1, -1)); },
      [&] { return store.removePolicy("knee-1"); },
      [&] { return store.setPolicy(policy("", -1, 5)); },
  };
  for (const auto& change : changes) {
    ASSERT_OK(change());
    for (const DueRecording& one : *due) {
      const auto left = store.markDeleted(one, crcsOf(3), {"x"}, 1);
      ASSERT_FALSE(left.ok());
      EXPECT_EQ(left.error().code, ErrorCode::kUnavailable);
      EXPECT_NE(left.error().message.find("policy"), std::string::npos) << left.error().message;
    }
  }
  ASSERT_OK(store.beginDerived(id, 100, 1));
  ASSERT_OK(store.appendDerived(id, 0, chunkOf(7)));
  EXPECT_FALSE(store.switchToDerived(due->front(), *store.sums(id), crcsOf(3), {"x"}, 1).ok());
  EXPECT_EQ(sessions.readChunks(uncovered, 0, 9, 1u << 20)->size(), 3u);
  // Unchanged: it continues.
  ASSERT_OK(store.setPolicy(told));
  EXPECT_OK(store.markDeleted(due->back(), crcsOf(3), {"x"}, 1));
}

TEST_F(RetentionStoreTest, badPoliciesAreNamed) {
  auto bad = policy("knee-1", 5, -1);
  bad.set_thin_rate_hz(0);
  EXPECT_NE(store.setPolicy(bad).error().message.find("thin_rate_hz"), std::string::npos);
  bad = policy("knee-1", -1, 40'000);
  EXPECT_NE(store.setPolicy(bad).error().message.find("delete_after_days: 40000"), std::string::npos);
  bad = policy("knee-1", 30, 30);
  EXPECT_FALSE(store.setPolicy(bad).ok());
  bad = policy("knee-1", 5, -1);
  bad.set_thin_coarser(0.5);
  EXPECT_EQ(store.setPolicy(bad).error().code, ErrorCode::kInvalidInput);
}

TEST_F(RetentionStoreTest, aThinnedRecordingReplacesItsOriginal) {
  const Uuid id = add("knee-1", 10);
  ASSERT_OK(ScoreStore(db.writer).put(test::scoreOf(id, "[1]")));
  const auto before = sessions.info(id);
  ASSERT_OK(store.beginDerived(id, 100, 1));
  EXPECT_FALSE(store.beginDerived(id, 100, 1).ok()) << "one at a time";
  EXPECT_FALSE(store.appendDerived(id, 1, chunkOf(7)).ok()) << "a gap";
  EXPECT_FALSE(store.appendDerived(id, 0, Bytes(50)).ok()) << "no chunk";
  ASSERT_OK(store.appendDerived(id, 0, chunkOf(7)));
  // It does not count until the switch.
  EXPECT_TRUE(sound());
  EXPECT_EQ(sessions.info(id)->SerializeAsString(), before->SerializeAsString());
  auto wrong = *store.sums(id);
  wrong.samples += 1;
  EXPECT_FALSE(store.switchToDerived(dueOf(id, false), wrong, crcsOf(3), {"x"}, 1).ok());
  EXPECT_FALSE(store.switchToDerived(dueOf(id, false), *store.sums(id), crcsOf(2), {"x"}, 1).ok());
  ASSERT_OK(store.switchToDerived(dueOf(id, false), *store.sums(id), crcsOf(3), {"retention"},
                                  100 * test::kDay_ns));

  EXPECT_TRUE(sound()) << "the original is still on its way out";
  const auto info = sessions.info(id);
  ASSERT_OK(info);
  EXPECT_EQ(info->chunks(), 1u);
  EXPECT_EQ(info->samples(), 20u);
  EXPECT_EQ(info->score_json(), "[1]");
  EXPECT_EQ(info->removed_original().fate(), pb::RemovedOriginal::THINNED);
  EXPECT_EQ(info->removed_original().samples(), 60u);
  EXPECT_EQ(info->removed_original().hash(), closeOf(id, 3).hash());
  EXPECT_EQ(info->removed_original().removed_unix_ns(), 100 * test::kDay_ns);
  const auto read = sessions.readChunks(id, 0, 10, 1 << 20);
  ASSERT_OK(read);
  ASSERT_EQ(read->size(), 1u);
  EXPECT_EQ((*read)[0].bytes, chunkOf(7));
  EXPECT_EQ(sessions.seek(id, {145, 0})->seq, 0u);

  // The original is deleted in pieces, from its end.
  ASSERT_EQ(store.leftovers()->size(), 1u);
  EXPECT_TRUE(*store.removeSome(id, 2));
  EXPECT_TRUE(sound());
  EXPECT_TRUE(*store.removeSome(id, 2));
  EXPECT_FALSE(*store.removeSome(id, 2));
  EXPECT_TRUE(store.leftovers()->empty());
  EXPECT_TRUE(sound());
  const test::WithZone zone("UTC");
  const auto check = sessions.verify(id);
  EXPECT_NE(check->text.find("thinned on 1970-04-11 (a reason)"), std::string::npos) << check->text;
  EXPECT_EQ(sessions.hashChunks(id, 3).error().code, ErrorCode::kNotFound);
  // It is not possible a second time.
  EXPECT_FALSE(store.beginDerived(id, 10, 1).ok());
}

TEST_F(RetentionStoreTest, aDeletedRecordingLeavesItsSession) {
  const Uuid original = add("knee-1", 10), second = add("knee-1", 10);
  ASSERT_OK(thin(second));
  while (*store.removeSome(second, 100)) continue;
  ASSERT_OK(store.markDeleted(dueOf(original, true), crcsOf(3), {"retention"}, 200 * test::kDay_ns));
  auto due = dueOf(second, true);
  due.thinned = true;
  ASSERT_OK(store.markDeleted(due, {}, {"retention"}, 200 * test::kDay_ns));
  EXPECT_FALSE(store.markDeleted(due, {}, {"retention"}, 1).ok()) << "once";
  EXPECT_TRUE(sound());
  EXPECT_EQ(store.leftovers()->size(), 2u);
  const test::WithZone zone(test::kStJohns);  // midnight UTC falls on the previous evening
  for (const Uuid& id : {original, second}) {
    while (*store.removeSome(id, 1)) EXPECT_TRUE(sound());
    const auto info = sessions.info(id);
    EXPECT_EQ(info->chunks(), 0u);
    EXPECT_EQ(info->removed_original().fate(), pb::RemovedOriginal::DELETED);
    EXPECT_EQ(info->removed_original().hash(), closeOf(id, 3).hash());
    EXPECT_EQ(info->removed_original().deleted_unix_ns(), 200 * test::kDay_ns);
    const auto refused = sessions.readChunks(id, 0, 10, 1 << 20);
    ASSERT_FALSE(refused.ok());
    EXPECT_EQ(refused.error().code, ErrorCode::kNotFound);
    EXPECT_NE(refused.error().message.find("deleted on 1970-07-19 (a reason)"), std::string::npos)
        << refused.error().message;
    EXPECT_EQ(sessions.seek(id, {0, 0}).error().code, ErrorCode::kNotFound);
  }
  EXPECT_TRUE(sound());
  EXPECT_TRUE(store.leftovers()->empty());
  auto rows =
      db.writer.prepare("SELECT (SELECT count(*) FROM chunks) + (SELECT count(*) FROM derived_chunks)");
  ASSERT_TRUE(*rows.step());
  EXPECT_EQ(rows.integer(0), 0);
}

TEST_F(RetentionStoreTest, aStationThatSendsOldChunksAgainHearsTheTruth) {
  const Uuid thinned = add("knee-1", 10), deleted = add("knee-1", 10);
  ASSERT_OK(thin(thinned));
  ASSERT_OK(store.markDeleted(dueOf(deleted, true), crcsOf(3), {"retention"}, 1));
  for (const Uuid& id : {thinned, deleted}) {
    while (*store.removeSome(id, 100)) continue;
    EXPECT_EQ(*sessions.open(
                  [&] {
                    auto d = test::describe(id);
                    d.set_exercise_id("knee-1");
                    return d;
                  }(),
                  9),
              3u);
    for (std::uint64_t seq = 0; seq < 3; ++seq) {
      const auto again = sessions.append(id, seq, chunkOf(seq));
      EXPECT_EQ(again->kind, Appended::Kind::kRepeated);
      EXPECT_EQ(again->next_seq, 3u);
    }
    // other bytes; bytes that are not a chunk, with a valid CRC at the end; one more chunk
    EXPECT_EQ(sessions.append(id, 1, chunkOf(2))->kind, Appended::Kind::kContradiction);
    Bytes forged = chunkOf(1);
    forged[20] ^= 1;
    EXPECT_EQ(sessions.append(id, 1, forged)->kind, Appended::Kind::kContradiction);
    EXPECT_EQ(sessions.append(id, 3, chunkOf(3))->kind, Appended::Kind::kContradiction);
    EXPECT_EQ(sessions.close(closeOf(id, 3), 9)->kind, Closed::Kind::kRepeated);
    EXPECT_EQ(sessions.close(closeOf(id, 2), 9)->kind, Closed::Kind::kContradiction);
  }
  EXPECT_TRUE(sound());
}

TEST_F(RetentionStoreTest, everyKindOfDamageIsFoundByVerify) {
  const Uuid thinned = add("knee-1", 10), deleted = add("knee-1", 10);
  const Uuid kept = add("knee-1", 10);
  ASSERT_OK(thin(thinned));
  ASSERT_OK(store.markDeleted(dueOf(deleted, true), crcsOf(3), {"retention"}, 1));
  for (const Uuid& id : {thinned, deleted}) {
    while (*store.removeSome(id, 100)) continue;
  }
  ASSERT_TRUE(sound());
  const std::string damages[] = {
      "UPDATE derived_chunks SET crc = crc + 1",
      "DELETE FROM derived_chunks",
      "UPDATE derived_recordings SET samples = 19",
      "UPDATE derived_recordings SET hash = zeroblob(32)",
      "UPDATE derived_recordings SET original_hash = zeroblob(32)",
      "DELETE FROM derived_chunks; DELETE FROM derived_recordings",
      "DELETE FROM removed_originals",
      "UPDATE removed_originals SET crcs = zeroblob(4)",
      "UPDATE sessions SET recording = 1",
      "UPDATE sessions SET recording = 3 WHERE recording = 1",
      "INSERT INTO chunks SELECT 2, 0, samples, crc, bytes FROM chunks WHERE session = 3 AND seq = 0",
  };
  for (const std::string& damage : damages) {
    ASSERT_OK(db.writer.script("BEGIN;" + damage));
    bool all = true;
    for (const Uuid& id : {thinned, deleted, kept}) {
      const auto check = sessions.verify(id);
      ASSERT_OK(check);
      all = all && check->ok;
    }
    EXPECT_FALSE(all) << damage;
    ASSERT_OK(db.writer.script("ROLLBACK"));
  }
  EXPECT_TRUE(sound());
}

TEST_F(RetentionStoreTest, checkNamesEveryDamagedChunkAndTheRestIsRead) {
  const Uuid bad = add("knee-1", 10, 12), good = add("knee-1", 10, 5);
  ASSERT_OK(
      db.writer.script("UPDATE chunks SET crc = 0 WHERE session = 1 AND seq IN (2, 3, 9);"
                       "DELETE FROM chunks WHERE session = 1 AND seq IN (5, 11)"));
  const auto check = checkDatabase(db.writer);
  ASSERT_OK(check);
  ASSERT_EQ(check->faults.size(), 5u);
  std::size_t i = 0;
  for (const char* chunk : {"chunk 2", "chunk 3", "chunk 5", "chunk 9", "chunk 11"}) {
    const std::string& text = check->faults[i++];
    EXPECT_NE(text.find(chunk), std::string::npos) << text;
    EXPECT_NE(text.find(uuidText(bad)), std::string::npos) << text;
  }
  EXPECT_EQ(check->chunks, 7u + 5u);
  EXPECT_TRUE(sessions.verify(good)->ok);
  const auto around = sessions.readAround(bad, 1, 100, 1 << 20);
  ASSERT_OK(around);
  EXPECT_EQ(around->chunks.size(), 6u);
  EXPECT_EQ(around->damaged.size(), 5u);
  EXPECT_EQ(around->next_seq, 12u);
  EXPECT_EQ(around->chunks.back().bytes, chunkOf(10));
}

}  // namespace
}  // namespace needlelab
