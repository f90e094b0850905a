// A person's data is erased. Order: what may be refused is asked first; then the line in DIR/erasures, then
// the transaction: a crash between the two shows as an erasure that must be repeated, never as one that is
// forgotten.
#include <sodium.h>

#include <algorithm>
#include <mutex>

#include "db/audit.h"
#include "db/erasure.h"
#include "db/pseudonyms.h"
#include "db/service/handlers.h"

namespace needlelab::handlers {
namespace {

std::string newErasurePseudonym() {
  std::array<unsigned char, 6> random{};
  randombytes_buf(random.data(), random.size());
  return "erased-" + hexDigitsOf(textOf(random));
}

}  // namespace

Result<pb::Reply> erasePerson(const Context& context, const pb::ErasePerson& call) {
  if (call.confirm() != call.name() || call.name().empty())
    return Error{ErrorCode::kInvalidInput, "confirm: to erase all data of '" + call.name() +
                                               "' for ever, give its name here; found '" + call.confirm() +
                                               "'"};
  if (call.name() == context.who.name)
    return Error{ErrorCode::kDenied, "nobody erases itself: let another administrator do it"};
  const auto open = ErasureStore(context.reader).openSessions(call.name());
  if (!open) return open.error();
  if (!open->empty() && !call.with_open_sessions())
    return Error{ErrorCode::kUnavailable,
                 "'" + call.name() + "' has a session that is open, " + open->front() +
                     (open->size() > 1 ? " and others" : "") +
                     ": let it be ended first, or say that what is still sent of it shall not be kept "
                     "(with_open_sessions)"};
  const auto folder = context.reader.path().parent_path();
  const auto key = ErasureStore(context.reader).key();
  if (!key) return key.error();

  // one at a time: the file is read and written as a whole
  static std::mutex one_erasure;
  const std::scoped_lock lock(one_erasure);
  auto lines = readErasures(folder);
  if (!lines) return lines.error();
  const auto before = *lines;
  const auto hash = key->nameHash(call.name());
  // one that is done again after a restore goes on with its pseudonym
  const auto repeat = ErasureStore(context.reader).toRepeat(folder);
  if (!repeat) return repeat.error();
  const auto again = std::find_if(repeat->begin(), repeat->end(),
                                  [&](const auto& erasure) { return erasure.name == call.name(); });
  ErasureLine line{again != repeat->end() ? again->pseudonym : newErasurePseudonym(), hash,
                   context.now_unix_ns};
  std::erase_if(*lines, [&](const ErasureLine& other) { return other.pseudonym == line.pseudonym; });
  lines->push_back(line);
  if (auto done = writeErasures(folder, *lines); !done) return done.error();

  pb::Erasure erasure;
  const auto status = context.writer.run([&](Connection& writer) -> Status {
    auto done =
        ErasureStore(writer).erase(call.name(), line, context.who.name, call.reason(), context.now_unix_ns);
    if (!done) return done.error();
    erasure = std::move(*done);
    const std::string detail = std::to_string(erasure.sessions()) + " sessions, " +
                               std::to_string(erasure.recordings()) + " recordings, " +
                               std::to_string(erasure.scores()) + " scores";
    return AuditStore(writer).add(
        {0, context.now_unix_ns, context.who.name, std::string(context.action), line.pseudonym, detail});
  });
  if (!status) {
    // nothing happened: neither does the file say so
    if (auto undone = writeErasures(folder, before); !undone) return undone.error();
    return status.error();
  }
  erasure.set_text(
      "Backups made before now still hold this person's data: remove them, or erase again after a restore "
      "(the "
      "server's log and 'check' say so then). Freed pages of the database are overwritten now, those of the "
      "log "
      "beside it (needlelab.db-wal) when it comes round; the server's own log files go by their rotation.");
  pb::Reply reply;
  *reply.mutable_erasure() = std::move(erasure);
  return reply;
}

}  // namespace needlelab::handlers
