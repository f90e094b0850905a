/// The cost of encoding and decoding a second of gesture (goals: README.md). With --recordings (or --results
/// DIR) the table of those goals; without, Google Benchmark. Items are samples: `items_per_second` is their
/// rate, 1e9 divided by it the time of one.
#include <benchmark/benchmark.h>

#include <string>
#include <string_view>

#include "common/base/bytes.h"
#include "common/gesture/chunk.h"
#include "tests/bench/codec_record.h"
#include "tests/unit/common/gesture/gesture_samples.h"
#include "tests/unit/common/gesture/recorded_gestures.h"

namespace needlelab {
namespace {

constexpr std::size_t kChunkSamples = 1000;

// the recordings if available, otherwise a synthetic gesture; cut into chunks of one second
const std::vector<std::vector<GestureSample>>& chunksOfSamples() {
  static const auto chunks = [] {
    std::vector<std::vector<GestureSample>> parts;
    const auto cut = [&](const std::vector<GestureSample>& samples) {
      for (std::size_t at = 0; at + kChunkSamples <= samples.size(); at += kChunkSamples)
        parts.emplace_back(samples.begin() + static_cast<std::ptrdiff_t>(at),
                           samples.begin() + static_cast<std::ptrdiff_t>(at + kChunkSamples));
    };
    for (const auto& gesture : test::recordedGestures({test::realRecordingsFolder(), true}))
      cut(gesture.samples);
    if (parts.empty()) cut(test::smoothGesture(40 * kChunkSamples));
    return parts;
  }();
  return chunks;
}

void finish(benchmark::State& state, std::size_t bytes) {
  const auto samples = state.iterations() * static_cast<std::int64_t>(kChunkSamples);
  state.SetItemsProcessed(samples);
  state.counters["time_per_sample"] = benchmark::Counter(
      static_cast<double>(samples), benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
  state.counters["bytes_per_sample"] = static_cast<double>(bytes) / static_cast<double>(samples);
}

void encode(benchmark::State& state, const Resolution& resolution) {
  std::size_t next = 0, bytes = 0;
  for (auto _ : state) {
    const Bytes chunk = encodeChunk(resolution, chunksOfSamples()[next++ % chunksOfSamples().size()]);
    bytes += chunk.size();
    benchmark::DoNotOptimize(chunk.data());
  }
  finish(state, bytes);
}

void decode(benchmark::State& state, const Resolution& resolution) {
  std::vector<Bytes> chunks;
  for (const auto& samples : chunksOfSamples()) chunks.push_back(encodeChunk(resolution, samples));
  std::size_t next = 0, bytes = 0;
  for (auto _ : state) {
    const Bytes& chunk = chunks[next++ % chunks.size()];
    const auto samples = decodeChunk(chunk);
    bytes += chunk.size();
    benchmark::DoNotOptimize(samples.value().data());
  }
  finish(state, bytes);
}

// what the server does with each chunk before it acknowledges it
void check(benchmark::State& state, const Resolution& resolution) {
  std::vector<Bytes> chunks;
  for (const auto& samples : chunksOfSamples()) chunks.push_back(encodeChunk(resolution, samples));
  std::size_t next = 0, bytes = 0;
  for (auto _ : state) {
    const Bytes& chunk = chunks[next++ % chunks.size()];
    bytes += chunk.size();
    benchmark::DoNotOptimize(checkChunk(chunk).ok());
  }
  finish(state, bytes);
}

// the most samples that a chunk claims, in the fewest bytes: the dearest byte that a hostile station can send
void checkAtRest(benchmark::State& state) {
  std::vector<GestureSample> samples(kMaxChunkSamples);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i].tick = i;
    samples[i].time_ns = static_cast<std::int64_t>(i) * 1'000'000;
  }
  const Bytes chunk = encodeChunk(Resolution::standard(), samples);
  for (auto _ : state) benchmark::DoNotOptimize(checkChunk(chunk).ok());
  state.counters["chunk_bytes"] = static_cast<double>(chunk.size());
}

void inspect(benchmark::State& state) {
  const Bytes chunk = encodeChunk(Resolution::standard(), chunksOfSamples().front());
  for (auto _ : state) benchmark::DoNotOptimize(inspectChunk(chunk).ok());
  finish(state, 0);
}

void hash(benchmark::State& state) {
  const Bytes chunk = encodeChunk(Resolution::standard(), chunksOfSamples().front());
  SessionHash session;
  for (auto _ : state) session.update(chunk);
  benchmark::DoNotOptimize(session.digest());
  finish(state, 0);
}

BENCHMARK_CAPTURE(encode, standard, Resolution::standard());
BENCHMARK_CAPTURE(decode, standard, Resolution::standard());
BENCHMARK_CAPTURE(encode, lossless, Resolution::lossless());
BENCHMARK_CAPTURE(decode, lossless, Resolution::lossless());
BENCHMARK_CAPTURE(check, standard, Resolution::standard());
BENCHMARK_CAPTURE(check, lossless, Resolution::lossless());
BENCHMARK(checkAtRest);
BENCHMARK(inspect);
BENCHMARK(hash);

}  // namespace
}  // namespace needlelab

// --results DIR and --commit TEXT: the table of goals, recording by recording; else Google Benchmark
int main(int argc, char** argv) {
  std::string results, commit;
  for (int i = 1; i + 1 < argc; ++i) {
    if (std::string_view(argv[i]) == "--results") results = argv[i + 1];
    if (std::string_view(argv[i]) == "--commit") commit = argv[i + 1];
  }
  if (!results.empty() || (argc > 1 && std::string_view(argv[1]) == "--recordings"))
    return needlelab::test::recordCodec(results, commit);
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
