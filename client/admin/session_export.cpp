#include "client/admin/session_export.h"

#include <fmt/core.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "client/admin/files/hdf5_file.h"
#include "common/base/bytes.h"
#include "common/base/files/files.h"
#include "common/base/text/text.h"
#include "common/base/text/uuid.h"
#include "common/base/time/clock.h"
#include "common/gesture/chunk.h"
#include "common/gesture/recording.h"

namespace needlelab {
namespace {

// --- output files

/// The exported samples. Times are ns since the recording's first sample.
struct SampleWindow {
  std::optional<std::int64_t> first_time_ns;  ///< of the recording; empty: taken from the first sample
  std::int64_t from_ns = INT64_MIN;
  std::int64_t to_ns = INT64_MAX;
};

/// Takes chunks in order, then one call of finish(); without it no file is left. Thread: one.
class SampleSink {
 public:
  SampleSink() = default;
  SampleSink(const SampleSink&) = delete;
  SampleSink& operator=(const SampleSink&) = delete;
  virtual ~SampleSink() = default;
  /// Errors: kCorrupt if the chunk cannot be decoded; nothing of it was written.
  virtual Status take(ByteView chunk) = 0;
  virtual Status finish() = 0;
  [[nodiscard]] std::uint64_t samples() const { return samples_; }
  /// Whether a sample at or after the window's end was seen.
  [[nodiscard]] bool past() const { return past_; }

 protected:
  std::uint64_t samples_ = 0;
  bool past_ = false;
};

std::string jsonText(const Json& session) {
  return session.dump(-1, ' ', false, Json::error_handler_t::replace);
}

/// Sample by sample.
class DecodedSink : public SampleSink {
 public:
  DecodedSink(const ExportFormat& format, const std::filesystem::path& name, GrowingFile file,
              const Json& session, const SampleWindow& window)
      : file_(std::move(file)), window_(window) {
    if (format.form == ExportForm::kHdf5) {
      hdf5_.emplace(name, file_.temporary(), session);
    } else {
      writer_ = format.samples();
      writer_->begin(text_, [&session] { return jsonText(session); });
    }
  }

  Status take(ByteView chunk) override {
    ASSIGN_OR_RETURN(auto samples, decodeChunk(chunk));
    std::erase_if(samples, [&](const GestureSample& sample) {
      if (!window_.first_time_ns) window_.first_time_ns = sample.time_ns;
      const std::int64_t time_ns = sample.time_ns - *window_.first_time_ns;
      if (time_ns >= window_.to_ns) past_ = true;
      return time_ns < window_.from_ns || time_ns >= window_.to_ns;
    });
    samples_ += samples.size();
    if (hdf5_) return hdf5_->add(samples, *window_.first_time_ns, inspectChunk(chunk)->resolution);
    for (const GestureSample& sample : samples) writer_->add(text_, sample, *window_.first_time_ns);
    auto done = file_.append(viewOf(text_));
    text_.clear();
    return done;
  }

  Status finish() override {
    if (writer_) writer_->end(text_);
    if (hdf5_) RETURN_IF_ERROR(hdf5_->close());
    RETURN_IF_ERROR(file_.append(viewOf(text_)));
    return file_.finish();
  }

 private:
  GrowingFile file_;
  std::unique_ptr<SampleWriter> writer_;  ///< or:
  std::optional<Hdf5File> hdf5_;
  SampleWindow window_;
  std::string text_;  ///< not yet written
};

/// Whole chunks, byte for byte.
class RecordingSink : public SampleSink {
 public:
  RecordingSink(RecordingWriter writer, const SampleWindow& window)
      : writer_(std::move(writer)), window_(window) {}

  Status take(ByteView chunk) override {
    ASSIGN_OR_RETURN(const auto info, inspectChunk(chunk));
    if (!window_.first_time_ns) window_.first_time_ns = info.first_time_ns;
    if (info.first_time_ns - *window_.first_time_ns >= window_.to_ns) {
      past_ = true;
      return {};
    }
    RETURN_IF_ERROR(writer_.append(chunk));
    samples_ += info.count;
    return {};
  }

  Status finish() override { return writer_.finish(); }

 private:
  RecordingWriter writer_;
  SampleWindow window_;
};

Result<std::unique_ptr<SampleSink>> openSampleSink(const ExportFormat& format,
                                                   const std::filesystem::path& file, const Json& session,
                                                   const SampleWindow& window) {
  if (format.form == ExportForm::kRecording) {
    ASSIGN_OR_RETURN(auto writer, RecordingWriter::create(file, jsonText(session)));
    return std::unique_ptr<SampleSink>(std::make_unique<RecordingSink>(std::move(writer), window));
  }
  ASSIGN_OR_RETURN(auto growing, GrowingFile::create(file));
  return std::unique_ptr<SampleSink>(
      std::make_unique<DecodedSink>(format, file, std::move(growing), session, window));
}

const char* stateName(pb::SessionState state) {
  switch (state) {
    case pb::SESSION_OPEN:
      return "open";
    case pb::SESSION_COMPLETE:
      return "complete";
    case pb::SESSION_INTERRUPTED:
      return "interrupted";
    default:
      return "unknown";
  }
}

std::string idText(const std::string& bytes) {
  Uuid id;
  if (bytes.size() != id.size()) return hexDigitsOf(bytes);
  std::copy(bytes.begin(), bytes.end(), id.begin());
  return uuidText(id);
}

/// Ten years: fits an integer of ns, and is longer than any session.
constexpr double kMaxSeconds = 3.2e8;
constexpr std::size_t kFaultsNamed = 20;

std::int64_t nsOf(double seconds) {
  return static_cast<std::int64_t>(std::llround(seconds * 1e9));
}

Status checkRange(const ExportRange& range) {
  for (const auto& [name, value] : {std::pair{"--from", range.from_s}, std::pair{"--to", range.to_s}}) {
    if (value && !(*value >= 0 && *value <= kMaxSeconds))
      return Error{ErrorCode::kInvalidInput,
                   fmt::format("{} {:f}: allowed is 0 to {:f} s", name, *value, kMaxSeconds)};
  }
  if (range.from_s && range.to_s && *range.to_s <= *range.from_s)
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("--to {:f}: allowed is more than --from", *range.to_s)};
  return {};
}

/// Shows the progress about once a second on a terminal.
class Progress {
 public:
  explicit Progress(Output& output) : output_(output), shown_(::isatty(STDERR_FILENO) != 0) {}
  void at(std::uint64_t chunk, std::uint64_t chunks, std::uint64_t samples, std::uint64_t bytes) {
    const auto now = Clock::now();
    if (!shown_ || now < next_) return;
    next_ = now + std::chrono::seconds(1);
    output_.remark(fmt::format("{} of {} chunks, {}", chunk, chunks, speed(samples, bytes)));
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

  Status run(const ExportFormat& format, const std::filesystem::path& file) {
    RETURN_IF_ERROR(checkRange(range_));
    pb::Request get;
    get.mutable_get_session()->set_session_id(id_);
    ASSIGN_OR_RETURN(const auto info, backend_.call(get));
    session_ = info.session();
    if (session_.removed_original().fate() == pb::RemovedOriginal::DELETED) {
      return Error{ErrorCode::kNotFound,
                   "its recording was deleted on " +
                       localTime(session_.removed_original().deleted_unix_ns(), TimeForm::kZoned) + " (" +
                       session_.removed_original().reason() +
                       "); `session show` has its score, events and remarks"};
    }
    Json row = sessionRow(session_);
    row["profile"] = storedJson(session_.description().profile_json());
    if (format.form == ExportForm::kHdf5) row["score"] = storedJson(session_.score_json());

    SampleWindow window;
    if (range_.from_s) window.from_ns = nsOf(*range_.from_s);
    if (range_.to_s) window.to_ns = nsOf(*range_.to_s);
    RETURN_IF_ERROR(seek(window));
    // samples, chunks and hash are those of the whole session, so say that this is a part
    if (range_.from_s || range_.to_s)
      row["part"] = {{"from_s", range_.from_s ? Json(*range_.from_s) : Json()},
                     {"to_s", range_.to_s ? Json(*range_.to_s) : Json()}};
    ASSIGN_OR_RETURN(auto sink, openSampleSink(format, file, row, window));
    RETURN_IF_ERROR(readInto(*sink));
    RETURN_IF_ERROR(checkHash());
    RETURN_IF_ERROR(sink->finish());
    return report(*sink, file);
  }

 private:
  /// Finds the first chunk and the time origin.
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

  /// Reads the chunks that existed at the request; a live session keeps growing.
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
      RETURN_IF_ERROR(takeChunks(sink, reply->chunks()));
      const std::uint64_t behind = reply->chunks().next_seq();
      if (behind <= next_ && reply->chunks().chunks_size() == 0) break;
      next_ = std::max(next_, behind);
      progress.at(std::min(next_, session_.chunks()), session_.chunks(), sink.samples(), bytes_);
    }
    if (next_ < session_.chunks() && !sink.past()) {
      return Error{ErrorCode::kCorrupt,
                   fmt::format("the session has {} chunks, only {} could be read", session_.chunks(), next_)};
    }
    whole_ = first_ == 0 && !sink.past();
    speed_ = progress.speed(sink.samples(), bytes_);
    return {};
  }

  Status takeChunks(SampleSink& sink, const pb::Chunks& chunks) {
    for (const pb::Chunk& chunk : chunks.chunks()) {
      if (chunk.seq() >= session_.chunks() || sink.past()) break;
      if (chunk.seq() < next_ || (chunk.seq() != next_ && !range_.around_damage)) {
        return Error{ErrorCode::kCorrupt, fmt::format("chunk {} was asked for, {} came", next_, chunk.seq())};
      }
      if (auto done = sink.take(viewOf(chunk.data())); !done) {
        const std::string text = fmt::format("chunk {}: {}", chunk.seq(), done.error().message);
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
    // samples after the end of the requested part do not belong to it
    if (seq >= session_.chunks()) return;
    if (++faults_ <= kFaultsNamed) output_.remark("damaged: " + text);
  }

  /// A partial export, or one around damage, has no hash to compare with.
  Status checkHash() {
    if (!whole_ || faults_ > 0 || session_.hash().empty()) return {};
    const Digest digest = hash_.digest();
    if (textOf(digest) == session_.hash()) return {};
    const std::string text = "the hash over what was read is " + hexOf(digest) +
                             ", the session was closed with " + hexDigitsOf(session_.hash());
    if (!range_.around_damage) return Error{ErrorCode::kCorrupt, text + ": nothing was written"};
    ++faults_;
    output_.remark("damaged: " + text);
    return {};
  }

  Status report(const SampleSink& sink, const std::filesystem::path& file) {
    if (session_.state() == pb::SESSION_OPEN)
      output_.remark("the session is still open: this is what has come so far");
    if (session_.has_removed_original()) {
      output_.remark(fmt::format("thinned recording: {}; the original had {} samples",
                                 session_.removed_original().reason(),
                                 session_.removed_original().samples()));
    }
    const std::string wrote = fmt::format("wrote {} samples to {}", sink.samples(), file.string());
    output_.done(wrote + " (" + speed_ + ")");
    if (faults_ == 0) return {};
    return Error{ErrorCode::kCorrupt,
                 fmt::format("{} of {} chunks are damaged or missing; the file holds what is around them",
                             faults_, session_.chunks())};
  }

  Backend& backend_;
  Output& output_;
  const std::string id_;
  const ExportRange range_;
  pb::SessionInfo session_;
  SessionHash hash_;
  std::uint64_t first_ = 0, next_ = 0;  ///< chunks: the first one and the next one
  std::uint64_t bytes_ = 0;
  std::size_t faults_ = 0;
  bool whole_ = false;
  std::string speed_;
};

}  // namespace

Json sessionRow(const pb::SessionInfo& session) {
  const auto& d = session.description();
  const auto& r = d.resolution();
  Json row = {{"session_id", idText(d.session_id())},
              {"state", stateName(session.state())},
              {"station", d.station()},
              {"trainee", d.trainee()},
              {"exercise_id", d.exercise_id()},
              {"profile_id", d.profile_id()},
              {"profile_revision", d.profile_revision()},
              {"engine_version", d.engine_version()},
              {"device", d.device()},
              {"rate_hz", d.rate_hz()},
              {"resolution",
               {{"length_m", r.length_m()},
                {"quaternion", r.quaternion()},
                {"force_n", r.force_n()},
                {"torque_nm", r.torque_nm()},
                {"time_s", r.time_s()},
                {"speed_m_s", r.speed_m_s()}}},
              {"placement", std::vector<double>(d.placement().begin(), d.placement().end())},
              {"tool", std::vector<double>(d.tool().begin(), d.tool().end())},
              {"started_unix_ns", d.started_unix_ns()},
              {"started_steady_ns", d.started_steady_ns()},
              {"received_unix_ns", session.received_unix_ns()},
              {"closed_unix_ns", session.closed_unix_ns()},
              {"samples", session.samples()},
              {"chunks", session.chunks()},
              {"stored_bytes", session.stored_bytes()},
              {"hash", nullptr},
              {"clock_offset_ns", nullptr},
              {"clock_round_trip_ns", nullptr}};
  row["unknown_trainee"] = session.unknown_trainee();
  row["code_unchecked"] = session.code_unchecked();
  row["not_assigned"] = session.not_assigned();
  row["quarantined_chunks"] = session.quarantined_chunks();
  row["given_trainee"] = session.has_given_trainee() ? Json(session.given_trainee()) : Json();
  row["verdict"] = session.has_passed() ? Json(session.passed() ? "passed" : "failed") : Json();
  if (session.figures_size() > 0) {
    Json& figures = row["figures"] = Json::object();
    for (const pb::Figure& figure : session.figures())
      figures[figure.measure()] = figure.has_value() ? Json(figure.value()) : Json();
  }
  row["recording"] = "original";
  if (session.has_removed_original()) {
    const auto& removed = session.removed_original();
    const bool thinned = removed.fate() == pb::RemovedOriginal::THINNED;
    row["recording"] = thinned ? "thinned" : "deleted";
    row["removed_original"] = {{"removed_unix_ns", removed.removed_unix_ns()},
                               {"deleted_unix_ns", removed.deleted_unix_ns()},
                               {"reason", removed.reason()},
                               {"chunks", removed.chunks()},
                               {"samples", removed.samples()},
                               {"stored_bytes", removed.stored_bytes()},
                               {"hash", hexDigitsOf(removed.hash())}};
    if (thinned) row["removed_original"]["thinned_rate_hz"] = removed.thinned_rate_hz();
  }
  if (!session.hash().empty()) row["hash"] = hexDigitsOf(session.hash());
  if (session.clock_round_trip_ns() != 0) {
    row["clock_offset_ns"] = session.clock_offset_ns();
    row["clock_round_trip_ns"] = session.clock_round_trip_ns();
  }
  return row;
}

Status exportSession(Backend& backend, Output& output, const Uuid& session, const ExportFormat& format,
                     const std::filesystem::path& file, const ExportRange& range) {
  return Export(backend, output, session, range).run(format, file);
}

Status readStudyChunks(Backend& backend, const std::string& study, const std::string& session,
                       const std::function<Status(ByteView chunk)>& take) {
  for (std::uint64_t next = 0;;) {
    pb::Request read;
    read.mutable_read_study_recording()->set_study(study);
    read.mutable_read_study_recording()->set_session(session);
    read.mutable_read_study_recording()->set_from_seq(next);
    ASSIGN_OR_RETURN(const auto reply, backend.call(read));
    for (const pb::Chunk& chunk : reply.chunks().chunks()) {
      if (chunk.seq() != next)
        return Error{ErrorCode::kCorrupt, fmt::format("chunk {} was asked for, {} came", next, chunk.seq())};
      if (auto done = take(viewOf(chunk.data())); !done)
        return Error{done.error().code, fmt::format("chunk {}: {}", next, done.error().message)};
      ++next;
    }
    if (reply.chunks().chunks_size() == 0) return {};
  }
}

Status exportStudyRecording(Backend& backend, Output& output, const std::string& study,
                            const std::string& session, const ExportFormat& format,
                            const std::filesystem::path& file) {
  ASSIGN_OR_RETURN(auto sink, openSampleSink(format, file, Json{{"study", study}, {"session", session}}, {}));
  RETURN_IF_ERROR(
      readStudyChunks(backend, study, session, [&](ByteView chunk) { return sink->take(chunk); }));
  RETURN_IF_ERROR(sink->finish());
  output.done(fmt::format("wrote {} samples to {}", sink->samples(), file.string()));
  return {};
}

}  // namespace needlelab
