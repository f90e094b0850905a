// Storing chunks together (SessionStore::appendMany, DbWriter::postChunk) or one by one gives the same
// results and the same tables. On SQLite the writer appends one by one, too.
#include <atomic>
#include <deque>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "db/people/people.h"
#include "db/sessions/db_writer.h"
#include "db/sessions/unknown_trainees.h"
#include "tests/support/store/chunk_files.h"
#include "tests/unit/db/planted_here.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

using namespace std::chrono_literals;
using test::chunkOf;

/// An arriving chunk and its result.
struct Arrival {
  Uuid session{};
  std::uint64_t seq = 0;
  Bytes bytes;
  std::string station = "station-1";
  bool admitted = true;
  std::optional<StationClaim> claim{};  ///< the log-in that sent it

  Appended appended;
  Status status = Error{ErrorCode::kFailed, "not done"};
  int asked = 0;  ///< number of calls of admit()

  ArrivedChunk chunk() {
    const auto admit = [this](const Appended& stored) -> Status {
      EXPECT_EQ(stored.next_seq, seq + 1);
      ++asked;
      if (admitted) return {};
      return Error{ErrorCode::kNoRoom, "its share is used up"};
    };
    ArrivedChunk chunk{session, seq, bytes, station, &appended, admit};
    if (claim) chunk.claim = &*claim;
    return chunk;
  }
  /// The answer to its station, and the counters.
  [[nodiscard]] std::string outcome() const {
    std::string text = "asked " + std::to_string(asked) + ", ";
    if (!status) return text + "error " + std::to_string(static_cast<int>(status.error().code));
    return text + "kind " + std::to_string(static_cast<int>(appended.kind)) + ", next " +
           std::to_string(appended.next_seq) + (appended.quarantined ? ", quarantined: " : ": ") +
           appended.text;
  }
};
using Arrivals = std::deque<Arrival>;  // their addresses must not change

std::string rowsOf(Connection& connection, const std::string& sql) {
  std::string text;
  auto rows = connection.prepare(sql);
  for (;;) {
    const auto there = rows.step();
    if (!there) return there.error().message;
    if (!*there) return text;
    text += rows.text(0) + "\n";
  }
}

/// Everything that appending chunks changes.
std::string tablesOf(Connection& connection) {
  std::string text;
  for (const char* const sql :
       {"SELECT hex(id) || ' ' || state || ' ' || chunks || ' ' || samples || ' ' || stored_bytes || ' ' || "
        "erased FROM sessions ORDER BY number",
        "SELECT session || ' ' || chunks || ' ' || samples || ' ' || stored_bytes FROM session_progress "
        "ORDER BY session",
        "SELECT session || ' ' || seq || ' ' || samples || ' ' || crc || ' ' || hex(bytes) FROM chunks "
        "ORDER BY session, seq",
        "SELECT session || ' ' || seq || ' ' || reason FROM quarantined_chunks ORDER BY session, seq",
        "SELECT id || ' ' || who || ' ' || action || ' ' || subject || ' ' || detail FROM audit ORDER BY id",
        "SELECT key FROM meta WHERE key LIKE 'contradicted%' ORDER BY key"})
    text += rowsOf(connection, sql) + "--\n";
  return text;
}

void open(Connection& writer, const Uuid& id, const std::string& station, const std::string& trainee) {
  auto description = test::describe(id);
  description.set_station(station);
  description.set_trainee(trainee);
  ASSERT_OK(SessionStore(writer).open(description, 1));
}

/// One by one, each in its savepoint, as DbWriter used to do.
void appendEach(Connection& writer, Arrivals& arrivals) {
  auto transaction = Transaction::begin(writer, Transaction::Kind::kWrite);
  ASSERT_OK(transaction);
  for (Arrival& arrival : arrivals) {
    auto savepoint = Savepoint::begin(writer);
    ASSERT_OK(savepoint);
    arrival.status = SessionStore(writer).append(arrival.chunk());
    if (arrival.status.ok()) ASSERT_OK(savepoint->release());
  }
  ASSERT_OK(transaction->commit());
}

/// Through a DbWriter with groups of `group`. Returns its counters.
DbWriter::Counters appendByWriter(Connection connection, Arrivals& arrivals, std::size_t group) {
  DbWriter writer(std::move(connection), {.window = 1h, .max_group = group}, {});
  for (Arrival& arrival : arrivals)
    EXPECT_OK(
        writer.postChunk(arrival.chunk(), [&arrival](const Status& status) { arrival.status = status; }));
  writer.stop();
  EXPECT_FALSE(writer.failed().has_value());
  return writer.counters();
}

/// Sessions of every kind, the same in two databases.
class TwoDatabases {
 public:
  TwoDatabases() {
    for (int i = 0; i < 4; ++i) sessions_.push_back({makeUuidV7(), "station-1", "anna"});
    sessions_.push_back({makeUuidV7(), "station-2", "anna"});
    closed_ = sessions_.size();
    sessions_.push_back({makeUuidV7(), "station-1", "anna"});
    erased_ = sessions_.size();
    sessions_.push_back({makeUuidV7(), "station-1", "ben"});
    for (test::TestDb* const db : {&each, &many}) fill(*db);
    unknown_ = sessions_.size();
    sessions_.push_back({makeUuidV7(), "station-1", "anna"});
  }

  /// Chunks as a station sends them, and others; most are the next ones.
  Arrivals arrivals(std::mt19937_64& random, std::size_t count) {
    const auto drawn = [&](std::size_t below) { return static_cast<std::size_t>(random() % below); };
    Arrivals made;
    std::size_t session = 0;
    while (made.size() < count) {
      if (drawn(3) == 0) session = drawn(sessions_.size());
      Known& known = sessions_[session];
      Arrival& arrival = made.emplace_back();
      arrival.session = known.id;
      arrival.station = known.station;
      arrival.seq = known.next;
      arrival.bytes = chunkOf(arrival.seq, 5);
      bool stored = session != closed_ && session != erased_ && session != unknown_;
      switch (drawn(24)) {
        case 0:  // repeated
          arrival.seq = known.next > 0 ? drawn(known.next) : 0;
          arrival.bytes = chunkOf(arrival.seq, 5);
          stored = stored && known.next == 0;
          break;
        case 1:  // different bytes
          arrival.seq = known.next > 0 ? drawn(known.next) : 0;
          arrival.bytes = chunkOf(arrival.seq, 6);
          stored = stored && known.next == 0;
          break;
        case 2:
          arrival.seq += 1 + drawn(3);
          stored = false;
          break;
        case 3:
          arrival.station = arrival.station == "station-1" ? "station-2" : "station-1";
          stored = false;
          break;
        case 4:
          arrival.bytes = undecodable_[drawn(undecodable_.size())].second;
          break;
        case 5:
          arrival.bytes[arrival.bytes.size() / 2] ^= 1;
          stored = false;
          break;
        case 6:
          arrival.admitted = false;
          stored = false;
          break;
        case 7:
          arrival.station.clear();
          break;
        case 8:
          arrival.bytes.resize(drawn(2) == 0 ? 0 : kMaxStoredChunkBytes + 1);
          stored = false;
          break;
        case 9:
          arrival.seq = ~std::uint64_t{0} - drawn(2);
          stored = false;
          break;
        case 10:  // from a log-in before the newest one
          arrival.claim = StationClaim{arrival.station, "first", 1};
          stored = false;
          break;
        case 11:
          arrival.claim = StationClaim{arrival.station, "b", 2};
          break;
        default:
          break;
      }
      if (stored) ++known.next;
    }
    return made;
  }

  test::TestDb each, many;

 private:
  struct Known {
    Uuid id{};
    std::string station, trainee;
    std::uint64_t next = 0;
  };
  void fill(test::TestDb& db) {
    ASSERT_OK(StationStore(db.writer).add("station-2", StationKeyBytes{}, 1));
    for (const char* const name : {"anna", "ben"})
      ASSERT_OK(PeopleStore(db.writer).add({name, pb::TRAINEE, "", false, 1}));
    for (const Known& known : sessions_) open(db.writer, known.id, known.station, known.trainee);
    for (const char* const server : {"first", "b"})
      for (const char* const station : {"station-1", "station-2"})
        ASSERT_OK(StationClaims(db.writer).raise(station, server, 1));
    SessionStore store(db.writer);
    for (std::uint64_t seq = 0; seq < 2; ++seq)
      ASSERT_OK(store.append(sessions_[closed_].id, seq, chunkOf(seq, 5)));
    ASSERT_OK(store.close(test::closeOf(sessions_[closed_].id, 2, 5), 2));
    ASSERT_OK(UnknownTraineeStore(db.writer).leaveEmpty(sessions_[erased_].id, 3));
    for (const std::size_t session : {closed_, erased_}) sessions_[session].next = 2;
  }

  std::vector<Known> sessions_;
  std::size_t closed_ = 0, erased_ = 0, unknown_ = 0;
  const std::vector<std::pair<std::string, Bytes>> undecodable_ =
      test::namedChunks(std::filesystem::path(NEEDLELAB_TEST_DATA) / "gesture/refused.tsv");
};

Arrivals copyOf(const Arrivals& arrivals) {
  return arrivals;
}

TEST(AppendMany, isEquivalentToAppendingOneByOne) {
  const std::size_t groups[] = {1, 7, 64, 400};
  std::uint64_t together = 0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    TwoDatabases two;
    Arrivals one_by_one = two.arrivals(random, 400);
    Arrivals in_groups = copyOf(one_by_one);
    auto reader = two.many.reader();
    appendEach(two.each.writer, one_by_one);
    const auto counters =
        appendByWriter(std::move(two.many.writer), in_groups, groups[seed % std::size(groups)]);
    together += counters.together;
    for (std::size_t i = 0; i < one_by_one.size(); ++i)
      ASSERT_EQ(in_groups[i].outcome(), one_by_one[i].outcome()) << "chunk " << i;
    ASSERT_EQ(tablesOf(reader), tablesOf(two.each.writer));
  }
  // of 4,800; a refused chunk leaves the session's later ones to append()
  EXPECT_GE(together, test::onPostgres() ? 500u : 0u);
  EXPECT_LE(together, test::onPostgres() ? 4800u : 0u);
}

/// Chunks 0 … chunks-1 of each session, alternating as stations send them.
Arrivals nextOnes(const std::vector<Uuid>& sessions, std::uint64_t chunks) {
  Arrivals arrivals;
  for (std::uint64_t seq = 0; seq < chunks; ++seq)
    for (const Uuid& session : sessions) {
      Arrival& arrival = arrivals.emplace_back();
      arrival.session = session;
      arrival.seq = seq;
      arrival.bytes = chunkOf(seq, 5);
    }
  return arrivals;
}

std::vector<Uuid> opened(Connection& writer, int count) {
  std::vector<Uuid> ids;
  for (int i = 0; i < count; ++i) {
    ids.push_back(makeUuidV7());
    open(writer, ids.back(), "station-1", "anna");
  }
  return ids;
}

TEST(AppendMany, takesAGroupWithOneStatementWhereThatSavesRoundTrips) {
  test::TestDb db;
  auto reader = db.reader();
  const auto ids = opened(db.writer, 10);
  Arrivals arrivals = nextOnes(ids, 20);
  const auto counters = appendByWriter(std::move(db.writer), arrivals, 200);
  EXPECT_EQ(counters.commits, 1u);
  EXPECT_EQ(counters.items, 200u);
  EXPECT_EQ(counters.together, test::onPostgres() ? 200u : 0u);
  for (const Arrival& arrival : arrivals) {
    ASSERT_OK(arrival.status);
    EXPECT_EQ(arrival.appended.next_seq, arrival.seq + 1);
    EXPECT_EQ(arrival.asked, 1);
  }
  for (const Uuid& id : ids) EXPECT_EQ(*SessionStore(reader).nextSeq(id), 20u);
  // sent again, all of them are known
  Arrivals again = nextOnes(ids, 20);
  const auto repeated =
      appendByWriter(test::TestDb::must(openAt(db.address, Connection::Mode::kWriter)), again, 200);
  EXPECT_EQ(repeated.together, 0u);
  for (const Arrival& arrival : again) {
    ASSERT_OK(arrival.status);
    EXPECT_EQ(arrival.appended.kind, Appended::Kind::kRepeated);
    EXPECT_EQ(arrival.asked, 0);
  }
}

TEST(AppendMany, looksAtAsManyAsOneStatementMayHave) {
  test::TestDb db;
  const Uuid id = opened(db.writer, 1).front();
  std::deque<Appended> outcomes(SessionStore::kMaxTogether + 10);
  std::vector<ArrivedChunk> chunks;
  std::vector<const ArrivedChunk*> wanted;
  const Bytes bytes = chunkOf(0, 5), large(SessionStore::kMaxTogetherBytes / 2);
  for (std::uint64_t seq = 0; seq < outcomes.size(); ++seq)
    chunks.push_back({id, seq, bytes, "station-1", &outcomes[seq]});
  for (const ArrivedChunk& chunk : chunks) wanted.push_back(&chunk);
  auto transaction = Transaction::begin(db.writer, Transaction::Kind::kWrite);
  ASSERT_OK(transaction);
  const auto results = SessionStore(db.writer).appendMany(wanted);
  ASSERT_OK(results);
  EXPECT_EQ(results->size(), SessionStore::kMaxTogether);
  for (const auto& result : *results) EXPECT_EQ(result.has_value() && result->ok(), test::onPostgres());
  // limited by bytes: two fit exactly, and the first one is taken at any length
  for (ArrivedChunk& chunk : chunks) chunk.bytes = large;
  EXPECT_EQ(SessionStore(db.writer).appendMany(wanted)->size(), 2u);
  const Bytes larger(SessionStore::kMaxTogetherBytes + 1);
  for (ArrivedChunk& chunk : chunks) chunk.bytes = larger;
  const auto first = SessionStore(db.writer).appendMany(wanted);
  EXPECT_EQ(first->size(), 1u);
  EXPECT_FALSE(first->front().has_value()) << "append() refuses it";
  EXPECT_TRUE(SessionStore(db.writer).appendMany({})->empty());
}

// the rows say that A has chunk 3, but its counters do not: only a damaged database has this fault
TEST(AppendMany, aChunkRefusedByTheTableFailsAlone) {
  test::TestDb db;
  auto reader = db.reader();
  const auto ids = opened(db.writer, 2);
  ASSERT_OK(
      db.writer.run("INSERT INTO chunks (session, seq, samples, crc, bytes)"
                    " SELECT number, 3, 1, 0, ? FROM sessions WHERE id = ?",
                    ByteView(chunkOf(3, 5)), ByteView(ids[0])));
  Arrivals arrivals = nextOnes(ids, 6);
  appendByWriter(std::move(db.writer), arrivals, 100);
  for (const Arrival& arrival : arrivals) {
    SCOPED_TRACE(arrival.seq);
    const bool is_other = arrival.session == ids[1];
    if (is_other || arrival.seq < 3) {
      ASSERT_OK(arrival.status);
      EXPECT_EQ(arrival.appended.kind, Appended::Kind::kStored);
    } else if (arrival.seq == 3) {
      ASSERT_FALSE(arrival.status.ok());
      EXPECT_EQ(arrival.status.error().code, ErrorCode::kAlreadyExists) << arrival.status.error().message;
    } else {
      ASSERT_OK(arrival.status);
      EXPECT_EQ(arrival.appended.kind, Appended::Kind::kGap);
    }
  }
  EXPECT_EQ(*SessionStore(reader).nextSeq(ids[0]), 3u);
  EXPECT_EQ(*SessionStore(reader).nextSeq(ids[1]), 6u);
}

// other items of a group see what came before them and nothing that comes after
TEST(AppendMany, otherItemsStayInTheirPlaceAmongTheChunks) {
  test::TestDb db;
  const Uuid id = opened(db.writer, 1).front();
  Arrivals arrivals = nextOnes({id}, 9);
  std::vector<std::uint64_t> seen;
  {
    DbWriter writer(std::move(db.writer), {.window = 1h}, {});
    for (Arrival& arrival : arrivals) {
      ASSERT_OK(
          writer.postChunk(arrival.chunk(), [&arrival](const Status& status) { arrival.status = status; }));
      if (arrival.seq % 3 != 2) continue;
      ASSERT_OK(writer.post(
          [&seen, id](Connection& connection) -> Status {
            ASSIGN_OR_RETURN(const auto next, SessionStore(connection).nextSeq(id));
            seen.push_back(next);
            return {};
          },
          {}));
    }
    writer.stop();
    EXPECT_EQ(writer.counters().commits, 1u);
  }
  EXPECT_EQ(seen, (std::vector<std::uint64_t>{3, 6, 9}));
  for (const Arrival& arrival : arrivals) EXPECT_OK(arrival.status);
}

/// Whether stored data stay unchanged when other data arrive for the same place.
bool keepsWhatIsStored() {
  test::TestDb db;
  auto reader = db.reader();
  const Uuid id = opened(db.writer, 1).front();
  Arrivals arrivals = nextOnes({id}, 4);
  appendByWriter(std::move(db.writer), arrivals, 100);
  const std::string before = rowsOf(reader, "SELECT hex(bytes) FROM chunks ORDER BY seq");
  Arrivals others = nextOnes({id}, 2);
  for (Arrival& other : others) other.bytes = chunkOf(other.seq, 6);
  appendByWriter(test::TestDb::must(openAt(db.address, Connection::Mode::kWriter)), others, 100);
  bool contradict = true;
  for (const Arrival& other : others)
    contradict = contradict && other.status.ok() && other.appended.kind == Appended::Kind::kContradiction;
  return contradict && rowsOf(reader, "SELECT hex(bytes) FROM chunks ORDER BY seq") == before;
}

TEST(AppendMany, whatIsStoredStaysAndATestWouldSeeOtherwise) {
  EXPECT_TRUE(keepsWhatIsStored());
  test::bugPlantedHere() = PlantedBug::kRepeatedChunkOverwrites;
  EXPECT_FALSE(keepsWhatIsStored());
  test::bugPlantedHere().reset();
}

}  // namespace
}  // namespace needlelab
