// Finding the chunk of a moment: by the key and a few headers, however long the recording is.
#include <algorithm>
#include <optional>

#include "common/gesture/chunk.h"
#include "db/session_row.h"
#include "db/session_store.h"
#include "db/transaction.h"

namespace needlelab {
namespace {

/// One search. Chunks are about equally long, so the place is guessed from both ends (a guess or two is
/// enough); every other step halves what is left, so that a recording with gaps is found in twice log2 steps.
class Search {
 public:
  Search(Connection& connection, std::string name, const StoredRecording& recording)
      : connection_(connection), name_(std::move(name)), recording_(recording) {}

  Result<SoughtChunk> run(const SeekTo& to) {
    auto first = infoOf(0);
    if (!first) return first.error();
    if (!*first)
      return Error{ErrorCode::kCorrupt, name_ + ", chunk 0: is damaged, times cannot be counted from it"};
    SoughtChunk sought;
    sought.recording_first_tick = (*first)->first_tick;
    sought.recording_first_time_ns = (*first)->first_time_ns;
    by_time_ = !to.tick.has_value();
    // counted from the first chunk, so that neither a tick nor a time loses digits
    origin_ = **first;
    target_ =
        by_time_ ? to.seconds * 1e9
                 : (*to.tick >= origin_.first_tick ? static_cast<double>(*to.tick - origin_.first_tick) : -1);

    std::uint64_t low = 0, high = recording_.chunks;
    ChunkInfo at_low = **first;
    double end = -1;  // where chunk `high` begins, once it is known
    if (target_ > 0 && high > 1) {
      const auto last = infoOf(high - 1);
      if (!last) return last.error();
      if (*last) {
        const double begin = beginOf(**last);
        if (target_ >= begin) {
          low = high - 1;
          at_low = **last;
        } else {
          high = high - 1;
          end = begin;
        }
      }
    }
    bool guess = true;
    while (target_ > 0 && high - low > 1) {
      if (!by_time_ && *to.tick >= at_low.first_tick && *to.tick <= at_low.last_tick) break;
      std::uint64_t middle = low + (high - low) / 2;
      if (guess && end > beginOf(at_low)) {
        const double share = (target_ - beginOf(at_low)) / (end - beginOf(at_low));
        middle = low + static_cast<std::uint64_t>(share * static_cast<double>(high - low));
        middle = std::clamp(middle, low + 1, high - 1);
      }
      guess = !guess || high - low <= 4;
      const auto info = infoOf(middle);
      if (!info) return info.error();
      // a damaged chunk cannot tell: what lies before it is searched, which is never too late
      if (!*info || beginOf(**info) > target_) {
        high = middle;
        if (*info) end = beginOf(**info);
      } else {
        low = middle;
        at_low = **info;
      }
    }
    sought.seq = low;
    sought.first_tick = at_low.first_tick;
    sought.first_time_ns = at_low.first_time_ns;
    sought.chunks_read = read_;
    return sought;
  }

 private:
  [[nodiscard]] double beginOf(const ChunkInfo& info) const {
    if (by_time_) return static_cast<double>(info.first_time_ns - origin_.first_time_ns);
    return info.first_tick >= origin_.first_tick ? static_cast<double>(info.first_tick - origin_.first_tick)
                                                 : 0;
  }

  /// The header of a chunk whose CRCs agree; nothing when it is damaged.
  Result<std::optional<ChunkInfo>> infoOf(std::uint64_t seq) {
    ++read_;
    ChunkScan scan(connection_, name_, recording_, seq, seq + 1);
    const auto item = scan.next();
    if (!item) return item.error();
    if (!*item || (*item)->fault) return std::optional<ChunkInfo>();
    const auto info = inspectChunk((*item)->bytes);
    return info ? std::optional(*info) : std::optional<ChunkInfo>();
  }

  Connection& connection_;
  const std::string name_;
  const StoredRecording recording_;
  ChunkInfo origin_;
  bool by_time_ = false;
  double target_ = 0;
  std::uint32_t read_ = 0;
};

}  // namespace

Result<SoughtChunk> SessionStore::seek(const Uuid& session, const SeekTo& to) {
  const auto view = Transaction::view(connection_);
  if (!view) return view.error();
  const auto recording = readableRecording(connection_, session);
  if (!recording) return recording.error();
  const std::string name = "session " + uuidText(session);
  if (recording->chunks == 0) return Error{ErrorCode::kNotFound, name + " has no samples to seek in"};
  return Search(connection_, name, *recording).run(to);
}

}  // namespace needlelab
