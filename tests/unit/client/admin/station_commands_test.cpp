// Commands for stations: invalid names, files and addresses; enrolments; keys.
#include <gmock/gmock.h>
#include <CLI/CLI.hpp>

#include <filesystem>
#include <optional>
#include <sstream>

#include "client/admin/command.h"
#include "client/net/link/credentials.h"
#include "common/base/files/files.h"
#include "tests/unit/client/admin/run_admin.h"

namespace needlelab {
namespace {

using testing::HasSubstr;
using Arguments = std::vector<std::string>;

class StationCommands : public test::AdminTest {
 protected:
  const std::string name_ = "läb: \"1\"";
};

TEST_F(StationCommands, wrongNamesAddressesAndFilesAreNamedAndMakeNoKey) {
  good({"user", "add", "tom", "--role", "trainee"});
  folder.write("taken", "mine");
  std::filesystem::create_symlink("/nowhere/at/all", file("dangling"));
  struct Case {
    std::string name, server, out, words;
  };
  const Case cases[] = {
      {"", "lab", file("k"), "station name: has 0 bytes"},
      {std::string(65, 's'), "lab", file("k"), "station name: has 65 bytes, allowed are 1 to 64"},
      {"lab/1", "lab", file("k"), "station name: holds a '/'"},
      {"lab\n1", "lab", file("k"), "station name: holds a control character"},
      {"s", "lab", file("taken"), "taken is there already; a key file is never overwritten"},
      {"s", "lab", file("dangling"), "dangling is there already"},
      {"s", "lab", folder.path().string(), "is there already"},
      {"s", "lab", file("none/k"), "none is not a folder that can be written to"},
      {"s", "", file("k"), "--server-name '' is no HOST:PORT"},
      {"s", "two words", file("k"), "--server-name 'two words' is no HOST:PORT"},
      {"s", "lab:99999", file("k"), "--server-name 'lab:99999' is no HOST:PORT"},
  };
  for (const Case& c : cases) {
    const Run enrolled =
        onData({"station", "enrol", "--server-name", c.server, "--out", c.out, "--", c.name});
    EXPECT_EQ(enrolled.code, 2) << c.words;
    EXPECT_THAT(enrolled.err, HasSubstr(c.words));
    if (c.words.find("--server-name") != std::string::npos) continue;
    const Run added = onData({"station", "add", "--out", c.out, "--", c.name});
    EXPECT_EQ(added.code, 2) << c.words;
    EXPECT_THAT(added.err, HasSubstr(c.words));
  }
  EXPECT_FALSE(std::filesystem::exists(file("k")));
  EXPECT_EQ(*readWholeFile(file("taken")), "mine");
  EXPECT_TRUE(good({"station", "list", "--json"}).rows().empty());
}

TEST_F(StationCommands, aStationMayKnowSeveralServersOfWhichThisFoldersIsOne) {
  const auto hosts = [this] {
    return good({"certificate", "show", "--json"}).rows()[1].at("hosts").get<std::string>();
  };
  // the folder has no certificate yet: it gets all these names
  good({"station", "enrol", "one", "--server-name", "a.example,b.example:7751", "--out", file("one")});
  const auto bundle = parseBundle(*readWholeFile(file("one")), "one");
  ASSERT_TRUE(bundle.ok()) << bundle.error().message;
  EXPECT_EQ(endpointsText(bundle->servers), "a.example:7750,b.example:7751");
  EXPECT_EQ(hosts(), "a.example, b.example");
  // once there is a certificate one of its names suffices: c.example is another server's and is not added
  good({"station", "enrol", "two", "--server-name", "c.example,A.example", "--out", file("two")});
  EXPECT_EQ(hosts(), "a.example, b.example");
  const Run bad =
      onData({"station", "enrol", "three", "--server-name", "a.example,,b", "--out", file("three")});
  EXPECT_EQ(bad.code, 2);
  EXPECT_THAT(bad.err, HasSubstr("--server-name 'a.example,,b' is no list of servers (an entry is empty)"));
}

/// Has one station, "lab-1". Counts the keys it makes; makes none if it has a `refusal`.
class OneStation : public Backend {
 public:
  explicit OneStation(bool revoked, std::optional<Error> refusal = {})
      : revoked_(revoked), refusal_(std::move(refusal)) {}
  Result<pb::Reply> call(const pb::Request& request) override {
    pb::Reply reply;
    if (request.has_list_stations()) {
      auto* station = reply.mutable_stations()->add_stations();
      station->set_name("lab-1");
      station->set_revoked(revoked_);
    }
    if (request.has_add_station() && refusal_) return *refusal_;
    if (request.has_add_station())
      reply.mutable_station_key()->set_key(std::string(32, static_cast<char>('0' + ++keys)));
    return reply;
  }
  [[nodiscard]] bool local() const override { return false; }
  int keys = 0;

 private:
  bool revoked_;
  std::optional<Error> refusal_;
};

TEST_F(StationCommands, anEnrolmentMakesItsKeyAfterAllElseThatCanFail) {
  const std::string authority = "-----BEGIN CERTIFICATE-----\n";
  const auto enrolled = [&](OneStation& server, const std::string& ca, const std::string& to) {
    GlobalOptions global;
    global.ca = ca;
    std::ostringstream out, err;
    Output output(out, err, std::nullopt);
    CommandContext context{server, output, global};
    CLI::App app;
    ChosenCommand chosen;
    addStationCommands(app, chosen);
    app.parse("station enrol lab-1 --server-name lab --out " + to);
    return chosen.run(context);
  };
  const auto ca = folder.write("ca.crt", authority).string();

  // a name in use: the server refuses it before anything else is checked
  for (const Error& refusal : {Error{ErrorCode::kAlreadyExists, "it is there"},
                               Error{ErrorCode::kDenied, "not for an instructor"}}) {
    OneStation active(false, refusal);
    const auto taken = enrolled(active, file("none.crt"), file("s.enrol"));
    ASSERT_FALSE(taken.ok());
    EXPECT_EQ(taken.error().code, refusal.code);
    EXPECT_EQ(taken.error().message, refusal.message);
  }
  EXPECT_FALSE(std::filesystem::exists(file("s.enrol")));

  // revoked between the question and the answer: the key is not thrown away
  OneStation just_revoked(false);
  const auto keyless = enrolled(just_revoked, file("none.crt"), file("s.enrol"));
  ASSERT_FALSE(keyless.ok());
  EXPECT_THAT(keyless.error().message,
              HasSubstr("station 'lab-1' was added, but its key is lost: revoke it and enrol it again"));
  ASSERT_TRUE(enrolled(just_revoked, ca, file("late.enrol")).ok());
  EXPECT_EQ(parseBundle(*readWholeFile(file("late.enrol")), "late.enrol")->key, std::string(32, '2'));
  EXPECT_EQ(just_revoked.keys, 2);

  OneStation revoked(true);
  const auto no_authority = enrolled(revoked, file("none.crt"), file("s.enrol"));
  ASSERT_FALSE(no_authority.ok());
  EXPECT_THAT(no_authority.error().message, HasSubstr("none.crt"));
  EXPECT_EQ(revoked.keys, 0);
  EXPECT_FALSE(std::filesystem::exists(file("s.enrol")));

  const auto done = enrolled(revoked, ca, file("s.enrol"));
  ASSERT_TRUE(done.ok()) << done.error().message;
  const auto bundle = parseBundle(*readWholeFile(file("s.enrol")), "s.enrol");
  ASSERT_TRUE(bundle.ok()) << bundle.error().message;
  EXPECT_EQ(bundle->key, std::string(32, '1'));
  EXPECT_EQ(bundle->ca_pem, authority);

  // a folder that disappears after the command's checks
  const auto lost = enrolled(revoked, ca, file("gone/s.enrol"));
  ASSERT_FALSE(lost.ok());
  EXPECT_THAT(lost.error().message,
              HasSubstr("station 'lab-1' was added, but its key is lost: revoke it and enrol it again"));
}

TEST_F(StationCommands, onlyARevokedStationNameGetsANewKey) {
  good({"station", "add", name_, "--out", file("first.key")});
  for (const Arguments& again :
       {Arguments{"station", "add", name_, "--out", file("second.key")},
        {"station", "enrol", name_, "--server-name", "lab", "--out", file("second.key")}}) {
    const Run taken = onData(again);
    EXPECT_EQ(taken.code, 1) << again[1];
    EXPECT_THAT(taken.err, HasSubstr("'" + name_ + "': revoke it first"));
    EXPECT_FALSE(std::filesystem::exists(file("second.key"))) << again[1];
  }
  good({"station", "revoke", name_});
  good({"station", "revoke", name_});
  const auto revoked = good({"station", "list", "--json"}).rows();
  ASSERT_EQ(revoked.size(), 1u);
  EXPECT_EQ(revoked[0].at("name"), name_);
  EXPECT_EQ(revoked[0].at("revoked"), true);
  good({"station", "add", name_, "--out", file("second.key")});
  EXPECT_THAT(good({"station", "list"}).out, HasSubstr(name_ + "  no "));
}

}  // namespace
}  // namespace needlelab
