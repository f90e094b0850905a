// retention show, set, run on a stopped server's folder; and lists that are longer than one message.
#include <fstream>
#include <iterator>

#include "db/people.h"
#include "tests/unit/client/admin/run_admin.h"

namespace needlelab {
namespace {

using RetentionCommands = test::AdminTest;

TEST_F(RetentionCommands, setShowRunAndWhatIsLeft) {
  const std::string id = uuidText(addSession(50));
  EXPECT_NE(good({"retention", "show"}).err.find("kept for ever"), std::string::npos);
  good({"retention", "set", "knee-1", "--thin-after", "0", "--rate", "100", "--coarser", "2",
        "--delete-after", "36500"});
  good({"retention", "set", "--default", "--keep"});
  const auto shown = good({"retention", "show", "--json"}).rows();
  ASSERT_EQ(shown.size(), 2u);
  EXPECT_TRUE(shown[0].at("exercise_id").is_null());
  EXPECT_TRUE(shown[0].at("thin_after_days").is_null());
  EXPECT_EQ(shown[1].at("exercise_id"), "knee-1");
  EXPECT_EQ(shown[1].at("thin_rate_hz"), 100);
  EXPECT_EQ(shown[1].at("thin_coarser"), 2);
  EXPECT_EQ(shown[1].at("delete_after_days"), 36'500);

  // no backup covers it yet
  const auto waits = good({"retention", "run", "--json"}).rows();
  ASSERT_EQ(waits.size(), 1u);
  EXPECT_EQ(waits[0].at("action"), "waits for a backup");
  good({"backup", file("copy.db")});
  const Run dry = good({"retention", "run", "--dry-run"});
  EXPECT_NE(dry.out.find("would be: 1 thinned"), std::string::npos) << dry.out;
  EXPECT_EQ(good({"session", "show", id, "--json"}).rows()[0].at("recording"), "original");
  const auto done = good({"retention", "run", "--json"}).rows();
  ASSERT_EQ(done.size(), 1u);
  EXPECT_EQ(done[0].at("action"), "thin");
  EXPECT_LT(done[0].at("bytes_after"), done[0].at("bytes_before"));

  const auto session = good({"session", "show", id, "--json"}).rows()[0];
  EXPECT_EQ(session.at("recording"), "thinned");
  EXPECT_EQ(session.at("removed_original").at("samples"), 1000);
  EXPECT_EQ(session.at("samples"), 101);
  const Run text = good({"session", "show", id});
  EXPECT_NE(text.out.find("the original (1000 samples"), std::string::npos) << text.out;
  EXPECT_EQ(good({"session", "verify", id}).code, 0);
  EXPECT_EQ(good({"check"}).code, 0);
  const Run exported = good({"session", "export", id, "--out", file("t.csv")});
  EXPECT_NE(exported.err.find("the original had 1000 samples"), std::string::npos) << exported.err;
  std::ifstream in(file("t.csv"));
  EXPECT_EQ(std::count(std::istreambuf_iterator<char>(in), {}, '\n'), 102);
  // a backup of it is sound, too
  good({"backup", file("copy2.db")});

  good({"retention", "set", "knee-1", "--delete-after", "0"});
  EXPECT_EQ(good({"retention", "run", "--json"}).rows()[0].at("action"), "delete");
  EXPECT_EQ(good({"session", "list", "--json"}).rows()[0].at("recording"), "deleted");
  const Run gone = onData({"session", "export", id, "--out", file("u.csv")});
  EXPECT_EQ(gone.code, 1);
  EXPECT_NE(gone.err.find("was deleted on"), std::string::npos) << gone.err;
  EXPECT_NE(good({"session", "verify", id}).out.find("its recording was deleted on"), std::string::npos);
  EXPECT_EQ(good({"check"}).code, 0);
  good({"retention", "set", "knee-1", "--as-default"});
  EXPECT_EQ(good({"retention", "show", "--json"}).rows().size(), 1u);
  EXPECT_EQ(onData({"retention", "set", "knee-1", "--as-default"}).code, 1);
}

TEST_F(RetentionCommands, wrongUsageIsTwo) {
  addSession(1);
  for (const std::vector<std::string>& wrong :
       {std::vector<std::string>{"knee-1"}, std::vector<std::string>{"--keep"},
        std::vector<std::string>{"knee-1", "--default", "--keep"},
        std::vector<std::string>{"knee-1", "--keep", "--delete-after", "3"},
        std::vector<std::string>{"knee-1", "--thin-after", "3"},
        std::vector<std::string>{"knee-1", "--rate", "3"},
        std::vector<std::string>{"knee-1", "--thin-after", "3", "--rate", "-5"},
        std::vector<std::string>{"knee-1", "--delete-after", "40000"},
        std::vector<std::string>{"knee-1", "--delete-after", "3", "--coarser", "2"},
        std::vector<std::string>{"knee-1", "--keep", "--without-backup"}}) {
    std::vector<std::string> all = {"retention", "set"};
    all.insert(all.end(), wrong.begin(), wrong.end());
    const Run run = onData(all);
    EXPECT_EQ(run.code, 2) << run.err;
  }
  EXPECT_TRUE(good({"retention", "show", "--json"}).rows().empty());
}

TEST_F(RetentionCommands, listsAreWholeHoweverLong) {
  {
    auto store = test::TestDb::must(Store::open(data(), {}));
    ASSERT_OK(store->writer().run([](Connection& c) -> Status {
      if (auto added = StationStore(c).add("station-1", StationKeyBytes{}, 1); !added) return added;
      for (int i = 0; i < 3000; ++i) {
        auto d = test::describe(makeUuidV7());
        d.set_started_unix_ns(1 + i);
        d.add_device_notes(std::string(600, 'n'));
        if (auto opened = SessionStore(c).open(d, 1); !opened) return opened.error();
        if (auto noted = AuditStore(c).add({0, i, "who", "action", "subject", std::string(600, 'd')}); !noted)
          return noted;
        if (auto added = PeopleStore(c).add(
                {"person " + std::to_string(i) + std::string(40, 'x'), pb::TRAINEE, "", false, 1});
            !added)
          return added;
      }
      return {};
    }));
  }
  EXPECT_EQ(good({"session", "list", "--limit", "0", "--json"}).rows().size(), 3000u);
  EXPECT_EQ(good({"session", "list", "--limit", "2345", "--json"}).rows().size(), 2345u);
  EXPECT_EQ(good({"session", "list", "--json"}).rows().size(), 100u);
  EXPECT_GE(good({"audit", "--limit", "0", "--json"}).rows().size(), 3000u);
  EXPECT_EQ(good({"audit", "--limit", "1999", "--json"}).rows().size(), 1999u);
  EXPECT_EQ(good({"user", "list", "--json"}).rows().size(), 3000u);
}

}  // namespace
}  // namespace needlelab
