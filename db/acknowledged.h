/// How far acknowledgements have come, for a database on PostgreSQL: a number that grows, in `meta` and in
/// DIR/acknowledged. Each of several servers has its own: what another one stored says nothing of what this
/// one acknowledged. Where the database has less than the folder, it lacks what was acknowledged: a standby
/// that lagged was promoted, or an older backup restored, while nobody was there who had it in memory.
/// Transactions are stored in order, so whoever has a number has all that was stored before it. Numbers of
/// PostgreSQL's transactions would not do: others' take them after a promotion.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "db/connection.h"
#include "db/db_writer.h"
#include "db/open_file.h"

namespace needlelab {

inline constexpr const char* kAcknowledgedFile = "acknowledged";
/// In `meta`, with " NAME" behind it for a server of another name than kFirstServer (serverNameOf).
inline constexpr std::string_view kAcknowledgedKey = "acknowledged";
/// Whether it is a server's: no copy (store_copy.h) has it.
bool isAcknowledgedKey(std::string_view key);

/// Keeps the number. Thread: one at a time.
class AcknowledgedMark {
 public:
  /// At a start, by the connection that will write: compares the two. Errors: the database's; kInvalidInput:
  /// the file has something else.
  static Result<AcknowledgedMark> atStart(Connection& writer);

  /// What the database lacks, for a person; empty: nothing.
  [[nodiscard]] const std::string& lack() const { return lack_; }

  /// Call it about once a second, and at the end before the writer stops: has the writer store the next
  /// number behind whatever it has stored since the last one. Where the database has less by then than was
  /// committed, the writer says so (DbWriter::sayLack). Waits for nothing.
  void post(DbWriter& writer);
  /// Writes the newest number that was committed into the file, if it has an older one. Waits for the disk.
  Status keep();

 private:
  AcknowledgedMark(std::filesystem::path file, std::string key, std::string lab, std::uint64_t number)
      : file_(std::move(file)), key_(std::move(key)), lab_(std::move(lab)), number_(number) {}
  /// Shared with the writer's items.
  struct UnderWay {
    std::atomic<std::uint64_t> committed{0};  ///< the newest number of which COMMIT returned success
    std::atomic<bool> waits{false};           ///< an item is in the writer's queue
    std::atomic<bool> refused{false};         ///< the last one was
  };

  std::filesystem::path file_;
  std::string key_, lab_, lack_;
  std::shared_ptr<OpenFile> in_place_;  ///< null: the file is to be made
  std::uint64_t number_;                ///< the last one that was given
  std::uint64_t kept_ = 0;              ///< by this program
  std::uint64_t covered_ = 0;           ///< items of the writer before the last number, and that one
  std::shared_ptr<UnderWay> under_way_ = std::make_shared<UnderWay>();
};

}  // namespace needlelab
