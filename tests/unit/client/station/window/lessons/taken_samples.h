/// The samples of the pieces that a window takes, one after the other.
#pragma once

#include <vector>

#include "client/station/window/lessons/lesson_board.h"

namespace needlelab::test {

/// Appends them; returns how many were dropped before them.
inline std::uint64_t takeSamples(LessonBoard& board, std::uint64_t lesson,
                                 std::vector<GestureSample>& samples) {
  std::vector<LessonBoard::Taken> pieces;
  const std::uint64_t dropped = board.takePieces(lesson, pieces);
  for (const LessonBoard::Taken& piece : pieces)
    samples.insert(samples.end(), piece.samples->begin(), piece.samples->end());
  return dropped;
}

}  // namespace needlelab::test
