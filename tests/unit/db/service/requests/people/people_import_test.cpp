// The possible cost of a class list (CSV): the groups it names, those it adds to, and its report.
#include <gmock/gmock.h>

#include <string>
#include <vector>

#include "common/base/text/text.h"
#include "db/people/people.h"
#include "db/service/requests/handlers.h"
#include "tests/unit/db/service/requests/results/teaching_fixture.h"

namespace needlelab {
namespace {

class PeopleImport : public test::TeachingTest {
 protected:
  /// "PREFIX0;PREFIX1;…"
  static std::string groupCell(const std::string& prefix, std::size_t count) {
    std::string cell;
    for (std::size_t i = 0; i < count; ++i) cell += (i == 0 ? "" : ";") + prefix + std::to_string(i);
    return cell;
  }
  Error refusedTable(const std::string& csv) {
    pb::Request request;
    request.mutable_import_people()->set_csv(csv);
    return ask(manager, request).error.value_or(Error{ErrorCode::kFailed, "it was taken"});
  }
};

TEST_F(PeopleImport, aHundredGroupsPerPersonAndFaultsNameTheLine) {
  const std::string full = groupCell("g", kMaxGroupsOfPerson);
  const auto refused = importPeople("name,group\nben,a\nanna," + full + ";one-more\n");
  EXPECT_FALSE(refused.done());
  ASSERT_EQ(refused.faults(), 1u);
  EXPECT_EQ(refused.rows(0).line(), 3u);
  EXPECT_EQ(refused.rows(0).column(), "group");
  EXPECT_EQ(refused.rows(0).text(), "has 101 groups, a person is in at most 100");
  EXPECT_EQ(count("SELECT count(*) FROM people"), 0);

  const auto taken = importPeople("name,group\nanna," + full + "\n");
  ASSERT_TRUE(taken.done()) << taken.DebugString();
  EXPECT_EQ(taken.rows(0).text(), "added as trainee, joins g0, g1, g2, g3, g4 and 95 more");
  const auto later = importPeople("name,group\nanna,one-more\n");
  EXPECT_FALSE(later.done());
  EXPECT_EQ(later.rows(0).text(), "is in 100 groups and joins 1 more, a person is in at most 100");
  EXPECT_TRUE(importPeople("name,group\nanna,g7;g8\n").done()) << "she is in them already";
  EXPECT_EQ(refusal(manager, putGroup("one-more", {"anna"}, 0)), ErrorCode::kInvalidInput);
  EXPECT_EQ(count("SELECT count(*) FROM group_members"), 100);
}

TEST_F(PeopleImport, listsAreReadAsSpreadsheetsWriteThem) {
  for (const std::string csv :
       {"name,full_name,role\nanna,Anna A,trainee\nben,Ben B,trainee\n",
        "name;full_name;role\r\nanna;Anna A;trainee\r\nben;Ben B;trainee\r\n",
        "NAME\tFull Name\tRole\nanna\tAnna A\ttrainee\nben\tBen B\ttrainee\n",
        "sep=;\nname;full_name;role\n;;\nanna;Anna A;trainee\n;;\nben;Ben B;trainee\n;;\n",
        "\xef\xbb\xbfname,full_name,role,,\nanna,Anna A,trainee,,\n,,,,\nben,Ben B,trainee,,\n",
        "name,,full_name,role\nanna,,Anna A,trainee\nben,,Ben B,trainee\n",
        "\"name\",\"full_name\",\"role\"\n\"anna\",\"Anna A\",\"trainee\"\n\"ben\",\"Ben "
        "B\",\"trainee\"\n"}) {
    pb::Request request;
    request.mutable_import_people()->set_csv(csv);
    request.mutable_import_people()->set_dry_run(true);
    const pb::PeopleImport report = get(manager, request).people_import();
    EXPECT_EQ(report.added(), 2u) << csv << report.DebugString();
    EXPECT_EQ(report.faults(), 0u) << csv << report.DebugString();
  }
  pb::Request titled;
  titled.mutable_import_people()->set_csv("Class of 2026\n\nname\nanna\n");
  titled.mutable_import_people()->set_lines_above(2);
  EXPECT_EQ(get(manager, titled).people_import().rows(0).line(), 4u);
  EXPECT_EQ(refusedTable("name\nK\xf6hler\n").message, "csv: is not UTF-8: save the table as \"CSV UTF-8\"");
  const auto unnamed = importPeople("name,,role\nanna,x,trainee\n");
  EXPECT_EQ(unnamed.rows(0).text(), "has a cell in column 2, whose name is missing in the header");
  const auto comma = importPeople("name;group\nanna;autumn-a,autumn-b\n");
  EXPECT_EQ(comma.rows(0).column(), "group");
  EXPECT_THAT(comma.rows(0).text(), testing::HasSubstr("separated by semicolons"));
}

TEST_F(PeopleImport, aRegistrarsHeaderIsReadByItsWordsAndExtraColumnsAreNamed) {
  struct List {
    const char *csv, *account, *ignored;
  };
  for (const List& list :
       {List{"E-Mail;Full Name;Username;Department\na@b;Anna Keller;k1;med\n", "k1", "E-Mail, Department"},
        {"\"Matrikel-Nr.\",\"Nachname\",\"Vorname\",\"Gruppe\"\nk2,Keller,Anna,y1\n", "k2", ""},
        {"\xef\xbb\xbfName\tVorname\tBenutzername\tStudiengang\nKeller\tAnna\tk3\tMed\n", "k3",
         "Studiengang"},
        {"Nom;PR\xc3\x89NOM;Num\xc3\xa9ro \xc3\xa9tudiant;Groupe\nKeller;Anna;k4;y1\n", "k4", ""},
        {"Name,Student ID,Username\nAnna Keller,471,k5\n", "k5", "Student ID"},
        {"name,full_name,Login\nk6,Anna Keller,x\n", "k6", "Login"},
        {"name,full_name,Vorname\nk8,Anna Keller,x\n", "k8", "Vorname"},
        {"Name;Vorname;Nachname;Username\nAnna Keller;x;y;k9\n", "k9", "Vorname, Nachname"},
        {"Account,First name,Last name,full_name\nk7,A,K,Anna Keller\n", "k7", "First name, Last name"}}) {
    const pb::PeopleImport report = importPeople(list.csv);
    EXPECT_TRUE(report.done()) << list.csv << report.DebugString();
    std::string ignored;
    for (const auto& row : report.rows()) {
      if (row.what() != pb::PeopleImport::WHAT_UNSPECIFIED) continue;
      EXPECT_EQ(row.line(), 1u);
      if (row.text() == "ignored") ignored += (ignored.empty() ? "" : ", ") + row.column();
    }
    EXPECT_EQ(ignored, list.ignored) << list.csv;
    EXPECT_EQ(report.rows_left_out(), 0u) << "the header is none of the people";
    pb::Request person;
    person.mutable_get_user()->set_name(list.account);
    EXPECT_EQ(get(manager, person).user().full_name(), "Anna Keller") << list.csv;
  }
  pb::Request group;
  group.mutable_get_group()->set_id("y1");
  EXPECT_EQ(get(manager, group).group().members_size(), 2);
}

TEST_F(PeopleImport, aHeaderWithoutAnAccountIsAFaultThatShowsIt) {
  // "Name" beside a given name is the family name
  for (const std::string header : {"nom;role", "Name;Vorname", "E-Mail;Stadt"}) {
    const auto report = importPeople(header + "\nanna;trainee\n");
    EXPECT_FALSE(report.done());
    EXPECT_EQ(report.faults(), 1u);
    const auto& fault = report.rows(report.rows_size() - 1);
    EXPECT_EQ(fault.column(), "name");
    EXPECT_EQ(fault.text(), "no column is known as the account: the header reads '" + header +
                                "', separated by semicolons");
    EXPECT_EQ(report.rows(0).column() + ";" + report.rows(1).column(), header);
  }
  EXPECT_EQ(refusedTable("Gruppe,Login,Gruppe\ny1,anna,y2\n").message, "csv: column 'group' is there twice");
  EXPECT_EQ(count("SELECT count(*) FROM people"), 0);
}

TEST_F(PeopleImport, codesThatASpreadsheetRoundedAndCodesOfTwoPeopleAreFaults) {
  for (const char* const code : {"4.71221E+11", "\"4,71221E+11\"", "5E+12", "4.7e-05"}) {
    const auto report = importPeople("name,code\nanna," + std::string(code) + "\n");
    ASSERT_EQ(report.faults(), 1u) << code;
    EXPECT_EQ(report.rows(0).column(), "code");
    EXPECT_THAT(report.rows(0).text(), testing::HasSubstr("format the column as text")) << code;
  }
  const auto twice = importPeople("name,code\nanna,471221034455\nben,12345\ncarl,471221034455\n");
  ASSERT_EQ(twice.faults(), 2u);
  EXPECT_EQ(twice.rows(0).text(), "is the code of line 4, too");
  EXPECT_EQ(twice.rows(1).text(), "is the code of line 2, too");
  EXPECT_TRUE(importPeople("name,code\nanna,4E11\nben,1E5-X\ncarl,471221\n").done()) << "codes of badges";
}

TEST_F(PeopleImport, tooManyGroupsInATableAreRefusedAtTheLine) {
  std::string csv = "name,group\n";
  for (int i = 0; i < 201; ++i) csv += "s" + std::to_string(i) + "," + groupCell("g", 100) + "\n";
  const Error refused = refusedTable(csv);
  EXPECT_EQ(refused.code, ErrorCode::kInvalidInput);
  EXPECT_TRUE(refused.message.starts_with("csv: line 202: ")) << refused.message;
  EXPECT_EQ(count("SELECT count(*) FROM people"), 0);
}

TEST_F(PeopleImport, overfullGroupsInATableAreRefusedAtALine) {
  ASSERT_OK(change([](Connection& c) -> Status {
    for (int i = 0; i < kMaxGroupMembers - 1; ++i)
      RETURN_IF_ERROR(PeopleStore(c).add({"p" + std::to_string(i), pb::TRAINEE, "", false, 1}));
    for (int group = 0; group < 5; ++group) {
      const std::string id = "g" + std::to_string(group);
      RETURN_IF_ERROR(
          c.run("INSERT INTO groups (id, name, revision, changed_by, changed_unix_ns)"
                " VALUES (?1, ?1, 1, 'mia', 1)",
                id));
      RETURN_IF_ERROR(c.run("INSERT INTO group_members (group_id, person) SELECT ?, ref FROM people", id));
    }
    return {};
  }));
  const Error refused = refusedTable("name,group\nben,g0;g1\nanna,g2;g3;g4\n");
  EXPECT_EQ(refused.code, ErrorCode::kInvalidInput);
  EXPECT_TRUE(refused.message.starts_with("csv: line 3: with group 'g4', ")) << refused.message;
  EXPECT_EQ(count("SELECT count(*) FROM accounts WHERE name IN ('anna', 'ben')"), 0);
  EXPECT_TRUE(importPeople("name,group\nben,g0;g1\n").done());
}

TEST_F(PeopleImport, theReportOfALongTableFitsIntoAMessage) {
  std::string csv = "name,group\n";
  for (int i = 0; i < 2000; ++i) {
    csv += std::to_string(10'000 + i) + std::string(kMaxNameBytes - 5, 'n') + ",";
    for (int group = 0; group < 10; ++group)
      csv += (group == 0 ? "" : ";") + std::to_string(group) + std::string(kMaxNameBytes - 1, 'g');
    csv += "\n";
  }
  const auto report = importPeople(csv, true);
  EXPECT_EQ(report.added(), 2000u);
  EXPECT_GT(report.rows_size(), 1000);
  EXPECT_LE(report.ByteSizeLong(), handlers::kMaxReplyBytes - 5000 * (kMaxNameBytes + 3));
}

TEST_F(PeopleImport, rowsGrantingRightsComeFirstAndTheRestAreCounted) {
  std::string csv = "name,role,password,code\n";
  const auto addTrainees = [&](int from, int to) {
    for (int i = from; i < to; ++i) csv += "s" + std::to_string(i) + ",trainee,,\n";
  };
  addPerson("tom", pb::TRAINEE);
  addPerson("ina", pb::INSTRUCTOR);
  addTrainees(0, 2050);
  csv += "zoe,administrator,correct horse,\nina,trainee,,\ntom,,,1234\nkim,,correct horse,\n";
  addTrainees(2050, 2090);
  for (const bool dry_run : {true, false}) {
    const auto report = importPeople(csv, dry_run, &admin);
    ASSERT_EQ(report.faults(), 0u) << report.rows(0).text();
    EXPECT_EQ(report.done(), !dry_run);
    EXPECT_EQ(report.added(), 2092u);
    ASSERT_EQ(report.rows_size(), 2000);
    EXPECT_EQ(report.rows_left_out(), 94u);
    EXPECT_EQ(report.rights_given(), 4u);
    EXPECT_EQ(report.rows(0).line(), 2052u);
    EXPECT_EQ(report.rows(0).text(), "added as administrator, with a password");
    EXPECT_EQ(report.rows(1).text(), "role: instructor to trainee");
    EXPECT_EQ(report.rows(2).text(), "given the code");
    EXPECT_EQ(report.rows(3).text(), "added as trainee, with a password");
    EXPECT_EQ(report.rows(4).line(), 2u) << "then the others, in order";
  }
}

TEST_F(PeopleImport, tooManyRightsForTheReportAreRefusedAtTheLine) {
  constexpr int kMost = 300;
  std::string csv = "name,full_name,role\n", one_more;
  ASSERT_OK(change([&](Connection& c) -> Status {
    for (int i = 0; i <= kMost; ++i) {
      const std::string name = std::to_string(10'000 + i) + std::string(kMaxNameBytes - 5, 'n');
      Person person{name, pb::INSTRUCTOR, "", false, 1};
      person.full_name = std::string(200, 'a');
      RETURN_IF_ERROR(PeopleStore(c).add(person));
      (i < kMost ? csv : one_more) += name + "," + std::string(200, 'b') + ",trainee\n";
    }
    return {};
  }));
  const auto taken = importPeople(csv, true, &admin);
  EXPECT_EQ(taken.rows_size(), kMost) << "none is left out for its length";
  EXPECT_EQ(taken.rows_left_out(), 0u);
  pb::Request request;
  request.mutable_import_people()->set_csv(csv + one_more);
  const auto refused = ask(admin, request).error;
  ASSERT_TRUE(refused.has_value());
  EXPECT_EQ(refused->code, ErrorCode::kInvalidInput);
  EXPECT_TRUE(refused->message.starts_with("line 302, '10300n")) << refused->message;
  EXPECT_EQ(count("SELECT count(*) FROM people WHERE role = 2"), kMost + 1);
}

TEST_F(PeopleImport, aPersonInVeryManyGroupsIsListedWithSome) {
  constexpr int kGroups = 20'000;
  addPerson("anna", pb::TRAINEE);
  addPerson("ben", pb::TRAINEE);
  ASSERT_OK(change([](Connection& c) -> Status {
    for (int i = 0; i < kGroups; ++i) {
      const std::string id = std::to_string(10'000 + i) + std::string(kMaxNameBytes - 5, 'g');
      RETURN_IF_ERROR(
          c.run("INSERT INTO groups (id, name, revision, changed_by, changed_unix_ns)"
                " VALUES (?1, ?1, 1, 'mia', 1)",
                id));
      RETURN_IF_ERROR(c.run(
          "INSERT INTO group_members (group_id, person) SELECT ?, ref FROM accounts WHERE name = 'anna'",
          id));
    }
    return {};
  }));
  pb::Request request;
  request.mutable_list_users();
  const pb::Reply listed = get(manager, request);
  ASSERT_EQ(listed.users().users_size(), 2);
  EXPECT_LE(listed.ByteSizeLong(), handlers::kMaxReplyBytes);
  EXPECT_EQ(listed.users().users(0).groups_size(), 1000);
  EXPECT_EQ(listed.users().users(0).more_groups(), kGroups - 1000u);
  EXPECT_EQ(listed.users().users(1).more_groups(), 0u);
  // she leaves groups and joins none
  const std::string first = "10000" + std::string(kMaxNameBytes - 5, 'g');
  EXPECT_FALSE(ask(manager, putGroup(first, {"anna", "ben"}, 1)).error) << "she stays in it";
  EXPECT_FALSE(ask(manager, putGroup(first, {"ben"}, 2)).error);
  EXPECT_EQ(refusal(manager, putGroup(first, {"anna", "ben"}, 3)), ErrorCode::kInvalidInput);
}

}  // namespace
}  // namespace needlelab
