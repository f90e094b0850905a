#include "common/scoring/strokes.h"

#include <algorithm>
#include <cmath>

#include "common/scoring/syringe_events.h"
#include "common/scoring/track.h"

namespace needlelab {
namespace {

constexpr double kBin_s = 0.01;

/// The plunger over 10 ms. Bins without samples do not exist.
struct Bin {
  std::size_t first = 0, last = 0;  // samples
  double begin_s = 0, end_s = 0;    // of these samples
  double plunger = 0;
};

std::vector<Bin> binsOf(std::span<const GestureSample> samples, double rate_hz) {
  std::vector<Bin> bins;
  double sum = 0;
  std::int64_t number = -1;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (!hasPlunger(samples[i])) continue;
    const double t = secondsBetween(samples.front(), samples[i], rate_hz);
    // a little on, so that a tick on a bin's edge is not moved by rounding
    const auto of = static_cast<std::int64_t>(std::floor(t / kBin_s + 1e-6));
    if (of != number) {
      number = of;
      bins.push_back({i, i, t, t, 0});
      sum = 0;
    }
    Bin& bin = bins.back();
    sum += samples[i].plunger;
    bin.last = i;
    bin.end_s = t;
    bin.plunger = sum / static_cast<double>(bin.last - bin.first + 1);
  }
  return bins;
}

/// A stroke in bins.
struct Move {
  std::size_t first = 0, last = 0;
  double from = 0, to = 0;
};

double signOf(double value) {
  return value < 0 ? -1 : 1;
}

/// Follows the plunger from bin to bin: at rest about a level, or moving in one direction.
class Follower {
 public:
  explicit Follower(const std::vector<Bin>& bins) : bins_(bins) { rest(0); }

  std::vector<Move> run() {
    for (std::size_t i = 1; i < bins_.size(); ++i) {
      if (moving_)
        goOn(i);
      else if (std::abs(bins_[i].plunger - from_) > kBand)
        start(began_, from_, i);
    }
    if (moving_) finish();
    return std::move(moves_);
  }

 private:
  void rest(std::size_t i) {
    moving_ = false;
    began_ = i;
    from_ = bins_[i].plunger;
  }

  void start(std::size_t first, double from, std::size_t i) {
    moving_ = true;
    began_ = first;
    from_ = from;
    extreme_ = marked_ = bins_[i].plunger;
    at_ = marked_at_ = i;
    sign_ = signOf(extreme_ - from);
  }

  void goOn(std::size_t i) {
    const double now = bins_[i].plunger;
    if (sign_ * (now - extreme_) > 0) {
      extreme_ = now;
      at_ = i;
    }
    if (sign_ * (now - marked_) >= kBand) {
      marked_ = now;
      marked_at_ = i;
    }
    if (sign_ * (extreme_ - now) >= kTurnBack) {
      // it turned: the next movement begins at the turning point
      const std::size_t turn = at_;
      const double level = extreme_;
      finish();
      start(turn, level, i);
    } else if (marked_at_ != i && bins_[i].begin_s - bins_[marked_at_].end_s >= kPause_s) {
      finish();
      rest(i);
    }
  }

  void finish() { moves_.push_back({began_, at_, from_, extreme_}); }

  const std::vector<Bin>& bins_;
  std::vector<Move> moves_;
  bool moving_ = false;
  std::size_t began_ = 0;  // of the movement: the bin at its start; of a rest: its first bin
  double from_ = 0;        // where the movement began; of a rest: its level
  double sign_ = 1;
  double extreme_ = 0, marked_ = 0;  // furthest so far; the level of the last progress by a band
  std::size_t at_ = 0, marked_at_ = 0;
};

/// The stroke's own time: from the last bin at the one end to the first bin at the other. `move` begins with
/// the rest before it.
void trim(const std::vector<Bin>& bins, Move& move) {
  const double sign = signOf(move.to - move.from), slack = 0.5 * kBand;
  std::size_t end = move.first;
  while (end < move.last && sign * (move.to - bins[end].plunger) > slack) ++end;
  std::size_t begin = end;
  while (begin > move.first && sign * (bins[begin].plunger - move.from) > slack) --begin;
  move.first = begin;
  move.last = end;
}

}  // namespace

std::vector<Stroke> strokesOf(std::span<const GestureSample> samples, double rate_hz) {
  const std::vector<Bin> bins = binsOf(samples, rate_hz);
  if (bins.empty()) return {};
  std::vector<Move> joined;
  for (Move& move : Follower(bins).run()) {
    trim(bins, move);
    // the same way again after a short rest: one stroke
    if (!joined.empty()) {
      Move& before = joined.back();
      const bool same_way = signOf(before.to - before.from) == signOf(move.to - move.from);
      const double rest_s = bins[move.first].begin_s - bins[before.last].end_s;
      if (same_way && rest_s < kPause_s && std::abs(move.from - before.to) < kTurnBack) {
        before.last = move.last;
        before.to = move.to;
        continue;
      }
    }
    joined.push_back(move);
  }
  std::vector<Stroke> strokes;
  for (const Move& move : joined) {
    // rounding of the stored plunger must not decide on a stroke of exactly that length
    if (std::abs(move.to - move.from) < kLeastStroke - 1e-4) continue;
    strokes.push_back({bins[move.first].last, bins[move.last].last, move.from, move.to});
  }
  return strokes;
}

}  // namespace needlelab
