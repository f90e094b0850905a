// Erasures after which nobody looked which files still hold the person.
#include "db/service/unseen_files.h"
#include "db/person_name.h"

#include <gmock/gmock.h>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "tests/unit/db/service/records_fixture.h"

namespace needlelab {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

class UnseenFilesOfErased : public test::RecordsTest {
 protected:
  void SetUp() override {
    addStation();
    addPerson("ada", pb::ADMINISTRATOR);
    addNamed("tom", "");
    closedSession("tom", 1, "");
    fs::create_directory(kept);
  }
  fs::path backup(const std::string& name) {
    pb::Request request;
    request.mutable_backup()->set_path((kept / name).string());
    get(admin, request);
    return kept / name;
  }
  void restart() {
    store.reset();
    store = test::openStore(data);
  }
  /// As a kill after the commit, once the list beside the backups has the erasure. Returns the pseudonym.
  std::string eraseUpToTheFiles() {
    RequestUnderWay under_way;
    for (int step = 0; step < 2; ++step)
      EXPECT_FALSE(store->service().executeStep(admin, erase("tom"), under_way));
    EXPECT_TRUE(under_way.isDone());
    return under_way.erased_as;
  }
  std::vector<std::string> faults() {
    pb::Request request;
    request.mutable_check();
    const auto report = get(admin, request).check_report();
    EXPECT_EQ(report.ok(), report.faults().empty());
    return {report.faults().begin(), report.faults().end()};
  }
  /// The lines of the audit log on files, newest first.
  std::vector<std::string> linesOn(const std::string& pseudonym) {
    pb::Request request;
    request.mutable_list_audit()->set_action("person erase");
    std::vector<std::string> lines;
    const pb::Reply reply = get(admin, request);
    for (const auto& entry : reply.audit().entries())
      if (entry.who() == kServerName && entry.subject() == pseudonym && entry.detail().starts_with("nobody"))
        lines.push_back(entry.detail());
    return lines;
  }
  std::uint64_t notes() {
    std::uint64_t count = 0;
    EXPECT_OK(change([&](Connection& c) -> Status {
      auto row = c.prepare("SELECT count(*) FROM meta WHERE key LIKE 'files\\_unseen%' ESCAPE '\\'");
      RETURN_IF_ERROR(row.step());
      count = row.natural(0);
      return {};
    }));
    return count;
  }
  const fs::path data = folder.path() / "data";
  const fs::path kept = folder.path() / "kept";
};

TEST_F(UnseenFilesOfErased, areSaidByCheckAfterAKillUntilTheyAreGone) {
  const auto one = backup("tom.db"), aside = data / "before-upgrade.db";
  fs::copy_file(one, aside);
  const std::string pseudonym = eraseUpToTheFiles();
  EXPECT_EQ(notes(), 1u);
  restart();
  EXPECT_THAT(linesOn(pseudonym), ElementsAre(AllOf(HasSubstr("person: 2 from before may"),
                                                    HasSubstr(kept.string()), Not(HasSubstr("tom.db")))))
      << "a file may be called as the person";
  const auto with_times = AllOf(HasSubstr(pseudonym), HasSubstr(one.string() + " (20"),
                                HasSubstr(aside.string() + " (20"), HasSubstr(" UTC)"));
  EXPECT_THAT(faults(), ElementsAre(with_times));
  // one that came later is not listed
  const auto later = backup("later.db");
  fs::last_write_time(later, fs::file_time_type::clock::now() + std::chrono::hours(1));
  EXPECT_THAT(faults(), ElementsAre(AllOf(with_times, Not(HasSubstr(later.string())))));
  restart();
  EXPECT_EQ(linesOn(pseudonym).size(), 1u) << "once";
  EXPECT_THAT(faults(), ElementsAre(with_times));
  fs::remove(one);
  EXPECT_THAT(faults(), ElementsAre(HasSubstr(aside.string())));
  fs::remove(aside);
  EXPECT_THAT(faults(), IsEmpty());
  EXPECT_EQ(notes(), 1u) << "`check` writes nothing";
  restart();
  EXPECT_EQ(notes(), 0u);
}

TEST_F(UnseenFilesOfErased, areCompressedCopiesAndTextsToo) {
  const auto one = backup("one.db");
  const fs::path compressed = kept / "old.db.gz", list = data / "class.csv";
  for (const fs::path& file : {compressed, list}) std::ofstream(file) << "tom";
  const std::string pseudonym = eraseUpToTheFiles();
  restart();
  EXPECT_THAT(linesOn(pseudonym), ElementsAre(HasSubstr("person: 3 from before may")));
  EXPECT_THAT(faults(),
              ElementsAre(AllOf(HasSubstr(compressed.string() + " (20"), HasSubstr(list.string() + " (20"))));
  fs::remove(one);
  fs::remove(list);
  EXPECT_THAT(faults(), ElementsAre(HasSubstr(compressed.string())));
  fs::remove(compressed);
  EXPECT_THAT(faults(), IsEmpty());
}

TEST_F(UnseenFilesOfErased, areNotForgottenWhileTheDiskOfTheBackupsIsNotThere) {
  const auto one = backup("one.db");
  const std::string pseudonym = eraseUpToTheFiles();
  fs::rename(kept, folder.path() / "away");
  restart();
  EXPECT_THAT(linesOn(pseudonym), ElementsAre(HasSubstr("none from before is in " + data.string())));
  EXPECT_THAT(faults(), IsEmpty());
  fs::rename(folder.path() / "away", kept);
  EXPECT_THAT(faults(), ElementsAre(HasSubstr(one.string())));
}

TEST_F(UnseenFilesOfErased, areThoseOfAnErasureThatAStartRepeatedToo) {
  const auto first = backup("first.db"), second = backup("second.db");
  const std::string pseudonym = get(admin, erase("tom")).erasure().pseudonym();
  EXPECT_EQ(notes(), 0u) << "they were looked at";
  EXPECT_THAT(faults(), IsEmpty());
  restart();
  EXPECT_THAT(linesOn(pseudonym), IsEmpty());
  store.reset();
  for (const char* suffix : {"-wal", "-shm"}) fs::remove((data / "needlelab.db").string() + suffix);
  // it knows of the first one
  fs::copy_file(second, data / "needlelab.db", fs::copy_options::overwrite_existing);
  store = test::openStore(data);
  ASSERT_EQ(store->erasuresRepeated(), 1u);
  EXPECT_THAT(linesOn(pseudonym), ElementsAre(HasSubstr("person: 2 from before may")));
  EXPECT_THAT(faults(), ElementsAre(AllOf(HasSubstr(pseudonym), HasSubstr(first.string()),
                                          HasSubstr(second.string()))));
}

TEST_F(UnseenFilesOfErased, areSaidWhileTheErasureGoesOn) {
  const auto one = backup("one.db");
  RequestUnderWay under_way;
  ASSERT_FALSE(store->service().executeStep(admin, erase("tom"), under_way));
  EXPECT_THAT(faults(), testing::Contains(HasSubstr(one.string())));
  while (!store->service().executeStep(admin, erase("tom"), under_way)) {
  }
  EXPECT_EQ(notes(), 0u);
  EXPECT_THAT(faults(), IsEmpty());
}

}  // namespace
}  // namespace needlelab
