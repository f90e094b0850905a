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
#include "common/gesture/sample_csv.h"
#include "server/web/reply_json.h"

namespace needlelab {
namespace {

constexpr double kMostPlotSeconds = 3.2e8;
constexpr std::uint32_t kChunksAPiece = 8;
constexpr std::size_t kMostPieceText = 256u << 10;

struct TimeSpan {
  std::optional<double> from_s, to_s;
};

Result<TimeSpan> timeSpanOf(const WebCall& call) {
  TimeSpan span;
  for (const auto& [name, into] : {std::pair{"from_s", &span.from_s}, std::pair{"to_s", &span.to_s}}) {
    const std::string text = call.query(name);
    if (text.empty()) continue;
    ASSIGN_OR_RETURN(const auto number, numberOf(name, text, 0, kMostPlotSeconds));
    *into = number;
  }
  if (span.from_s && span.to_s && *span.to_s <= *span.from_s)
    return Error{ErrorCode::kInvalidInput, "to_s: must be more than from_s"};
  return span;
}

std::int64_t nsOfSeconds(double seconds) {
  return static_cast<std::int64_t>(std::llround(seconds * 1e9));
}

/// Reads a session's chunks in order, with the requester's permissions.
class ChunkReader {
 public:
  /// Errors: those of GetSession; kNotFound when the recording was deleted.
  static Result<ChunkReader> open(Service& service, const WebCall& call) {
    ChunkReader reader(service, call.who);
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

  /// Moves to the chunk of a moment; sets firstTimeNs. Not for a session without chunks.
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
      ASSIGN_OR_RETURN(const auto samples, read(info_.chunks() - back, 1, true));
      if (!samples.empty()) return static_cast<double>(samples.back().time_ns - first_time_ns_) * 1e-9;
    }
    return 0.0;
  }

  /// The samples of the next chunks; empty at the end (or when all these chunks are damaged).
  Result<std::vector<GestureSample>> take(std::uint32_t most_chunks, bool skip_damaged) {
    while (next_ < info_.chunks()) {
      auto samples = read(next_, most_chunks, skip_damaged);
      if (!samples) return samples.error();
      if (behind_ <= next_) break;
      next_ = behind_;
      if (!samples->empty()) return samples;
    }
    if (next_ < info_.chunks())
      return Error{ErrorCode::kCorrupt,
                   fmt::format("only {} of {} chunks could be read", next_, info_.chunks())};
    return std::vector<GestureSample>{};
  }

 private:
  ChunkReader(Service& service, Principal who) : service_(&service), who_(std::move(who)) {}

  Result<pb::Reply> ask(const pb::Request& request) {
    Outcome outcome = service_->execute(who_, request);
    if (outcome.error) return *outcome.error;
    return std::move(outcome.reply);
  }

  Result<std::vector<GestureSample>> read(std::uint64_t from, std::uint32_t most, bool skip_damaged) {
    pb::Request request;
    auto& read = *request.mutable_read_chunks();
    read.set_session_id(id_);
    read.set_from_seq(from);
    read.set_max_chunks(most);
    read.set_skip_damaged(skip_damaged);
    read.set_hash(info_.hash());
    ASSIGN_OR_RETURN(const auto reply, ask(request));
    std::vector<GestureSample> samples;
    for (const pb::Chunk& chunk : reply.chunks().chunks()) {
      const auto decoded = decodeChunk(viewOf(chunk.data()));
      if (!decoded && skip_damaged) continue;
      if (!decoded) return decoded.error();
      samples.insert(samples.end(), decoded->begin(), decoded->end());
    }
    behind_ = reply.chunks().next_seq();
    return samples;
  }

  Service* service_;
  Principal who_;
  std::string id_;
  pb::SessionInfo info_;
  std::uint64_t next_ = 0, behind_ = 0;
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

/// Makes the CSV, some chunks at a time.
class CsvPieces {
 public:
  CsvPieces(ChunkReader reader, const TimeSpan& span)
      : reader_(std::move(reader)),
        from_ns_(nsOfSeconds(span.from_s.value_or(0))),
        to_ns_(span.to_s ? nsOfSeconds(*span.to_s) : INT64_MAX) {
    appendSampleCsvHeader(text_);
  }

  Result<std::string> next() {
    // one piece for a small recording, many for a long one
    while (!ended_ && text_.size() < kMostPieceText) {
      ASSIGN_OR_RETURN(const auto samples, reader_.take(kChunksAPiece, false));
      ended_ = samples.empty();
      for (const GestureSample& sample : samples) {
        const std::int64_t time_ns = sample.time_ns - reader_.firstTimeNs();
        if (time_ns >= to_ns_) {
          ended_ = true;
          break;
        }
        if (time_ns >= from_ns_) appendSampleCsvRow(text_, sample, reader_.firstTimeNs());
      }
    }
    return std::exchange(text_, {});
  }

 private:
  ChunkReader reader_;
  const std::int64_t from_ns_, to_ns_;
  std::string text_;
  bool ended_ = false;
};

}  // namespace

Result<WebJson> samplePlot(Service& service, const WebCall& call) {
  ASSIGN_OR_RETURN(const auto span, timeSpanOf(call));
  std::size_t points = 2000;
  if (const std::string text = call.query("points"); !text.empty()) {
    ASSIGN_OR_RETURN(const auto number, wholeOf("points", text, 2, 10'000));
    points = number;
  }
  ASSIGN_OR_RETURN(auto reader, ChunkReader::open(service, call));
  const double from_s = span.from_s.value_or(0);
  double to_s = from_s;
  std::vector<GestureSample> few;  // used while there are no more samples than points
  std::vector<PlotBin> bins;
  if (reader.info().chunks() > 0) {
    RETURN_IF_ERROR(reader.seek(from_s));
    ASSIGN_OR_RETURN(const auto end_s, reader.endSeconds());
    to_s = std::min(span.to_s.value_or(end_s), end_s);
  }
  const double width_s = (to_s - from_s) / static_cast<double>(points / 2);
  const auto bin = [&](const GestureSample& sample) {
    const double time_s = static_cast<double>(sample.time_ns - reader.firstTimeNs()) * 1e-9;
    const double place = width_s > 0 ? (time_s - from_s) / width_s : 0;
    const std::size_t i = std::min(bins.size() - 1, static_cast<std::size_t>(std::max(0.0, place)));
    bins[i].add(sample, time_s, from_s + (static_cast<double>(i) + 0.5) * width_s);
  };
  bool past = reader.info().chunks() == 0;
  while (!past) {
    ASSIGN_OR_RETURN(const auto samples, reader.take(256, true));
    if (samples.empty()) break;
    for (const GestureSample& sample : samples) {
      const double time_s = static_cast<double>(sample.time_ns - reader.firstTimeNs()) * 1e-9;
      if (time_s < from_s) continue;
      if (time_s > to_s + 1e-9) {
        past = true;
        break;
      }
      if (bins.empty()) {
        few.push_back(sample);
        if (few.size() <= points) continue;
        bins.resize(points / 2);
        for (const GestureSample& earlier : few) bin(earlier);
        few = {};
      } else {
        bin(sample);
      }
    }
  }
  PlotRows rows;
  for (const GestureSample& sample : few)
    rows.add(sample, static_cast<double>(sample.time_ns - reader.firstTimeNs()) * 1e-9);
  for (const PlotBin& one : bins) rows.add(one);
  return WebJson{{"rate_hz", reader.info().description().rate_hz()},
                 {"samples", reader.info().samples()},
                 {"from_s", from_s},
                 {"to_s", to_s},
                 {"decimated", !bins.empty()},
                 {"columns", rows.json()}};
}

Result<WebStream> sampleCsv(Service& service, const WebCall& call) {
  ASSIGN_OR_RETURN(const auto span, timeSpanOf(call));
  ASSIGN_OR_RETURN(auto reader, ChunkReader::open(service, call));
  if (reader.info().chunks() > 0) {
    RETURN_IF_ERROR(reader.seek(span.from_s.value_or(0)));
  }
  auto pieces = std::make_shared<CsvPieces>(std::move(reader), span);
  return WebStream{"text/csv; charset=utf-8", call.parts[0] + ".csv", [pieces] { return pieces->next(); }};
}

}  // namespace needlelab
