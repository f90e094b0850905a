#include "tests/postgres/isolation/server_works.h"

#include <future>
#include <map>
#include <utility>

#include "common/base/text/uuid.h"
#include "common/base/time/clock.h"
#include "db/service/context/code_guard.h"
#include "db/sessions/seen_time.h"
#include "tests/postgres/isolation/shared_world.h"
#include "tests/support/store/chunk_files.h"
#include "tests/unit/db/test_db.h"

namespace needlelab::test {
namespace {

/// What stations send, through the writer as in server/live.
ServerWork onWriter(std::function<Result<std::string>(Connection&)> work) {
  return [work = std::move(work)](OneServer& server) {
    std::string text;
    const Status done = server.writer().run([&](Connection& c) -> Status {
      ASSIGN_OR_RETURN(text, work(c));
      return {};
    });
    return done ? text
                : "refused " + std::to_string(static_cast<int>(done.error().code)) + ": " +
                      done.error().message;
  };
}

/// Appends these bytes as chunk `seq` of the open session.
ServerWork appendingBytes(std::uint64_t seq, const Bytes& bytes) {
  return [=](OneServer& server) {
    Appended appended;
    std::promise<Status> done;
    const Status posted =
        server.writer().postChunk({*uuidOf(kOpenSession), seq, bytes, "station-1", &appended},
                                  [&](const Status& status) { done.set_value(status); });
    const Status status = posted ? done.get_future().get() : posted;
    if (!status) return "refused: " + status.error().message;
    return "appended " + std::to_string(static_cast<int>(appended.kind)) + ", next " +
           std::to_string(appended.next_seq) + (appended.quarantined ? " quarantined " : " ") + appended.text;
  };
}

std::string doneText(const Status& done) {
  return done ? "done" : "refused: " + done.error().message;
}

pb::CloseSession closeOfOpen(std::uint64_t chunks, const char* session) {
  constexpr std::size_t kSamples = 60;
  return closeOf(*uuidOf(session), chunks, kSamples);
}

std::string closedText(const Closed& closed) {
  return "closed " + std::to_string(static_cast<int>(closed.kind)) + ", next " +
         std::to_string(closed.next_seq) + ", state " + std::to_string(static_cast<int>(closed.state)) +
         ", " + closed.text + ", ";
}

}  // namespace

Principal principalOf(const std::string& name) {
  // the first people added by SharedWorld::fill(), in this order
  static const std::map<std::string, std::pair<const char*, pb::Role>> kStaff{
      {"ada", {"@1", pb::ADMINISTRATOR}},
      {"abe", {"@2", pb::ADMINISTRATOR}},
      {"mia", {"@3", pb::CURRICULUM_MANAGER}},
      {"ina", {"@4", pb::INSTRUCTOR}},
      {"rea", {"@5", pb::RESEARCHER}}};
  const auto& [ref, role] = kStaff.at(name);
  return {ref, role, true, {}, name};
}

std::string answerText(const Outcome& outcome) {
  const std::string access = outcome.access_changed ? " (access changed)" : "";
  if (outcome.error)
    return "refused " + std::to_string(static_cast<int>(outcome.error->code)) + ": " +
           outcome.error->message + access;
  return outcome.reply.ShortDebugString() + access;
}

ServerWork opening(const std::string& id, const std::string& trainee, const std::string& device) {
  return onWriter([=](Connection& c) -> Result<std::string> {
    auto d = describe(*uuidOf(id));
    d.set_trainee(trainee);
    d.set_exercise_id("first");
    d.set_device(device);
    ASSIGN_OR_RETURN(const auto next, SessionStore(c).open(d, 1));
    return "next " + std::to_string(next);
  });
}

ServerWork appending(std::uint64_t seq, std::size_t samples) {
  return appendingBytes(seq, chunkOf(seq, samples));
}

ServerWork appendingUndecodable(std::uint64_t seq) {
  return appendingBytes(seq, namedChunks(NEEDLELAB_GESTURE_DATA "/refused.tsv").front().second);
}

ServerWork loggingIn(const char* who) {
  return [=](OneServer& server) {
    const Status first = server.service().notes().noteLogin(principalOf(who), "10.0.0.1");
    return doneText(first) + ", " +
           doneText(server.service().notes().noteLogin(principalOf(who), "10.0.0.1"));
  };
}

ServerWork typingWrongCodes() {
  return [](OneServer& server) {
    pb::Request request;
    request.mutable_check_trainee()->set_trainee("cora");
    request.mutable_check_trainee()->set_code("1174");
    std::string text;
    for (unsigned i = 0; i < CodeGuard::Settings().allowed; ++i)
      text = answerText(server.service().execute({"station-1", pb::STATION}, request));
    // after the line
    return text + ", " + doneText(server.writer().run([](Connection&) { return Status(); }));
  };
}

ServerWork noting(const char* action, const char* subject, const char* detail) {
  return [=](OneServer& server) {
    return doneText(server.service().notes().note("local:tess", action, subject, detail));
  };
}

ServerWork closing(std::uint64_t chunks, const char* session) {
  return [=](OneServer& server) {
    const auto closed = server.service().scoring().closeSession(closeOfOpen(chunks, session), "station-1");
    if (!closed) return "refused: " + closed.error().message;
    return closedText(closed->closed) + closed->score_json + closed->score_fault;
  };
}

InTwoCommits closingInTwoCommits(std::uint64_t chunks, const char* session) {
  const auto close = onWriter([=](Connection& c) -> Result<std::string> {
    const std::int64_t now_unix_ns = wallNowNs();
    ASSIGN_OR_RETURN(const auto closed,
                     SessionStore(c).close(closeOfOpen(chunks, session), now_unix_ns, "station-1"));
    RETURN_IF_ERROR(SeenTimeStore(c).noteClose(*uuidOf(session), now_unix_ns));
    return closedText(closed);
  });
  return {close, [=](OneServer& server) -> std::string {
            const auto again =
                server.service().scoring().closeSession(closeOfOpen(chunks, session), "station-1");
            return again ? again->score_json + again->score_fault : "refused: " + again.error().message;
          }};
}

}  // namespace needlelab::test
