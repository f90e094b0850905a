#include "common/gesture/whole_recording.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>
#include <utility>

#include "common/base/histogram.h"
#include "common/base/text/strict_json.h"
#include "common/gesture/chunk.h"
#include "common/gesture/recording.h"

namespace needlelab {
namespace {

/// A place in the file that cannot be read.
struct Fault {
  std::uint64_t offset = 0;
  std::string what;
};
/// The ticks of a readable chunk, with its place in the file.
struct Piece {
  std::uint64_t offset = 0, first_tick = 0, last_tick = 0;
};

std::string holeText(const Piece* before, const Piece* after, const std::string& why) {
  if (before != nullptr && after != nullptr && before->last_tick + 1 < after->first_tick)
    return fmt::format("ticks {} to {}: {}", before->last_tick + 1, after->first_tick - 1, why);
  if (before != nullptr && after != nullptr)
    return fmt::format("between tick {} and tick {}: {}", before->last_tick, after->first_tick, why);
  if (after != nullptr) return fmt::format("ticks before {}: {}", after->first_tick, why);
  if (before != nullptr) return fmt::format("ticks from {} on: {}", before->last_tick + 1, why);
  return "all ticks: " + why;
}

using EachChunk = std::function<Status(std::span<const GestureSample>, ByteView chunk)>;

/// Passes on the samples chunk by chunk and finds the holes.
class WholeReader {
 public:
  WholeReader(const RecordingReader& reader, const EachChunk& each) : reader_(reader), each_(each) {}

  /// Returns the holes.
  Result<std::vector<std::string>> run() {
    for (const RecordingReader::Damage& damage : reader_.damages())
      faults_.push_back({damage.offset, damage.what});
    for (std::size_t i = 0; i < reader_.entries().size(); ++i) RETURN_IF_ERROR(readChunk(i));
    findHoles();
    compareWithItself();
    compareWithMetadata();
    return std::move(holes_);
  }

  [[nodiscard]] std::uint64_t samples() const { return samples_; }

 private:
  Status readChunk(std::size_t index) {
    const RecordingEntry& entry = reader_.entries()[index];
    const auto samples = reader_.samples(index);
    if (!samples) {
      if (samples.error().code == ErrorCode::kFailed) return samples.error();
      // only the first after a readable chunk: findHoles() makes one hole of them
      if (std::exchange(faulty_behind_, pieces_.size()) != pieces_.size())
        faults_.push_back({entry.offset, samples.error().message});
      return {};
    }
    ASSIGN_OR_RETURN(const auto bytes, reader_.chunkBytes(index));
    hash_.update(bytes);
    pieces_.push_back({entry.offset, samples->front().tick, samples->back().tick});
    samples_ += samples->size();
    return each_(*samples, bytes);
  }

  /// Names the ticks around each fault; faults between the same two chunks are one hole.
  void findHoles() {
    std::stable_sort(faults_.begin(), faults_.end(),
                     [](const Fault& a, const Fault& b) { return a.offset < b.offset; });
    std::optional<std::size_t> last_place;
    for (const Fault& fault : faults_) {
      const auto behind = std::partition_point(
          pieces_.begin(), pieces_.end(), [&](const Piece& piece) { return piece.offset <= fault.offset; });
      const auto place = static_cast<std::size_t>(behind - pieces_.begin());
      if (std::exchange(last_place, place) == place) continue;
      holes_.push_back(holeText(place > 0 ? &pieces_[place - 1] : nullptr,
                                behind != pieces_.end() ? &*behind : nullptr, fault.what));
    }
    if (reader_.complete()) return;
    holes_.push_back(holeText(
        pieces_.empty() ? nullptr : &pieces_.back(), nullptr,
        fmt::format(
            "the file has no valid index at its end, behind {} unreadable bytes: it was cut off or damaged",
            reader_.unusableTailBytes())));
  }

  void compareWithItself() {
    if (!reader_.complete() || !holes_.empty() || hash_.digest() == reader_.declaredHash()) return;
    holes_.push_back("unknown ticks: the hash of its chunks is " + hexOf(hash_.digest()) +
                     ", its index says " + hexOf(reader_.declaredHash()));
  }

  void compareWithMetadata() {
    const auto metadata = readShallowJson<nlohmann::json>(reader_.metadata());
    if (!metadata.is_object()) {
      if (reader_.metadata().empty()) return;  // the metadata's record already is a fault
      holes_.push_back("unknown ticks: its metadata is not a JSON object");
      return;
    }
    if (metadata.contains("part")) return;
    const auto compare = [&](const char* name, std::uint64_t found, const char* what) {
      const auto declared = metadata.find(name);
      if (declared == metadata.end() || !declared->is_number_unsigned() ||
          declared->get<std::uint64_t>() == found)
        return;
      holes_.push_back(fmt::format("{} {} can be read, its metadata say {}{}", found, what,
                                   declared->get<std::uint64_t>(), jumps()));
    };
    compare("samples", samples_, "samples");
    compare("chunks", pieces_.size(), "chunks");
    const auto hash = metadata.find("hash");
    if (hash != metadata.end() && hash->is_string() && holes_.empty() &&
        hash->get<std::string>() != hexOf(hash_.digest()))
      holes_.push_back("unknown ticks: the hash of its chunks is " + hexOf(hash_.digest()) +
                       ", its metadata say " + hash->get<std::string>());
  }

  /// Returns the ticks missing between chunks: the only sign of a chunk that is gone without a trace.
  [[nodiscard]] std::string jumps() const {
    std::string text;
    for (std::size_t i = 1; i < pieces_.size(); ++i) {
      if (pieces_[i - 1].last_tick + 1 >= pieces_[i].first_tick) continue;
      text += fmt::format("{} {} to {}", text.empty() ? "; no chunk has the ticks" : ",",
                          pieces_[i - 1].last_tick + 1, pieces_[i].first_tick - 1);
    }
    return text;
  }

  const RecordingReader& reader_;
  const EachChunk& each_;
  std::vector<std::string> holes_;
  std::uint64_t samples_ = 0;  // passed on
  std::vector<Fault> faults_;
  std::optional<std::size_t> faulty_behind_;  // number of pieces when a chunk last could not be read
  std::vector<Piece> pieces_;                 // by their place in the file
  SessionHash hash_;
};

/// Checks the declared lengths of the chunks, because decoding takes memory and time.
Status checkLength(const RecordingReader& reader, const std::filesystem::path& path) {
  const std::uint64_t samples = reader.sampleCount();
  if (samples <= kMaxReadSamples) return {};
  return Error{
      ErrorCode::kInvalidInput,
      fmt::format("{}: has {} samples in {} chunks, at most {} are read (an hour at 1 kHz): export a "
                  "part of the session (needlelab-admin session export --from --to)",
                  path.string(), samples, reader.entries().size(), kMaxReadSamples)};
}

Result<std::vector<std::string>> readChunks(const RecordingReader& reader, const std::filesystem::path& path,
                                            DamagedRecording damaged, const EachChunk& each) {
  RETURN_IF_ERROR(checkLength(reader, path));
  WholeReader whole(reader, each);
  ASSIGN_OR_RETURN(auto holes, whole.run());
  if (holes.empty() || (damaged == DamagedRecording::kRead && whole.samples() > 0)) return holes;
  return Error{
      ErrorCode::kCorrupt,
      fmt::format("{}: incomplete; {} samples can be read. Missing: {}{}", path.string(), whole.samples(),
                  holes.front(),
                  holes.size() == 1 ? std::string() : fmt::format(" (and {} more)", holes.size() - 1))};
}

}  // namespace

Result<ReadRecording> readRecording(const std::filesystem::path& path, DamagedRecording damaged) {
  ASSIGN_OR_RETURN(const auto reader, RecordingReader::open(path));
  ReadRecording read;
  const EachChunk keep = [&](std::span<const GestureSample> samples, ByteView chunk) -> Status {
    // reserve all at once, because growing would take twice the memory for a while
    if (read.samples.empty()) read.samples.reserve(reader.sampleCount());
    read.samples.insert(read.samples.end(), samples.begin(), samples.end());
    if (Bytes paths = pathListOf(chunk); !paths.empty()) read.paths.push_back(std::move(paths));
    return {};
  };
  ASSIGN_OR_RETURN(read.holes, readChunks(reader, path, damaged, keep));
  const auto metadata = readShallowJson<nlohmann::json>(reader.metadata());
  const auto rate = metadata.is_object() ? metadata.find("rate_hz") : metadata.end();
  if (rate != metadata.end() && rate->is_number()) read.rate_hz = rate->get<double>();
  if (!(read.rate_hz > 0)) read.rate_hz = 0;
  read.metadata = reader.metadata();
  return read;
}

Result<std::vector<std::string>> readRecordingByChunk(
    const std::filesystem::path& path, DamagedRecording damaged,
    const std::function<Status(std::span<const GestureSample>)>& each) {
  ASSIGN_OR_RETURN(const auto reader, RecordingReader::open(path));
  return readChunks(reader, path, damaged,
                    [&](std::span<const GestureSample> samples, ByteView) { return each(samples); });
}

double tickOf_s(std::span<const GestureSample> samples) {
  std::vector<double> periods;
  for (std::size_t i = 1; i < samples.size(); ++i)
    if (samples[i].tick > samples[i - 1].tick)
      periods.push_back(
          1e-9 *
          static_cast<double>(static_cast<std::int64_t>(static_cast<std::uint64_t>(samples[i].time_ns) -
                                                        static_cast<std::uint64_t>(samples[i - 1].time_ns))) /
          static_cast<double>(samples[i].tick - samples[i - 1].tick));
  return periods.empty() ? 0 : medianOf(std::move(periods));
}

double wholeRate_hz(double tick_s) {
  constexpr double kOff = 5e-3;
  if (!(tick_s > 0)) return 0;
  const double rate_hz = std::round(1 / tick_s);
  return rate_hz > 0 && std::abs(rate_hz * tick_s - 1) <= kOff ? rate_hz : 0;
}

bool beginsAsRecording(const std::filesystem::path& path) {
  // a first byte that was damaged or converted must not make the rest a CSV
  constexpr std::string_view kLetters = "NLREC";
  std::array<char, 6> start{};
  std::ifstream in(path, std::ios::binary);
  in.read(start.data(), start.size());
  return std::string_view(start.data() + 1, kLetters.size()) == kLetters;
}

}  // namespace needlelab
