#include "server/web/session_views.h"

#include <fmt/core.h>
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "common/gesture/chunk.h"
#include "common/haptics/engine.h"
#include "server/web/routes.h"
#include "server/web/web_call.h"

namespace needlelab {
namespace {

constexpr double kMaxPlotSeconds = 3.2e8;
constexpr std::uint32_t kDownloadChunksAtOnce = 8;
constexpr std::size_t kMaxPieceText = 256u << 10;

struct TimeSpan {
  std::optional<double> from_s, to_s;
};

Result<TimeSpan> timeSpanOf(const WebCall& call) {
  TimeSpan span;
  for (const auto& [name, into] : {std::pair{"from_s", &span.from_s}, std::pair{"to_s", &span.to_s}}) {
    const std::string text = call.query(name);
    if (text.empty()) continue;
    ASSIGN_OR_RETURN(const auto number, numberOf(name, text, 0, kMaxPlotSeconds));
    *into = number;
  }
  if (span.from_s && span.to_s && *span.to_s <= *span.from_s)
    return Error{ErrorCode::kInvalidInput, "to_s: must be more than from_s"};
  return span;
}

std::int64_t nsOfSeconds(double seconds) {
  return static_cast<std::int64_t>(std::llround(seconds * 1e9));
}

/// Reads a session's chunks in order, with the requester's permissions. Holds the bytes of at most
/// `chunks_at_once` chunks and of one reply (1 MiB), but no samples.
class ChunkReader {
 public:
  /// Errors: those of GetSession; kNotFound when the recording was deleted.
  static Result<ChunkReader> open(Service& service, const WebCall& call, std::uint32_t chunks_at_once) {
    ChunkReader reader(service, call.who, chunks_at_once);
    ASSIGN_OR_RETURN(auto id, sessionBytesOf(call.parts[0]));
    reader.id_ = std::move(id);
    pb::Request request;
    request.mutable_get_session()->set_session_id(reader.id_);
    ASSIGN_OR_RETURN(auto reply, reader.ask(request));
    reader.info_ = std::move(*reply.mutable_session());
    if (reader.info_.removed_original().fate() == pb::RemovedOriginal::DELETED) {
      return Error{ErrorCode::kNotFound, "the recording was deleted (" +
                                             reader.info_.removed_original().reason() +
                                             "); score, events and remarks are kept"};
    }
    return reader;
  }

  [[nodiscard]] const pb::SessionInfo& info() const { return info_; }
  [[nodiscard]] std::int64_t firstTimeNs() const { return first_time_ns_; }

  /// Moves to the chunk at a time; sets firstTimeNs. Not for a session without chunks.
  Status seek(double seconds) {
    pb::Request request;
    request.mutable_seek_session()->set_session_id(id_);
    request.mutable_seek_session()->set_seconds(seconds);
    ASSIGN_OR_RETURN(const auto reply, ask(request));
    next_ = reply.sought().seq();
    first_time_ns_ = reply.sought().recording_first_time_ns();
    return {};
  }

  /// The end of the last readable chunk, in s since the first sample; 0 when no chunk can be read.
  Result<double> endSeconds() {
    for (std::uint64_t back = 1; back <= std::min<std::uint64_t>(info_.chunks(), 16); ++back) {
      ASSIGN_OR_RETURN(const auto reply, read(info_.chunks() - back, 1, true));
      if (reply.chunks().chunks().empty()) continue;
      const auto samples = decodeChunk(viewOf(reply.chunks().chunks(0).data()));
      if (samples) return static_cast<double>(samples->back().time_ns - first_time_ns_) * 1e-9;
    }
    return 0.0;
  }

  /// Whether all chunks have been passed.
  [[nodiscard]] bool ended() const { return next_ >= info_.chunks() && at_ == held_.chunks().chunks_size(); }

  /// Decodes the next chunk: at most kMaxChunkSamples. Empty: the chunk is damaged or missing.
  Result<std::vector<GestureSample>> samples(bool skip_damaged) {
    if (at_ == held_.chunks().chunks_size()) {
      if (ended()) return std::vector<GestureSample>{};
      ASSIGN_OR_RETURN(auto reply, read(next_, chunks_at_once_, skip_damaged));
      if (reply.chunks().next_seq() <= next_)
        return Error{ErrorCode::kCorrupt,
                     fmt::format("only {} of {} chunks could be read", next_, info_.chunks())};
      held_ = std::move(reply);
      at_ = 0;
      next_ = held_.chunks().next_seq();
      if (held_.chunks().chunks().empty()) return std::vector<GestureSample>{};
    }
    auto decoded = decodeChunk(viewOf(held_.chunks().chunks(at_).data()));
    if (!decoded && skip_damaged) return std::vector<GestureSample>{};
    return decoded;
  }

  /// Skips the chunk that samples() returned.
  void pass() {
    if (at_ < held_.chunks().chunks_size()) ++at_;
  }

 private:
  ChunkReader(Service& service, Principal who, std::uint32_t chunks_at_once)
      : service_(&service), who_(std::move(who)), chunks_at_once_(chunks_at_once) {}

  Result<pb::Reply> ask(const pb::Request& request) {
    Outcome outcome = service_->execute(who_, request);
    if (outcome.error) return *outcome.error;
    return std::move(outcome.reply);
  }

  Result<pb::Reply> read(std::uint64_t from, std::uint32_t most, bool skip_damaged) {
    pb::Request request;
    auto& read = *request.mutable_read_chunks();
    read.set_session_id(id_);
    read.set_from_seq(from);
    read.set_max_chunks(most);
    read.set_skip_damaged(skip_damaged);
    read.set_hash(info_.hash());
    return ask(request);
  }

  Service* service_;
  Principal who_;
  std::uint32_t chunks_at_once_;
  std::string id_;
  pb::SessionInfo info_;
  pb::Reply held_;          // chunks read in advance
  int at_ = 0;              // index of the next one in held_
  std::uint64_t next_ = 0;  // the chunk after those
  std::int64_t first_time_ns_ = 0;
};

struct PlotColumn {
  std::string_view name;
  double (*value)(const GestureSample& sample);
  bool extremes;  ///< gives minimum and maximum of a span, not just two of its samples
};

constexpr std::array kPlotColumns = {
    PlotColumn{"px_m", [](const GestureSample& s) { return s.p_WT_m[0]; }, false},
    PlotColumn{"py_m", [](const GestureSample& s) { return s.p_WT_m[1]; }, false},
    PlotColumn{"pz_m", [](const GestureSample& s) { return s.p_WT_m[2]; }, false},
    PlotColumn{"qx", [](const GestureSample& s) { return s.q_WT[0]; }, false},
    PlotColumn{"qy", [](const GestureSample& s) { return s.q_WT[1]; }, false},
    PlotColumn{"qz", [](const GestureSample& s) { return s.q_WT[2]; }, false},
    PlotColumn{"qw", [](const GestureSample& s) { return s.q_WT[3]; }, false},
    PlotColumn{"speed_m_s", [](const GestureSample& s) { return s.speed_mps; }, true},
    PlotColumn{"fx_n", [](const GestureSample& s) { return s.force_W_N[0]; }, true},
    PlotColumn{"fy_n", [](const GestureSample& s) { return s.force_W_N[1]; }, true},
    PlotColumn{"fz_n", [](const GestureSample& s) { return s.force_W_N[2]; }, true},
    PlotColumn{
        "force_n",
        [](const GestureSample& s) { return std::hypot(s.force_W_N[0], s.force_W_N[1], s.force_W_N[2]); },
        true},
    PlotColumn{"insertion_m", [](const GestureSample& s) { return s.insertion_m; }, true},
    PlotColumn{"lateral_error_m", [](const GestureSample& s) { return s.lateral_error_m; }, true},
    PlotColumn{"plunger", [](const GestureSample& s) { return s.plunger; }, true},
    PlotColumn{"phase", [](const GestureSample& s) { return static_cast<double>(s.phase); }, false},
    PlotColumn{"layer", [](const GestureSample& s) { return static_cast<double>(s.layer); }, false},
    PlotColumn{"fault", [](const GestureSample& s) { return static_cast<double>(s.fault); }, false},
    PlotColumn{"capped", [](const GestureSample& s) { return (s.flags & kFlagCapped) != 0 ? 1.0 : 0.0; },
               false},
};

/// The data of one time span.
struct PlotBin {
  std::uint64_t count = 0;
  double first_s = 0, middle_s = 0;  ///< of the two samples that represent the span
  std::array<double, kPlotColumns.size()> first{}, middle{}, least{}, greatest{};
  std::array<bool, kPlotColumns.size()> fell{};  ///< the maximum came before the minimum

  void add(const GestureSample& sample, double time_s, double middle_of_span_s) {
    const bool is_first = count++ == 0;
    // the last sample before the span's middle, or the first one after it
    const bool is_middle = !is_first && (time_s <= middle_of_span_s || middle_s == first_s);
    if (is_first) first_s = middle_s = time_s;
    if (is_middle) middle_s = time_s;
    for (std::size_t i = 0; i < kPlotColumns.size(); ++i) {
      const double value = kPlotColumns[i].value(sample);
      if (is_first) first[i] = middle[i] = least[i] = greatest[i] = value;
      if (is_middle) middle[i] = value;
      if (value < least[i]) {
        least[i] = value;
        fell[i] = true;
      }
      if (value > greatest[i]) {
        greatest[i] = value;
        fell[i] = false;
      }
    }
  }
};

/// Collects a plot's rows, column by column.
class PlotRows {
 public:
  void add(const GestureSample& sample, double time_s) {
    times_.push_back(time_s);
    for (std::size_t i = 0; i < kPlotColumns.size(); ++i)
      columns_[i].push_back(kPlotColumns[i].value(sample));
  }

  void add(const PlotBin& bin) {
    if (bin.count == 0) return;
    times_.push_back(bin.first_s);
    if (bin.count > 1) times_.push_back(bin.middle_s);
    for (std::size_t i = 0; i < kPlotColumns.size(); ++i) {
      const bool extremes = kPlotColumns[i].extremes;
      columns_[i].push_back(!extremes ? bin.first[i] : bin.fell[i] ? bin.greatest[i] : bin.least[i]);
      if (bin.count > 1)
        columns_[i].push_back(!extremes ? bin.middle[i] : bin.fell[i] ? bin.least[i] : bin.greatest[i]);
    }
  }

  [[nodiscard]] WebJson json() const {
    WebJson columns = WebJson::object();
    columns["t_s"] = times_;
    for (std::size_t i = 0; i < kPlotColumns.size(); ++i)
      columns[std::string(kPlotColumns[i].name)] = columns_[i];
    return columns;
  }

 private:
  std::vector<double> times_;
  std::array<std::vector<double>, kPlotColumns.size()> columns_;
};

/// Makes a download, some rows at a time.
class SamplePieces {
 public:
  SamplePieces(ChunkReader reader, std::unique_ptr<SampleWriter> writer, const TimeSpan& span)
      : reader_(std::move(reader)),
        writer_(std::move(writer)),
        from_ns_(nsOfSeconds(span.from_s.value_or(0))),
        to_ns_(span.to_s ? nsOfSeconds(*span.to_s) : INT64_MAX) {
    writer_->begin(text_, [this] {
      return jsonOf(reader_.info()).dump(-1, ' ', false, WebJson::error_handler_t::replace);
    });
  }

  Result<WebPiece> next() {
    // one piece for a small recording, many for a long one
    std::size_t rows = 0, decoded = 0;
    for (std::uint32_t n = 0; !ended_ && rows < kMaxPieceRows && text_.size() < kMaxPieceText &&
                              n < kMaxStepChunks && decoded < kMaxStepSamples;
         ++n) {
      // a long chunk is decoded again for each of its pieces, not held while the browser does not read
      ASSIGN_OR_RETURN(const auto samples, reader_.samples(false));
      decoded += samples.size();
      for (; !ended_ && done_ < samples.size() && rows < kMaxPieceRows; ++done_) {
        const GestureSample& sample = samples[done_];
        const std::int64_t time_ns = sample.time_ns - reader_.firstTimeNs();
        ended_ = time_ns >= to_ns_;
        if (ended_ || time_ns < from_ns_) continue;
        writer_->add(text_, sample, reader_.firstTimeNs());
        ++rows;
      }
      if (done_ < samples.size()) continue;
      done_ = 0;
      reader_.pass();
      ended_ = ended_ || reader_.ended();
    }
    if (ended_ && !std::exchange(has_end_, true)) writer_->end(text_);
    if (text_.empty() && !ended_) return WebPiece();
    return WebPiece(std::exchange(text_, {}));
  }

 private:
  ChunkReader reader_;
  std::unique_ptr<SampleWriter> writer_;
  const std::int64_t from_ns_, to_ns_;
  std::string text_;
  std::size_t done_ = 0;  // rows done of the reader's chunk
  bool ended_ = false, has_end_ = false;
};

/// A plot's parameters.
struct PlotAsked {
  TimeSpan span;
  std::size_t points = 2000;
};

Result<PlotAsked> plotAskedIn(const WebCall& call) {
  PlotAsked asked;
  ASSIGN_OR_RETURN(asked.span, timeSpanOf(call));
  if (const std::string text = call.query("points"); !text.empty()) {
    ASSIGN_OR_RETURN(asked.points, wholeOf("points", text, 2, 10'000));
  }
  return asked;
}

/// Makes a plot, some chunks at a time.
class PlotSteps {
 public:
  PlotSteps(ChunkReader reader, const PlotAsked& asked)
      : reader_(std::move(reader)),
        points_(asked.points),
        from_s_(asked.span.from_s.value_or(0)),
        to_s_(from_s_),
        wanted_to_s_(asked.span.to_s) {}

  /// Finds the span. Call before the first step.
  Status begin() {
    past_ = reader_.info().chunks() == 0;
    if (past_) return {};
    RETURN_IF_ERROR(reader_.seek(from_s_));
    ASSIGN_OR_RETURN(const auto end_s, reader_.endSeconds());
    to_s_ = std::min(wanted_to_s_.value_or(end_s), end_s);
    return {};
  }

  Result<std::optional<WebJson>> step() {
    std::size_t decoded = 0;
    for (std::uint32_t n = 0; !past_ && n < kMaxStepChunks && decoded < kMaxStepSamples; ++n) {
      ASSIGN_OR_RETURN(const auto samples, reader_.samples(true));
      reader_.pass();
      decoded += samples.size();
      for (const GestureSample& sample : samples) {
        if (!past_) add(sample);
      }
      past_ = past_ || reader_.ended();
    }
    if (!past_) return std::optional<WebJson>();
    return std::optional<WebJson>(json());
  }

 private:
  [[nodiscard]] double timeOf(const GestureSample& sample) const {
    return static_cast<double>(sample.time_ns - reader_.firstTimeNs()) * 1e-9;
  }

  void add(const GestureSample& sample) {
    const double time_s = timeOf(sample);
    if (time_s < from_s_) return;
    past_ = time_s > to_s_ + 1e-9;
    if (past_) return;
    if (!bins_.empty()) {
      bin(sample);
      return;
    }
    few_.push_back(sample);
    if (few_.size() <= points_) return;
    bins_.resize(points_ / 2);
    for (const GestureSample& earlier : few_) bin(earlier);
    few_ = {};
  }

  void bin(const GestureSample& sample) {
    const double width_s = (to_s_ - from_s_) / static_cast<double>(points_ / 2);
    const double time_s = timeOf(sample);
    const double place = width_s > 0 ? (time_s - from_s_) / width_s : 0;
    const std::size_t i = std::min(bins_.size() - 1, static_cast<std::size_t>(std::max(0.0, place)));
    bins_[i].add(sample, time_s, from_s_ + (static_cast<double>(i) + 0.5) * width_s);
  }

  [[nodiscard]] WebJson json() const {
    PlotRows rows;
    for (const GestureSample& sample : few_) rows.add(sample, timeOf(sample));
    for (const PlotBin& one : bins_) rows.add(one);
    return WebJson{{"rate_hz", reader_.info().description().rate_hz()},
                   {"samples", reader_.info().samples()},
                   {"from_s", from_s_},
                   {"to_s", to_s_},
                   {"decimated", !bins_.empty()},
                   {"columns", rows.json()}};
  }

  ChunkReader reader_;
  std::size_t points_;
  double from_s_, to_s_;
  std::optional<double> wanted_to_s_;
  std::vector<GestureSample> few_;  // used while there are no more samples than points
  std::vector<PlotBin> bins_;
  bool past_ = false;
};

}  // namespace

Result<WebSteps> samplePlot(Service& service, const WebCall& call) {
  ASSIGN_OR_RETURN(const auto asked, plotAskedIn(call));
  ASSIGN_OR_RETURN(auto reader, ChunkReader::open(service, call, kMaxStepChunks));
  auto steps = std::make_shared<PlotSteps>(std::move(reader), asked);
  RETURN_IF_ERROR(steps->begin());
  return WebSteps{[steps] { return steps->step(); }};
}

Result<WebStream> sampleStream(Service& service, const WebRoute& route, const WebCall& call) {
  ASSIGN_OR_RETURN(const auto span, timeSpanOf(call));
  ASSIGN_OR_RETURN(auto reader, ChunkReader::open(service, call, kDownloadChunksAtOnce));
  if (reader.info().chunks() > 0) {
    RETURN_IF_ERROR(reader.seek(span.from_s.value_or(0)));
  }
  auto pieces = std::make_shared<SamplePieces>(std::move(reader), route.format->samples(), span);
  return streamFromFirst(*route.format, call.parts[0], [pieces] { return pieces->next(); });
}

}  // namespace needlelab
