/// How far acknowledgements have come, for a database on PostgreSQL: a growing number, in `meta` and in
/// DIR/acknowledged. Each of several servers has its own, because what one server stored says nothing about
/// what another acknowledged. If the database's number is below the folder's, the database lacks acknowledged
/// data: a lagging standby was promoted, or an older backup restored, and no running server remembers the
/// data. Transactions are stored in order, so a database with a number has everything stored before it.
/// PostgreSQL's transaction numbers would not work: after a promotion they are reused.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "common/base/files/files.h"
#include "common/base/result.h"
#include "db/sessions/db_writer.h"
#include "db/store/connection.h"

namespace needlelab {

inline constexpr const char* kAcknowledgedFile = "acknowledged";
/// Key in `meta`, followed by " NAME" for a server whose name is not kFirstServer (serverNameOf).
inline constexpr std::string_view kAcknowledgedKey = "acknowledged";
/// Whether the key belongs to one server; copies (store_copy.h) omit it.
bool isAcknowledgedKey(std::string_view key);

/// Keeps the number. Thread: one at a time.
class AcknowledgedMark {
 public:
  /// To be called at start-up, with the connection that will write: compares the two numbers. Errors: the
  /// database's; kInvalidInput (unexpected file contents).
  static Result<AcknowledgedMark> atStart(Connection& writer);

  /// What the database lacks, human-readable; empty: nothing.
  [[nodiscard]] const std::string& lack() const { return lack_; }

  /// Call about once a second, and once more before the writer stops: makes the writer store the next number
  /// after everything stored since the last one. If the database then has a lower number than was committed,
  /// the writer reports it (DbWriter::reportMissing). Does not block.
  void post(DbWriter& writer);
  /// Writes the newest committed number to the file if the file has an older one. Blocks on the disk.
  Status keep();

 private:
  AcknowledgedMark(std::filesystem::path file, std::string key, std::string lab, std::uint64_t number)
      : file_(std::move(file)), key_(std::move(key)), lab_(std::move(lab)), number_(number) {}
  /// Shared with the writer's items.
  struct UnderWay {
    std::atomic<std::uint64_t> committed{0};  ///< the newest number whose COMMIT returned success
    std::atomic<bool> waits{false};           ///< an item is in the writer's queue
    std::atomic<bool> refused{false};         ///< the last item was refused
  };

  std::filesystem::path file_;
  std::string key_, lab_, lack_;
  std::shared_ptr<OpenFile> in_place_;  ///< null: the file does not exist yet
  std::uint64_t number_;                ///< the last number issued
  std::uint64_t kept_ = 0;              ///< written to the file by this program
  std::uint64_t covered_ = 0;           ///< items of the writer up to and including the last number
  std::shared_ptr<UnderWay> under_way_ = std::make_shared<UnderWay>();
};

}  // namespace needlelab
