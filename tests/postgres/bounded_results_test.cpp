// PostgreSQL's driver reads a result completely before its first row: from a recording, a log or a list only
// the requested part is read, however much follows. And what a connection keeps at its server is bounded.
#include <gtest/gtest.h>

#include <fmt/core.h>

#include <algorithm>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "common/base/files/files.h"
#include "common/scoring/motion/recorded_samples.h"
#include "db/audit/audit.h"
#include "db/audit/audit_chain.h"
#include "db/people/people.h"
#include "db/service/scoring/session_samples.h"
#include "db/sessions/session_results.h"
#include "db/store/store_address.h"
#include "tests/support/store/chunk_files.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

/// Rows and bytes of other, small answers: the session's row, the view.
constexpr std::uint64_t kRowsBesides = 16, kBytesBesides = 16 << 10;

/// What the connection received while `work` ran.
template <typename Work>
ResultsSoFar cameDuring(Connection& connection, const Work& work) {
  const ResultsSoFar before = connection.results();
  work();
  const ResultsSoFar after = connection.results();
  return {after.rows - before.rows, after.bytes - before.bytes, after.largest};
}

/// One session of chunks with noise, so that they are large.
class BoundedResults : public testing::Test {
 protected:
  static constexpr std::uint64_t kChunks = 200;
  static Bytes noisyChunk(std::uint64_t seq, std::size_t samples) {
    auto some = test::someSamples(seq * samples, samples);
    std::uint64_t state = seq + 1;
    for (GestureSample& sample : some)
      for (auto& component : sample.p_WT_m) {
        state = state * 6364136223846793005u + 1442695040888963407u;
        component = 1e-6 * static_cast<double>(state >> 48);
      }
    return encodeChunk(Resolution{}, some);
  }
  void record(std::uint64_t chunks, std::size_t samples) {
    pb::SessionDescription description = test::describe(id);
    description.set_profile_json(profile);
    ASSERT_OK(SessionStore(db.writer).open(description, 1));
    for (std::uint64_t seq = 0; seq < chunks; ++seq) {
      const Bytes bytes = noisyChunk(seq, samples);
      largest_chunk = std::max<std::uint64_t>(largest_chunk, bytes.size());
      all_bytes += bytes.size();
      ASSERT_OK(SessionStore(db.writer).append(id, seq, bytes, "station-1"));
    }
  }

  test::TestDb db;
  const Uuid id = makeUuidV7();
  std::string profile =
      test::TestDb::must(readWholeFile(std::string(NEEDLELAB_SOURCE) + "/db/samples/knee-adult.json"));
  std::uint64_t largest_chunk = 0, all_bytes = 0;
};

// as the thief of a key sends them: each is stored through the writer
TEST_F(BoundedResults, appendingReadsNoEarlierQuarantinedChunk) {
  const auto refused = test::namedChunks(std::filesystem::path(NEEDLELAB_TEST_DATA) / "gesture/refused.tsv");
  ASSERT_FALSE(refused.empty());
  const Bytes& bad = refused.front().second;
  ASSERT_OK(SessionStore(db.writer).open(test::describe(id), 1));
  constexpr std::uint64_t kBad = 100;
  std::uint64_t last = 0;
  for (std::uint64_t seq = 0; seq < kBad; ++seq) {
    const auto came = cameDuring(db.writer, [&] {
      const auto appended = SessionStore(db.writer).append(id, seq, bad, "station-1");
      ASSERT_OK(appended);
      EXPECT_TRUE(appended->quarantined);
    });
    last = came.rows;
  }
  EXPECT_LE(last, kRowsBesides);
}

TEST_F(BoundedResults, readingARecordingFetchesOnlyTheRequestedChunks) {
  record(kChunks, 2000);
  ASSERT_GT(all_bytes, 20 * largest_chunk);
  auto reader = db.reader();
  SessionStore store(reader);
  const auto expectAtMost = [&](const char* what, const ResultsSoFar& came, std::uint64_t rows,
                                std::uint64_t bytes) {
    EXPECT_LE(came.rows, rows + kRowsBesides) << what;
    EXPECT_LE(came.bytes, bytes + largest_chunk + kBytesBesides) << what;
  };
  for (const std::uint64_t from : {std::uint64_t{0}, kChunks / 2, kChunks - 1})
    expectAtMost("one chunk",
                 cameDuring(reader, [&] { EXPECT_EQ(store.readChunks(id, from, 1, 1 << 20)->size(), 1u); }),
                 1, 0);
  const std::uint64_t most_bytes = 5 * largest_chunk;
  expectAtMost("chunks up to some bytes",
               cameDuring(reader, [&] { EXPECT_GE(store.readChunks(id, 3, 1000, most_bytes)->size(), 4u); }),
               kChunks / 10, most_bytes);

  // hashing in turns reads each chunk once, except the one that ends a turn
  HashSoFar so_far;
  const std::uint64_t turn = 10 * largest_chunk;
  std::uint64_t turns = 0, rows = 0;
  while (so_far.chunks < kChunks) {
    const std::uint64_t chunks_before = so_far.chunks;
    const auto came = cameDuring(reader, [&] { ASSERT_OK(store.hashOn(id, kChunks, turn, so_far)); });
    expectAtMost("a turn of the hash", came, so_far.chunks - chunks_before, turn);
    rows += came.rows;
    ASSERT_LT(++turns, kChunks);
  }
  EXPECT_GT(turns, 5u);
  EXPECT_LE(rows, kChunks + turns * 4);
  const auto whole = SessionStore(db.writer).hashChunks(id, kChunks);
  ASSERT_OK(whole);
  EXPECT_EQ(so_far.result().hash, whole->hash);

  SessionCheckSoFar check;
  const auto checked = cameDuring(reader, [&] { ASSERT_OK(store.verifyOn(id, turn, check)); });
  expectAtMost("a turn of the check", checked, 20, turn);

  const auto sought = cameDuring(reader, [&] {
    const auto found = store.seek(id, {.tick = 2000 * 77 + 5});
    ASSERT_OK(found);
    EXPECT_EQ(found->seq, 77u);
    EXPECT_LE(found->chunks_read, 20u);
  });
  expectAtMost("a search", sought, 20, 20 * largest_chunk);

  SessionReading reading(id);
  const auto step = cameDuring(reader, [&] {
    StepWork work(1);
    const auto all = reading.step(reader, work);
    ASSERT_OK(all);
    EXPECT_FALSE(*all);
  });
  expectAtMost("a step of a score", step, 1, profile.size());
  // for each chunk the session's row and the chunk's; the view is the step's
  const std::uint64_t trips = reader.roundTrips();
  StepWork some(20'000);
  ASSERT_OK(reading.step(reader, some));
  const std::uint64_t chunks_read = 20'000 / (2000 + 100) + 1;
  EXPECT_LE(reader.roundTrips() - trips, 2 * chunks_read + 4);
}

TEST_F(BoundedResults, whatIsMissingIsFoundAtTheEndsOfPiecesToo) {
  constexpr std::uint64_t kAll = 600;  // a piece has at most 256
  record(kAll, 5);
  const std::set<std::uint64_t> missing = {0, 255, 256, 257, 300, 511, 599};
  for (const std::uint64_t seq : missing) ASSERT_OK(db.writer.run("DELETE FROM chunks WHERE seq = ?", seq));
  auto reader = db.reader();
  const auto read = SessionStore(reader).readAround(id, 0, kAll, 1 << 30);
  ASSERT_OK(read);
  std::set<std::uint64_t> damaged;
  for (const auto& one : read->damaged) damaged.insert(one.seq);
  EXPECT_EQ(damaged, missing);
  EXPECT_EQ(read->chunks.size(), kAll - missing.size());
  for (const auto& chunk : read->chunks) EXPECT_EQ(chunk.bytes, noisyChunk(chunk.seq, 5));
}

TEST_F(BoundedResults, listingSessionsFetchesNoProfilesAndOnlyOnePage) {
  constexpr int kSessions = 75;
  constexpr std::size_t kScore = 40'000;
  profile.insert(1, std::string(100'000, ' '));
  for (int i = 0; i < kSessions; ++i) {
    pb::SessionDescription description = test::describe(makeUuidV7());
    description.set_profile_json(profile);
    description.set_started_unix_ns(1000 + i);
    ASSERT_OK(SessionStore(db.writer).open(description, 1));
  }
  ASSERT_OK(
      db.writer.run("UPDATE sessions SET score_json = '[\"' || repeat('x', CAST(? AS INTEGER)) || '\"]'",
                    static_cast<std::int64_t>(kScore)));
  auto reader = db.reader();
  std::vector<pb::SessionInfo> all;
  const std::uint64_t trips = reader.roundTrips();
  const auto came = cameDuring(reader, [&] {
    auto listed = SessionStore(reader).list({});
    ASSERT_OK(listed);
    all = *std::move(listed);
  });
  ASSERT_EQ(all.size(), kSessions);
  std::uint64_t last = 1000 + kSessions;
  for (const pb::SessionInfo& one : all) EXPECT_EQ(one.description().started_unix_ns(), --last);
  EXPECT_LE(came.bytes, kSessions * (kScore + 2000) + kBytesBesides) << "no profile";
  EXPECT_LE(came.rows, kSessions + kRowsBesides);
  EXPECT_LE(came.largest, (1u << 20) + 2 * kScore);
  EXPECT_LE(reader.roundTrips() - trips, 12u) << "not row by row";

  // a caller that stops early has not read the others
  constexpr std::size_t kTaken = 5;
  const auto some = cameDuring(reader, [&] {
    std::size_t taken = 0;
    const auto listed =
        SessionStore(reader).list({}, {}, false, [&](pb::SessionInfo&) { return ++taken <= kTaken; });
    ASSERT_OK(listed);
    EXPECT_EQ(listed->size(), kTaken);
  });
  EXPECT_LE(some.rows, kRowsBesides + 1);
  pb::ListSessions few;
  few.set_limit(3);
  const auto three = cameDuring(reader, [&] { EXPECT_EQ(SessionStore(reader).list(few)->size(), 3u); });
  EXPECT_LE(three.rows, 4u);
}

TEST_F(BoundedResults, readingRemarksFetchesOnePageOrOneRemark) {
  constexpr std::uint64_t kRemarks = 3000, kText = 4000;
  ASSERT_OK(SessionStore(db.writer).open(test::describe(id), 1));
  ASSERT_OK(
      db.writer.run("INSERT INTO annotations (session, tick, text, author, created_unix_ns)"
                    " SELECT s.number, 7, repeat('x', CAST(?2 AS INTEGER)), 'mia', 1 FROM sessions s, "
                    "generate_series(1, ?1)",
                    kRemarks, kText));
  auto reader = db.reader();
  AnnotationStore remarks(reader);
  constexpr std::size_t kPage = 200;
  std::optional<AnnotationPlace> after;
  std::uint64_t seen = 0;
  for (int pages = 0; pages < 3; ++pages) {
    const auto came = cameDuring(reader, [&] {
      std::size_t taken = 0;
      const auto page = remarks.list(id, after, [&](const StoredAnnotation&) { return ++taken <= kPage; });
      ASSERT_OK(page);
      ASSERT_EQ(page->size(), kPage);
      for (const StoredAnnotation& one : *page) EXPECT_GT(one.id, std::exchange(seen, one.id));
      after = AnnotationPlace{page->back().tick, page->back().id};
    });
    // the next request is at most twice the previous one
    EXPECT_LE(came.rows, 2 * kPage + kRowsBesides);
    EXPECT_LE(came.largest, (1u << 20) + 4 * kText);
  }
  const std::uint64_t trips = reader.roundTrips();
  const auto whole = cameDuring(reader, [&] { EXPECT_EQ(remarks.list(id)->size(), kRemarks); });
  EXPECT_LE(whole.largest, (2u << 20));
  EXPECT_LE(reader.roundTrips() - trips, 100u) << "not row by row";
  const auto one = cameDuring(reader, [&] {
    const auto text = remarks.textOf(id, seen);
    ASSERT_OK(text);
    EXPECT_EQ(text->value_or("").size(), kText);
    EXPECT_FALSE(remarks.textOf(id, kRemarks + 100)->has_value());
    EXPECT_FALSE(remarks.find(id, "server", "cannot be scored: it is too long")->has_value());
  });
  EXPECT_LE(one.rows, kRowsBesides);
  EXPECT_LE(one.bytes, kText + 2 * kBytesBesides);
}

TEST_F(BoundedResults, theAuditLogIsReadInPieces) {
  constexpr int kLines = 1500;
  {
    auto transaction = Transaction::begin(db.writer, Transaction::Kind::kWrite);
    ASSERT_OK(transaction);
    for (int i = 0; i < kLines; ++i)
      ASSERT_OK(AuditStore(db.writer).add({0, i, "mia", "look", std::to_string(i), std::string(1000, 'x')}));
    ASSERT_OK(transaction->commit());
  }
  auto reader = db.reader();
  const auto page =
      cameDuring(reader, [&] { EXPECT_EQ(AuditStore(reader).list(50, 0, "", "")->size(), 50u); });
  EXPECT_LE(page.rows, 50 + kRowsBesides);
  const auto came = cameDuring(reader, [&] {
    const auto verdict = verifyAudit(reader, {}, {});
    ASSERT_OK(verdict);
  });
  EXPECT_LE(came.largest, 1024u * 2200) << "libpq takes blocks of 2 KiB";
  EXPECT_LE(came.rows, 3u * kLines + 1000);
}

std::int64_t namesAt(Connection& connection) {
  const auto count =
      connection.prepare("SELECT count(*) FROM pg_prepared_statements").first([](const Statement& row) {
        return row.integer(0);
      });
  return count && *count ? **count : -1;
}

TEST_F(BoundedResults, thousandsOfTextsLeaveFewPreparedStatements) {
  constexpr const char* kOften = "SELECT 7";
  const auto ask = [&](const std::string& sql) { EXPECT_OK(db.writer.prepare(sql).first(firstText)); };
  ask(kOften);
  for (int i = 0; i < 2000; ++i) {
    ask(fmt::format("SELECT {} AS a", i));
    if (i % 100 != 0) continue;
    const std::uint64_t before = db.writer.roundTrips();
    ask(kOften);
    EXPECT_EQ(db.writer.roundTrips() - before, 1u) << i << ": what is used often stays prepared";
  }
  EXPECT_LE(namesAt(db.writer), 256 + 8);
  EXPECT_GT(namesAt(db.writer), 200);

  // also within a transaction, between savepoints
  auto transaction = Transaction::begin(db.writer, Transaction::Kind::kWriteSoon);
  ASSERT_OK(transaction);
  for (int i = 0; i < 300; ++i) {
    auto savepoint = Savepoint::begin(db.writer);
    ASSERT_OK(savepoint);
    const std::uint64_t before = db.writer.roundTrips();
    if (i % 3 == 0) {
      EXPECT_FALSE(db.writer.run(fmt::format("SELECT {} AS b FROM not_there", i)).ok());
      continue;  // is undone
    }
    ask(fmt::format("SELECT {} AS c", i));
    EXPECT_EQ(db.writer.roundTrips() - before, 2u) << "to forget others has no round trip of its own";
    ASSERT_OK(savepoint->release());
  }
  ASSERT_OK(transaction->commit());
  EXPECT_LE(namesAt(db.writer), 256 + 8);
}

TEST_F(BoundedResults, textsWithValuesOfManyTypesHaveABoundTogether) {
  for (int i = 0; i < 256; ++i) {
    const std::string sql = fmt::format("SELECT {} AS a, ?1 IS NULL, ?2 IS NULL", i);
    for (int types = 0; types < 9; ++types) {
      auto query = db.writer.prepare(sql);
      for (const int type : {types % 3, types / 3})
        type == 0 ? query.bind(1) : type == 1 ? query.bind("text") : query.bind(0.5);
      EXPECT_OK(query.first(firstText));
    }
  }
  EXPECT_LE(namesAt(db.writer), 512 + 256 + 8);
  EXPECT_GE(namesAt(db.writer), 512);
}

TEST_F(BoundedResults, aConnectionWhoseServerLacksMemoryIsNotLentAgain) {
  ReaderPool pool(db.address);
  const auto borrow = [&](std::string_view state) {
    auto lease = pool.borrow();
    EXPECT_OK(lease);
    const auto pid = (*lease)->prepare("SELECT pg_backend_pid()").first([](const Statement& row) {
      return row.integer(0);
    });
    EXPECT_OK(pid);
    if (!state.empty()) {
      EXPECT_FALSE(
          (*lease)
              ->script(fmt::format("DO $$BEGIN RAISE EXCEPTION 'planted' USING ERRCODE = '{}'; END$$", state))
              .ok());
    }
    return pid && *pid ? **pid : -1;
  };
  const std::int64_t first = borrow("");
  EXPECT_EQ(borrow("22012"), first) << "an error of what was asked";
  EXPECT_EQ(borrow("53200"), first);
  const std::int64_t second = borrow("53300");
  EXPECT_NE(second, first);
  EXPECT_NE(borrow(""), second);
}

TEST_F(BoundedResults, theEventsOfASessionAreOneStatement) {
  ASSERT_OK(SessionStore(db.writer).open(test::describe(id), 1));
  ASSERT_OK(SessionStore(db.writer).close(test::closeOf(id, 0), 2, "station-1"));
  std::vector<pb::SyringeEvent> events(3600);
  for (std::size_t i = 0; i < events.size(); ++i) {
    pb::SyringeEvent& event = events[i];
    event.set_kind(i % 2 == 0 ? pb::SyringeEvent::ASPIRATION : pb::SyringeEvent::INJECTION);
    event.set_begin_tick(i);
    event.set_end_tick(i + 1);
    event.set_begin_s(0.1 * static_cast<double>(i));
    event.set_end_s(1.0 / 3.0 + static_cast<double>(i));
    event.set_plunger_from(1e-300);
    event.set_in_target_share(5e-324);
    event.mutable_begin()->set_x_m(-0.1 / 3.0);
    event.mutable_begin()->set_in_tissue(i % 3 == 0);
    event.mutable_begin()->set_layer(i % 3 == 0 ? 2 : -1);
    event.mutable_begin()->set_tissue("skin, \"'{}\\ and NULL");
    event.mutable_end()->set_layer(-1);
    event.mutable_end()->set_target_distance_m(-1e300);
    if (i % 5 == 0) event.add_hazards("nerve");
    if (i % 10 == 0) event.add_hazards("artery");
  }
  const std::uint64_t before = db.writer.roundTrips();
  ASSERT_OK(EventStore(db.writer).put(id, events));
  EXPECT_LE(db.writer.roundTrips() - before, 6u);
  const auto stored = EventStore(db.writer).list(id);
  ASSERT_OK(stored);
  ASSERT_TRUE(stored->has_value());
  ASSERT_EQ((*stored)->size(), events.size());
  for (std::size_t i = 0; i < events.size(); ++i) {
    EXPECT_EQ((**stored)[i].SerializeAsString(), events[i].SerializeAsString()) << i;
  }
}

TEST_F(BoundedResults, theMembersOfAGroupAreOneStatement) {
  ASSERT_OK(
      db.writer.run("INSERT INTO people (id, uuid, role, created_unix_ns, changed_unix_ns) SELECT i,"
                    " decode(lpad(to_hex(i), 32, '0'), 'hex'), 1, 1, 1 FROM generate_series(1, 300) AS i"));
  ASSERT_OK(
      db.writer.run("INSERT INTO names (person, name, folded, typed) SELECT i, 'p' || i, 'p' || i, 0"
                    " FROM generate_series(1, 300) AS i"));
  pb::Group group;
  group.set_id("year-1");
  group.set_name("Year 1");
  for (int i = 1; i <= 300; ++i) group.add_members(fmt::format("@{}", i));
  GroupStore groups(db.writer);
  const std::uint64_t before = db.writer.roundTrips();
  const auto put = groups.put(group, {}, "mia", 1);
  ASSERT_OK(put);
  EXPECT_LE(db.writer.roundTrips() - before, 24u);
  EXPECT_EQ(put->members_size(), 300);
  group.add_members("nobody");
  const auto refused = groups.put(group, {}, "mia", 2);
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.error().message.find("'nobody'"), std::string::npos) << refused.error().message;
}

}  // namespace
}  // namespace needlelab
