/// Audit log lines that belong to no request: log-ins, live watching, refusals.
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "common/base/result.h"
#include "db/audit/audit.h"
#include "db/service/context/export_ledger.h"
#include "db/service/context/principal.h"
#include "db/sessions/db_writer.h"

namespace needlelab {

/// Thread: any. The writer must outlive it.
class AuditNotes {
 public:
  /// `exports`: the reads noted within the last hour; shared with the writer's items.
  AuditNotes(DbWriter& writer, std::shared_ptr<ExportLedger> exports)
      : writer_(writer), exports_(std::move(exports)) {}

  /// Writes a line to the audit log, e.g. for a refused log-in.
  Status note(const std::string& who, const std::string& action, const std::string& subject,
              const std::string& detail);
  /// Same, without waiting, for lines of which hundreds may arrive at once. Lines added before the writer
  /// reaches the first of them share one item of its queue; the writer still writes them when it stops.
  /// `failed` is called for a line that could not be stored, on the caller's or the writer's thread. Thread:
  /// any.
  void noteSoon(const Doer& who, const std::string& action, const std::string& subject,
                const std::string& detail, std::function<void(const Error&)> failed);
  /// Notes that `who` begins to watch a station or, if `session` is not empty, a session live: once an hour
  /// per person and target. Only existing stations and open sessions get a line, so that invented ones do not
  /// fill the log. Does not wait; thread: any. `failed`: as in noteSoon(); the next time that `who` watches
  /// the target, that is noted again. If the database can no longer be written, there is no line.
  void noteWatching(const Principal& who, const std::string& station, const std::string& session,
                    std::function<void(const Error&)> failed);
  /// Notes that staff or a researcher has logged in from `host`: once an hour per person and host.
  Status noteLogin(const Principal& who, const std::string& host);

 private:
  /// Lines of noteSoon() and noteWatching() on their way to the writer, whose queue may outlive the service.
  struct SoonNoted {
    struct Line {
      AuditRow row;
      std::function<void(const Error&)> failed;
      std::function<Result<bool>(Connection&)> wanted{};  ///< whether to store the line; empty: always
    };
    using Item = std::vector<Line>;
    /// Posts one item to the writer. If one of its lines cannot be stored, each is retried alone.
    static Status post(DbWriter& writer, const std::shared_ptr<SoonNoted>& noted,
                       const std::shared_ptr<Item>& item);
    /// Closes the item for further lines.
    void end(const std::shared_ptr<Item>& item);
    std::mutex mutex;
    std::shared_ptr<Item> open;  ///< guarded by mutex; null: the next line begins an item
  };
  void addSoon(SoonNoted::Line line);

  DbWriter& writer_;
  const std::shared_ptr<ExportLedger> exports_;
  const std::shared_ptr<SoonNoted> soon_noted_ = std::make_shared<SoonNoted>();
};

}  // namespace needlelab
