#include "db/service/context/context.h"

#include <fmt/core.h>
#include <algorithm>

#include "common/base/time/clock.h"
#include "db/audit/audit.h"
#include "db/login/access_numbers.h"
#include "db/service/context/export_ledger.h"

namespace needlelab::handlers {

Result<pb::Reply> withReader(const ServiceParts& parts, const Principal& who, std::string_view action,
                             RequestUnderWay& under_way,
                             const std::function<Result<pb::Reply>(const Context&)>& work) {
  ASSIGN_OR_RETURN(auto reader, parts.readers.borrow());
  return work(
      {who, parts, parts.writer, *reader, wallNowNs(), action, parts.exports, parts.codes, under_way});
}

Status write(const Context& context, const std::string& subject, const std::string& detail,
             const std::function<Status(Connection&)>& work) {
  return writeIfChanged(context, subject, detail, [&](Connection& writer) -> Result<bool> {
    RETURN_IF_ERROR(work(writer));
    return true;
  });
}

Status writeIfChanged(const Context& context, const std::string& subject, const std::string& detail,
                      const std::function<Result<bool>(Connection&)>& work) {
  return context.writer.run([&](Connection& writer) -> Status {
    RETURN_IF_ERROR(checkAccess(writer, context.who));
    ASSIGN_OR_RETURN(const bool changed, work(writer));
    if (!changed) return {};
    return AuditStore(writer).add(
        {0, context.now_unix_ns, context.who.name, std::string(context.action), subject, detail});
  });
}

Status edit(const Context& context, const std::string& subject, const std::string& detail,
            const std::function<Status(Connection&)>& work) {
  return write(context, subject, detail, [&](Connection& writer) -> Status {
    const Status done = work(writer);
    if (done || done.error().code != ErrorCode::kConflict || done.error().current_revision == 0) return done;
    Error conflict = done.error();
    // an import of a class table may also have changed the person
    const std::string_view other = context.action == "user change" ? "user import" : context.action;
    // on the writer, so that the newest line is the change that caused the conflict
    auto row = writer.query(
        "SELECT detail FROM audit WHERE subject = ? AND action IN (?, ?) ORDER BY id DESC LIMIT 1", subject,
        context.action, other);
    const auto found = row.step();
    if (found && *found && !row.text(0).empty()) conflict.message += ". What came first: " + row.text(0);
    return conflict;
  });
}

Status noteRead(const Context& context, const std::string& subject, const std::string& detail) {
  const std::string what = std::string(context.action) + "\n" + subject + "\n" + detail;
  if (!context.exports.isNew(context.who, what, context.now_unix_ns)) return {};
  const Status noted = writeIfChanged(context, subject, detail, [&](Connection& writer) {
    return context.exports.isNewOnAllServers(writer, context.who, what);
  });
  if (context.writer.failed()) return {};
  if (!noted.ok()) context.exports.revoke(context.who, what);
  return noted;
}

void noteAccessChanged(const Context& context) {
  context.under_way.access_changed = true;
}

pb::Reply doneReply() {
  pb::Reply reply;
  reply.mutable_done();
  return reply;
}

Status keepOwnAccess(const Context& context, Connection& writer, const std::string& name) {
  if (context.who.name != name || !context.who.access_number) return {};
  ASSIGN_OR_RETURN(context.under_way.access_number, AccessNumberStore(writer).of(AccessKind::kPerson, name));
  return {};
}

Status requireOwnData(const Context& context, const std::string& name, const std::string& what) {
  const bool limited = context.who.role == pb::TRAINEE || context.who.role == pb::RESEARCHER;
  if (!limited || name == context.who.name) return {};
  return Error{ErrorCode::kDenied,
               "a " + std::string(roleName(context.who.role)) + " sees own " + what + " only"};
}

Result<Uuid> sessionId(const std::string& bytes) {
  Uuid id;
  if (bytes.size() != id.size()) {
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("session_id: has {} bytes, allowed are 16", bytes.size())};
  }
  std::copy(bytes.begin(), bytes.end(), id.begin());
  return id;
}

}  // namespace needlelab::handlers
