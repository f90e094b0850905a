// Plots and downloads are made in steps of bounded work and memory, whatever a recording's chunks hold.
// web_lessons_test.cpp tests their content.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "common/base/text/uuid.h"
#include "common/gesture/chunk.h"
#include "server/web/routes.h"
#include "server/web/session_views.h"
#include "tests/unit/server/web/web_lab.h"

namespace needlelab {
namespace {

using test::FakeSession;
using test::WebLab;

WebRoute csvRoute() {
  WebRoute route;
  route.format = formatsAt(ExportPlace::kWebSamples).front();
  return route;
}

/// Samples of a motionless hand at 1 kHz, from a given tick and time: a whole chunk of them is some 8 KiB.
Bytes stillChunk(std::size_t count, std::uint64_t first_tick, std::int64_t first_time_ns) {
  std::vector<GestureSample> samples(count);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i].tick = first_tick + i;
    samples[i].time_ns = first_time_ns + static_cast<std::int64_t>(i) * 1'000'000;
  }
  return encodeChunk(Resolution::standard(), samples);
}

/// Adds a session of tina's in these chunks, with this many samples in total. Returns its id as text.
std::string recordedIn(WebLab& lab, const std::vector<Bytes>& chunks, std::uint64_t samples) {
  pb::Login login;
  login.mutable_station()->set_station("bench");
  login.mutable_station()->set_key(lab.stationKey());
  auto station = lab.server().connect(login);
  if (!station.ok()) throw std::runtime_error(station.error().message);
  const FakeSession session("bench");
  (void)station->send(session.open());
  (void)test::waitFor(*station, [](const pb::Envelope& e) { return e.has_session_opened(); });
  SessionHash hash;
  for (std::size_t seq = 0; seq < chunks.size(); ++seq) {
    hash.update(chunks[seq]);
    pb::Envelope envelope;
    envelope.mutable_chunk()->set_session_id(session.id());
    envelope.mutable_chunk()->set_seq(seq);
    envelope.mutable_chunk()->set_data(chunks[seq].data(), chunks[seq].size());
    (void)station->send(envelope);
  }
  session.waitForAck(*station, chunks.size());
  const Digest digest = hash.digest();
  pb::Envelope close = session.close(0);
  close.mutable_close_session()->set_chunks(chunks.size());
  close.mutable_close_session()->set_samples(samples);
  close.mutable_close_session()->set_hash(digest.data(), digest.size());
  (void)station->send(close);
  (void)test::waitFor(*station, [](const pb::Envelope& e) { return e.has_session_closed(); });
  Uuid id;
  std::copy(session.id().begin(), session.id().end(), id.begin());
  return uuidText(id);
}

/// The same in this many chunks of maximum length, one after the other.
std::string recordedInLongChunks(WebLab& lab, std::uint64_t count) {
  std::vector<Bytes> chunks;
  for (std::uint64_t seq = 0; seq < count; ++seq) {
    const std::uint64_t first = seq * kMaxChunkSamples;
    chunks.push_back(stillChunk(kMaxChunkSamples, first, static_cast<std::int64_t>(first) * 1'000'000));
  }
  return recordedIn(lab, chunks, count * kMaxChunkSamples);
}

/// A recording of 8 chunks whose times go back. The search for 500 s reads chunks 7, 3 and 1, which are one
/// sample each at 1000 s, and so ends at chunk 0; the 5 others last 65.5 s from 0 s on.
std::string recordedBackInTime(WebLab& lab) {
  constexpr std::int64_t kLate_ns = 1'000'000'000'000;
  std::vector<Bytes> chunks;
  std::uint64_t samples = 0;
  for (const bool is_late : {false, true, false, true, false, false, false, true}) {
    const std::size_t count = is_late ? 1 : kMaxChunkSamples;
    chunks.push_back(stillChunk(count, samples, is_late ? kLate_ns : 0));
    samples += count;
  }
  return recordedIn(lab, chunks, samples);
}

WebCall callOf(const std::string& session) {
  WebCall call;
  call.parts = {session};
  call.who = {"ines", pb::INSTRUCTOR};
  return call;
}

/// The number of steps until the plot is complete; sets `plot`.
std::size_t stepsOf(WebLab& lab, const std::string& session, WebJson& plot) {
  const auto steps = samplePlot(lab.server().service(), callOf(session));
  if (!steps.ok()) throw std::runtime_error(steps.error().message);
  for (std::size_t n = 1;; ++n) {
    auto done = steps->step();
    if (!done.ok()) throw std::runtime_error(done.error().message);
    if (!*done) continue;
    plot = std::move(**done);
    return n;
  }
}

TEST(SessionViews, aPlotStepDecodesOneLongestChunk) {
  WebLab lab;
  constexpr std::uint64_t kChunks = 5;
  const std::string id = recordedInLongChunks(lab, kChunks);
  WebJson plot;
  EXPECT_EQ(stepsOf(lab, id, plot), kChunks * kMaxChunkSamples / kMaxStepSamples);
  EXPECT_EQ(plot["samples"], kChunks * kMaxChunkSamples);
  EXPECT_EQ(plot["columns"]["t_s"].size(), 2000u);
  EXPECT_NEAR(plot["to_s"].get<double>(), (kChunks * kMaxChunkSamples - 1) * 1e-3, 1e-9);
}

TEST(SessionViews, aPlotStepReadsABoundedNumberOfChunks) {
  WebLab lab;
  const std::string id = lab.recorded(2 * kMaxStepChunks + 1);
  WebJson plot;
  EXPECT_EQ(stepsOf(lab, id, plot), 3u);
  EXPECT_EQ(plot["samples"], (2 * kMaxStepChunks + 1) * 100);
  EXPECT_EQ(plot["columns"]["t_s"].size(), 2000u);
}

TEST(SessionViews, aPlotWithoutChunksIsThereAfterOneStep) {
  WebLab lab;
  WebJson plot;
  EXPECT_EQ(stepsOf(lab, lab.recorded(0), plot), 1u);
  EXPECT_EQ(plot["columns"]["t_s"].size(), 0u);
}

TEST(SessionViews, aCsvPieceHasABoundOfRows) {
  WebLab lab;
  constexpr std::uint64_t kChunks = 2;
  const std::string id = recordedInLongChunks(lab, kChunks);
  const auto stream = sampleStream(lab.server().service(), csvRoute(), callOf(id));
  ASSERT_TRUE(stream.ok()) << stream.error().message;
  std::string csv;
  std::size_t pieces = 0;
  for (;;) {
    const auto next = stream->next();
    ASSERT_TRUE(next.ok()) << next.error().message;
    const WebPiece& piece = next.value();
    ASSERT_TRUE(piece.has_value());
    if (piece->empty()) break;
    const auto lines = static_cast<std::size_t>(std::count(piece->begin(), piece->end(), '\n'));
    EXPECT_EQ(lines, kMaxPieceRows + (pieces == 0 ? 1 : 0))
        << "piece " << pieces << ", the first has the header";
    ++pieces;
    csv += *piece;
  }
  EXPECT_EQ(pieces, kChunks * kMaxChunkSamples / kMaxPieceRows);
  // no row twice, none omitted: the last sample's tick is the number of rows minus one
  const std::string last = csv.substr(csv.rfind('\n', csv.size() - 2) + 1);
  EXPECT_EQ(last.substr(last.find(',') + 1).substr(0, 7), "131071,");
}

TEST(SessionViews, aCsvPieceDecodesOneLongestChunkEvenWithoutRows) {
  WebLab lab;
  WebCall call = callOf(recordedBackInTime(lab));
  call.target.query["from_s"] = "500";
  const auto stream = sampleStream(lab.server().service(), csvRoute(), call);
  ASSERT_TRUE(stream.ok()) << stream.error().message;
  // lines of each piece, the header first; -1: no text yet
  std::vector<int> pieces;
  for (;;) {
    const auto piece = stream->next();
    ASSERT_TRUE(piece.ok()) << piece.error().message;
    const WebPiece& text = piece.value();
    if (text && text->empty()) break;
    pieces.push_back(text ? static_cast<int>(std::count(text->begin(), text->end(), '\n')) : -1);
  }
  // each piece ends after the long chunk in 0 | 1, 2 | 3, 4 | 5 | 6 | 7
  EXPECT_EQ(pieces, (std::vector<int>{1, 1, 1, -1, -1, 1}));
}

TEST(SessionViews, aDownloadGoesOnAfterAPieceWithoutText) {
  WebLab lab;
  const std::string id = recordedBackInTime(lab);
  auto ines = lab.browserOf("ines");
  const auto csv = ines.get("/api/v1/sessions/" + id + "/samples.csv?from_s=500");
  EXPECT_EQ(csv.status, 200);
  EXPECT_EQ(std::count(csv.body.begin(), csv.body.end(), '\n'), 4) << "the header and the 3 late samples";
}

}  // namespace
}  // namespace needlelab
