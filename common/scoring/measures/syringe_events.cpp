#include "common/scoring/measures/syringe_events.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "common/haptics/scene_model.h"
#include "common/haptics/scene_spec.h"
#include "common/profile/layer_names.h"
#include "common/profile/scene_of_profile.h"
#include "common/profile/structure_kinds.h"
#include "common/scoring/anatomy/anatomy.h"
#include "common/scoring/anatomy/needle_way.h"
#include "common/scoring/measures/measure_table.h"

namespace needlelab {
namespace {

/// A movement in one direction, from sample `first` to sample `last` (indices).
struct Stroke {
  std::size_t first = 0, last = 0;
  double from = 0, to = 0;  ///< plunger at its ends, averaged over 10 ms
};

/// Whether the plunger of a sample is usable: `cleaned` does not check it.
bool hasPlunger(const GestureSample& sample) {
  return sample.plunger >= -0.01 && sample.plunger <= 1.01;
}

/// The parts of the profile that describe an event's place.
struct Surroundings {
  Anatomy anatomy;
  std::vector<std::string> tissues, layer_names;  // by layer
  double opening_behind_tip_m = 0;
};

Surroundings surroundingsOf(const pb::Profile& profile, const Pose& X_WL) {
  Surroundings all{
      anatomyOf(profile, X_WL), {}, layerNames(profile), openingBehindTip_m(needleOf(profile.needle()))};
  for (const LayerKind& layer : layerKinds(profile))
    all.tissues.push_back(pb::Layer::Tissue_Name(layer.tissue));
  return all;
}

NeedleWay wayToOpening(const Surroundings& around, const GestureSample& sample) {
  return wayOf(sample, around.opening_behind_tip_m);
}

bool isInTissue(const Surroundings& around, const GestureSample& sample, Vec3 opening_W_m) {
  return isInside(sample) && isUnderSkin(around.anatomy, opening_W_m);
}

pb::SyringePlace placeOf(const Surroundings& around, const GestureSample& sample) {
  const NeedleWay way = wayToOpening(around, sample);
  const Vec3 p = way.end();
  pb::SyringePlace place;
  place.set_x_m(p.x);
  place.set_y_m(p.y);
  place.set_z_m(p.z);
  place.set_depth_m(depthAt(around.anatomy, p));
  place.set_layer(-1);
  if (isInTissue(around, sample, p)) {
    place.set_in_tissue(true);
    place.set_insertion_m(std::max(0.0, sample.insertion_m - around.opening_behind_tip_m));
    if (const int layer = layerAt(around.anatomy, p); layer >= 0) {
      place.set_layer(layer);
      place.set_tissue(around.tissues[static_cast<std::size_t>(layer)]);
      place.set_layer_name(around.layer_names[static_cast<std::size_t>(layer)]);
    }
  }
  const Target* nearest = nullptr;
  for (const Target& target : around.anatomy.targets) {
    const double distance = distanceOn(around.anatomy, target, way);
    if (nearest != nullptr && distance >= place.target_distance_m()) continue;
    nearest = &target;
    place.set_target_distance_m(distance);
  }
  if (nearest != nullptr) place.set_target(nearest->ball.name);
  for (const Region& hazard : around.anatomy.hazards) {
    if (distanceTo(hazard, p) > 0) continue;
    place.set_hazard(hazard.name);
    break;
  }
  return place;
}

/// Shares of one stroke, weighted by the plunger's movement in each tick, and the hazards met. Takes the
/// stroke's samples in order.
class Shares {
 public:
  Shares(const Surroundings& around, const Stroke& stroke)
      : around_(&around),
        in_target_now_(around.anatomy),
        stroke_(stroke),
        next_(stroke.first),
        met_(around.anatomy.hazards.size(), false) {}

  /// Returns true when all samples are taken.
  bool step(const RecordedSamples& samples, StepWork& work) {
    const std::uint64_t cost = 1 + (around_->anatomy.targets.size() + met_.size()) / kRegionsAsASample;
    for (; next_ <= stroke_.last; ++next_) {
      if (work.isOver()) return false;
      work.spend(cost);
      add(samples, next_);
    }
    return true;
  }

  void put(pb::SyringeEvent& event) const {
    if (all_ > 0) {
      event.set_in_tissue_share(std::clamp(in_tissue_ / all_, 0.0, 1.0));
      event.set_in_target_share(std::clamp(in_target_ / all_, 0.0, 1.0));
    }
    std::size_t bytes = 0, more = 0;
    for (std::size_t h = 0; h < met_.size(); ++h) {
      if (!met_[h]) continue;
      const std::string& name = around_->anatomy.hazards[h].name;
      if (more > 0 || bytes + name.size() > kMaxEventHazardBytes) {
        ++more;
        continue;
      }
      bytes += name.size();
      event.add_hazards(name);
    }
    if (more > 0) event.add_hazards(fmt::format("and {} more", more));
  }

 private:
  void add(const RecordedSamples& samples, std::size_t i) {
    const double sign = stroke_.to < stroke_.from ? -1 : 1;
    // half of the movement from the previous sample and half of that to the next belong to this sample
    const auto step = [&](std::size_t a, std::size_t b) {
      const bool known = hasPlunger(samples[a]) && hasPlunger(samples[b]);
      return known ? 0.5 * sign * (samples[b].plunger - samples[a].plunger) : 0.0;
    };
    const double way = (i > stroke_.first ? step(i - 1, i) : 0) + (i < stroke_.last ? step(i, i + 1) : 0);
    const NeedleWay needle = wayToOpening(*around_, samples[i]);
    const Vec3 p = needle.end();
    all_ += way;
    if (isInTissue(*around_, samples[i], p)) in_tissue_ += way;
    if (in_target_now_(needle)) in_target_ += way;
    for (std::size_t h = 0; h < met_.size(); ++h)
      if (!met_[h] && distanceTo(around_->anatomy.hazards[h], p) <= 0) met_[h] = true;
  }

  const Surroundings* around_;
  InTarget in_target_now_;
  Stroke stroke_;
  std::size_t next_;
  double all_ = 0, in_tissue_ = 0, in_target_ = 0;
  std::vector<bool> met_;  // by hazard
};

constexpr double kBin_s = 0.01;

/// The plunger averaged over 10 ms. There are no empty bins.
struct Bin {
  std::size_t first = 0, last = 0;  // samples
  double begin_s = 0, end_s = 0;    // of these samples
  double plunger = 0;
};

/// Makes the bins from the samples, in order.
class Bins {
 public:
  /// `time_s`: since the recording's first sample.
  void add(const GestureSample& sample, std::size_t i, double time_s) {
    if (!hasPlunger(sample)) return;
    // a small offset keeps rounding from moving a tick at a bin's edge
    const auto of = static_cast<std::int64_t>(std::floor(time_s / kBin_s + 1e-6));
    if (of != number_) {
      number_ = of;
      all.push_back({i, i, time_s, time_s, 0});
      sum_ = 0;
    }
    Bin& bin = all.back();
    sum_ += sample.plunger;
    bin.last = i;
    bin.end_s = time_s;
    bin.plunger = sum_ / static_cast<double>(bin.last - bin.first + 1);
  }
  std::vector<Bin> all;

 private:
  double sum_ = 0;
  std::int64_t number_ = -1;
};

/// A stroke in bins.
struct Move {
  std::size_t first = 0, last = 0;
  double from = 0, to = 0;
};

double signOf(double value) {
  return value < 0 ? -1 : 1;
}

/// Follows the plunger from bin to bin: at rest around a level, or moving in one direction. Calls `take` at
/// the end of each movement.
class Follower {
 public:
  Follower(const std::vector<Bin>& bins, std::function<void(Move)> take)
      : bins_(bins), take_(std::move(take)) {
    rest(0);
  }

  void run() {
    for (std::size_t i = 1; i < bins_.size(); ++i) {
      if (moving_)
        goOn(i);
      else if (std::abs(bins_[i].plunger - from_) > kBand)
        start(began_, from_, i);
    }
    if (moving_) finish();
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
      // the plunger turned: the next movement begins at the turning point
      const std::size_t turn = at_;
      const double level = extreme_;
      finish();
      start(turn, level, i);
    } else if (marked_at_ != i && bins_[i].begin_s - bins_[marked_at_].end_s >= kPause_s) {
      finish();
      rest(i);
    }
  }

  void finish() { take_({began_, at_, from_, extreme_}); }

  const std::vector<Bin>& bins_;
  const std::function<void(Move)> take_;
  bool moving_ = false;
  std::size_t began_ = 0;  // for a movement: the bin at its start; for a rest: its first bin
  double from_ = 0;        // for a movement: its starting level; for a rest: its level
  double sign_ = 1;
  double extreme_ = 0, marked_ = 0;  // furthest so far; the level of the last progress by a band
  std::size_t at_ = 0, marked_at_ = 0;
};

/// Trims `move`, which begins with the preceding rest, to the stroke: from the last bin at one end to the
/// first bin at the other.
void trim(const std::vector<Bin>& bins, Move& move) {
  const double sign = signOf(move.to - move.from), slack = 0.5 * kBand;
  std::size_t end = move.first;
  while (end < move.last && sign * (move.to - bins[end].plunger) > slack) ++end;
  std::size_t begin = end;
  while (begin > move.first && sign * (bins[begin].plunger - move.from) > slack) --begin;
  move.first = begin;
  move.last = end;
}

using Json = nlohmann::ordered_json;

constexpr double kSamePlace_m = 0.0005;

/// "21 mm deep in bursa, 0.4 mm inside subacromial bursa"
std::string placeText(const pb::SyringePlace& place) {
  if (!place.in_tissue()) return "outside the tissue";
  std::string text = valueText(place.depth_m(), "m") + " deep";
  // if the layer has no name, use its tissue
  const std::string& layer = place.layer_name().empty() ? place.tissue() : place.layer_name();
  if (!layer.empty()) text += " in " + layer;
  if (!place.target().empty())
    text += ", " + valueText(std::abs(place.target_distance_m()), "m") +
            (place.target_distance_m() <= 0 ? " inside " : " from ") + place.target();
  return text;
}

bool isSamePlace(const pb::SyringePlace& a, const pb::SyringePlace& b) {
  return a.in_tissue() == b.in_tissue() && a.layer() == b.layer() &&
         norm(Vec3{a.x_m() - b.x_m(), a.y_m() - b.y_m(), a.z_m() - b.z_m()}) <= kSamePlace_m;
}

Json textOrNull(const std::string& text) {
  return text.empty() ? Json() : Json(text);
}

Json placeJson(const pb::SyringePlace& place) {
  return {{"x_m", place.x_m()},
          {"y_m", place.y_m()},
          {"z_m", place.z_m()},
          {"in_tissue", place.in_tissue()},
          {"layer", place.layer()},
          {"tissue", textOrNull(place.tissue())},
          {"layer_name", textOrNull(place.layer_name())},
          {"depth_m", place.depth_m()},
          {"insertion_m", place.insertion_m()},
          {"target", textOrNull(place.target())},
          {"target_distance_m", place.target().empty() ? Json() : Json(place.target_distance_m())},
          {"hazard", textOrNull(place.hazard())}};
}

/// The strokes in the bins of a cleaned recording, in order (defined in syringe_events.h); the first
/// kMaxSyringeEvents.
std::vector<Stroke> strokesOf(const std::vector<Bin>& bins) {
  std::vector<Stroke> strokes;
  if (bins.empty()) return strokes;
  const auto keep = [&](const Move& move) {
    // rounding of the stored plunger must not decide about strokes of exactly that length
    if (std::abs(move.to - move.from) < kMinStroke - 1e-4 || strokes.size() == kMaxSyringeEvents) return;
    strokes.push_back({bins[move.first].last, bins[move.last].last, move.from, move.to});
  };
  std::optional<Move> before;
  Follower(bins, [&](Move move) {
    trim(bins, move);
    if (before) {
      // the same direction again after a short rest: one stroke
      const bool same_way = signOf(before->to - before->from) == signOf(move.to - move.from);
      const double rest_s = bins[move.first].begin_s - bins[before->last].end_s;
      if (same_way && rest_s < kPause_s && std::abs(move.from - before->to) < kTurnBack) {
        before->last = move.last;
        before->to = move.to;
        return;
      }
      keep(*before);
    }
    before = move;
  }).run();
  if (before) keep(*before);
  return strokes;
}

class EventsOfGesture : public SyringeEventsInSteps {
 public:
  EventsOfGesture(const RecordedSamples& samples, double rate_hz, const pb::Profile& profile,
                  const Pose& X_WL)
      : samples_(samples), rate_hz_(rate_hz), around_(surroundingsOf(profile, X_WL)) {}

  void add(std::size_t i) override {
    const GestureSample& sample = samples_[i];
    bins_.add(sample, i, secondsBetween(samples_.front(), sample, rate_hz_));
  }

  bool finish(StepWork& work) override {
    if (!strokes_) {
      work.spend(bins_.all.size());
      strokes_ = strokesOf(bins_.all);
      bins_.all = {};
    }
    for (; events_.size() < strokes_->size(); shares_.reset()) {
      const Stroke& stroke = (*strokes_)[events_.size()];
      if (!shares_) shares_.emplace(around_, stroke);
      if (!shares_->step(samples_, work)) return false;
      shares_->put(events_.emplace_back(eventOf(stroke)));
    }
    return true;
  }

  std::vector<pb::SyringeEvent> take() override { return std::move(events_); }

 private:
  /// The event, without shares and hazards.
  pb::SyringeEvent eventOf(const Stroke& stroke) const {
    const GestureSample &first = samples_[stroke.first], &last = samples_[stroke.last];
    pb::SyringeEvent event;
    event.set_kind(stroke.to < stroke.from ? pb::SyringeEvent::ASPIRATION : pb::SyringeEvent::INJECTION);
    event.set_begin_tick(first.tick);
    event.set_end_tick(last.tick);
    event.set_begin_s(secondsBetween(samples_.front(), first, rate_hz_));
    event.set_end_s(secondsBetween(samples_.front(), last, rate_hz_));
    event.set_plunger_from(stroke.from);
    event.set_plunger_to(stroke.to);
    *event.mutable_begin() = placeOf(around_, first);
    *event.mutable_end() = placeOf(around_, last);
    return event;
  }

  const RecordedSamples& samples_;
  const double rate_hz_;
  const Surroundings around_;
  Bins bins_;
  std::optional<std::vector<Stroke>> strokes_;
  std::optional<Shares> shares_;  // of the next stroke
  std::vector<pb::SyringeEvent> events_;
};

}  // namespace

std::unique_ptr<SyringeEventsInSteps> syringeEventsInSteps(const RecordedSamples& samples, double rate_hz,
                                                           const pb::Profile& profile, const Pose& X_WL) {
  return std::make_unique<EventsOfGesture>(samples, rate_hz, profile, X_WL);
}

std::vector<pb::SyringeEvent> syringeEvents(std::span<const GestureSample> samples, double rate_hz,
                                            const pb::Profile& profile, const Pose& X_WL) {
  return syringeEvents(RecordedSamples(samples), rate_hz, profile, X_WL);
}

std::vector<pb::SyringeEvent> syringeEvents(const RecordedSamples& samples, double rate_hz,
                                            const pb::Profile& profile, const Pose& X_WL) {
  if (!(rate_hz >= kMinRateHz && rate_hz <= kMaxRateHz)) return {};
  const auto events = syringeEventsInSteps(samples, rate_hz, profile, X_WL);
  for (std::size_t i = 0; i < samples.size(); ++i) events->add(i);
  StepWork all = StepWork::all();
  events->finish(all);
  return events->take();
}

void nameLayers(const pb::Profile& profile, std::span<pb::SyringeEvent> events) {
  const std::vector<std::string> names = layerNames(profile);
  for (pb::SyringeEvent& event : events) {
    for (pb::SyringePlace* const place : {event.mutable_begin(), event.mutable_end()}) {
      if (place->in_tissue() && place->layer() >= 0 &&
          static_cast<std::size_t>(place->layer()) < names.size())
        place->set_layer_name(names[static_cast<std::size_t>(place->layer())]);
    }
  }
}

std::string eventText(const pb::SyringeEvent& event) {
  const double stroke = std::abs(event.plunger_to() - event.plunger_from());
  std::string text = event.kind() == pb::SyringeEvent::ASPIRATION ? "aspiration" : "injection";
  text += fmt::format(" of {} at {:.1f} s for {:.1f} s, ", percentText(stroke), event.begin_s(),
                      event.end_s() - event.begin_s()) +
          placeText(event.begin());
  if (!isSamePlace(event.begin(), event.end())) text += "; to " + placeText(event.end());
  for (int i = 0; i < event.hazards_size(); ++i) text += (i == 0 ? "; into " : ", ") + event.hazards(i);
  return text;
}

std::string eventsJson(std::span<const pb::SyringeEvent> events) {
  Json rows = Json::array();
  for (const pb::SyringeEvent& event : events)
    rows.push_back({{"event", pb::SyringeEvent::Kind_Name(event.kind())},
                    {"begin_s", event.begin_s()},
                    {"end_s", event.end_s()},
                    {"begin_tick", event.begin_tick()},
                    {"end_tick", event.end_tick()},
                    {"plunger_from", event.plunger_from()},
                    {"plunger_to", event.plunger_to()},
                    {"in_tissue_share", event.in_tissue_share()},
                    {"in_target_share", event.in_target_share()},
                    {"begin", placeJson(event.begin())},
                    {"end", placeJson(event.end())},
                    {"hazards", std::vector<std::string>(event.hazards().begin(), event.hazards().end())},
                    {"words", eventText(event)}});
  return rows.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace needlelab
