/// A handler's tools for one request: the requester, a reader, the writer's transaction with its audit line,
/// pages, and the parts of the service.
#pragma once

#include <charconv>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "common/base/text/uuid.h"
#include "db/people/person_refs.h"
#include "db/service/context/principal.h"
#include "db/sessions/db_writer.h"
#include "db/sessions/session_store.h"
#include "db/store/connection.h"
#include "db/store/store_address.h"
#include "needlelab/control.pb.h"

namespace needlelab {

class Backups;
class CodeTries;
struct ErasureUnderWay;
class Erasures;
class ExportLedger;
struct LongWork;
class RescoringRuns;
class RetentionRuns;
class SessionEvents;
class SessionScore;
class SessionScoring;

/// The parts of a service. Each has its own header and mutex; a handler includes those it uses. All belong to
/// one service and live as long.
struct ServiceParts {
  DbWriter& writer;
  ReaderPool& readers;
  ExportLedger& exports;
  CodeTries& codes;
  LongWork& long_work;
  Backups& backups;
  SessionScoring& scoring;
  RescoringRuns& rescoring;
  RetentionRuns& retention;
  Erasures& erasures;
};

/// A request between the steps of its work.
struct RequestUnderWay {
  std::shared_ptr<const pb::Request> with_refs{};  ///< the request, once toRefs() was applied
  std::map<std::string, std::string> written{};    ///< persons as written in the request, by ref
  /// The account or station that the request names is (or already was) disabled or revoked, or its role or
  /// password changed. Also set if the change was in a transaction that then failed, because it may still
  /// have been carried out. Not set by an erasure, whose reply contains this.
  bool access_changed = false;
  /// The requester has changed its own access and continues with this number (Principal::access_number).
  std::optional<std::int64_t> access_number{};
  bool more = false;  ///< set by a handler: this was one step, and the reply is not complete
  std::optional<SessionCheckSoFar> check{};  ///< of VerifySession
  std::shared_ptr<SessionScore> score{};     ///< of RescoreSession
  std::shared_ptr<SessionEvents> events{};   ///< of ListEvents, if none are stored
  bool is_long = false;                      ///< for score and events: the next step waits for a place
  /// Of ErasePerson, once the person is erased.
  std::shared_ptr<ErasureUnderWay> erasure{};
  /// The requested change is done; the remaining steps only complete the reply, but others are already
  /// notified.
  [[nodiscard]] bool isDone() const { return erasure != nullptr; }
};

namespace handlers {

/// A handler's tools for one request.
struct Context {
  const Principal& who;
  const ServiceParts& parts;
  DbWriter& writer;
  Connection& reader;
  std::int64_t now_unix_ns;
  std::string_view action;  ///< for the audit log
  ExportLedger& exports;
  CodeTries& codes;
  RequestUnderWay& under_way;
};

/// Calls `work` with a borrowed reader.
Result<pb::Reply> withReader(const ServiceParts& parts, const Principal& who, std::string_view action,
                             RequestUnderWay& under_way,
                             const std::function<Result<pb::Reply>(const Context&)>& work);

/// Checks the requester's access, runs `work` on the writer and adds an audit line, all or nothing; returns
/// after the commit.
Status write(const Context& context, const std::string& subject, const std::string& detail,
             const std::function<Status(Connection&)>& work);
/// Same, but without a line if `work` returns false, because it found on the writer that nothing needs
/// changing: someone else may have made the change since a reader looked.
Status writeIfChanged(const Context& context, const std::string& subject, const std::string& detail,
                      const std::function<Result<bool>(Connection&)>& work);

/// Same, for an edit: a conflict's message describes the earlier change as in the audit log.
Status edit(const Context& context, const std::string& subject, const std::string& detail,
            const std::function<Status(Connection&)>& work);
/// Notes that someone reads other people's data, before the data is returned. Reads of one subject by one
/// person within an hour share one line (ExportLedger::isNew). If the database can no longer be written,
/// reading continues without a line.
Status noteRead(const Context& context, const std::string& subject, const std::string& detail);

/// The request ends an access, or changes what it was granted with (RequestUnderWay::access_changed). Called
/// within the transaction: a COMMIT whose answer is lost may have been carried out.
void noteAccessChanged(const Context& context);

/// If the requester has changed its own access, keeps it valid on the requesting connection
/// (RequestUnderWay::access_number). Call within the transaction, after the change.
Status keepOwnAccess(const Context& context, Connection& writer, const std::string& name);

/// A reply that only confirms success.
pb::Reply doneReply();
/// kDenied if a trainee or a researcher asks for another person's data. `what`: e.g. "results".
Status requireOwnData(const Context& context, const std::string& name, const std::string& what);

/// A session id from the network. kInvalidInput if the bytes are not an id.
Result<Uuid> sessionId(const std::string& bytes);

/// Maximum size of a reply: it must fit into a 1 MiB message with its envelope.
inline constexpr std::size_t kMaxReplyBytes = (1u << 20) - 4096;

// --- lists that are longer than a message come in pages (control.proto)

/// Counts the bytes of a page's rows.
class PageRoom {
 public:
  /// False: the page is full and cannot take `row_bytes` more. The first row always fits.
  bool take(std::size_t row_bytes) {
    const bool fits = bytes_ == 0 || bytes_ + row_bytes <= kMaxReplyBytes;
    if (fits) bytes_ += row_bytes + 8;
    return fits;
  }
  /// Includes room for the names that will replace refs.
  bool take(const google::protobuf::Message& row) { return take(row.ByteSizeLong() + roomForNames(row)); }

 private:
  std::size_t bytes_ = 0;
};

/// Parses a numeric page token: a position in a list, or an id. 0 for the first page. kInvalidInput.
inline Result<std::uint64_t> numberOfPage(const std::string& page) {
  std::uint64_t number = 0;
  if (page.empty()) return number;
  const auto [end, error] = std::from_chars(page.data(), page.data() + page.size(), number);
  if (error == std::errc() && end == page.data() + page.size()) return number;
  return Error{ErrorCode::kInvalidInput, "page: give back the next_page of the reply before"};
}

}  // namespace handlers
}  // namespace needlelab
