#include "client/station/run/black_box_writer.h"

#include <chrono>
#include <utility>

#include "client/station/run/black_box_csv.h"
#include "common/base/files.h"
#include "common/base/text.h"

namespace needlelab {
namespace {

namespace fs = std::filesystem;

// half a second of the box's spare second is left for copying and writing
constexpr auto kLookEvery = std::chrono::milliseconds(50);

Status write(const fs::path& path, const std::vector<BlackBoxTick>& ticks) {
  std::error_code error;
  fs::create_directories(path.parent_path(), error);
  if (error)
    return Error{ErrorCode::kUnavailable,
                 "cannot make the folder " + path.parent_path().string() + ": " + error.message()};
  // what a hand did is nobody else's affair, as with the rest of the spool
  return writeFileAtomically(path, viewOf(blackBoxCsv(ticks)), 0600);
}

}  // namespace

BlackBoxWriter::BlackBoxWriter(BlackBox& box, fs::path folder, std::string session,
                               std::function<void(const std::string&)> say)
    : box_(box),
      folder_(std::move(folder)),
      session_(std::move(session)),
      say_(std::move(say)),
      thread_([this] { run(); }) {}

void BlackBoxWriter::run() {
  while (!finish_.load(std::memory_order_acquire)) {
    writeAll();
    std::this_thread::sleep_for(kLookEvery);
  }
  writeAll();
}

void BlackBoxWriter::writeAll() {
  BlackBoxDump dump;
  while (box_.take(dump, ticks_)) {
    const fs::path path = folder_ / formatted("%s-%02u.csv", session_.c_str(), dump.number);
    const Status status = write(path, ticks_);
    auto& counter = status.ok() ? files_ : not_written_;
    counter.store(counter.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
    say_(blackBoxText(dump) + (status.ok() ? "; the 2 s before it and what followed are in " + path.string()
                                           : "; it is not kept: " + status.error().message));
  }
}

void BlackBoxWriter::finish() {
  if (!thread_.joinable()) return;
  finish_.store(true, std::memory_order_release);
  thread_.join();
  const BlackBoxCounts all = counts();
  if (all.not_kept > 0)
    say_("black box: " + std::to_string(all.not_kept) + " of " + std::to_string(all.triggers) +
         " faults and storms of missed ticks came after the most that is kept of a session");
  if (all.ticks_refused > 0)
    say_("black box: " + std::to_string(all.ticks_refused) +
         " ticks are not in it, because the disk was more than a second behind");
}

BlackBoxCounts BlackBoxWriter::counts() const noexcept {
  return {box_.triggers(), files_.load(std::memory_order_relaxed),
          not_written_.load(std::memory_order_relaxed), box_.notKept(), box_.ticksRefused()};
}

std::size_t removeOldBlackBoxes(const fs::path& folder, std::int64_t age_s) {
  std::size_t removed = 0;
  std::error_code error;
  const auto oldest = fs::file_time_type::clock::now() - std::chrono::seconds(age_s);
  for (auto at = fs::directory_iterator(folder, error); !error && at != fs::end(at); at.increment(error)) {
    std::error_code ignored;
    if (at->path().extension() == ".csv" && at->last_write_time(ignored) < oldest && !ignored)
      removed += fs::remove(at->path(), ignored) ? 1 : 0;
  }
  return removed;
}

}  // namespace needlelab
