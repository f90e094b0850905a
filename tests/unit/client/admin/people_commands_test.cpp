// Commands for people: difficult names, malformed tables, deleted people.
#include <gmock/gmock.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <sstream>
#include <tuple>
#include <utility>

#include "common/base/files/files.h"
#include "tests/unit/client/admin/run_admin.h"

namespace needlelab {
namespace {

using testing::HasSubstr;
using testing::Not;
using Arguments = std::vector<std::string>;

const std::string kQuoted = R"(Zoë "Z" O'Neil)";

class PeopleCommands : public test::AdminTest {
 protected:
  void SetUp() override {
    password_ = secret("pw", "correct horse");
    good({"user", "add", "ada", "--role", "administrator", "--password-file", password_});
  }
  /// A file that only its owner can read, so that no warning is printed.
  std::string secret(const std::string& name, const std::string& text) const {
    const auto path = folder.write(name, text);
    std::filesystem::permissions(path, std::filesystem::perms::owner_read);
    return path.string();
  }
  /// People by name, without those of SetUp.
  std::map<std::string, nlohmann::json> people() const {
    std::map<std::string, nlohmann::json> all;
    for (const auto& row : good({"user", "list", "--json"}).rows())
      if (row.at("name") != "ada") all[row.at("name")] = row;
    return all;
  }
  /// The records of an export without the audit log: each export adds a line there. Also without the last
  /// line.
  static std::vector<nlohmann::json> records(const std::string& text) {
    std::vector<nlohmann::json> all;
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) {
      auto record = nlohmann::json::parse(line);
      if (record.at("kind") != "audit" && record.at("kind") != "end") all.push_back(std::move(record));
    }
    return all;
  }
  bool logsIn(const std::string& name, const std::string& password) const {
    const auto store = test::TestDb::must(Store::open(data(), {}));
    return store->service().logins().loginPerson(name, password).ok();
  }
  std::string password_;
};

TEST_F(PeopleCommands, aBadNameOrRoleIsNamedAndAddsNoOne) {
  struct Case {
    std::string name, role, full_name, words;
  };
  const Case cases[] = {
      {"", "trainee", "", "name: has 0 bytes, allowed are 1 to 64"},
      {std::string(65, 'x'), "trainee", "", "name: has 65 bytes, allowed are 1 to 64"},
      {"@tom", "trainee", "", "name: begins with '@'"},
      {"tom/1", "trainee", "", "name: holds a '/'"},
      {"..", "trainee", "", "name: is '..'"},
      {"tom\x1b[2J", "trainee", "", "name: holds a control character"},
      {"tom\xff", "trainee", "", "name: is not valid UTF-8 text"},
      {"tom", "boss", "", "--role: 'boss', allowed are trainee, instructor"},
      {"tom", "station", "", "--role: 'station', allowed are"},
      {"tom", "", "", "--role: '', allowed are"},
      {"tom", "trainee", std::string(201, 'x'), "full_name: has 201 bytes, allowed are 0 to 200"},
      {"tom", "trainee", "two\nlines", "full_name: holds a control character (U+000A)"},
  };
  for (const Case& c : cases) {
    const Run result = onData({"user", "add", "--role", c.role, "--full-name", c.full_name, "--", c.name});
    EXPECT_EQ(result.code, 2) << c.words;
    EXPECT_THAT(result.err, HasSubstr(c.words));
    EXPECT_EQ(result.out, "") << c.words;
  }
  EXPECT_TRUE(people().empty());
}

TEST_F(PeopleCommands, spacesAtTheEndsOfANameAreNoPartOfIt) {
  EXPECT_THAT(good({"user", "add", "\u00a0tom ", "--role", "trainee"}).out, HasSubstr("'tom'"));
  const Run again = onData({"user", "add", "Tom\u2003", "--role", "trainee"});
  EXPECT_EQ(again.code, 1);
  EXPECT_THAT(again.err, HasSubstr("is it the same person?"));
  EXPECT_TRUE(people().contains("tom"));
  EXPECT_EQ(people().size(), 1u);
}

TEST_F(PeopleCommands, hardNamesComeBackAsTheyWere) {
  std::string longest;
  for (int i = 0; i < 32; ++i) longest += "é";  // 64 bytes
  const std::string names[] = {kQuoted, "x'; DROP TABLE people; --", "=1+1", "a,b;c", "%", "李 明", longest};
  for (const auto& name : names) good({"user", "add", name, "--role", "trainee", "--full-name", name + "!"});
  const auto known = people();
  EXPECT_EQ(known.size(), std::size(names));
  const std::string table = good({"user", "list"}).out;
  EXPECT_EQ(std::count(table.begin(), table.end(), '\n'), 2 + static_cast<int>(std::size(names)));
  for (const auto& name : names) {
    ASSERT_TRUE(known.contains(name)) << name;
    EXPECT_EQ(known.at(name).at("full_name"), name + "!");
    EXPECT_THAT(table, HasSubstr(name + " "));
  }
}

TEST_F(PeopleCommands, anExistingNameKeepsItsRoleAndFullName) {
  good({"user", "add", kQuoted, "--role", "trainee", "--full-name", "the first"});
  const Run again = onData({"user", "add", kQuoted, "--role", "instructor", "--full-name", "the second",
                            "--password-file", password_});
  EXPECT_EQ(again.code, 1);
  EXPECT_THAT(again.err, HasSubstr("already a person named '" + kQuoted + "'"));
  const auto known = people();
  ASSERT_EQ(known.size(), 1u);
  EXPECT_EQ(known.at(kQuoted).at("role"), "trainee");
  EXPECT_EQ(known.at(kQuoted).at("full_name"), "the first");
  EXPECT_EQ(known.at(kQuoted).at("has_password"), false);
}

TEST_F(PeopleCommands, aChangeThatIsRefusedChangesNothing) {
  good({"user", "add", "tom", "--role", "trainee", "--full-name", "Tom T"});
  const std::tuple<Arguments, int, std::string> cases[] = {
      {{"tom", "--role", "boss"}, 2, "--role: 'boss', allowed are"},
      {{"tom", "--role", "instructor"}, 2, "role: 'tom' has no password"},
      {{"tom", "--full-name", "a\nb"}, 2, "full_name: holds a control character"},
      {{"nobody", "--role", "trainee"}, 1, "no person named 'nobody'"},
      {{"ada", "--role", "trainee"}, 1, "'ada' is the last administrator"},
      {{"tom", "--name", ""}, 2, "name: has 0 bytes, allowed are 1 to 64"},
      {{"tom", "--name", "ADA"}, 1, "is it the same person?"},
  };
  const std::string before = good({"user", "list", "--json"}).out;
  for (const auto& [arguments, code, words] : cases) {
    Arguments all = {"user", "change"};
    all.insert(all.end(), arguments.begin(), arguments.end());
    const Run result = onData(all);
    EXPECT_EQ(result.code, code) << words;
    EXPECT_THAT(result.err, HasSubstr(words));
  }
  EXPECT_EQ(onData({"user", "disable", "ada"}).code, 1) << "the last administrator";
  EXPECT_EQ(good({"user", "list", "--json"}).out, before);
  EXPECT_THAT(good({"user", "change", "tom", "--full-name", ""}).out, HasSubstr("'tom' is revision 2"));
  EXPECT_EQ(people().at("tom").at("full_name"), "");
  EXPECT_THAT(good({"user", "change", "tom"}).out, HasSubstr("'tom' is revision 2")) << "nothing to change";
  const auto id = people().at("tom").at("id");
  good({"user", "change", id, "--name", "Tim"});
  EXPECT_FALSE(people().contains("tom"));
  EXPECT_EQ(people().at("Tim").at("id"), id);
}

TEST_F(PeopleCommands, aPersonIsDisabledAndEnabledAlsoTwice) {
  good({"user", "add", "ines", "--role", "instructor", "--password-file", password_});
  for (const bool enable : {false, false, true, true}) {
    const Run done = good({"user", enable ? "enable" : "disable", "ines"});
    EXPECT_EQ(done.out, enable ? "enabled 'ines'\n" : "disabled 'ines'\n");
    EXPECT_EQ(people().at("ines").at("disabled"), !enable);
  }
}

TEST_F(PeopleCommands, aCodeIsMadeSetFromAFileAndRemoved) {
  good({"user", "add", "tom", "--role", "trainee"});
  const auto practises = [&](const std::string& code) {
    const auto store = test::TestDb::must(Store::open(data(), {}));
    pb::Request check;
    check.mutable_check_trainee()->set_trainee("tom");
    check.mutable_check_trainee()->set_code(code);
    return !store->service().execute({"station-1", pb::STATION}, check).error.has_value();
  };
  EXPECT_EQ(people().at("tom").at("has_code"), false);
  const std::string pin = good({"user", "code", "tom", "--make", "--json"}).rows().at(0).at("code");
  EXPECT_THAT(pin, testing::MatchesRegex("[0-9]{6}"));
  EXPECT_EQ(people().at("tom").at("has_code"), true);
  EXPECT_THAT(good({"user", "list"}).out, HasSubstr("  CODE  "));
  EXPECT_TRUE(practises(pin));
  EXPECT_FALSE(practises(""));
  EXPECT_THAT(good({"user", "code", "tom", "--make"}).out, HasSubstr("only its hash is kept"));
  // only the owner can read a file with the PIN, even if others could before
  const std::string kept = folder.write("code.json", "").string();
  std::filesystem::permissions(kept, std::filesystem::perms(0644));
  good({"user", "code", "tom", "--make", "--json=" + kept});
  EXPECT_EQ(std::filesystem::status(kept).permissions(), std::filesystem::perms(0600));
  EXPECT_THAT(*readWholeFile(kept), HasSubstr("\"code\": \""));
  EXPECT_FALSE(practises(pin)) << "another one";
  EXPECT_EQ(good({"user", "code", "tom", "--code-file", secret("badge", "badge 0007\n")}).out,
            "code of 'tom' set\n");
  EXPECT_TRUE(practises("badge 0007"));

  const std::tuple<Arguments, int, std::string> bad[] = {
      {{"tom", "--code-file", secret("empty", "\n")}, 2, "its first line, the code, is empty"},
      {{"tom", "--make", "--remove"}, 2, "excludes"},
      {{"tom", "--make", "--code-file", secret("other", "1234")}, 2, "excludes"},
  };
  for (const auto& [arguments, code, words] : bad) {
    Arguments all = {"user", "code"};
    all.insert(all.end(), arguments.begin(), arguments.end());
    const Run result = onData(all);
    EXPECT_EQ(result.code, code) << words;
    EXPECT_THAT(result.err, HasSubstr(words));
    EXPECT_TRUE(practises("badge 0007")) << words;
  }
  EXPECT_EQ(good({"user", "code", "tom", "--remove"}).out, "code of 'tom' removed\n");
  EXPECT_TRUE(practises(""));
}

TEST_F(PeopleCommands, onlyAValidNewPasswordReplacesTheOld) {
  good({"user", "add", "ines", "--role", "instructor", "--password-file", password_});
  const std::pair<std::string, std::string> bad[] = {
      {file("none"), "none: cannot open"},
      {secret("empty", "\nsecond line"), "its first line, the password, is empty"},
      {secret("short", "seven77"), "10 to 256"},
  };
  for (const auto& [path, words] : bad) {
    const Run result = onData({"user", "passwd", "ines", "--password-file", path});
    EXPECT_EQ(result.code, 2) << path;
    EXPECT_THAT(result.err, HasSubstr(words));
    EXPECT_THAT(result.err, Not(HasSubstr("seven77")));
    EXPECT_TRUE(logsIn("ines", "correct horse")) << path;
  }
  good({"user", "passwd", "ines", "--new-password-file", secret("pw2", "another horse")});
  EXPECT_TRUE(logsIn("ines", "another horse"));
  EXPECT_FALSE(logsIn("ines", "correct horse"));
}

TEST_F(PeopleCommands, aTableWithOneBadRowChangesNothing) {
  good({"user", "add", "tom", "--role", "trainee", "--full-name", "Tom T"});
  struct Case {
    std::string row;  ///< in the third line; the second is valid
    std::string column, words;
  };
  const Case cases[] = {
      {"zoe,Zoë,boss,,", "role", "'boss', allowed are trainee"},
      {",Nobody,,,", "name", "has 0 bytes"},
      {"a/b,,,,", "name", "holds a '/'"},
      {"local:root,,,,", "name", "'local:root' begins with 'local:', as the audit log calls"},
      {"\"two\nlines\",,,,", "name", "holds a control character"},
      {"zoe," + std::string(201, 'z') + ",,,", "full_name", "has 201 bytes"},
      {"zoe,,instructor,,", "password", "is missing"},
      {"zoe,,,,short", "password", "has 5 bytes, allowed are 8 to 256"},
      {"zoe,,,", "", "has 4 cells, the header has 5"},
  };
  const std::string before = good({"user", "list", "--json"}).out;
  for (const Case& c : cases) {
    const auto csv = folder
                         .write("class.csv", "name,full_name,role,group,password\nanna,Anna,,g1,\n" + c.row +
                                                 "\ntom,Another Tom,,g1,\n")
                         .string();
    const Run result = onData({"user", "import", csv, "--json"});
    EXPECT_EQ(result.code, 2) << c.words;
    EXPECT_EQ(result.err, "needlelab-admin: " + csv + ": 1 rows cannot be taken: nothing was changed\n");
    const auto fault = result.rows().at(0);  // faults are listed first
    EXPECT_EQ(fault.at("what"), "fault");
    EXPECT_EQ(fault.at("line"), 3) << c.words;
    EXPECT_EQ(fault.at("column"), c.column) << c.words;
    EXPECT_THAT(fault.at("text").get<std::string>(), HasSubstr(c.words));
    EXPECT_THAT(result.out, Not(HasSubstr("\"short\"")));
    EXPECT_EQ(good({"user", "list", "--json"}).out, before) << c.words;
    EXPECT_TRUE(good({"group", "list", "--json"}).rows().empty()) << c.words;
  }
}

TEST_F(PeopleCommands, aFileWithoutAPeopleTableIsRefusedByName) {
  const std::pair<std::string, std::string> cases[] = {
      {"", "is empty"},
      {"name\n", "has a header and no rows"},
      {"name\n" + std::string(900'000, 'x'), "at most 900000 are read"},
  };
  for (const auto& [text, words] : cases) {
    const auto csv = folder.write("class.csv", text).string();
    const Run result = onData({"user", "import", csv});
    EXPECT_EQ(result.code, 2) << words;
    EXPECT_THAT(result.err, HasSubstr("needlelab-admin: " + csv));
    EXPECT_THAT(result.err, HasSubstr(words));
    EXPECT_EQ(result.out, "");
  }
  EXPECT_TRUE(people().empty());
}

TEST_F(PeopleCommands, importNamesTheColumnsThatItIgnoresAndShowsAHeaderWithoutAnAccount) {
  const auto list =
      folder.write("class.csv", "Login;Colour;Prénom;Nom;Size\nanna;red;Anna;Keller;4\n").string();
  const Run taken = good({"user", "import", list});
  EXPECT_THAT(taken.err, HasSubstr("ignored: Colour, Size\n"));
  EXPECT_THAT(taken.out, testing::Not(HasSubstr("Colour")));
  EXPECT_EQ(people().at("anna").at("full_name"), "Anna Keller");
  const auto lacking = folder.write("class.csv", "full_name\nAnna\n").string();
  const Run refused = onData({"user", "import", lacking});
  EXPECT_EQ(refused.code, 2);
  EXPECT_THAT(refused.out, HasSubstr("no column is known as the account: the header reads 'full_name'"));
}

TEST_F(PeopleCommands, importingASpreadsheetTwiceChangesNothing) {
  good({"user", "add", "tom", "--role", "trainee"});
  const auto csv = folder
                       .write("class.csv",
                              "\xef\xbb\xbfname;full_name;group\r\n"
                              "\"semi;colon\";\"Eve \"\"Q\"\", née\";\"g1; g2\"\r\ntom;Tom T;g1\r\n")
                       .string();
  EXPECT_THAT(good({"user", "import", csv, "--dry-run"}).out,
              HasSubstr("a dry run: 1 added, 1 changed, 0 as they were"));
  EXPECT_EQ(people().size(), 1u);
  EXPECT_THAT(good({"user", "import", csv}).out, HasSubstr("\n1 added, 1 changed, 0 as they were"));
  const auto known = people();
  EXPECT_EQ(known.at("semi;colon").at("groups"), "g1, g2");
  EXPECT_THAT(good({"user", "import", csv}).out, HasSubstr("0 added, 0 changed, 2 as they were"));
  EXPECT_EQ(good({"user", "list", "--json"}).rows().size(), 3u);
}

TEST_F(PeopleCommands, aLongTableListsNewRightsAndTheOmittedRowCount) {
  std::string table = "name,role,password\n";
  for (int i = 0; i < 2000; ++i) table += "s" + std::to_string(i) + ",,\n";
  const auto csv = folder.write("class.csv", table + "zoe,administrator,correct horse\n").string();
  const Run dry = good({"user", "import", csv, "--dry-run"});
  EXPECT_THAT(dry.out, HasSubstr("added as administrator, with a password"));
  EXPECT_THAT(dry.out, HasSubstr("; the first 1 rows give a role, a password or a code"));
  EXPECT_THAT(dry.err, HasSubstr("1 more rows are not shown: none gives a role"));
}

TEST_F(PeopleCommands, anImportOfAFileThatCannotBeReadMakesNoFolder) {
  const auto other = file("other");
  const auto bad = folder.write("bad.json", "{\"id\": 5}").string();
  for (const Arguments& import : {Arguments{"user", "import", file("none")},
                                  {"profile", "import", file("none")},
                                  {"profile", "import", bad},
                                  {"curriculum", "import", file("none")},
                                  {"curriculum", "import", bad}}) {
    Arguments all = {"--data", other};
    all.insert(all.end(), import.begin(), import.end());
    const Run result = run(all);
    EXPECT_EQ(result.code, 2) << import[0];
    EXPECT_THAT(result.err, HasSubstr(import.back())) << import[0];
    EXPECT_FALSE(std::filesystem::exists(other)) << import[0];
  }
}

TEST_F(PeopleCommands, anErasedPersonIsGoneAndTheNameStartsFresh) {
  good({"user", "add", kQuoted, "--role", "trainee"});
  good({"assign", kQuoted, "knee-recess"});
  good({"consent", "give", kQuoted, "--note", "paper \"7\""});
  for (const std::string wrong : {"", "zoë", "Zoë"}) {
    const Run refused = onData({"person", "erase", kQuoted, "--confirm", wrong});
    EXPECT_EQ(refused.code, 2) << wrong;
    EXPECT_THAT(refused.err, HasSubstr("confirm"));
  }

  const auto erased = good({"person", "erase", kQuoted, "--confirm", kQuoted, "--json"}).rows().at(0);
  EXPECT_THAT(erased.at("pseudonym").get<std::string>(), testing::StartsWith("erased person "));
  EXPECT_TRUE(people().empty());
  EXPECT_TRUE(good({"assignments", "--json"}).rows().empty());
  for (const Arguments& gone : {Arguments{"person", "erase", kQuoted, "--confirm", kQuoted},
                                {"person", "export", kQuoted, "--out", file("gone.jsonl")},
                                {"consent", "list", kQuoted},
                                {"user", "enable", kQuoted},
                                {"assign", kQuoted, "knee-recess"}}) {
    const Run result = onData(gone);
    EXPECT_EQ(result.code, 1) << gone[1];
    EXPECT_THAT(result.err, HasSubstr("no person named '" + kQuoted + "'")) << gone[1];
  }
  EXPECT_FALSE(std::filesystem::exists(file("gone.jsonl")));

  good({"user", "add", kQuoted, "--role", "trainee"});
  EXPECT_EQ(people().at(kQuoted).at("consents"), "-");
  EXPECT_THAT(good({"consent", "list", kQuoted}).err, HasSubstr("never asked"));
}

TEST_F(PeopleCommands, anExportPrintsItsFilesRecordsWithOrWithoutJson) {
  good({"user", "add", kQuoted, "--role", "trainee", "--full-name", "a, \"b\""});
  good({"consent", "give", kQuoted});
  for (const Arguments& what :
       {Arguments{"person", "export", kQuoted}, {"study", "export", "s1"}, {"export-all"}}) {
    Arguments to_file = what;
    to_file.insert(to_file.end(), {"--out", file("records.jsonl"), "--replace"});
    good(to_file);
    const auto written = records(*readWholeFile(file("records.jsonl")));
    EXPECT_GE(written.size(), 1u) << what[0];
    EXPECT_EQ(records(good(what).out), written) << what[0];
    Arguments with_json = what;
    with_json.emplace_back("--json");
    EXPECT_EQ(records(good(with_json).out), written) << what[0] << " prints nothing with --json";
  }
}

}  // namespace
}  // namespace needlelab
