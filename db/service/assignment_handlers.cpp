#include "db/assignments.h"
#include "db/documents.h"
#include "db/service/handlers.h"
#include "db/service/page.h"

namespace needlelab::handlers {
namespace {

/// "course basics for group a, due 2026-…": for the audit log.
std::string assignmentText(const pb::Assignment& a) {
  return (a.course_id().empty() ? "exercise " + a.exercise_id() : "course " + a.course_id()) + " for " +
         (a.group_id().empty() ? a.trainee() : "group " + a.group_id()) +
         (a.due_unix_ns() == 0 ? "" : ", due " + secondText(a.due_unix_ns()));
}

std::string assignmentSubject(const pb::Assignment& a) {
  return a.group_id().empty() ? a.trainee() : a.group_id();
}

}  // namespace

Result<pb::Reply> assign(const Context& context, const pb::Assign& call) {
  pb::Assignment assignment;
  assignment.set_trainee(call.trainee());
  assignment.set_exercise_id(call.exercise_id());
  assignment.set_course_id(call.course_id());
  assignment.set_group_id(call.group_id());
  assignment.set_due_unix_ns(call.due_unix_ns());
  assignment.set_by(context.who.name);
  assignment.set_created_unix_ns(context.now_unix_ns);
  const auto status =
      write(context, assignmentSubject(assignment), assignmentText(assignment), [&](Connection& writer) {
        auto stored = AssignmentStore(writer).put(assignment);
        if (!stored) return Status(stored.error());
        assignment = std::move(*stored);
        return Status();
      });
  if (!status) return status.error();
  pb::Reply reply;
  *reply.mutable_assignments()->add_assignments() = std::move(assignment);
  return reply;
}

Result<pb::Reply> removeAssignment(const Context& context, const pb::RemoveAssignment& call) {
  std::string subject, detail;
  const auto status = write(context, subject, detail, [&](Connection& writer) {
    const auto removed = AssignmentStore(writer).remove(call.id());
    if (!removed) return Status(removed.error());
    subject = assignmentSubject(*removed);
    detail = assignmentText(*removed);
    return Status();
  });
  if (!status) return status.error();
  pb::Reply reply;
  reply.mutable_done();
  return reply;
}

Result<pb::Reply> listAssignments(const Context& context, const pb::ListAssignments& call) {
  const bool own = context.who.role == pb::TRAINEE;
  if (own && !call.trainee().empty() && call.trainee() != context.who.name) {
    return Error{ErrorCode::kDenied, "a trainee sees own assignments only"};
  }
  const auto from = numberOfPage(call.page());
  if (!from) return from.error();
  const auto assignments =
      AssignmentStore(context.reader)
          .list({own ? context.who.name : call.trainee(), call.course_id(), call.group_id()});
  if (!assignments) return assignments.error();
  pb::Reply reply;
  auto* list = reply.mutable_assignments();
  PageRoom room;
  for (const pb::Assignment& assignment : *assignments) {
    // newest ids first; the page is the last one's id, so that those that come or go move no others
    if (*from != 0 && assignment.id() >= *from) continue;
    if (!room.take(assignment.ByteSizeLong())) {
      list->set_next_page(std::to_string(list->assignments().rbegin()->id()));
      break;
    }
    *list->add_assignments() = assignment;
  }
  return reply;
}

}  // namespace needlelab::handlers
