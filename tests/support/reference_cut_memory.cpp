#include "tests/support/reference_cut_memory.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "tests/support/reference_engine.h"

namespace needlelab::test {
namespace {

constexpr std::size_t kTracks = 16;
constexpr double kBeyond_m = 1e-6;

Vec3 q(const CutTick& tick, double s) {
  return tick.p_entry_W_m + tick.u_W * s;  // Q(s) = P0 + u·s
}

Vec3 acrossOf(Vec3 arm, Vec3 u) {
  return arm - u * dot(arm, u);
}

// x_c = min(x, s of all intact membranes already met)
double cutPosition(const CutTick& tick) {
  double x_c = tick.x;
  for (const auto& membrane : tick.membranes)
    if (membrane.met && !membrane.open) x_c = std::min(x_c, membrane.place);
  return x_c;
}

}  // namespace

double ReferenceCutMemory::distanceTo(const Track& track, Vec3 point) const {
  return norm(acrossOf(point - track.p_entry_W_m, track.u_W));
}

// "the way along u to that track's end, or to where u leaves it"
double ReferenceCutMemory::wayWithin(const Track& track, Vec3 point, Vec3 u) const {
  const Vec3 arm = point - track.p_entry_W_m;
  const double to_end = (track.length - dot(arm, track.u_W)) / dot(u, track.u_W);
  const Vec3 a = acrossOf(arm, track.u_W), b = acrossOf(u, track.u_W);
  // |a + b·t| = r
  double to_side = std::numeric_limits<double>::infinity();
  if (normSquared(b) > 0) {
    const double half = dot(a, b) / normSquared(b);
    const double rest = (normSquared(a) - radius_m_ * radius_m_) / normSquared(b);
    to_side = -half + std::sqrt(std::max(0.0, half * half - rest));
  }
  return std::min(to_end, to_side);
}

// the greatest of the ends of other tracks within r of Q(w)
std::optional<double> ReferenceCutMemory::endOfOthers(const CutTick& tick) const {
  std::optional<double> end;
  const Vec3 at = q(tick, tick.wall);
  for (std::size_t i = 0; i < tracks_.size(); ++i) {
    if (own_ == i || distanceTo(tracks_[i], at) > radius_m_) continue;
    const double this_end = tick.wall + wayWithin(tracks_[i], at, tick.u_W);
    if (!end || this_end > *end) end = this_end;
  }
  return end;
}

ReferenceCutMemory::Track& ReferenceCutMemory::makeTrack(const CutTick& tick) {
  // "it takes the place of a track that it makes longer (that track's line passes within r of P0 and of Q(w),
  // and ends before it), else the oldest's"
  const Vec3 at = q(tick, tick.wall);
  for (std::size_t i = 0; i < tracks_.size(); ++i) {
    const Track& track = tracks_[i];
    if (distanceTo(track, tick.p_entry_W_m) > radius_m_ || distanceTo(track, at) > radius_m_) continue;
    if (track.length >= dot(at - track.p_entry_W_m, track.u_W)) continue;
    own_ = i;
    return tracks_[i] = {};
  }
  if (tracks_.size() == kTracks) tracks_.erase(tracks_.begin());
  own_ = tracks_.size();
  return tracks_.emplace_back();
}

// 1. Tracks
void ReferenceCutMemory::keepTrack(const CutTick& tick) {
  if (!own_) {
    const double cut_to = std::max(0.0, endOfOthers(tick).value_or(0.0));
    if (!(tick.wall > cut_to + kBeyond_m) && !tick.ruptured) return;
    makeTrack(tick);
  } else {
    tracks_[*own_].length += tick.turned_by;  // "turns with it"
  }
  Track& own = tracks_[*own_];
  own.p_entry_W_m = tick.p_entry_W_m;
  own.u_W = tick.u_W;
  own.length = std::max(own.length, tick.wall);
  own.open.assign(tick.membranes.size(), false);
  for (std::size_t i = 0; i < tick.membranes.size(); ++i) own.open[i] = tick.membranes[i].open;
}

ReferenceCutMemory::Released ReferenceCutMemory::step(CutTick& tick) {
  Released released;
  if (tick.entry) held_.assign(tick.membranes.size(), false);
  keepTrack(tick);

  // 2. Membranes
  for (std::size_t i = 0; i < tick.membranes.size(); ++i) {
    auto& membrane = tick.membranes[i];
    if (!membrane.met || membrane.open) continue;
    for (const Track& track : tracks_)
      if (track.open[i] && distanceTo(track, q(tick, membrane.place)) <= radius_m_) membrane.open = true;
    if (membrane.open && held_[i]) released.membrane = true;
  }
  const double x_c = cutPosition(tick);  // "w and w_f follow x_c"
  tick.wall += x_c - tick.x_c;
  tick.friction_wall += x_c - tick.x_c;
  tick.x_c = x_c;

  // 3. End of the cut
  std::optional<double> end = endOfOthers(tick);
  if (own_) end = std::max(end.value_or(tracks_[*own_].length), tracks_[*own_].length);

  // 4. Wall
  if (end) {
    const double moved = std::max(tick.wall, std::min(x_c - share_ * tick.cut_reach, *end)) - tick.wall;
    tick.wall += moved;
    const double further = moved - (tick.x - tick.x_before);
    released.wall = moved > 0 && further > 0;
    released.undecided = std::abs(further) < 1e-12;
  }

  for (std::size_t i = 0; i < tick.membranes.size(); ++i)
    held_[i] = tick.membranes[i].met && !tick.membranes[i].open && tick.x > tick.membranes[i].place;
  return released;
}

void ReferenceCutMemory::exit() {
  own_.reset();
  held_.clear();
}

}  // namespace needlelab::test
