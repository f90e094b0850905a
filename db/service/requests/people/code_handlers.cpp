// Trainees' codes: who may set them, the check before a lesson, and whether the lab requires them.
#include <fmt/core.h>
#include <fmt/ranges.h>
#include <optional>
#include <utility>
#include <vector>

#include "common/base/secret.h"
#include "common/base/text/text.h"
#include "db/audit/audit.h"
#include "db/login/credentials.h"
#include "db/people/people.h"
#include "db/service/context/code_guard.h"
#include "db/service/context/code_tries.h"
#include "db/service/requests/handlers.h"
#include "db/store/connection.h"
#include "db/store/schema.h"

namespace needlelab::handlers {
namespace {

/// People may set their own code; managers also those of the people they manage.
Status maySetCode(const Context& context, Connection& connection, const std::string& name) {
  const bool manages = context.who.role == pb::CURRICULUM_MANAGER || context.who.role == pb::ADMINISTRATOR;
  if (!manages && context.who.name != name)
    return Error{ErrorCode::kDenied,
                 "only curriculum managers and administrators set the codes of other people"};
  ASSIGN_OR_RETURN(const auto person, PeopleStore(connection).find(name));
  if (!person) return Error{ErrorCode::kNotFound, "there is no person named '" + printable(name) + "'"};
  return context.who.name == name ? Status() : mayManage(context, person->role);
}

/// Does not wait for the audit line: the answer does not depend on it, and log-ins wait for this thread.
void noteLocked(const Context& context, const std::string& name, const std::string& wait) {
  AuditRow line{
      0, context.now_unix_ns, context.who.name, "code locked", name, "too many wrong codes: waits " + wait};
  static_cast<void>(context.writer.post(
      [line = std::move(line)](Connection& writer) { return AuditStore(writer).add(line); },
      [](const Status&) {}, DbWriter::Places::kKept));
}

Result<pb::Reply> settingsReply(Connection& connection) {
  ASSIGN_OR_RETURN(const bool required, LabSettingsStore(connection).codesRequired());
  ASSIGN_OR_RETURN(const bool keeps, LabSettingsStore(connection).keepsRecordingsOfErased());
  pb::Reply reply;
  reply.mutable_lab_settings()->set_codes_required(required);
  reply.mutable_lab_settings()->set_keep_recordings_of_erased(keeps);
  return reply;
}

}  // namespace

Result<pb::Reply> setCode(const Context& context, const pb::SetCode& call) {
  if (call.make() && !call.code().empty())
    return Error{ErrorCode::kInvalidInput, "code: give either a code or make, which makes one"};
  RETURN_IF_ERROR(maySetCode(context, context.reader, call.name()));
  std::string code = call.make() ? makePin() : call.code();
  const WipeAtEnd wiped(code);
  std::string hash;
  if (!code.empty()) {
    ASSIGN_OR_RETURN(hash, hashCode(code));
  }
  pb::Reply reply;
  reply.mutable_new_code()->set_name(call.name());
  if (code.empty()) {
    ASSIGN_OR_RETURN(const auto person, PeopleStore(context.reader).find(call.name()));
    if (person && person->code_hash.empty()) return reply;  // nothing to remove
  }
  const std::string_view detail = code.empty() ? "removed" : call.make() ? "made" : "set";
  const Status written =
      writeIfChanged(context, call.name(), std::string(detail), [&](Connection& writer) -> Result<bool> {
        // check again: hashing took a while
        RETURN_IF_ERROR(maySetCode(context, writer, call.name()));
        ASSIGN_OR_RETURN(const auto person, PeopleStore(writer).find(call.name()));
        if (code.empty() && person && person->code_hash.empty()) return false;
        RETURN_IF_ERROR(PeopleStore(writer).setCodeHash(call.name(), hash));
        return true;
      });
  if (!written) return written.error();
  (void)context.codes.forget(call.name());  // the code is stored even if this fails; then the wait continues
  if (call.make()) reply.mutable_new_code()->set_code(code);
  return reply;
}

Result<pb::Reply> getLabSettings(const Context& context, const pb::GetLabSettings&) {
  return settingsReply(context.reader);
}

Result<pb::Reply> changeLabSettings(const Context& context, const pb::ChangeLabSettings& call) {
  ASSIGN_OR_RETURN(auto reply, settingsReply(context.reader));
  pb::LabSettings wanted = reply.lab_settings();
  std::vector<std::string> changes;
  if (call.has_codes_required() && call.codes_required() != wanted.codes_required()) {
    wanted.set_codes_required(call.codes_required());
    changes.emplace_back(call.codes_required() ? "codes required" : "codes optional");
  }
  if (call.has_keep_recordings_of_erased() &&
      call.keep_recordings_of_erased() != wanted.keep_recordings_of_erased()) {
    wanted.set_keep_recordings_of_erased(call.keep_recordings_of_erased());
    changes.emplace_back(call.keep_recordings_of_erased() ? "sessions of erased people stay"
                                                          : "sessions of erased people go");
  }
  if (changes.empty()) return reply;
  const std::string detail = fmt::format("{}", fmt::join(changes, "; "));
  const Status written = writeIfChanged(context, "", detail, [&](Connection& writer) -> Result<bool> {
    LabSettingsStore settings(writer);
    ASSIGN_OR_RETURN(const bool required, settings.codesRequired());
    ASSIGN_OR_RETURN(const bool keeps, settings.keepsRecordingsOfErased());
    if (call.has_codes_required()) RETURN_IF_ERROR(settings.setCodesRequired(call.codes_required()));
    if (call.has_keep_recordings_of_erased())
      RETURN_IF_ERROR(settings.setKeepsRecordingsOfErased(call.keep_recordings_of_erased()));
    ASSIGN_OR_RETURN(reply, settingsReply(writer));
    return required != reply.lab_settings().codes_required() ||
           keeps != reply.lab_settings().keep_recordings_of_erased();
  });
  if (!written) return written.error();
  return reply;
}

Result<bool> checkCodeOf(const Context& context, const std::string& name, const std::string& code) {
  if (context.who.role != pb::STATION || name.empty() || name == kGuestName) return false;
  ASSIGN_OR_RETURN(const auto person, PeopleStore(context.reader).find(name));
  if (!person || person->code_hash.empty()) {
    ASSIGN_OR_RETURN(const bool required, LabSettingsStore(context.reader).codesRequired());
    if (!required) return false;
    return Error{ErrorCode::kDenied, name + " has no code yet: ask a manager for one"};
  }
  if (code.empty())
    return Error{ErrorCode::kCode, name + " has a code: type the PIN or hold the badge to the reader"};
  const auto tried = context.codes.begin(name);
  if (!tried) return Error{ErrorCode::kCode, "the code cannot be checked now: " + tried.error().message};
  const CodeGuard::Try& begun = *tried;
  // also kCode: on kUnavailable a station would begin the lesson from its cache
  if (begun.must_wait.count() > 0)
    return Error{ErrorCode::kCode,
                 fmt::format("too many wrong codes of {}: try again in {}", name, waitText(begun.must_wait))};
  const auto right = verifyPassword(person->code_hash, code);
  if (!right.ok()) {
    (void)context.codes.giveBack(name);
    return right.error();
  }
  if (*right) {
    (void)context.codes.forget(name);  // the code is right even if resetting the count fails
    return true;
  }
  const std::string wrong = "this is not the code of " + name + "; ";
  if (begun.left > 0)
    return Error{ErrorCode::kCode,
                 wrong + fmt::format("{} {} left", begun.left, begun.left == 1 ? "try" : "tries")};
  const std::string wait = waitText(begun.then_wait);
  noteLocked(context, name, wait);
  return Error{ErrorCode::kCode, wrong + "try again in " + wait};
}

}  // namespace needlelab::handlers
