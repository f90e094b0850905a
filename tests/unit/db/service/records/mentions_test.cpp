// Texts that name people, and removing the names from them.
#include "db/service/records/mentions.h"

#include <gmock/gmock.h>

#include <algorithm>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/unit/db/service/test_service.h"

namespace needlelab {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::UnorderedElementsAre;

TEST(Phrases, areFoundAsWholeWordsInAnyCaseAndFormOfUnicode) {
  const Phrases phrases(std::vector<std::string>{"anna.bell", "Anna Bell", "J\u00e4ger", ""});
  EXPECT_THAT(phrases.placesIn("ANNA bell was here"), ElementsAre(testing::Pair(0u, 9u)));
  EXPECT_THAT(phrases.placesIn("as anna.bell and Anna  Bell said"),
              ElementsAre(testing::Pair(3u, 12u), testing::Pair(17u, 27u)));
  EXPECT_THAT(phrases.placesIn("Ja\u0308ger"), ElementsAre(testing::Pair(0u, 7u))) << "decomposed";
  for (const char* const other : {"", "Anna Bellini", "Susanna Bell", "Anna", "Bell Anna", "J\u00e4gerin"})
    EXPECT_THAT(phrases.placesIn(other), IsEmpty()) << other;
  EXPECT_EQ(phrases.without("ask Anna Bell, or J\u00c4GER."), "ask [name removed], or [name removed].");
  EXPECT_TRUE(Phrases(std::vector<std::string>{"", " - "}).empty());
  EXPECT_THAT(phrases.placesIn("\xff Anna Bell \xc3"), ElementsAre(testing::Pair(2u, 11u)))
      << "bytes that are not UTF-8";
}

class Mentions : public test::ServiceTest {
 protected:
  void SetUp() override {
    addStation();
    ASSERT_OK(change([&](Connection& c) {
      return PeopleStore(c).add({"anna.bell", pb::TRAINEE, "", false, 1, "Anna Bell"});
    }));
    pb::Request group;
    group.mutable_put_group()->mutable_group()->set_id("g1");
    group.mutable_put_group()->mutable_group()->set_name("Friends of Anna Bell");
    get(manager, group);
    session_ = addSession("anna.bell", 2);
    ASSERT_OK(change([&](Connection& c) -> Status {
      const auto closed = SessionStore(c).close(test::closeOf(session_, 2, 20), 2);
      return closed ? Status() : Status(closed.error());
    }));
    remark("Anna Bell trembles. anna.bell should rest.");
    remark("Annabell is another person");
  }
  void remark(const std::string& text) {
    pb::Request request;
    request.mutable_annotate()->set_session_id(test::bytesOfId(session_));
    request.mutable_annotate()->set_text(text);
    get(instructor, request);
  }
  static pb::Request list(const std::string& name, const std::string& text = "") {
    pb::Request request;
    request.mutable_list_mentions()->set_name(name);
    request.mutable_list_mentions()->set_text(text);
    return request;
  }
  static pb::Request redact(const std::string& name, const std::string& where, const std::string& text = "") {
    pb::Request request;
    request.mutable_redact()->set_name(name);
    request.mutable_redact()->set_where(where);
    request.mutable_redact()->set_text(text);
    return request;
  }
  std::vector<std::string> wheres(const std::string& name, const std::string& text = "") {
    std::vector<std::string> found;
    const pb::Reply reply = get(admin, list(name, text));
    for (const pb::Mention& one : reply.mentions().mentions()) found.push_back(one.where());
    return found;
  }
  void importCourse(const std::string& name) {
    pb::Request request;
    request.mutable_import_curriculum()->set_json(nlohmann::json{
        {"id", "course"},
        {"name", name},
        {"exercises",
         {{{"id", "anna"}, {"name", "As \"Anna Bell\" does it"}, {"profile_id", "phantom-ball"}}}}}
                                                      .dump());
    get(manager, request);
  }

  Uuid session_{};
};

TEST_F(Mentions, areListedWithTheirPlacesAndLeftAloneByAnErasure) {
  const pb::Reply reply = get(admin, list("anna.bell"));
  ASSERT_EQ(reply.mentions().mentions_size(), 2);
  const pb::Mention& remark = reply.mentions().mentions(0);
  EXPECT_EQ(remark.where(), "remark 1");
  EXPECT_EQ(remark.times(), 2u);
  EXPECT_EQ(remark.text(), "Anna Bell trembles. anna.bell should rest.");
  EXPECT_EQ(remark.link(), "#/sessions/" + uuidText(session_));
  EXPECT_EQ(reply.mentions().mentions(1).where(), "group g1");
  EXPECT_EQ(reply.mentions().mentions(1).link(), "#/groups/g1");
  EXPECT_THAT(wheres("anna.bell", "annabell"), ElementsAre("remark 1", "remark 2", "group g1"));

  pb::Request erase;
  erase.mutable_erase_person()->set_name("anna.bell");
  erase.mutable_erase_person()->set_confirm("anna.bell");
  const std::string gone = get(admin, erase).erasure().pseudonym();
  EXPECT_EQ(ask(admin, list("anna.bell")).error->code, ErrorCode::kInvalidInput) << "no name to look for";
  EXPECT_THAT(wheres("anna.bell", "Anna Bell"), ElementsAre("remark 1", "group g1")) << "by the words";
}

TEST_F(Mentions, areRemovedFromOneTextAndTheAuditOmitsTheText) {
  get(admin, redact("anna.bell", "remark 1"));
  EXPECT_THAT(wheres("anna.bell"), ElementsAre("group g1"));
  pb::Request remarks;
  remarks.mutable_list_annotations()->set_session_id(test::bytesOfId(session_));
  EXPECT_EQ(get(instructor, remarks).annotations().annotations(0).text(),
            "[name removed] trembles. [name removed] should rest.");
  get(admin, redact("anna.bell", "group g1"));
  pb::Request group;
  group.mutable_get_group()->set_id("g1");
  EXPECT_EQ(get(manager, group).group().name(), "Friends of [name removed]");
  EXPECT_EQ(get(manager, group).group().revision(), 2u);
  pb::Request audit;
  audit.mutable_list_audit();
  const pb::Reply lines = get(admin, audit);
  EXPECT_EQ(lines.audit().entries(0).action(), "person redact");
  EXPECT_EQ(lines.audit().entries(0).detail(), "group g1");
  EXPECT_EQ(lines.audit().entries(1).detail(), "remark 1");
  EXPECT_THAT(lines.audit().entries(0).DebugString(), Not(HasSubstr("Friends")));
}

TEST_F(Mentions, inTitlesAreRemovedFromEachRevisionAndStationData) {
  importCourse("With Anna Bell");
  importCourse("With Anna Bell, again");
  EXPECT_THAT(wheres("anna.bell"), UnorderedElementsAre("remark 1", "group g1", "course course/1",
                                                        "course course/2", "exercise anna"));
  for (const char* const where : {"course course/1", "course course/2", "exercise anna"})
    get(admin, redact("anna.bell", where));
  EXPECT_THAT(wheres("anna.bell"), ElementsAre("remark 1", "group g1"));
  pb::Request curricula;
  curricula.mutable_list_curricula();
  const pb::Reply listed = get(manager, curricula);
  EXPECT_TRUE(std::ranges::any_of(listed.curricula().curricula(), [](const auto& course) {
    return course.name() == "With [name removed], again";
  }));
  pb::Request lesson;
  lesson.mutable_get_lesson()->set_exercise_id("anna");
  const auto exercise = nlohmann::json::parse(get(station, lesson).lesson().exercise_json());
  EXPECT_EQ(exercise["name"], "As \"[name removed]\" does it");
  EXPECT_EQ(exercise["id"], "anna") << "ids are not titles";
}

TEST_F(Mentions, areOfTextsThatAreThere) {
  EXPECT_EQ(ask(admin, redact("anna.bell", "remark 9")).error->code, ErrorCode::kNotFound);
  for (const char* const where : {"", "remark", "remark ", "person anna.bell", "'; DROP TABLE names; --"})
    EXPECT_EQ(ask(admin, redact("anna.bell", where)).error->code, ErrorCode::kInvalidInput) << where;
}

}  // namespace
}  // namespace needlelab
