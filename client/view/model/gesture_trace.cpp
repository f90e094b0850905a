#include "client/view/model/gesture_trace.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <fmt/core.h>

#include "common/base/units.h"

namespace needlelab {
namespace {

constexpr std::size_t kBlock = 1024, kPart = 32, kParts = kBlock / kPart;
constexpr double kMomentPeriod_s = 0.01;
constexpr std::size_t kMaxEvents = 4000;
constexpr double kSameTurn_s = 0.2;  // turns within this time count as one event
constexpr double kSameGap_s = 0.2;   // likewise gaps

float shortened(double value) {
  return static_cast<float>(value);
}

constexpr std::size_t kFixedChannels = kChannelCount - kEffectCount;

// null for a channel that is not an effect's term
const EffectEntry* effectOf(TraceChannel channel) {
  const auto index = static_cast<std::size_t>(channel);
  return index < kFixedChannels ? nullptr : &effectEntry(static_cast<Effect>(index - kFixedChannels));
}

}  // namespace

ChannelInfo infoOf(TraceChannel channel) {
  static constexpr std::array<ChannelInfo, kFixedChannels> kInfo = {{
      {"force", "N", 1},
      {"depth", "mm", 1000},
      {"inserted", "mm", 1000},
      {"speed", "mm/s", 1000},
      {"from own line", "mm", 1000},
      {"α", "°", kDegreesPerRad},
      {"tilt from own line", "°", kDegreesPerRad},
      {"tip x", "mm", 1000},
      {"tip y", "mm", 1000},
      {"tip z", "mm", 1000},
      {"wall x", "mm", 1000},
      {"wall y", "mm", 1000},
      {"wall z", "mm", 1000},
      {"force x", "N", 1},
      {"force y", "N", 1},
      {"force z", "N", 1},
      {"plunger", "%", 100},
      {"layer", "", 1},
      {"phase", "", 1},
  }};
  if (const EffectEntry* effect = effectOf(channel)) return {effect->term, effect->unit, 1};
  return kInfo[static_cast<std::size_t>(channel)];
}

double valueOf(TraceChannel channel, const Moment& moment) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  if (const EffectEntry* effect = effectOf(channel)) {
    if (moment.approximate && effect->unit == "N") return std::numeric_limits<double>::quiet_NaN();
    const double term = termOf(*effect, moment);
    return effect->along_u ? -term : term;
  }
  switch (channel) {
    case TraceChannel::kForce:
      return forceOf(moment);
    case TraceChannel::kDepth:
      return isCapped(moment) ? nan : moment.depth_m;  // what the cap presses in is skin
    case TraceChannel::kInsertion:
      return moment.insertion_m;
    case TraceChannel::kSpeed:
      return moment.speed_mps;
    case TraceChannel::kLateralError:
      return moment.lateral_error_m;
    case TraceChannel::kAlpha:
      return moment.alpha_rad;
    case TraceChannel::kTilt:
      return moment.inside ? moment.tilt_rad : nan;
    case TraceChannel::kTipX:
      return moment.p_WT_m.x;
    case TraceChannel::kTipY:
      return moment.p_WT_m.y;
    case TraceChannel::kTipZ:
      return moment.p_WT_m.z;
    case TraceChannel::kWallX:
      return moment.wall_W_m.x;
    case TraceChannel::kWallY:
      return moment.wall_W_m.y;
    case TraceChannel::kWallZ:
      return moment.wall_W_m.z;
    case TraceChannel::kForceX:
      return moment.force_W_N.x;
    case TraceChannel::kForceY:
      return moment.force_W_N.y;
    case TraceChannel::kForceZ:
      return moment.force_W_N.z;
    case TraceChannel::kPlunger:
      return moment.plunger;
    case TraceChannel::kLayer:
      return moment.layer;
    case TraceChannel::kPhase:
      return static_cast<double>(moment.phase);
  }
  return nan;
}

std::string_view nameOf(TraceEvent::Kind kind) {
  switch (kind) {
    case TraceEvent::Kind::kEntry:
      return "in";
    case TraceEvent::Kind::kExit:
      return "out";
    case TraceEvent::Kind::kLayerChange:
      return "layer";
    case TraceEvent::Kind::kRupture:
      return "rupture";
    case TraceEvent::Kind::kTurn:
      return "change of trajectory";
    case TraceEvent::Kind::kStop:
      return "at rest";
    case TraceEvent::Kind::kFault:
      return "FAULT";
    case TraceEvent::Kind::kGap:
      return "samples missing";
    case TraceEvent::Kind::kRemark:
      return "remark";
    case TraceEvent::Kind::kBoneContact:
      return kBoneContactWords;
    case TraceEvent::Kind::kHubContact:
      return kHubContactWords;
    case TraceEvent::Kind::kHazard:
      return "hazard touched";
  }
  return "";
}

std::string wordsOf(const TraceEvent& event) {
  if (event.kind == TraceEvent::Kind::kHazard) return event.text + " touched";
  if (!event.text.empty()) return event.text;
  if (event.kind != TraceEvent::Kind::kGap || event.missing == 0) return std::string(nameOf(event.kind));
  const std::string time = event.missing_s < 1 ? fmt::format("{:.0f} ms", 1e3 * event.missing_s)
                                               : fmt::format("{:.1f} s", event.missing_s);
  return fmt::format("{} sample{} missing ({})", event.missing, event.missing == 1 ? "" : "s", time);
}

std::string_view signOf(TraceEvent::Kind kind) {
  switch (kind) {
    case TraceEvent::Kind::kEntry:
      return "▼";
    case TraceEvent::Kind::kExit:
      return "▲";
    case TraceEvent::Kind::kLayerChange:
      return "–";
    case TraceEvent::Kind::kRupture:
      return "✶";
    case TraceEvent::Kind::kTurn:
      return "↷";
    case TraceEvent::Kind::kStop:
      return "■";
    case TraceEvent::Kind::kFault:
      return "⚠";
    case TraceEvent::Kind::kGap:
      return "…";
    case TraceEvent::Kind::kRemark:
      return "✎";
    case TraceEvent::Kind::kBoneContact:
    case TraceEvent::Kind::kHubContact:
    case TraceEvent::Kind::kHazard:
      return "✗";
  }
  return "";
}

namespace {

/// Whether two paths look the same in a plot.
bool looksLike(const PathLayers* a, const PathLayers* b) {
  constexpr double kSeen_m = 0.25e-3;
  if (a == b) return true;
  return a != nullptr && b != nullptr &&
         std::equal(a->layers.begin(), a->layers.begin() + a->count, b->layers.begin(),
                    b->layers.begin() + b->count, [](const auto& x, const auto& y) {
                      return x.structure == y.structure && std::fabs(x.top_m - y.top_m) < kSeen_m;
                    });
}

AlarmTick alarmTickOf(const Moment& moment) {
  const bool inside = moment.layer >= 0;
  return {moment.time_s,
          isCapped(moment) ? 0 : forceOf(moment),
          inside,
          moment.p_WT_m,
          moment.p_WT_m - moment.insertion_m * zAxis(normalized(moment.q_WT)),
          moment.layer,
          (moment.flags & kFlagBeyondNeedle) != 0};
}

}  // namespace

// A page of ticks, with each channel's minimum and maximum per 32 ticks and for the whole page.
struct GestureTrace::Store {
  struct Block {
    std::size_t count = 0;
    std::array<double, kBlock> time_s;
    std::array<std::array<float, kBlock>, kChannelCount> values;
    std::array<std::array<PixelColumn, kParts>, kChannelCount> parts{};
    std::array<PixelColumn, kChannelCount> whole{};

    void push(const Moment& moment);
  };

  double span_s = 300, ticks_per_sample = 1;
  std::deque<std::unique_ptr<Block>> blocks;
  std::deque<Moment> moments;
  std::deque<TraceEvent> events;
  std::deque<PlotGap> gaps;
  std::deque<WayStretch> ways;
  Moment last;
  bool any = false;
  double last_turn_s = 0, gap_until_s = 0;
  BoneContacts bones;
  HubContacts hub;
  GestureAlarms alarms;

  void findGap(const Moment& moment);
  void findWay(const Moment& moment);
  void findEvents(const Moment& moment);
  void addEvent(TraceEvent event);
  void forgetOld();
  void columns(std::size_t channel, double from_s, double to_s, std::span<PixelColumn> out) const;
  static void addBlock(const Block& block, std::size_t channel, double from_s, double to_s,
                       std::span<PixelColumn> out);
  [[nodiscard]] const Moment& at(double time_s) const;
};

void GestureTrace::Store::Block::push(const Moment& moment) {
  time_s[count] = moment.time_s;
  for (std::size_t channel = 0; channel < kChannelCount; ++channel) {
    const float value = shortened(valueOf(static_cast<TraceChannel>(channel), moment));
    values[channel][count] = value;
    if (!std::isfinite(value)) continue;
    parts[channel][count / kPart].take(value);
    whole[channel].take(value);
  }
  ++count;
}

GestureTrace::GestureTrace(double span_s, BoneContacts bones, double ticks_per_sample, GestureAlarms alarms)
    : store_(std::make_unique<Store>()) {
  store_->span_s = span_s;
  store_->ticks_per_sample = std::max(1.0, ticks_per_sample);
  store_->bones = std::move(bones);
  store_->alarms = std::move(alarms);
}
GestureTrace::GestureTrace(GestureTrace&&) noexcept = default;
GestureTrace& GestureTrace::operator=(GestureTrace&&) noexcept = default;
GestureTrace::~GestureTrace() = default;

void GestureTrace::clear() {
  Store empty;
  empty.span_s = store_->span_s;
  empty.ticks_per_sample = store_->ticks_per_sample;
  empty.bones = std::move(store_->bones);
  empty.bones.restart();
  empty.alarms = std::move(store_->alarms);
  empty.alarms.restart();
  *store_ = std::move(empty);
}

void GestureTrace::push(const Moment& moment) {
  if (store_->any && moment.time_s <= store_->last.time_s) clear();
  Store& store = *store_;
  if (store.blocks.empty() || store.blocks.back()->count == kBlock)
    store.blocks.push_back(std::make_unique<Store::Block>());
  store.blocks.back()->push(moment);
  const std::size_t events_before = store.events.size();
  store.findGap(moment);
  store.findWay(moment);
  store.findEvents(moment);
  // keep whole moments at 100 Hz and at events
  if (store.moments.empty() || moment.time_s >= store.moments.back().time_s + kMomentPeriod_s - 1e-9 ||
      store.events.size() != events_before)
    store.moments.push_back(moment);
  store.last = moment;
  store.any = true;
  store.forgetOld();
}

void GestureTrace::Store::forgetOld() {
  const double oldest_s = last.time_s - span_s;
  while (blocks.size() > 1 && blocks.front()->time_s[blocks.front()->count - 1] < oldest_s)
    blocks.pop_front();
  while (moments.size() > 1 && moments[1].time_s <= oldest_s) moments.pop_front();
  while (!events.empty() && (events.front().time_s < oldest_s || events.size() > kMaxEvents))
    events.pop_front();
  while (!ways.empty() && (ways.front().to_s < oldest_s || ways.size() > kMaxEvents)) ways.pop_front();
  while (!gaps.empty() && (gaps.front().to < oldest_s || gaps.size() > kMaxEvents)) gaps.pop_front();
}

void GestureTrace::Store::addEvent(TraceEvent event) {
  const auto after = std::upper_bound(events.begin(), events.end(), event.time_s,
                                      [](double time_s, const TraceEvent& e) { return time_s < e.time_s; });
  events.insert(after, std::move(event));
}

void GestureTrace::Store::findGap(const Moment& moment) {
  if (!any || moment.tick <= last.tick) return;
  const double ticks = static_cast<double>(moment.tick - last.tick);
  // The thinner keeps the first tick at or after each point of its grid, so neighbours are less than a step
  // plus a tick apart.
  const double missing = std::floor((ticks - 1) / ticks_per_sample);
  if (missing < 1) return;
  gaps.push_back({last.time_s, moment.time_s});
  const double missing_s = (moment.time_s - last.time_s) * missing / (missing + 1);
  const auto before = std::find_if(events.rbegin(), events.rend(), [](const TraceEvent& event) {
    return event.kind == TraceEvent::Kind::kGap;
  });
  if (before != events.rend() && last.time_s <= gap_until_s + kSameGap_s) {
    before->missing += static_cast<std::uint64_t>(missing);
    before->missing_s += missing_s;
  } else {
    TraceEvent event;
    event.kind = TraceEvent::Kind::kGap;
    event.time_s = last.time_s;
    event.missing = static_cast<std::uint64_t>(missing);
    event.missing_s = missing_s;
    addEvent(std::move(event));
  }
  gap_until_s = moment.time_s;
}

void GestureTrace::Store::findWay(const Moment& moment) {
  if (!moment.inside) return;
  const bool goes_on = any && last.inside && !ways.empty();
  if (goes_on) ways.back().to_s = moment.time_s;
  if (goes_on && looksLike(ways.back().line.path.get(), moment.path.get())) return;
  if (const auto line = lineOf(moment)) ways.push_back({moment.time_s, moment.time_s, goes_on, *line});
}

void GestureTrace::Store::findEvents(const Moment& moment) {
  using Kind = TraceEvent::Kind;
  const auto note = [&](Kind kind, const std::string& text = {}) {
    TraceEvent event;
    event.kind = kind;
    event.text = text;
    event.time_s = moment.time_s;
    event.layer = moment.layer;
    event.fault = moment.fault;
    addEvent(std::move(event));
  };
  const int layer_before = any ? last.layer : -1;
  if (moment.layer >= 0 && layer_before < 0) note(Kind::kEntry);
  if (moment.layer < 0 && layer_before >= 0) note(Kind::kExit);
  if (moment.layer >= 0 && layer_before >= 0 && moment.layer != layer_before) note(Kind::kLayerChange);
  if (bones.add(moment.time_s, moment.layer, moment.p_WT_m)) note(Kind::kBoneContact);
  if (hub.add(moment.time_s, moment.flags)) note(Kind::kHubContact);
  for (const ActiveAlarm& alarm : alarms.add(alarmTickOf(moment)))
    if (alarm.alarm == Alarm::kHazard) note(Kind::kHazard, alarm.detail);
  if ((moment.flags & kFlagRupture) != 0) note(Kind::kRupture);
  if ((moment.flags & kFlagTurn) != 0) {
    if (last_turn_s == 0 || moment.time_s > last_turn_s + kSameTurn_s) note(Kind::kTurn);
    last_turn_s = moment.time_s;
  }
  if (moment.phase == Phase::kStopped && any && last.phase != Phase::kStopped) note(Kind::kStop);
  if (moment.fault != 0 && (!any || last.fault != moment.fault)) note(Kind::kFault);
}

void GestureTrace::add(TraceEvent event) {
  store_->addEvent(std::move(event));
}

std::vector<ActiveAlarm> GestureTrace::alarms() const {
  return store_->alarms.now();
}

bool GestureTrace::empty() const {
  return !store_->any;
}

double GestureTrace::firstTime_s() const {
  return store_->any ? store_->blocks.front()->time_s[0] : 0;
}

double GestureTrace::lastTime_s() const {
  return store_->any ? store_->last.time_s : 0;
}

const Moment& GestureTrace::last() const {
  return store_->last;
}

const Moment& GestureTrace::Store::at(double time_s) const {
  if (moments.empty() || time_s >= last.time_s) return last;
  const auto after = std::upper_bound(moments.begin(), moments.end(), time_s,
                                      [](double t, const Moment& moment) { return t < moment.time_s; });
  return after == moments.begin() ? moments.front() : *std::prev(after);
}

const Moment& GestureTrace::at(double time_s) const {
  return store_->at(time_s);
}

std::vector<Moment> GestureTrace::between(double from_s, double to_s) const {
  const auto& moments = store_->moments;
  const auto before = [](const Moment& moment, double t) { return moment.time_s < t; };
  const auto first = std::lower_bound(moments.begin(), moments.end(), from_s, before);
  std::vector<Moment> out;
  for (auto at = first; at != moments.end() && at->time_s <= to_s; ++at) out.push_back(*at);
  return out;
}

const std::deque<TraceEvent>& GestureTrace::events() const {
  return store_->events;
}

const std::deque<WayStretch>& GestureTrace::ways() const {
  return store_->ways;
}

const std::deque<PlotGap>& GestureTrace::gaps() const {
  return store_->gaps;
}

std::optional<float> GestureTrace::value(TraceChannel channel, double time_s) const {
  const auto& blocks = store_->blocks;
  const auto after = std::upper_bound(blocks.begin(), blocks.end(), time_s,
                                      [](double t, const auto& block) { return t < block->time_s[0]; });
  if (after == blocks.begin()) return std::nullopt;
  const Store::Block& block = **std::prev(after);
  const auto end = block.time_s.begin() + static_cast<std::ptrdiff_t>(block.count);
  const auto next = std::upper_bound(block.time_s.begin(), end, time_s);
  const auto index = static_cast<std::size_t>(next - block.time_s.begin()) - 1;
  const float found = block.values[static_cast<std::size_t>(channel)][index];
  return std::isfinite(found) ? std::optional<float>(found) : std::nullopt;
}

double GestureTrace::peakForce_N() const {
  double peak_N = 0;
  for (const auto& block : store_->blocks)
    peak_N = std::fmax(peak_N,
                       static_cast<double>(block->whole[static_cast<std::size_t>(TraceChannel::kForce)].max));
  return peak_N;
}

// Adds a run of ticks within one column by its minimum and maximum.
void GestureTrace::Store::addBlock(const Block& block, std::size_t channel, double from_s, double to_s,
                                   std::span<PixelColumn> out) {
  const double per_s = static_cast<double>(out.size()) / (to_s - from_s);
  const auto columnOf = [&](double time_s) -> std::ptrdiff_t {
    return static_cast<std::ptrdiff_t>(std::floor((time_s - from_s) * per_s));
  };
  const auto size = static_cast<std::ptrdiff_t>(out.size());
  const auto addStretch = [&](std::size_t first, std::size_t until, const PixelColumn& extremes) {
    const std::ptrdiff_t column = columnOf(block.time_s[first]);
    if (column != columnOf(block.time_s[until])) return false;
    if (column < 0 || column >= size || extremes.empty()) return true;
    PixelColumn& into = out[static_cast<std::size_t>(column)];
    into.take(extremes.min);
    into.take(extremes.max);
    into.last = extremes.last;
    return true;
  };
  if (addStretch(0, block.count - 1, block.whole[channel])) return;
  for (std::size_t first = 0; first < block.count; first += kPart) {
    const std::size_t last = std::min(first + kPart, block.count) - 1;
    if (block.time_s[last] < from_s || block.time_s[first] >= to_s) continue;
    if (addStretch(first, last, block.parts[channel][first / kPart])) continue;
    for (std::size_t i = first; i <= last; ++i) {
      const float value = block.values[channel][i];
      const std::ptrdiff_t column = columnOf(block.time_s[i]);
      if (std::isfinite(value) && column >= 0 && column < size)
        out[static_cast<std::size_t>(column)].take(value);
    }
  }
}

void GestureTrace::Store::columns(std::size_t channel, double from_s, double to_s,
                                  std::span<PixelColumn> out) const {
  std::fill(out.begin(), out.end(), PixelColumn{});
  if (out.empty() || !(to_s > from_s)) return;
  for (const auto& block : blocks) {
    if (block->time_s[block->count - 1] < from_s) continue;
    if (block->time_s[0] >= to_s) break;
    addBlock(*block, channel, from_s, to_s, out);
  }
}

void GestureTrace::columns(TraceChannel channel, double from_s, double to_s,
                           std::span<PixelColumn> out) const {
  store_->columns(static_cast<std::size_t>(channel), from_s, to_s, out);
}

ColumnSource GestureTrace::source(TraceChannel channel) const {
  const Store* store = store_.get();
  const auto scale = static_cast<float>(infoOf(channel).shown_per_si);
  return [store, channel, scale](double from_s, double to_s, std::span<PixelColumn> out) {
    store->columns(static_cast<std::size_t>(channel), from_s, to_s, out);
    for (PixelColumn& column : out) {
      column.min *= scale;
      column.max *= scale;
      column.last *= scale;
    }
  };
}

PlotReader GestureTrace::reader(TraceChannel channel) const {
  return [store = store_.get(), channel](double time_s) -> std::optional<double> {
    if (!store->any || time_s < store->blocks.front()->time_s[0] || time_s > store->last.time_s)
      return std::nullopt;
    for (const PlotGap& gap : store->gaps)
      if (time_s > gap.from && time_s < gap.to) return std::nullopt;
    const double value = valueOf(channel, store->at(time_s));
    return std::isfinite(value) ? std::optional(value * infoOf(channel).shown_per_si) : std::nullopt;
  };
}

}  // namespace needlelab
