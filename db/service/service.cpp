#include "db/service/service.h"

#include <fmt/core.h>

#include <cassert>
#include <exception>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "db/people/person_refs.h"
#include "proto/session_rules.h"

namespace needlelab {
namespace {

/// Staff may look up everyone's name; others only their own, and names that they wrote themselves.
bool mayReadNames(pb::Role role) {
  return role == pb::INSTRUCTOR || role == pb::CURRICULUM_MANAGER || role == pb::ADMINISTRATOR;
}

/// The message for `who`, with refs replaced by names.
std::string messageFor(Connection& reader, const Principal& who, const std::string& message,
                       std::map<std::string, std::string> names) {
  auto refs = refsIn(message);
  std::erase_if(refs, [&](const std::string& ref) {
    return names.contains(ref) || (!mayReadNames(who.role) && ref != who.name);
  });
  const std::vector<std::string> list(refs.begin(), refs.end());
  if (auto others = namesOfRefs(reader, list)) names.merge(*others);
  return withNames(message, names);
}

}  // namespace

Service::Service(DbWriter& writer, ReaderPool& readers, bool together, std::shared_ptr<ExportLedger> exports,
                 std::unique_ptr<CodeTries> codes)
    : readers_(readers),
      exports_(std::move(exports)),
      codes_(std::move(codes)),
      logins_(readers, together),
      notes_(writer, exports_),
      scoring_(writer, readers),
      rescoring_(writer, readers, scoring_, backups_, long_work_),
      retention_(writer, readers, scoring_, backups_, long_work_),
      erasures_(writer, readers, scoring_, retention_, long_work_),
      parts_{writer,   readers,  *exports_,  *codes_,    long_work_,
             backups_, scoring_, rescoring_, retention_, erasures_} {}

Outcome Service::execute(const Principal& principal, const pb::Request& request) {
  RequestUnderWay under_way;
  for (;;)
    if (auto outcome = executeStep(principal, request, under_way)) return *std::move(outcome);
}

std::optional<Outcome> Service::executeStep(const Principal& principal, const pb::Request& request,
                                            RequestUnderWay& under_way) {
  under_way.more = false;
  const RequestRow* row = requestRow(request.call_case());
  Outcome outcome;
  const auto guarded = [&]() -> Result<pb::Reply> {
    // an unexpected exception fails only this request and must not affect lessons
    try {
      RETURN_IF_ERROR(checkRole(principal, request.call_case()));
      if (!under_way.isDone()) {
        ASSIGN_OR_RETURN(auto reader, readers_.borrow());
        RETURN_IF_ERROR(checkAccess(*reader, principal));
        if (!under_way.with_refs) {
          const std::shared_ptr<pb::Request> with_refs(new pb::Request(request), [](pb::Request* held) {
            wipeSecrets(*held);
            delete held;
          });
          RETURN_IF_ERROR(toRefs(*reader, *with_refs, under_way.written));
          under_way.with_refs = with_refs;
        }
      }
      return row->handler.run(parts_, principal, *under_way.with_refs, under_way);
    } catch (const std::exception& thrown) {
      return Error{
          ErrorCode::kFailed,
          fmt::format("the request '{}' failed inside: {}: please report this as a fault of the program",
                      callName(request.call_case()), thrown.what())};
    }
  };
  auto reply = guarded();
  if (reply && under_way.more) return std::nullopt;
  if (reply) {
    const auto& roles = reply->people_import().roles_changed();
    outcome.roles_changed.assign(roles.begin(), roles.end());
  }
  if (auto reader = readers_.borrow()) {
    if (!reply) {
      Error error = reply.error();
      error.message = messageFor(**reader, principal, error.message, under_way.written);
      reply = std::move(error);
    } else if (const Status named = toNames(**reader, *reply); !named && !under_way.isDone()) {
      reply = named.error();
    }
  }
  outcome.access_changed = under_way.access_changed;
  outcome.with_refs = under_way.with_refs;
  outcome.access_number = under_way.access_number;
  if (reply) {
    assert(reply->result_case() == row->reply);
    outcome.reply = std::move(*reply);
    outcome.server_part = row->server_part;
  } else {
    outcome.error = reply.error();
  }
  outcome.reply.set_id(request.id());
  return outcome;
}

}  // namespace needlelab
