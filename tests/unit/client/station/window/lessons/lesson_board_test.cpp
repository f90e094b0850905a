// The communication between the station's threads and the window; the window blocks no thread.
#include <gtest/gtest.h>

#include <atomic>
#include <thread>
#include <utility>

#include "client/station/window/lessons/lesson_board.h"
#include "tests/support/time/fake_time.h"
#include "tests/unit/client/station/window/lessons/taken_samples.h"

namespace needlelab {
namespace {

using test::takeSamples;

using namespace std::chrono_literals;

std::shared_ptr<const LessonBeginning> someLesson(AidList aids = usualAids()) {
  auto beginning = std::make_shared<LessonBeginning>();
  pb::Exercise exercise;
  *exercise.mutable_aids()->mutable_allowed() = aids;
  beginning->lesson.exercise = exercise;
  return beginning;
}

SamplePiece pieceFrom(std::uint64_t first_tick, std::uint64_t count = 20) {
  std::vector<GestureSample> samples(count);
  for (std::uint64_t i = 0; i < count; ++i) samples[i].tick = first_tick + i;
  SamplePiece piece;
  piece.last = samples.back();
  piece.samples = std::make_shared<const std::vector<GestureSample>>(std::move(samples));
  return piece;
}

TEST(LessonBoard, theWindowSeesEachChangeOnce) {
  LessonBoard board;
  BoardState state;
  std::uint64_t seen = 0;
  EXPECT_TRUE(board.look(state, seen));
  EXPECT_EQ(state.stage, Stage::kOpening);
  EXPECT_FALSE(board.look(state, seen));
  board.change([](BoardState& s) { s.stage = Stage::kStart; });
  EXPECT_TRUE(board.look(state, seen));
  EXPECT_EQ(state.stage, Stage::kStart);
}

TEST(LessonBoard, samplesComeInOrderAndOnce) {
  LessonBoard board;
  board.began(someLesson());
  board.piece(pieceFrom(0));
  board.piece(pieceFrom(20));
  std::vector<GestureSample> samples;
  EXPECT_EQ(takeSamples(board, 1, samples), 0u);
  ASSERT_EQ(samples.size(), 40u);
  for (std::uint64_t i = 0; i < 40; ++i) EXPECT_EQ(samples[i].tick, i);
  EXPECT_EQ(takeSamples(board, 1, samples), 0u);
  EXPECT_EQ(samples.size(), 40u);
}

TEST(LessonBoard, aStalledWindowLosesTheOldestSamplesAndLearnsHowMany) {
  LessonBoard board(10);
  board.began(someLesson());
  for (std::uint64_t i = 0; i < 25; ++i) board.piece(pieceFrom(20 * i));
  std::vector<GestureSample> samples;
  EXPECT_EQ(takeSamples(board, 1, samples), 15u * 20u);
  ASSERT_EQ(samples.size(), 200u);
  EXPECT_EQ(samples.front().tick, 300u);
  EXPECT_EQ(board.droppedBatches(), 15u);
  samples.clear();
  EXPECT_EQ(takeSamples(board, 1, samples), 0u) << "said once";
}

TEST(LessonBoard, givesThePieceWithTheMemoryOfTheCutThatCameWithIt) {
  LessonBoard board(10);
  board.began(someLesson());
  for (std::uint8_t i = 0; i < 25; ++i) {
    SamplePiece piece = pieceFrom(std::uint64_t{20} * i);
    if (i % 8 == 1) piece.cut_memory = {i};
    board.piece(piece);
  }
  std::vector<LessonBoard::Taken> pieces;
  board.takePieces(1, pieces);
  ASSERT_EQ(pieces.size(), 10U);
  for (std::size_t i = 0; i < 10; ++i) EXPECT_EQ(pieces[i].cut_memory, i == 2 ? Bytes{17} : Bytes{}) << i;
}

TEST(LessonBoard, givesEachPieceItsOwnPaths) {
  LessonBoard board(10);
  board.began(someLesson());
  for (std::uint8_t i = 0; i < 25; ++i) {
    SamplePiece piece = pieceFrom(std::uint64_t{20} * i);
    if (i % 4 == 0) piece.paths = {i, 1};
    board.piece(piece);
  }
  std::vector<LessonBoard::Taken> pieces;
  board.takePieces(1, pieces);
  ASSERT_EQ(pieces.size(), 10U) << "the last ten";
  for (std::uint8_t i = 0; i < 10; ++i)
    EXPECT_EQ(pieces[i].paths, (i + 15) % 4 == 0 ? (Bytes{static_cast<std::uint8_t>(i + 15), 1}) : Bytes{});
  board.takePieces(1, pieces);
  EXPECT_TRUE(pieces.empty());
}

TEST(LessonBoard, samplesOfTheLessonBeforeAreNotTakenForThisOne) {
  LessonBoard board;
  board.began(someLesson());
  board.piece(pieceFrom(0));
  board.began(someLesson());
  board.piece(pieceFrom(500));
  std::vector<GestureSample> samples;
  EXPECT_EQ(takeSamples(board, 2, samples), 0u);
  ASSERT_EQ(samples.size(), 20u);
  EXPECT_EQ(samples.front().tick, 500u);
}

TEST(LessonBoard, onlyTheNewestRequestIsTakenAndOnlyOnce) {
  LessonBoard board;
  EXPECT_EQ(board.waitForRequest(0ms).kind, BoardRequest::Kind::kNothing);
  board.ask({BoardRequest::Kind::kStart, {}});
  board.ask({BoardRequest::Kind::kBegin, {"tom", "knee", false}});
  EXPECT_TRUE(board.requestWaits());
  const BoardRequest request = board.waitForRequest(0ms);
  EXPECT_EQ(request.kind, BoardRequest::Kind::kBegin);
  EXPECT_EQ(request.choice.trainee, "tom");
  EXPECT_EQ(board.waitForRequest(0ms).kind, BoardRequest::Kind::kNothing);
}

TEST(LessonBoard, aCodeIsConsumedWithItsRequest) {
  LessonBoard board;
  board.ask({BoardRequest::Kind::kBegin, {"tom", "ball", false}, "4711"});
  EXPECT_EQ(board.waitForRequest(0ms).code, "4711");
  board.ask({BoardRequest::Kind::kBegin, {"tom", "ball", false}});
  EXPECT_EQ(board.waitForRequest(0ms).code, "");
}

TEST(LessonBoard, withoutAWishTheWaitEndsWithItsPatience) {
  test::FakeTime time;
  LessonBoard board(500, time);
  const std::int64_t began_ns = time.nowNs();
  EXPECT_EQ(board.waitForRequest(100ms).kind, BoardRequest::Kind::kNothing);
  EXPECT_EQ(time.nowNs() - began_ns, 100'000'000);
  board.ask({BoardRequest::Kind::kStart, {}});
  EXPECT_EQ(board.waitForRequest(100ms).kind, BoardRequest::Kind::kStart);
  EXPECT_EQ(time.nowNs() - began_ns, 100'000'000) << "a wish is not waited for";
}

TEST(LessonBoard, whoQuitsIsNotOutshouted) {
  LessonBoard board;
  board.ask({BoardRequest::Kind::kQuit, {}});
  board.ask({BoardRequest::Kind::kBegin, {"tom", "knee", false}});
  EXPECT_EQ(board.waitForRequest(0ms).kind, BoardRequest::Kind::kQuit);
  EXPECT_EQ(board.waitForRequest(0ms).kind, BoardRequest::Kind::kQuit);
}

TEST(LessonBoard, whatTheWindowAsksByItselfTakesNoPersonsPlace) {
  using Kind = BoardRequest::Kind;
  LessonBoard board;
  board.ask({Kind::kTrainee, {"tom", "", false}});
  EXPECT_FALSE(board.requestWaits()) << "the lists are not given up for it";
  board.ask({Kind::kTrainee, {"zoe", "", false}});
  EXPECT_EQ(board.waitForRequest(0ms).choice.trainee, "zoe") << "the newest";
  board.ask({Kind::kTrainee, {"tom", "", false}});
  board.ask({Kind::kBegin, {"tom", "knee", false}});
  board.ask({Kind::kTrainee, {"zoe", "", false}});
  EXPECT_TRUE(board.requestWaits());
  EXPECT_EQ(board.waitForRequest(0ms).kind, Kind::kBegin);
  EXPECT_EQ(board.waitForRequest(0ms).kind, Kind::kNothing);
}

TEST(LessonBoard, instructorsWordsCarryWhoAndWhenAndNothingThatCommandsATerminal) {
  LessonBoard board;
  board.began(someLesson());
  LessonStatus status;
  status.time_s = 12.5;
  board.status(status);
  board.message("ines", "slower\x1b[2J");
  board.nextExercise("ines", "knee-recess");
  BoardState state;
  std::uint64_t seen = 0;
  ASSERT_TRUE(board.look(state, seen));
  ASSERT_EQ(state.messages.size(), 1u);
  EXPECT_EQ(state.messages[0].from, "ines");
  EXPECT_EQ(state.messages[0].text, "slower?[2J");
  EXPECT_EQ(state.messages[0].lesson_s, 12.5);
  EXPECT_GT(state.messages[0].unix_ns, 0);
  ASSERT_TRUE(state.next);
  EXPECT_EQ(state.next->exercise, "knee-recess");
  for (int i = 0; i < 100; ++i) board.message("ines", std::to_string(i));
  ASSERT_TRUE(board.look(state, seen));
  EXPECT_EQ(state.messages.size(), 50u);
  EXPECT_EQ(state.messages.back().text, "99");
}

TEST(LessonBoard, theNextExerciseIsPreselectedOrWaitsForTheLessonsEnd) {
  LessonBoard board;
  BoardState state;
  std::uint64_t seen = 0;
  board.change([](BoardState& s) { s.stage = Stage::kStart; });
  board.nextExercise("ines", "knee-recess");
  ASSERT_TRUE(board.look(state, seen));
  EXPECT_EQ(state.choice.exercise, "knee-recess");
  board.began(someLesson());
  board.nextExercise("ines", "hip");
  ASSERT_TRUE(board.look(state, seen));
  EXPECT_EQ(state.choice.exercise, "knee-recess");
  EXPECT_EQ(state.next->exercise, "hip");
}

TEST(LessonBoard, instructorAidsHoldUntilWithdrawnOrTheLessonChanges) {
  AidList own;
  own.Add(pb::Exercise::DEPTH);
  LessonBoard board;
  board.began(someLesson(own));
  BoardState state;
  std::uint64_t seen = 0;
  ASSERT_TRUE(board.look(state, seen));
  EXPECT_EQ(aidsText(state.aids), "DEPTH");
  AidList chosen;
  chosen.Add(pb::Exercise::FORCE);
  board.aids({"ines", chosen, false});
  ASSERT_TRUE(board.look(state, seen));
  EXPECT_EQ(aidsText(state.aids), "FORCE");
  EXPECT_EQ(state.aids_by, "ines");
  board.aids({"ines", {}, true});
  ASSERT_TRUE(board.look(state, seen));
  EXPECT_EQ(aidsText(state.aids), "DEPTH");
  EXPECT_EQ(state.aids_by, "");
  board.aids({"ines", chosen, false});
  board.began(someLesson(own));
  ASSERT_TRUE(board.look(state, seen));
  EXPECT_EQ(aidsText(state.aids), "DEPTH");
}

TEST(LessonBoard, manyThreadsAtOnce) {
  LessonBoard board(50);
  board.began(someLesson());
  std::atomic<bool> stop{false};
  std::thread writer([&] {
    for (std::uint64_t i = 0; i < 400; ++i) board.piece(pieceFrom(20 * i));
    stop = true;
  });
  std::thread station([&] {
    while (!stop) {
      board.status({});
      static_cast<void>(board.waitForRequest(0ms));
    }
  });
  std::uint64_t seen = 0, got = 0, dropped = 0;
  BoardState state;
  std::vector<GestureSample> samples;
  const auto take = [&] {
    samples.clear();
    dropped += takeSamples(board, 1, samples);
    got += samples.size();
    board.look(state, seen);
    board.ask({BoardRequest::Kind::kLook, {}});
  };
  while (!stop) take();
  writer.join();
  station.join();
  take();
  EXPECT_EQ(got + dropped, 8000u);
}

}  // namespace
}  // namespace needlelab
