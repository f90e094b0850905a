#include "tests/bench/codec_record.h"

#include <fmt/core.h>

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <random>
#include <sstream>
#include <vector>

#include "common/base/files/files.h"
#include "common/base/program.h"
#include "common/gesture/chunk.h"
#include "tests/bench/result_folder.h"
#include "tests/unit/common/gesture/recorded_gestures.h"

namespace needlelab::test {
namespace {

constexpr double kBytesGoal = 8, kEncodeGoalNs = 100, kDecodeGoalNs = 50;
constexpr std::size_t kChunkSamples = 1000;  // a second, as the station cuts
constexpr int kPasses = 41;

using Samples = std::vector<GestureSample>;

// this thread's processor time: other programs disturb it less
double nowNs() {
  timespec t{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e9 * static_cast<double>(t.tv_sec) + static_cast<double>(t.tv_nsec);
}

// times of device and engine, and wake-ups late by 0-20 µs, as in a station's loop
Samples withClocks(Samples samples) {
  std::mt19937_64 random(1);
  for (GestureSample& s : samples) {
    s.device_ns = static_cast<std::int32_t>(8'000 + random() % 4'000);
    s.engine_ns = static_cast<std::int32_t>(30 + random() % 400);
    s.time_ns += static_cast<std::int64_t>((random() % 10'000) + (random() % 10'000));
  }
  return samples;
}

std::vector<Bytes> encodeAll(const Samples& samples) {
  std::vector<Bytes> chunks;
  for (std::size_t at = 0; at < samples.size(); at += kChunkSamples)
    chunks.push_back(
        encodeChunk(Resolution::standard(),
                    std::span(samples).subspan(at, std::min(kChunkSamples, samples.size() - at))));
  return chunks;
}

double bytesOf(const std::vector<Bytes>& chunks) {
  double bytes = 0;
  for (const Bytes& chunk : chunks) bytes += static_cast<double>(chunk.size());
  return bytes;
}

struct Figures {
  std::string name;
  double samples = 0, bytes = 0, clock_bytes = 0;  // per sample, the clock columns on their own
  double encode_ns = 0, decode_ns = 0;             // per sample, medians over the passes
};

double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
                   values.end());
  return values[values.size() / 2];
}

// encoding and decoding in turns, clock columns included, as in a station and a reader
Figures measure(const RecordedGesture& gesture) {
  const Samples samples = withClocks(gesture.samples);
  const auto count = static_cast<double>(samples.size());
  Figures figures{gesture.name, count, bytesOf(encodeAll(gesture.samples)) / count, 0, 0, 0};
  const std::vector<Bytes> chunks = encodeAll(samples);
  figures.clock_bytes = bytesOf(chunks) / count - figures.bytes;
  std::vector<double> encode, decode;
  std::size_t checked = 0;
  for (int pass = 0; pass < kPasses; ++pass) {
    const double begin = nowNs();
    checked += encodeAll(samples).size();
    const double middle = nowNs();
    for (const Bytes& chunk : chunks) checked += decodeChunk(chunk).value().size();
    const double end = nowNs();
    encode.push_back((middle - begin) / count);
    decode.push_back((end - middle) / count);
  }
  if (checked != static_cast<std::size_t>(kPasses) * (chunks.size() + samples.size()))
    std::printf("(samples are missing)\n");
  figures.encode_ns = median(encode);
  figures.decode_ns = median(decode);
  return figures;
}

bool met(const Figures& f) {
  return f.bytes <= kBytesGoal && f.encode_ns <= kEncodeGoalNs && f.decode_ns <= kDecodeGoalNs;
}

}  // namespace

int recordCodec(const std::filesystem::path& results, const std::string& commit) {
  const auto gestures = test::recordedGestures({test::realRecordingsFolder(), true});
  if (gestures.empty()) {
    std::fprintf(stderr, "codec_bench: no recordings in %s; set NEEDLELAB_DATA\n",
                 test::realRecordingsFolder().c_str());
    return 2;
  }
  std::ostringstream text;
  text << "# What a gesture takes\n\n"
       << machineText() << "; " << nowText() << (commit.empty() ? "" : "; commit " + commit) << ".\n\n"
       << "Written by `NEEDLELAB_DATA=… cmake --build build/release --target record_codec_bench`. The "
          "recordings of a real Virtuose at 1 kHz with the "
          "engine's forces, default resolution, chunks of 1000 samples. Bytes: all columns but those of "
          "clocks; beside them what the clocks take "
          "(due times that jitter by 0–20 µs, times of device and engine). Times: processor time per sample, "
          "all columns and the CRC in them, the "
          "median of "
       << kPasses << " passes, encoding and decoding in turns.\n\n"
       << "| recording | samples | bytes/sample (≤ 8) | clock columns | encode ns (≤ 100) | decode ns (≤ 50) "
          "| |\n"
       << "|---|---:|---:|---:|---:|---:|---|\n";
  bool all = true;
  for (const auto& gesture : gestures) {
    const Figures f = measure(gesture);
    all = all && met(f);
    std::printf(
        "%-22s %7.0f samples: %.2f bytes/sample (clock columns %.2f more), encode %.1f ns, decode %.1f ns: "
        "%s\n",
        f.name.c_str(), f.samples, f.bytes, f.clock_bytes, f.encode_ns, f.decode_ns,
        met(f) ? "PASS" : "FAIL");
    text << fmt::format("| {} | {:.0f} | {:.2f} | {:.2f} | {:.1f} | {:.1f} | {} |\n", f.name.c_str(),
                        f.samples, f.bytes, f.clock_bytes, f.encode_ns, f.decode_ns,
                        met(f) ? "PASS" : "**FAIL**");
  }
  if (!results.empty()) {
    const auto folder = results / folderName(machineText());
    std::error_code ignored;
    std::filesystem::create_directories(folder, ignored);
    const std::string out = text.str();
    if (const Status written = writeFileAtomically(folder / "codec.md", viewOf(out)); !written.ok()) {
      std::fprintf(stderr, "codec_bench: %s\n", written.error().message.c_str());
      return 2;
    }
    std::printf("written: %s\n", (folder / "codec.md").c_str());
  }
  return all ? 0 : 1;
}

}  // namespace needlelab::test
