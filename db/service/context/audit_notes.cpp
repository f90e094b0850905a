#include "db/service/context/audit_notes.h"

#include <optional>

#include "common/base/bytes.h"
#include "common/base/time/clock.h"
#include "db/sessions/session_rows.h"
#include "db/store/connection.h"
#include "needlelab/types.pb.h"

namespace needlelab {

Status AuditNotes::note(const std::string& who, const std::string& action, const std::string& subject,
                        const std::string& detail) {
  return writer_.run([&](Connection& writer) {
    return AuditStore(writer).add({0, wallNowNs(), who, action, subject, detail});
  });
}

void AuditNotes::noteSoon(const Doer& who, const std::string& action, const std::string& subject,
                          const std::string& detail, std::function<void(const Error&)> failed) {
  addSoon({{0, wallNowNs(), who.name, action, subject, detail}, std::move(failed)});
}

void AuditNotes::addSoon(SoonNoted::Line line) {
  std::optional<Error> refused;
  {
    const std::lock_guard lock(soon_noted_->mutex);
    if (!soon_noted_->open) {
      const auto item = std::make_shared<SoonNoted::Item>();
      const Status posted = SoonNoted::post(writer_, soon_noted_, item);
      if (posted.ok()) {
        soon_noted_->open = item;
      } else {
        refused = posted.error();
      }
    }
    if (!refused) soon_noted_->open->push_back(std::move(line));
  }
  if (refused) line.failed(*refused);
}

Status AuditNotes::SoonNoted::post(DbWriter& writer, const std::shared_ptr<SoonNoted>& noted,
                                   const std::shared_ptr<Item>& item) {
  const auto line_failed = std::make_shared<bool>(false);
  return writer.post(
      [noted, item, line_failed](Connection& connection) -> Status {
        noted->end(item);
        const auto store = [&]() -> Status {
          for (const Line& each : *item) {
            if (each.wanted) {
              ASSIGN_OR_RETURN(const bool wanted, each.wanted(connection));
              if (!wanted) continue;
            }
            RETURN_IF_ERROR(AuditStore(connection).add(each.row));
          }
          return {};
        };
        const Status stored = store();
        *line_failed = !stored.ok();
        return stored;
      },
      [&writer, noted, item, line_failed](const Status& stored) {
        noted->end(item);  // also if the work did not begin
        if (stored.ok()) return;
        for (Line& each : *item) {
          // one person's line must not prevent another's
          if (*line_failed && item->size() > 1) {
            const auto alone = std::make_shared<Item>(1, each);
            if (post(writer, noted, alone).ok()) continue;
          }
          each.failed(stored.error());
        }
      },
      DbWriter::Places::kKept);
}

void AuditNotes::SoonNoted::end(const std::shared_ptr<Item>& item) {
  const std::lock_guard lock(mutex);
  if (open == item) open.reset();
}

Status AuditNotes::noteLogin(const Principal& who, const std::string& host) {
  const std::string what = "log-in\n" + host;
  if (who.role == pb::TRAINEE || !exports_->isNew(who, what, wallNowNs())) return {};
  AuditRow line{0, wallNowNs(), who.name, "log-in", "", std::string(roleName(who.role)) + " from " + host};
  Status noted = writer_.run([&](Connection& writer) -> Status {
    ASSIGN_OR_RETURN(const bool is_new, exports_->isNewOnAllServers(writer, who, what));
    return is_new ? AuditStore(writer).add(line) : Status();
  });
  if (!noted.ok()) exports_->revoke(who, what);
  return noted;
}

void AuditNotes::noteWatching(const Principal& who, const std::string& station, const std::string& session,
                              std::function<void(const Error&)> failed) {
  if ((station.empty() && session.empty()) || writer_.failed()) return;
  const std::int64_t now_unix_ns = wallNowNs();
  const std::string what = "watch\n" + station + "\n" + session;
  if (!exports_->isNew(who, what, now_unix_ns)) return;
  // without the line, watching continues: the network's thread must not wait
  SoonNoted::Line line;
  line.row = {0,
              now_unix_ns,
              who.name,
              "watch live",
              session.empty() ? station : sessionText(session),
              session.empty() ? "a station" : "a session"};
  line.failed = [exports = exports_, who, what, failed = std::move(failed)](const Error& error) {
    exports->revoke(who, what);
    failed(error);
  };
  line.wanted = [exports = exports_, who, what, station, session](Connection& writer) -> Result<bool> {
    auto known = session.empty() ? writer.query("SELECT 1 FROM stations WHERE name = ?", station)
                                 : writer.query("SELECT 1 FROM sessions WHERE id = ? AND state = ?",
                                                viewOf(session), static_cast<int>(pb::SESSION_OPEN));
    ASSIGN_OR_RETURN(const bool found, known.step());
    if (!found) return false;
    return exports->isNewOnAllServers(writer, who, what);
  };
  addSoon(std::move(line));
}

}  // namespace needlelab
