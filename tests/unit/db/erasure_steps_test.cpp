// An erasure in steps: what each of them reads and writes, what comes between them, and the room that they
// ask for.
#include <fmt/core.h>
#include <gmock/gmock.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "db/audit.h"
#include "db/db_writer.h"
#include "db/erasure.h"
#include "db/people.h"
#include "db/session_results.h"
#include "db/text_pages.h"
#include "db/unknown_trainees.h"
#include "tests/unit/db/erasure_fixture.h"
#include "tests/unit/db/shim_vfs.h"

namespace needlelab {
namespace {

std::string texts(Connection& c, const std::string& sql) {
  const auto rows = c.prepare(sql).all(firstText);
  EXPECT_OK(rows);
  std::string all;
  for (const std::string& row : *rows) all += row + "\n";
  return all;
}
std::string remarks(Connection& c) {
  return texts(c, "SELECT author || ': ' || text FROM annotations ORDER BY id");
}
std::string lines(Connection& c) {
  return texts(c, "SELECT who || '|' || action || '|' || subject || '|' || detail FROM audit ORDER BY id");
}

/// Adds `count` remarks to the session, each `every`th of which is `text`; all are equally long.
void addRemarks(Connection& c, const Uuid& session, std::uint64_t count, std::uint64_t every,
                const std::string& text) {
  ASSERT_OK(
      c.run("WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < ?2)"
            " INSERT INTO annotations (session, tick, author, text, created_unix_ns)"
            " SELECT s.number, 1, 'ina', CASE WHEN i % ?3 = 0 THEN ?4 ELSE printf('%.*c', ?5, '.') END, 1"
            " FROM sessions s, n WHERE s.id = ?1",
            ByteView(session), count, every, text, static_cast<std::uint64_t>(text.size())));
}
void addLines(Connection& c, std::uint64_t count, const std::string& detail) {
  ASSERT_OK(
      c.run("WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < ?1)"
            " INSERT INTO audit (unix_ns, who, action, subject, detail)"
            " SELECT 1, 'ina', 'session assign', 'x', ?2 FROM n",
            count, detail));
}

class ErasureStepsTest : public test::ErasureTest {
 protected:
  static constexpr std::int64_t kWhen = 1'800'000'000'000'000'000;
  Result<FoundNames> look() {
    auto reader = db.reader();
    return ErasureStore(reader).lookForNames("anna", line("anna", kWhen), false);
  }
  Status replace(FoundNames& found, const FoundNames::Page& page) {
    ASSIGN_OR_RETURN(auto transaction, Transaction::begin(db.writer, Transaction::Kind::kWrite));
    RETURN_IF_ERROR(ErasureStore(db.writer).replaceNames(found, page));
    return transaction.commit();
  }
  void replaceAll(FoundNames& found) {
    for (const FoundNames::Page& page : std::vector(found.pages)) ASSERT_OK(replace(found, page));
  }
  Result<ErasedRows> eraseRows(const FoundNames& found) {
    return ErasureStore(db.writer).eraseRows("anna", line("anna", kWhen), "ada", "wish", kWhen, false,
                                             &found);
  }
  std::uint64_t count(const std::string& sql) {
    auto row = db.writer.prepare(sql);
    EXPECT_TRUE(*row.step()) << sql;
    return row.natural(0);
  }
};

TEST_F(ErasureStepsTest, namesAreReplacedInBoundedPagesAndTheTransactionReadsNoRowOfThem) {
  const Uuid of_ben = session("ben", 1, true);
  const std::string note = "better than anna, I think";
  constexpr std::uint64_t kRemarks = 2 * kRowsOfPage + 10, kEvery = 100, kLines = kRowsOfPage + 5;
  addRemarks(db.writer, of_ben, kRemarks, kEvery, note);
  addLines(db.writer, kLines, "from Anna to ben");
  auto found = look();
  ASSERT_OK(found);
  const std::uint64_t with_names = kRemarks / kEvery;
  static_assert(kRemarks - kRemarks % kEvery > 2 * kRowsOfPage, "the last page has a name, too");
  ASSERT_EQ(found->pages.size(), 3u + 2u);
  EXPECT_EQ(found->bytes, with_names * (note.size() + 3) + kLines * (3 + 1 + 16));
  for (const FoundNames::Page& page : std::vector(found->pages)) {
    EXPECT_LE(static_cast<std::uint64_t>(page.last - std::max<std::int64_t>(page.after, 0)), kRowsOfPage);
    ASSERT_OK(replace(*found, page));
    EXPECT_TRUE(PeopleStore(db.writer).find("anna")->has_value()) << "not before the transaction";
  }
  EXPECT_EQ(found->replaced.remarks, with_names);
  EXPECT_EQ(found->replaced.remarks_of_others, with_names);
  EXPECT_EQ(found->replaced.lines, kLines);
  EXPECT_EQ(count("SELECT count(*) FROM annotations WHERE text LIKE '%anna%'"), 0u);
  EXPECT_EQ(count("SELECT count(*) FROM audit WHERE detail = 'from erased-1234 to ben'"), kLines);
  // who read these rows once more would find it
  ASSERT_OK(db.writer.run("UPDATE annotations SET text = 'anna' WHERE id = 7"));
  ASSERT_OK(db.writer.run("UPDATE audit SET detail = 'anna' WHERE id = 7"));
  const auto done = eraseRows(*found);
  ASSERT_OK(done);
  EXPECT_EQ(count("SELECT count(*) FROM annotations WHERE text = 'anna'"), 1u);
  EXPECT_EQ(count("SELECT count(*) FROM audit WHERE detail = 'anna'"), 1u);
  EXPECT_EQ(done->erasure.audit_lines(), kLines);
  EXPECT_FALSE(PeopleStore(db.writer).find("anna")->has_value());
  const auto text = ErasureStore(db.writer).reportOf(*done);
  ASSERT_OK(text);
  EXPECT_THAT(*text, testing::HasSubstr(fmt::format("{} remarks in sessions of others", with_names)));
  EXPECT_THAT(*text, testing::HasSubstr("1 remarks, such as number 7"));
}

TEST_F(ErasureStepsTest, thePersonsSessionsGoInBoundedPagesAndTheTransactionTakesTheLast) {
  const Uuid of_ben = session("ben", 1, true);
  constexpr std::uint64_t kOfAnna = 8, kInPage = 3;
  for (std::uint64_t i = 0; i < kOfAnna; ++i) session("anna", 1, true);
  // the description fills the page up
  ASSERT_OK(db.writer.run("UPDATE sessions SET profile_json = printf('%.*c', ?, '.')",
                          static_cast<std::uint64_t>(kBytesOfPage / kInPage)));
  auto found = look();
  ASSERT_OK(found);
  const auto eraseSome = [&]() -> Result<bool> {
    ASSIGN_OR_RETURN(auto transaction, Transaction::begin(db.writer, Transaction::Kind::kWrite));
    ASSIGN_OR_RETURN(const bool more, ErasureStore(db.writer).eraseSomeSessions("anna", line("anna", kWhen),
                                                                                "ada", kWhen, false, *found));
    RETURN_IF_ERROR(transaction.commit());
    return more;
  };
  const auto erased = [&] {
    return count("SELECT count(*) FROM sessions WHERE erased = 1 AND profile_json = '{}'");
  };
  for (const std::uint64_t expected : {kInPage, 2 * kInPage}) {
    EXPECT_TRUE(*eraseSome());
    EXPECT_EQ(erased(), expected);
    EXPECT_TRUE(PeopleStore(db.writer).find("anna")->has_value()) << "not before the transaction";
  }
  EXPECT_FALSE(*eraseSome()) << "two are left, less than a page";
  EXPECT_EQ(erased(), 2 * kInPage);
  const auto done = eraseRows(*found);
  ASSERT_OK(done);
  EXPECT_EQ(done->erasure.sessions(), kOfAnna);
  EXPECT_EQ(done->erasure.recordings(), kOfAnna);
  EXPECT_EQ(done->session_ids.size(), kOfAnna) << "backups are searched for all of them";
  EXPECT_EQ(erased(), kOfAnna);
  EXPECT_EQ(count("SELECT count(*) FROM sessions WHERE trainee = 'erased-1234'"), kOfAnna);
  EXPECT_EQ(SessionStore(db.writer).info(of_ben)->description().trainee(), "ben");
}

TEST_F(ErasureStepsTest, aNameThatStationsGaveIsLookedForAlsoOnceItsSessionsAreErased) {
  const Uuid misspelt = session("Annuschka", 1, true);
  ASSERT_OK(UnknownTraineeStore(db.writer).assign(misspelt, "anna", {}, "mia", 3));
  session("anna", 1, true);
  ASSERT_OK(db.writer.run("UPDATE sessions SET profile_json = printf('%.*c', ?, '.')",
                          static_cast<std::uint64_t>(kBytesOfPage)));
  auto found = look();
  ASSERT_OK(found);
  ASSERT_TRUE(
      *ErasureStore(db.writer).eraseSomeSessions("anna", line("anna", kWhen), "ada", kWhen, false, *found));
  ASSERT_OK(AnnotationStore(db.writer).add({0, misspelt, 1, "Annuschka holds still", "ina", 1}));
  const auto done = eraseRows(*found);
  ASSERT_OK(done);
  EXPECT_EQ(remarks(db.writer), "ina: erased-1234 holds still\n");
  EXPECT_EQ(done->names.given, std::vector<std::string>{"Annuschka"});
}

TEST_F(ErasureStepsTest, aPageOfLongTextsEndsAtItsBytes) {
  const Uuid of_ben = session("ben", 1, true);
  const std::string note = "anna " + std::string(4091, '.');
  constexpr std::uint64_t kRemarks = 600;  // 2.4 MB
  addRemarks(db.writer, of_ben, kRemarks, 1, note);
  const auto found = look();
  ASSERT_OK(found);
  const std::uint64_t bytes_of_row = note.size() + std::string("ina").size();
  const std::uint64_t rows_of_page = (kBytesOfPage + bytes_of_row - 1) / bytes_of_row;
  EXPECT_EQ(found->pages.size(), (kRemarks + rows_of_page - 1) / rows_of_page);
}

TEST_F(ErasureStepsTest, whatComesBetweenTheStepsGoesWithTheTransaction) {
  const Uuid of_ben = session("ben", 1, true), of_anna = session("anna", 2, true);
  const auto remark = [&](const Uuid& id, const std::string& text, const std::string& author) {
    ASSERT_OK(AnnotationStore(db.writer).add({0, id, 1, text, author, 1}));
  };
  remark(of_ben, "as anna does", "ina");
  remark(of_anna, "Östlund-Berg holds still", "ina");
  auto found = look();
  ASSERT_OK(found);
  remark(of_ben, "anna again", "anna");
  const Uuid later = session("anna", 1, false);
  remark(later, "Östlund-Berg, hold still", "ina");
  ASSERT_OK(AuditStore(db.writer).add({0, 1, "ina", "consent", "anna", "given"}));
  replaceAll(*found);
  remark(of_anna, "Anna Östlund-Berg is done", "ina");
  const auto done = eraseRows(*found);
  ASSERT_OK(done);
  EXPECT_EQ(done->erasure.sessions(), 2u);
  EXPECT_EQ(remarks(db.writer),
            "ina: as erased-1234 does\nina: erased-1234 holds still\nerased-1234: erased-1234 again\n"
            "ina: erased-1234, hold still\nina: erased-1234 is done\n");
  EXPECT_EQ(lines(db.writer).find("anna"), std::string::npos) << lines(db.writer);
  EXPECT_EQ(done->replaced.remarks, 5u);
}

TEST_F(ErasureStepsTest, whatThePersonGetsBetweenTheStepsIsLookedForInOlderRowsToo) {
  const Uuid of_ben = session("ben", 1, true), of_anna = session("anna", 1, true);
  ASSERT_OK(AnnotationStore(db.writer).add({0, of_anna, 1, "Quint holds still", "ina", 1}));
  ASSERT_OK(AnnotationStore(db.writer).add({0, of_ben, 1, "Östlund-Berg holds still", "ina", 1}));
  auto found = look();
  ASSERT_OK(found);
  replaceAll(*found);
  EXPECT_EQ(remarks(db.writer), "ina: Quint holds still\nina: Östlund-Berg holds still\n");
  ASSERT_OK(PeopleStore(db.writer).change("anna", {}, {.full_name = "Anna Quint"}, "mia", 2));
  // a manager gives the person a session, whose remarks are about it from now on
  ASSERT_OK(db.writer.run("UPDATE sessions SET trainee = 'anna' WHERE id = ?", ByteView(of_ben)));
  ASSERT_OK(eraseRows(*found));
  EXPECT_EQ(remarks(db.writer), "ina: erased-1234 holds still\nina: erased-1234 holds still\n");
}

TEST_F(ErasureStepsTest, namesOfGroupsThatLoseThePersonAreNoOtherNames) {
  const Uuid of_ben = session("ben", 1, true);
  pb::Group group;
  group.set_id("g1");
  group.set_name("anna and friends");
  ASSERT_OK(GroupStore(db.writer).put(group, {}, "mia", 1));
  ASSERT_OK(AnnotationStore(db.writer).add({0, of_ben, 1, "as anna and friends do", "ina", 1}));
  auto found = look();
  ASSERT_OK(found);
  replaceAll(*found);
  EXPECT_EQ(remarks(db.writer), "ina: as erased-1234 and friends do\n");
  ASSERT_OK(eraseRows(*found));
  EXPECT_EQ(GroupStore(db.writer).get("g1")->name(), "erased-1234 and friends");
}

TEST_F(ErasureStepsTest, whoMayNotBeErasedIsToldBeforeAnythingIsChanged) {
  ASSERT_OK(PeopleStore(db.writer).add({"root", pb::ADMINISTRATOR, "hash", false, 1}));
  auto reader = db.reader();
  EXPECT_EQ(ErasureStore(reader).lookForNames("root", line("root", kWhen), false).error().code,
            ErrorCode::kDenied);
  EXPECT_EQ(ErasureStore(reader).lookForNames("nobody", line("nobody", kWhen), false).error().code,
            ErrorCode::kNotFound);
}

TEST_F(ErasureStepsTest, theRoomForAllRowsIsAskedForBeforeTheFirstIsChanged) {
  const Uuid of_ben = session("ben", 1, true);
  addRemarks(db.writer, of_ben, 4000, 1, "anna " + std::string(1000, '.'));
  ASSERT_TRUE(*db.writer.emptyLog(0));
  auto reader = db.reader();
  const auto lookWith = [&](std::uint64_t room) {
    return ErasureStore(reader, [room] { return std::optional(room); })
        .lookForNames("anna", line("anna", kWhen), false);
  };
  const std::uint64_t needed = ErasureStore::kRoomLeft_bytes + 2 * 4000 * (1005 + 3);
  EXPECT_OK(lookWith(needed));
  const auto refused = lookWith(needed - 1);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kNoRoom);
  EXPECT_THAT(refused.error().message, testing::HasSubstr("the person is not erased; make room on it"));
}

TEST_F(ErasureStepsTest, theRoomThatADatabaseGrowsByIsCountedInItsOwnPages) {
  ASSERT_OK(db.writer.script(
      "PRAGMA journal_mode=DELETE; PRAGMA page_size=16384; VACUUM; PRAGMA journal_mode=WAL"));
  ASSERT_EQ(count("PRAGMA page_size"), 16384u);
  const Uuid of_ben = session("ben", 1, true);
  ASSERT_TRUE(*db.writer.emptyLog(0));
  addRemarks(db.writer, of_ben, 2000, 1, std::string(4000, '.'));
  const std::uint64_t grown = count("PRAGMA page_count") * 16384 - std::filesystem::file_size(db.path);
  ASSERT_GT(grown, 8'000'000u);
  auto reader = db.reader();
  const auto lookWith = [&](std::uint64_t room) {
    return ErasureStore(reader, [room] { return std::optional(room); })
        .lookForNames("anna", line("anna", kWhen), false);
  };
  EXPECT_OK(lookWith(ErasureStore::kRoomLeft_bytes + grown));
  const auto refused = lookWith(ErasureStore::kRoomLeft_bytes + grown - 1);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kNoRoom);
}

/// A disk of `bytes` for the log; the database lies on another one.
class SmallDisk {
 public:
  explicit SmallDisk(std::int64_t bytes) : bytes_(bytes) {
    test::ShimVfs::instance().setHook(
        [this](test::ShimVfs::Op op, const std::string& path, std::int64_t offset, int size) {
          if (op != test::ShimVfs::Op::kWrite || !path.ends_with("-wal")) return SQLITE_OK;
          if (offset + size > bytes_) return full_ = true, SQLITE_FULL;
          log_ = std::max(log_.load(), offset + size);
          return SQLITE_OK;
        });
  }
  ~SmallDisk() { test::ShimVfs::instance().setHook({}); }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;
  [[nodiscard]] std::uint64_t left() const { return static_cast<std::uint64_t>(bytes_ - log_); }
  [[nodiscard]] bool wasFull() const { return full_; }

 private:
  std::int64_t bytes_;
  std::atomic<std::int64_t> log_ = 0;
  std::atomic<bool> full_ = false;
};

TEST(ErasureOnAFullDisk, isRefusedAndTheWriterGoesOnWhereverThePersonIsNamed) {
  constexpr std::int64_t kDisk = 56 << 20;
  // 80 MB each: more than the disk and the writer's memory take
  const std::pair<const char*, const char*> places[] = {
      {"remarks",
       "INSERT INTO annotations (session, tick, text, author, created_unix_ns)"
       " SELECT 1, 1, 'anna' || char(10) || printf('%8000s', ''), 'ina', 1 FROM n"},
      {"remarks by the person",
       "INSERT INTO annotations (session, tick, text, author, created_unix_ns)"
       " SELECT 1, 1, printf('%8000s', ''), 'anna', 1 FROM n"},
      {"lines of the audit log",
       "INSERT INTO audit (unix_ns, who, action, subject, detail)"
       " SELECT 1, 'anna', 'settings', 'lab', printf('%8000s', '') FROM n"},
      {"profiles",
       "INSERT INTO profiles (id, revision, name, json, author, created_unix_ns)"
       " SELECT 'p', i + 1, 'P', printf('%8000s', ''), 'anna', 1 FROM n"},
  };
  for (const auto& [place, fill] : places) {
    SCOPED_TRACE(place);
    test::TestDb db(test::ShimVfs::name());
    ASSERT_OK(PeopleStore(db.writer).add({"anna", pb::TRAINEE, "", false, 1}));
    auto d = test::describe(makeUuidV7());
    d.set_trainee("ben");
    ASSERT_OK(SessionStore(db.writer).open(d, 1));
    const std::string sql = fill;
    const std::size_t select = sql.find(" SELECT ");
    ASSERT_OK(
        db.writer.script(sql.substr(0, select) +
                         " WITH RECURSIVE n (i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM n WHERE i < 9999)" +
                         sql.substr(select)));
    const auto emptied = db.writer.emptyLog(0);
    ASSERT_OK(emptied);
    auto reader = db.reader();
    const auto key = PseudonymKey::ofFolder(db.folder.path());
    ASSERT_OK(key);
    const ErasureLine line{"erased-1234", key->nameHash("anna"), 77};
    const SmallDisk disk(kDisk);
    DbWriter writer(std::move(db.writer), {}, {});
    const auto erase = [&](const ErasureStore::FreeRoom& room) {
      return writer.run([&](Connection& connection) -> Status {
        const auto done = ErasureStore(connection, room).erase("anna", line, "ada", "wish", 77);
        return done ? Status() : Status(done.error());
      });
    };
    const auto refused = erase([&] { return std::optional(disk.left()); });
    ASSERT_FALSE(refused.ok());
    EXPECT_EQ(refused.error().code, ErrorCode::kNoRoom) << refused.error().message;
    EXPECT_THAT(refused.error().message, testing::HasSubstr("make room on it, then erase again"));
    EXPECT_FALSE(disk.wasFull());
    EXPECT_FALSE(writer.failed());
    ASSERT_OK(writer.run([](Connection& connection) {
      return PeopleStore(connection).add({"eve", pb::TRAINEE, "", false, 1});
    }));
    const auto anna = PeopleStore(reader).find("anna"), eve = PeopleStore(reader).find("eve");
    ASSERT_OK(anna);
    ASSERT_OK(eve);
    EXPECT_TRUE(*anna && *eve) << "nothing of the erasure is stored";
  }
}

}  // namespace
}  // namespace needlelab
