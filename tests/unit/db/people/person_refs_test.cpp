#include "db/people/person_refs.h"

#include <gmock/gmock.h>

#include <functional>
#include <set>

#include "needlelab/control.pb.h"
#include "needlelab/options.pb.h"
#include "tests/unit/db/erasure/erasure_fixture.h"

namespace needlelab {
namespace {

class PersonRefs : public test::ErasureTest {};

TEST_F(PersonRefs, aPersonIsFoundByIdUuidOrAnySpelling) {
  const std::string outer = **outerRef(db.writer, anna);
  EXPECT_EQ(outer.size(), 37u);
  for (const std::string& named : {anna, outer, std::string("anna"), std::string(" ANNA\u00a0")})
    EXPECT_EQ(*findPerson(db.writer, named), anna) << named;
  for (const char* none : {"", "@", "@0", "@12x", "ann", "@00000000-0000-7000-8000-000000000000", "guest"})
    EXPECT_FALSE(*findPerson(db.writer, none)) << none;
}

TEST_F(PersonRefs, aTypedNameIsFoundOnRequestWithoutAccount) {
  session("Zoë", 1, true);
  EXPECT_FALSE(*findPerson(db.writer, "Zoë"));
  const auto typed = findPerson(db.writer, "zoe\u0308", Named::kAccountOrTyped);
  ASSERT_TRUE(typed.ok() && *typed);
  std::string account;
  ASSERT_OK(PeopleStore(db.writer).add({"zoë", pb::TRAINEE, "", false, 1}, &account));
  EXPECT_EQ(*findPerson(db.writer, "Zoë", Named::kAccountOrTyped), account);
  EXPECT_NE(account, **typed);
}

TEST_F(PersonRefs, requestsGetRefsAndRepliesNames) {
  pb::Request request;
  request.set_id(7);
  auto* group = request.mutable_put_group()->mutable_group();
  group->set_name("anna");
  for (const char* member : {"anna", "nobody", "BEN"}) group->add_members(member);
  std::map<std::string, std::string> written;
  ASSERT_OK(toRefs(db.writer, request, written));
  EXPECT_THAT(group->members(), testing::ElementsAre(anna, "nobody", ben));
  EXPECT_EQ(group->name(), "anna") << "a group's name says nothing of a person";
  EXPECT_EQ(written[ben], "BEN");

  pb::Reply reply;
  auto* entry = reply.mutable_audit()->add_entries();
  entry->set_who(ben);
  entry->set_subject(anna);
  entry->set_detail("joined: " + anna + ", " + ben + "; @99 and a@b");
  auto* moved = reply.mutable_audit()->add_entries();
  const std::string address = "postgresql://needlelab" + anna + ".0.0.5:5432/lab, @1.0.0.1, mail" + anna;
  moved->set_detail(address + ", " + anna + ".");
  ASSERT_OK(erase(ben));
  ASSERT_OK(toNames(db.writer, reply));
  const std::string gone = "erased person " + ben.substr(1);
  EXPECT_EQ(entry->who(), gone);
  EXPECT_EQ(entry->subject(), "anna");
  EXPECT_EQ(entry->detail(), "joined: anna, " + gone + "; @99 and a@b");
  EXPECT_EQ(moved->detail(), address + ", anna.") << "addresses hold no ids";
}

TEST_F(PersonRefs, everyFieldNamingAPersonIsMarked) {
  // request or reply fields with these names identify a person, except those listed
  const std::set<std::string> names{"trainee", "author", "by", "who", "changed_by", "recorded_by", "members"};
  const std::set<std::string> others{"needlelab.pb.StationStatus.trainee"};  // filled in by the hub
  std::set<const google::protobuf::Descriptor*> seen;
  std::vector<std::string> unmarked;
  const std::function<void(const google::protobuf::Descriptor*)> look = [&](const auto* message) {
    if (!seen.insert(message).second) return;
    for (int i = 0; i < message->field_count(); ++i) {
      const auto* field = message->field(i);
      if (field->message_type() != nullptr) look(field->message_type());
      if (names.contains(field->name()) && field->options().GetExtension(pb::person) == pb::NO_PERSON &&
          !others.contains(field->full_name()))
        unmarked.push_back(field->full_name());
    }
  };
  look(pb::Request::descriptor());
  look(pb::Reply::descriptor());
  EXPECT_THAT(unmarked, testing::IsEmpty());
}

}  // namespace
}  // namespace needlelab
