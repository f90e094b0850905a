/// Small files that pin the formats of FORMAT.md, each with a JSON twin that holds the values a reader must
/// find. NEEDLELAB_WRITE_GOLDEN=1 rewrites them: only for a new format version, which CHANGELOG.md must
/// announce with a migration line.
#include <gtest/gtest.h>

#include <cstdlib>
#include <optional>

#include "common/base/files/files.h"
#include "common/base/text/csv.h"
#include "common/gesture/recording.h"
#include "common/gesture/sample.h"
#include "common/haptics/body/path_snapshot.h"
#include "common/haptics/cut_snapshot.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/common/gesture/gesture_samples.h"

namespace needlelab {
namespace {

namespace fs = std::filesystem;

fs::path goldenFolder() {
  return fs::path(NEEDLELAB_SOURCE_DIR) / "tests" / "data" / "gesture";
}
bool writing() {
  return std::getenv("NEEDLELAB_WRITE_GOLDEN") != nullptr;
}

// only sums, products and quotients: same bits with any maths library
std::vector<GestureSample> madeSamples(std::size_t count, int variant) {
  std::vector<GestureSample> samples(count);
  std::mt19937_64 random(static_cast<std::uint64_t>(variant));
  for (std::size_t i = 0; i < count; ++i) {
    GestureSample& s = samples[i];
    const double t = static_cast<double>(i) / 32;
    s.tick = 100'000 + i + (i > 20 ? 3 : 0);  // three ticks were missed
    s.time_ns = 77'000'000'000'000 + static_cast<std::int64_t>(s.tick) * 1'000'000 +
                static_cast<std::int64_t>(random() % 2000);
    for (int k = 0; k < 3; ++k) {
      s.p_WT_m[k] = 0.1 * (k + 1) + 0.01 * t * (1 - 0.3 * t) - 0.002 * k * t;
      if (i >= 5) {
        s.wall_W_m[k] = s.p_WT_m[k] - 0.001;
        s.force_W_N[k] = 0.5 * t * (k - 1) + 0.01 * static_cast<double>(random() % 3);
        s.torque_W_Nm[k] = 0.01 * t * (1 - k);
      }
    }
    const double x = 0.25 * t / (1 + t);
    s.q_WT[0] = 2 * x / (1 + x * x);
    s.q_WT[3] = (1 - x * x) / (1 + x * x);
    if (i >= 5) {
      s.speed_mps = 0.013;
      s.insertion_m = 0.0004 * static_cast<double>(i - 5);
      s.lateral_error_m = 0.00001 * static_cast<double>(i % 4);
      s.layer = static_cast<std::int8_t>(i / 16);
      s.phase = i < 30 ? 1 : 2;
      s.flags = i == 5 ? 1u : i % 16 == 0 ? 1u << 18 | 4u : 0;
    }
    s.plunger = i > 33 ? 0.5 : 0;
    s.buttons = i > 33 ? 2 : 0;
    s.device_ns = static_cast<std::int32_t>(9'000 + random() % 4'000);
    s.engine_ns = static_cast<std::int32_t>(20 + random() % 1'000);
    s.fault = i == count - 1 ? 4 : 0;
  }
  return samples;
}

std::vector<GestureSample> samplesAtRest() {
  auto samples = madeSamples(70, 2);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i] = samples[40];
    samples[i].tick = i;
    samples[i].time_ns = static_cast<std::int64_t>(i) * 1'000'000;
  }
  return samples;
}

std::vector<GestureSample> oddSamples() {
  auto samples = madeSamples(12, 3);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i].speed_mps = static_cast<double>(i) * std::numeric_limits<double>::denorm_min();
    samples[i].plunger = i % 2 == 0 ? -0.0 : 0.0;
    samples[i].p_WT_m[2] =
        i % 2 == 0 ? std::numeric_limits<double>::max() : -std::numeric_limits<double>::max();
    samples[i].wall_W_m[1] = i % 3 == 0 ? std::numeric_limits<double>::quiet_NaN() : 1e-300;
    samples[i].tick = i * i * i * 1'000'000'007;
    samples[i].time_ns = static_cast<std::int64_t>(i) * -123'456'789'012'345;
    samples[i].device_ns =
        i % 2 == 0 ? std::numeric_limits<std::int32_t>::min() : std::numeric_limits<std::int32_t>::max();
    samples[i].flags = 0xFFFFFFFFu >> i;
    samples[i].buttons = 0x80000000u >> i;
    samples[i].layer = static_cast<std::int8_t>(-128 + static_cast<int>(i) * 20);
  }
  return samples;
}

CutSnapshot madeCuts() {
  CutSnapshot snapshot;
  snapshot.tick = 100'003;
  snapshot.insertions = 5;
  snapshot.cuts.count = snapshot.cuts.next = 2;
  snapshot.cuts.tracks[0] = {{0.1, 0.2, 0.3}, {0, 0, -1}, 0.02, 3};
  snapshot.cuts.tracks[1] = {{0.125, -0.25, 0.3}, {0.6, 0, -0.8}, 0.0375, 0};
  return snapshot;
}

Bytes madePaths() {
  PathSnapshot entry;
  entry.tick = 100'002;
  entry.path.point_W_m = {0.1, 0.2, 0.3};
  entry.path.normal_W = {0, 0.6, 0.8};
  entry.path.count = 3;
  entry.path.layers[0] = {4, 0};
  entry.path.layers[1] = {0, 0.002};
  entry.path.layers[2] = {kOutside, 0.0375};
  PathSnapshot next = entry;
  next.tick = 100'022;
  next.path.asked_depth_m = 0.002;
  next.path.ball_W_m = {0.1, 0.2, 0.25};
  next.path.ball_radius_m = 0.0125;
  next.path.layers[1].top_m = 0.00225;
  next.path.layers[2] = {7, 0.03};
  Bytes list;
  EXPECT_TRUE(appendPath(entry, list) && appendPath(next, list));
  return list;
}

struct GoldenChunk {
  const char* name;
  Resolution resolution;
  std::vector<GestureSample> samples;
  Bytes cut_memory{}, paths{};
};
std::vector<GoldenChunk> goldenChunks() {
  return {{"motion", Resolution::standard(), madeSamples(40, 1)},
          {"rest", Resolution::standard(), samplesAtRest()},
          {"single", Resolution::standard(), madeSamples(1, 1)},
          {"lossless", Resolution::lossless(), oddSamples()},
          {"not_in_steps", Resolution::standard(), oddSamples()},
          {"listed", {1e-5, 0x1p-12, 0, 1e-3, 1e-8, 1e-2}, madeSamples(40, 4)},
          {"with_cuts", Resolution::standard(), madeSamples(40, 1), encodeCuts(madeCuts())},
          {"with_paths", Resolution::standard(), madeSamples(40, 1), {}, madePaths()},
          {"with_both", Resolution::standard(), madeSamples(2, 1), encodeCuts(madeCuts()), madePaths()}};
}

std::string number(double value) {
  std::string text;
  appendNumber(text, value);
  return text;
}

std::string twinOf(const CutSnapshot& cuts) {
  const auto listed = [](Vec3 v) { return "[" + number(v.x) + "," + number(v.y) + "," + number(v.z) + "]"; };
  std::string text = "{\"tick\":" + std::to_string(cuts.tick) +
                     ",\"insertions\":" + std::to_string(cuts.insertions) +
                     ",\"next\":" + std::to_string(cuts.cuts.next) + ",\"tracks\":[";
  for (std::uint32_t i = 0; i < cuts.cuts.count; ++i) {
    const CutTrack& track = cuts.cuts.tracks[i];
    text += (i == 0 ? "\n{\"entry_m\":" : ",\n{\"entry_m\":") + listed(track.p_entry_W_m) +
            ",\"direction\":" + listed(track.u_W) + ",\"length_m\":" + number(track.length_m) +
            ",\"membranes\":" + std::to_string(track.membranes) + "}";
  }
  return text + "]}";
}

std::string twinOf(const std::vector<PathSnapshot>& paths) {
  const auto listed = [](Vec3 v) { return "[" + number(v.x) + "," + number(v.y) + "," + number(v.z) + "]"; };
  std::string text = "[";
  for (const PathSnapshot& snapshot : paths) {
    const PathLayers& path = snapshot.path;
    text += (text.size() == 1 ? "\n{\"tick\":" : ",\n{\"tick\":") + std::to_string(snapshot.tick) +
            ",\"point_m\":" + listed(path.point_W_m) + ",\"normal\":" + listed(path.normal_W) +
            ",\"ball_m\":" + listed(path.ball_W_m) + ",\"ball_radius_m\":" + number(path.ball_radius_m) +
            ",\"asked_depth_m\":" + number(path.asked_depth_m) + ",\"layers\":[";
    for (std::uint32_t i = 0; i < path.count; ++i)
      text += (i == 0 ? "[" : ",[") + std::to_string(path.layers[i].structure) + "," +
              number(path.layers[i].top_m) + "]";
    text += "]}";
  }
  return text + "]";
}

std::string twinOf(const ChunkInfo& info, const std::vector<GestureSample>& samples,
                   const std::optional<CutSnapshot>& cuts, const std::vector<PathSnapshot>& paths) {
  const Resolution& r = info.resolution;
  std::string text =
      "{\"version\":" + std::to_string(info.version) + ",\"count\":" + std::to_string(info.count) +
      ",\"first_tick\":" + std::to_string(info.first_tick) +
      ",\"last_tick\":" + std::to_string(info.last_tick) +
      ",\"first_time_ns\":" + std::to_string(info.first_time_ns) +
      ",\"lossless_columns\":" + std::to_string(info.lossless_columns) +
      ",\n\"resolution\":{\"length_m\":" + number(r.length_m) + ",\"quaternion\":" + number(r.quaternion) +
      ",\"force_n\":" + number(r.force_N) + ",\"torque_nm\":" + number(r.torque_Nm) +
      ",\"time_s\":" + number(r.time_s) + ",\"speed_m_s\":" + number(r.speed_mps) + "},\n" +
      (cuts ? "\"cut_memory\":" + twinOf(*cuts) + ",\n" : std::string()) +
      (paths.empty() ? std::string() : "\"paths\":" + twinOf(paths) + ",\n") + "\"samples\":[";
  for (std::size_t i = 0; i < samples.size(); ++i) {
    text += i == 0 ? "\n" : ",\n";
    appendSampleJson(text, samples[i], info.first_time_ns);
  }
  return text + "\n]}\n";
}

std::string twinOf(const RecordingReader& reader) {
  std::string text = std::string("{\"complete\":") + (reader.complete() ? "true" : "false") +
                     ",\"metadata\":" + (reader.metadata().empty() ? "null" : reader.metadata()) +
                     ",\"unusable_tail_bytes\":" + std::to_string(reader.unusableTailBytes()) +
                     ",\"hash\":\"" + hexOf(reader.declaredHash()) + "\",\n\"chunks\":[";
  for (std::size_t i = 0; i < reader.entries().size(); ++i) {
    const RecordingEntry& entry = reader.entries()[i];
    text += (i == 0 ? "\n" : ",\n") + std::string("{\"offset\":") + std::to_string(entry.offset) +
            ",\"bytes\":" + std::to_string(entry.bytes) + ",\"count\":" + std::to_string(entry.count) +
            ",\"first_tick\":" + std::to_string(entry.first_tick) +
            ",\"last_tick\":" + std::to_string(entry.last_tick) +
            ",\"readable\":" + (reader.samples(i).ok() ? "true}" : "false}");
  }
  return text + "\n]}\n";
}

// compares with the file, or writes it
void expectFile(const fs::path& path, ByteView bytes) {
  if (writing()) {
    ASSERT_TRUE(writeFileAtomically(path, bytes).ok());
    return;
  }
  const auto stored = readWholeFile(path);
  ASSERT_TRUE(stored.ok()) << stored.error().message;
  EXPECT_TRUE(*stored == textOf(bytes)) << path << " differs: the format changed, or a reader's view of it";
}

TEST(Golden, chunksEncodeToTheStoredBytesAndDecodeToTheirTwins) {
  for (const GoldenChunk& golden : goldenChunks()) {
    SCOPED_TRACE(golden.name);
    const fs::path path = goldenFolder() / (std::string(golden.name) + ".chunk");
    expectFile(path, encodeChunk(golden.resolution, golden.samples, golden.cut_memory, golden.paths));
    const auto stored = readWholeFile(path);
    ASSERT_TRUE(stored.ok());
    const auto info = inspectChunk(viewOf(*stored));
    const auto samples = decodeChunk(viewOf(*stored));
    ASSERT_TRUE(info.ok());
    ASSERT_TRUE(samples.ok());
    EXPECT_TRUE(checkChunk(viewOf(*stored)).ok()) << "what every version wrote passes";
    const std::string twin =
        twinOf(*info, *samples, cutsIn(cutMemoryOf(viewOf(*stored))), pathsIn(pathListOf(viewOf(*stored))));
    expectFile(goldenFolder() / (std::string(golden.name) + ".chunk.json"), viewOf(twin));
  }
}

TEST(Golden, recordingsAreWrittenAsStoredAndSeenAsTheirTwinsSay) {
  // a complete file, the same cut off within its third chunk, and the same with a changed byte in its second
  // chunk
  const test::TempFolder folder;
  const fs::path made = folder.path() / "made.rec";
  auto writer = RecordingWriter::create(made, R"({"session":"golden","exercise":"made"})");
  ASSERT_TRUE(writer.ok());
  for (int variant = 1; variant <= 3; ++variant)
    ASSERT_TRUE(writer->append(encodeChunk(Resolution::standard(), madeSamples(10, variant))).ok());
  ASSERT_TRUE(writer->finish().ok());
  const std::string complete = *readWholeFile(made);
  const auto entries = RecordingReader::open(made)->entries();

  std::string damaged = complete;
  damaged[entries[1].offset + 100] ^= 1;
  const std::pair<const char*, std::string> files[] = {
      {"complete", complete}, {"cut", complete.substr(0, entries[2].offset + 50)}, {"damaged", damaged}};
  for (const auto& [name, bytes] : files) {
    SCOPED_TRACE(name);
    const fs::path path = goldenFolder() / (std::string(name) + ".rec");
    expectFile(path, viewOf(bytes));
    const auto reader = RecordingReader::open(path);
    ASSERT_TRUE(reader.ok());
    const std::string twin = twinOf(*reader);
    expectFile(goldenFolder() / (std::string(name) + ".rec.json"), viewOf(twin));
  }
}

}  // namespace
}  // namespace needlelab
