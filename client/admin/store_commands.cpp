// Moving a lab's database from SQLite to PostgreSQL and back.
#include <fmt/core.h>
#include <unistd.h>
#include <CLI/CLI.hpp>

#include <chrono>
#include <filesystem>
#include <memory>
#include <string>

#include "client/admin/backend.h"
#include "client/admin/command.h"
#include "common/base/time/clock.h"
#include "db/service/start/bootstrap.h"
#include "db/service/start/store_move.h"

namespace needlelab {
namespace {

/// Whether --from or --to is PostgreSQL: postgresql://…, or host=… dbname=…, which --store also accepts.
bool isAddress(const std::string& store) {
  std::error_code error;
  if (std::filesystem::exists(store, error)) return false;
  return store.find("://") != std::string::npos || store.find('=') != std::string::npos;
}

/// Reports the copy's progress on standard error: each table that has rows, and about every five seconds
/// within a large one.
class CopyLines {
 public:
  explicit CopyLines(Output& output) : output_(output) {}
  Status at(const CopyProgress& progress) {
    const auto now = Clock::now();
    const bool ended = progress.table_ended && progress.rows > 0;
    if (!ended && (now < next_ || progress.rows == 0)) return {};
    next_ = now + std::chrono::seconds(5);
    std::string line = fmt::format("{} {}: {} {}", progress.comparing ? "compared" : "copied", progress.table,
                                   progress.rows, progress.rows == 1 ? "row" : "rows");
    if (progress.bytes > 0) line += ", " + bytesText(progress.bytes) + " of recordings";
    output_.remark(line);
    return {};
  }

 private:
  using Clock = std::chrono::steady_clock;
  Output& output_;
  Clock::time_point next_ = Clock::now() + std::chrono::seconds(5);
};

Status showMoved(Output& output, const StoreMove& move, const StoreMoved& moved) {
  const std::string data = move.folder.string();
  RETURN_IF_ERROR(output.one({{"copy", "copy"},
                              {"rows", "rows compared"},
                              {"chunks", "chunks of recordings"},
                              {"bytes", "of recordings", Column::Kind::kBytes},
                              {"kept", "kept"}},
                             {{"copy", move.to_postgres ? move.url : data},
                              {"went_on", moved.went_on},
                              {"rows_copied", moved.copied.rows},
                              {"rows", moved.compared.rows},
                              {"chunks", moved.compared.chunks},
                              {"bytes", moved.compared.bytes},
                              {"kept", moved.kept.string()}}));
  output.text("Now: needlelab-admin --data " + data + " check; then start the server on " + data +
              (move.to_postgres ? " as before. --store is not needed: " + data + "/store says it."
                                : ", without --store, and enable its backups (OPERATIONS.md, Backup)."));
  if (move.to_postgres)
    output.text(moved.kept.string() +
                " is the old database: remove it once there is a backup of the new one. Make backups with "
                "PostgreSQL's tools from now on (FACULTY.md, From SQLite to PostgreSQL and back).");
  else
    output.text(
        "The database on PostgreSQL is as it was: remove it (dropdb) once there is a backup of the new one; "
        "no erasure reaches it. " +
        moved.kept.string() + " has its address.");
  return {};
}

Status copyStore(Output& output, StoreMove move) {
  RETURN_IF_ERROR(checkFolderUser(move.folder, ::geteuid()));
  move.by = localName();
  move.now_unix_ns = wallNowNs();
  CopyLines lines(output);
  move.copy.on_progress = [&](const CopyProgress& progress) { return lines.at(progress); };
  ASSIGN_OR_RETURN(const auto moved, moveStore(move));
  if (moved.was_done) {
    output.done("nothing to do: " + move.folder.string() + " works with this copy already");
    return {};
  }
  return showMoved(output, move, moved);
}

}  // namespace

void addStoreCommands(CLI::App& app, const GlobalOptions& global, ChosenCommand& chosen) {
  struct Values {
    std::string from, to;
    bool begin_again = false;
  };
  const auto values = std::make_shared<Values>();
  auto* store = app.add_subcommand("store", "the lab's database");
  store->require_subcommand(1);
  auto* copy =
      store->add_subcommand("copy",
                            "from SQLite in a data folder to PostgreSQL, or back: copies the stopped "
                            "server's database, compares each row and each chunk, and has the folder work "
                            "with the copy. If interrupted, run it again to continue");
  copy->add_option("--from", values->from,
                   "the database: its data folder, or postgresql://USER@HOST/DATABASE")
      ->required()
      ->type_name("STORE");
  copy->add_option("--to", values->to,
                   "an empty database postgresql://USER@HOST/DATABASE, or the lab's data folder")
      ->required()
      ->type_name("STORE");
  copy->add_flag("--begin-again", values->begin_again,
                 "empty the unfinished copy in --to, and copy everything: a server has worked with --from "
                 "since");
  copy->callback([&chosen, &global, values] {
    chosen.check = [&global, values]() -> Status {
      if (!global.data.empty() || !global.server.empty() || !global.store.empty())
        return Error{ErrorCode::kInvalidInput,
                     "store copy: give --from and --to only, without --data, --server or --store"};
      if (isAddress(values->from) == isAddress(values->to))
        return Error{ErrorCode::kInvalidInput,
                     "store copy: one of --from and --to is the lab's data folder, the other "
                     "postgresql://USER@HOST/DATABASE; SQLite is copied to SQLite by backup and restore, "
                     "PostgreSQL to PostgreSQL by pg_dump and pg_restore"};
      return {};
    };
    chosen.run_without_folder = [values](Output& output) {
      const bool to_postgres = isAddress(values->to);
      return copyStore(output, {.folder = to_postgres ? values->from : values->to,
                                .url = to_postgres ? values->to : values->from,
                                .to_postgres = to_postgres,
                                .begin_again = values->begin_again});
    };
  });
}

}  // namespace needlelab
