// Messages from instructors to stations: permissions, refusals, audit log.
#include "common/profile/aid_list.h"
#include "tests/unit/db/service/test_service.h"

namespace needlelab {
namespace {

class StationHandlers : public test::ServiceTest {
 protected:
  void SetUp() override { addStation(); }
  static pb::Request messageTo(const std::string& name, const std::string& text) {
    pb::Request request;
    request.mutable_trainee_message()->set_station(name);
    request.mutable_trainee_message()->set_text(text);
    return request;
  }
  static pb::Request aids(std::initializer_list<pb::Exercise::Aid> on, bool reset = false) {
    pb::Request request;
    request.mutable_set_aids()->set_station("station-1");
    for (const auto aid : on) request.mutable_set_aids()->add_aids(aid);
    request.mutable_set_aids()->set_reset(reset);
    return request;
  }
  static pb::Request stop(const std::string& reason) {
    pb::Request request;
    request.mutable_stop_lesson()->set_station("station-1");
    request.mutable_stop_lesson()->set_reason(reason);
    return request;
  }
  void expectDelivered(const Principal& who, const pb::Request& request) {
    const Outcome outcome = ask(who, request);
    EXPECT_FALSE(outcome.error.has_value()) << outcome.error->message;
    EXPECT_EQ(outcome.server_part, ServerPart::kDeliver);
  }
  pb::AuditEntry newestAudit() {
    pb::Request list;
    list.mutable_list_audit()->set_limit(1);
    const auto audit = get(admin, list).audit();
    return audit.entries_size() == 0 ? pb::AuditEntry() : audit.entries(0);
  }
};

TEST_F(StationHandlers, everyWordIsInTheAuditLogWithWhoAndWhat) {
  expectDelivered(instructor, messageTo("station-1", "slower, please"));
  pb::AuditEntry line = newestAudit();
  EXPECT_EQ(line.who(), "ina");
  EXPECT_EQ(line.action(), "message");
  EXPECT_EQ(line.subject(), "station-1");
  EXPECT_EQ(line.detail(), "slower, please");

  pb::Request courses, next;
  courses.mutable_list_curricula();
  const std::string exercise = get(admin, courses).curricula().curricula(0).exercise_ids(0);
  next.mutable_next_exercise()->set_station("station-1");
  next.mutable_next_exercise()->set_exercise_id(exercise);
  expectDelivered(admin, next);
  line = newestAudit();
  EXPECT_EQ(line.who(), "ada");
  EXPECT_EQ(line.action(), "next exercise");
  EXPECT_EQ(line.detail(), exercise);

  expectDelivered(manager, aids({pb::Exercise::DEPTH, pb::Exercise::ULTRASOUND}));
  line = newestAudit();
  EXPECT_EQ(line.who(), "mia");
  EXPECT_EQ(line.action(), "aids");
  EXPECT_EQ(line.detail(), "DEPTH, ULTRASOUND");
  expectDelivered(instructor, aids({}, true));
  EXPECT_EQ(newestAudit().detail(), "as the exercise says");
  expectDelivered(instructor, aids({}));
  EXPECT_EQ(newestAudit().detail(), "none");

  const Uuid lesson = makeUuidV7();
  pb::Request ends = stop("the table moved");
  ends.mutable_stop_lesson()->set_session_id(test::bytesOfId(lesson));
  expectDelivered(instructor, ends);
  line = newestAudit();
  EXPECT_EQ(line.action(), "stop");
  EXPECT_EQ(line.subject(), "station-1");
  EXPECT_EQ(line.detail(), "the table moved (session " + uuidText(lesson) + ")");
  expectDelivered(instructor, stop(""));
}

TEST_F(StationHandlers, invalidAidsAndLessonsAreRefusedWithoutAuditLine) {
  const auto before = newestAudit().id();
  pb::Request wrong = aids({pb::Exercise::DEPTH, pb::Exercise::DEPTH});
  EXPECT_EQ(refusal(instructor, wrong), ErrorCode::kInvalidInput) << "twice";
  EXPECT_EQ(refusal(instructor, aids({pb::Exercise::AID_UNSPECIFIED})), ErrorCode::kInvalidInput);
  // proto3 keeps unknown values
  EXPECT_EQ(refusal(instructor, aids({static_cast<pb::Exercise::Aid>(99)})), ErrorCode::kInvalidInput);
  EXPECT_EQ(refusal(instructor, aids({pb::Exercise::DEPTH}, true)), ErrorCode::kInvalidInput) << "both";
  pb::Request many;
  many.mutable_set_aids()->set_station("station-1");
  for (int i = 0; i < 100'000; ++i) many.mutable_set_aids()->add_aids(pb::Exercise::DEPTH);
  EXPECT_EQ(refusal(instructor, many), ErrorCode::kInvalidInput);
  wrong = aids({});
  wrong.mutable_set_aids()->set_session_id("no id");
  EXPECT_EQ(refusal(instructor, wrong), ErrorCode::kInvalidInput);
  wrong = stop("why");
  wrong.mutable_stop_lesson()->set_session_id(std::string(17, 'x'));
  EXPECT_EQ(refusal(instructor, wrong), ErrorCode::kInvalidInput);
  EXPECT_EQ(refusal(instructor, stop(std::string(5000, 'x'))), ErrorCode::kInvalidInput);
  EXPECT_EQ(refusal(instructor, stop("\x1b[2J")), ErrorCode::kInvalidInput);
  wrong = stop("");
  wrong.mutable_stop_lesson()->set_station("nowhere");
  EXPECT_EQ(refusal(instructor, wrong), ErrorCode::kNotFound);
  wrong = aids({});
  wrong.mutable_set_aids()->set_station("nowhere");
  EXPECT_EQ(refusal(instructor, wrong), ErrorCode::kNotFound);
  EXPECT_EQ(newestAudit().id(), before) << "a refused message was never sent";
}

TEST_F(StationHandlers, aRemarkOnARunningLessonIsKept) {
  addPerson("anna", pb::TRAINEE);
  const Uuid id = addSession("anna", 3);
  pb::Request annotate;
  annotate.mutable_annotate()->set_session_id(test::bytesOfId(id));
  annotate.mutable_annotate()->set_tick(1'000'000);  // ahead of the data that has reached the server
  annotate.mutable_annotate()->set_text("watch the angle here");
  const auto remark = get(instructor, annotate).annotation();
  EXPECT_EQ(remark.author(), "ina");
  EXPECT_EQ(newestAudit().action(), "annotate");
  EXPECT_EQ(newestAudit().subject(), uuidText(id));
  pb::Request list;
  list.mutable_list_annotations()->set_session_id(test::bytesOfId(id));
  ASSERT_EQ(get(instructor, list).annotations().annotations_size(), 1);

  ASSERT_OK(store->service().scoring().closeSession(test::closeOf(id, 3), "station-1"));
  annotate.mutable_annotate()->set_tick(5);
  get(instructor, annotate);
  const auto kept = get(trainee, list).annotations();
  ASSERT_EQ(kept.annotations_size(), 2) << "in order of ticks";
  EXPECT_EQ(kept.annotations(0).tick(), 5u);
  EXPECT_EQ(kept.annotations(1).SerializeAsString(), remark.SerializeAsString());
}

}  // namespace
}  // namespace needlelab
