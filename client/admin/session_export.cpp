#include "client/admin/session_export.h"

#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <vector>

#include "client/admin/sample_sink.h"
#include "client/admin/session_rows.h"
#include "common/gesture/session_hash.h"

namespace needlelab {
namespace {

/// Ten years: what an integer of ns can hold, and more than a session lasts.
constexpr double kMostSeconds = 3.2e8;
constexpr std::size_t kFaultsNamed = 20;

std::int64_t nsOf(double seconds) {
  return static_cast<std::int64_t>(std::llround(seconds * 1e9));
}

Status checkRange(const ExportRange& range) {
  for (const auto& [name, value] : {std::pair{"--from", range.from_s}, std::pair{"--to", range.to_s}}) {
    if (value && !(*value >= 0 && *value <= kMostSeconds))
      return Error{ErrorCode::kInvalidInput, std::string(name) + " " + std::to_string(*value) +
                                                 ": allowed is 0 to " + std::to_string(kMostSeconds) + " s"};
  }
  if (range.from_s && range.to_s && *range.to_s <= *range.from_s)
    return Error{ErrorCode::kInvalidInput,
                 "--to " + std::to_string(*range.to_s) + ": allowed is more than --from"};
  return {};
}

/// Says each second or so how far it is, when somebody looks.
class Progress {
 public:
  explicit Progress(Output& output) : output_(output), shown_(::isatty(STDERR_FILENO) != 0) {}
  void at(std::uint64_t chunk, std::uint64_t chunks, std::uint64_t samples, std::uint64_t bytes) {
    const auto now = Clock::now();
    if (!shown_ || now < next_) return;
    next_ = now + std::chrono::seconds(1);
    output_.remark(std::to_string(chunk) + " of " + std::to_string(chunks) + " chunks, " +
                   speed(samples, bytes));
  }
  [[nodiscard]] std::string speed(std::uint64_t samples, std::uint64_t bytes) const {
    const double seconds = std::max(1e-6, std::chrono::duration<double>(Clock::now() - begun_).count());
    char text[96];
    std::snprintf(text, sizeof(text), "%.3g million samples/s, %.3g MB/s read",
                  1e-6 * static_cast<double>(samples) / seconds, 1e-6 * static_cast<double>(bytes) / seconds);
    return text;
  }

 private:
  using Clock = std::chrono::steady_clock;
  Output& output_;
  const bool shown_;
  const Clock::time_point begun_ = Clock::now();
  Clock::time_point next_ = begun_ + std::chrono::seconds(1);
};

class Export {
 public:
  Export(Backend& backend, Output& output, const Uuid& id, const ExportRange& range)
      : backend_(backend), output_(output), id_(id.begin(), id.end()), range_(range) {}

  Status run(const std::string& format, const std::filesystem::path& file) {
    if (auto valid = checkRange(range_); !valid) return valid;
    pb::Request get;
    get.mutable_get_session()->set_session_id(id_);
    const auto info = backend_.call(get);
    if (!info) return info.error();
    session_ = info->session();
    if (session_.removed_original().fate() == pb::RemovedOriginal::DELETED) {
      return Error{ErrorCode::kNotFound, "its recording was deleted on " +
                                             timeText(session_.removed_original().deleted_unix_ns()) + " (" +
                                             session_.removed_original().reason() +
                                             "); `session show` has its score, events and remarks"};
    }
    Json row = sessionRow(session_);
    row["profile"] = Json::parse(session_.description().profile_json(), nullptr, false);

    SampleWindow window;
    if (range_.from_s) window.from_ns = nsOf(*range_.from_s);
    if (range_.to_s) window.to_ns = nsOf(*range_.to_s);
    if (auto sought = seek(window); !sought) return sought;
    auto sink = openSampleSink(format, file, row, window);
    if (!sink) return sink.error();
    if (auto done = readInto(**sink); !done) return done;
    if (auto sound = checkHash(); !sound) return sound;
    if (auto done = (*sink)->finish(); !done) return done;
    return report(**sink, file);
  }

 private:
  /// Where to begin, and from when times are counted.
  Status seek(SampleWindow& window) {
    if (!range_.from_s || session_.chunks() == 0) return {};
    pb::Request request;
    request.mutable_seek_session()->set_session_id(id_);
    request.mutable_seek_session()->set_seconds(*range_.from_s);
    const auto reply = backend_.call(request);
    if (reply) {
      next_ = reply->sought().seq();
      window.first_time_ns = reply->sought().recording_first_time_ns();
      return {};
    }
    if (!range_.around_damage) return reply.error();
    output_.remark(reply.error().message + "; times count from the first sample that can be read");
    return {};
  }

  /// As many chunks as the session had when it was asked for; a live one goes on growing.
  Status readInto(SampleSink& sink) {
    first_ = next_;
    Progress progress(output_);
    while (next_ < session_.chunks() && !sink.past()) {
      pb::Request read;
      read.mutable_read_chunks()->set_session_id(id_);
      read.mutable_read_chunks()->set_from_seq(next_);
      read.mutable_read_chunks()->set_skip_damaged(range_.around_damage);
      read.mutable_read_chunks()->set_hash(session_.hash());
      const auto reply = backend_.call(read);
      if (!reply) {
        return Error{reply.error().code,
                     reply.error().message +
                         (range_.around_damage ? "" : " (--damaged writes what is around a damaged chunk)")};
      }
      for (const auto& damaged : reply->chunks().damaged()) fault(damaged.seq(), damaged.text());
      if (auto done = takeChunks(sink, reply->chunks()); !done) return done;
      const std::uint64_t behind = reply->chunks().next_seq();
      if (behind <= next_ && reply->chunks().chunks_size() == 0) break;
      next_ = std::max(next_, behind);
      progress.at(std::min(next_, session_.chunks()), session_.chunks(), sink.samples(), bytes_);
    }
    if (next_ < session_.chunks() && !sink.past()) {
      return Error{ErrorCode::kCorrupt, "the session has " + std::to_string(session_.chunks()) +
                                            " chunks, only " + std::to_string(next_) + " could be read"};
    }
    whole_ = first_ == 0 && !sink.past();
    speed_ = progress.speed(sink.samples(), bytes_);
    return {};
  }

  Status takeChunks(SampleSink& sink, const pb::Chunks& chunks) {
    for (const pb::Chunk& chunk : chunks.chunks()) {
      if (chunk.seq() >= session_.chunks() || sink.past()) break;
      if (chunk.seq() < next_ || (chunk.seq() != next_ && !range_.around_damage)) {
        return Error{ErrorCode::kCorrupt, "chunk " + std::to_string(next_) + " was asked for, " +
                                              std::to_string(chunk.seq()) + " came"};
      }
      if (auto done = sink.take(viewOf(chunk.data())); !done) {
        const std::string text = "chunk " + std::to_string(chunk.seq()) + ": " + done.error().message;
        if (!range_.around_damage || done.error().code != ErrorCode::kCorrupt)
          return Error{done.error().code, text};
        fault(chunk.seq(), text);
      }
      hash_.update(viewOf(chunk.data()));
      bytes_ += chunk.data().size();
      next_ = chunk.seq() + 1;
    }
    return {};
  }

  void fault(std::uint64_t seq, const std::string& text) {
    // what lies behind the end of the part asked for is none of it
    if (seq >= session_.chunks()) return;
    if (++faults_ <= kFaultsNamed) output_.remark("damaged: " + text);
  }

  /// Over a part, or around damage, there is nothing to compare with.
  Status checkHash() {
    if (!whole_ || faults_ > 0 || session_.hash().empty()) return {};
    const Digest digest = hash_.digest();
    if (textOf(digest) == session_.hash()) return {};
    const std::string text = "the hash over what was read is " + hexOf(digest) +
                             ", the session was closed with " + hexOfBytes(session_.hash());
    if (!range_.around_damage) return Error{ErrorCode::kCorrupt, text + ": nothing was written"};
    ++faults_;
    output_.remark("damaged: " + text);
    return {};
  }

  Status report(const SampleSink& sink, const std::filesystem::path& file) {
    if (session_.state() == pb::SESSION_OPEN)
      output_.remark("the session is still open: this is what has come so far");
    if (session_.has_removed_original()) {
      output_.remark("thinned recording: " + session_.removed_original().reason() + "; the original had " +
                     std::to_string(session_.removed_original().samples()) + " samples");
    }
    const std::string wrote = "wrote " + std::to_string(sink.samples()) + " samples to " + file.string();
    output_.done(wrote + " (" + speed_ + ")");
    if (faults_ == 0) return {};
    return Error{ErrorCode::kCorrupt,
                 std::to_string(faults_) + " of " + std::to_string(session_.chunks()) +
                     " chunks are damaged or missing; the file holds what is around them"};
  }

  Backend& backend_;
  Output& output_;
  const std::string id_;
  const ExportRange range_;
  pb::SessionInfo session_;
  SessionHash hash_;
  std::uint64_t first_ = 0, next_ = 0;  ///< chunks: where it began, what comes next
  std::uint64_t bytes_ = 0;
  std::size_t faults_ = 0;
  bool whole_ = false;
  std::string speed_;
};

}  // namespace

Status exportSession(Backend& backend, Output& output, const Uuid& session, const std::string& format,
                     const std::filesystem::path& file, const ExportRange& range) {
  return Export(backend, output, session, range).run(format, file);
}

}  // namespace needlelab
