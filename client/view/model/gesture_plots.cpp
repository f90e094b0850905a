#include "client/view/model/gesture_plots.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string_view>
#include <utility>

#include "client/view/model/palette.h"
#include "common/scoring/measures/measure_table.h"

namespace needlelab {
namespace {

/// Measures that judge a plotted quantity over the same ticks.
struct JudgingMeasure {
  MeasureRole role;
  GesturePlot plot;
  TraceChannel channel;
  std::string_view more = {};  ///< appended to the limit's text
  bool both_ways = false;      ///< also drawn below zero
};
constexpr JudgingMeasure kJudgingMeasures[] = {
    {MeasureRole::kForce, GesturePlot::kForces, TraceChannel::kForce},
    {MeasureRole::kSpeed, GesturePlot::kSpeed, TraceChannel::kSpeed, ", in any direction", true},
    {MeasureRole::kDepth, GesturePlot::kDepth, TraceChannel::kDepth},
    {MeasureRole::kOwnLine, GesturePlot::kAlignment, TraceChannel::kLateralError},
};

PlotSeries seriesOf(const GestureTrace& trace, TraceChannel channel, Rgb colour, bool dashed = false) {
  PlotSeries series;
  series.name = infoOf(channel).name;
  series.colour = colour;
  series.columns = trace.source(channel);
  series.reader = trace.reader(channel);
  series.dashed = dashed;
  return series;
}

Rgb eventColour(TraceEvent::Kind kind) {
  switch (kind) {
    case TraceEvent::Kind::kFault:
    case TraceEvent::Kind::kBoneContact:
    case TraceEvent::Kind::kHubContact:
    case TraceEvent::Kind::kHazard:
      return styleOf(Condition::kTrouble).colour;
    case TraceEvent::Kind::kGap:
      return styleOf(Condition::kAttention).colour;
    case TraceEvent::Kind::kRupture:
      return kYellow;
    case TraceEvent::Kind::kTurn:
      return kReddishPurple;
    case TraceEvent::Kind::kRemark:
      return kSkyBlue;
    default:
      return kDimText;
  }
}

std::vector<PlotMark> marksOf(const GestureTrace& trace, const SceneView* scene, double from_s, double to_s) {
  std::vector<PlotMark> marks;
  for (const TraceEvent& event : trace.events()) {
    if (event.time_s < from_s || event.time_s > to_s) continue;
    PlotMark mark;
    mark.x = event.time_s;
    mark.colour = eventColour(event.kind);
    mark.sign = signOf(event.kind);
    mark.text = wordsOf(event);
    if (event.kind == TraceEvent::Kind::kLayerChange && scene != nullptr)
      mark.text = layerName(*scene, event.layer);
    marks.push_back(std::move(mark));
  }
  return marks;
}

/// In a body: bands of what each insertion met and was ahead of it, while the needle was in it. A name stands
/// once in an insertion.
void addWays(Plot& plot, const GestureTrace& trace, const SceneView& scene) {
  constexpr double kFarBeyond_m = 0.05;
  std::map<std::string, std::size_t> named;  // in this insertion, each the band with its name
  for (const WayStretch& stretch : trace.ways()) {
    if (stretch.to_s < plot.from || stretch.from_s > plot.to) continue;
    if (!stretch.goes_on) named.clear();
    const double mm = 1e3 * stretch.line.slant;
    const auto add = [&](const std::string& name, double top_m, double bottom_m, Rgb colour, bool is_target) {
      const auto [at, first] = named.try_emplace(name + (is_target ? "*" : ""), plot.bands.size());
      plot.bands.push_back({top_m * mm, bottom_m * mm, colour, first ? name : std::string(), stretch.from_s,
                            stretch.to_s, stretch.to_s, is_target});
      plot.bands[at->second].name_to = stretch.to_s;
    };
    const TissuesOnLine way = tissuesOnLine(scene, stretch.line, scene.needle.length_m + kFarBeyond_m);
    for (const TissuesOnLine::Tissue& tissue : way.tissues) {
      const LayerView& layer = scene.layers[static_cast<std::size_t>(tissue.layer)];
      add(isTarget(scene, tissue.layer) ? std::string() : layer.name, tissue.top_m, tissue.bottom_m,
          layer.colour, false);
    }
    for (const TissuesOnLine::Aim& aim : way.targets)
      add(aim.name, aim.top_m, aim.bottom_m, kTargetColour, true);
  }
}

void addDepth(Plot& plot, const GestureTrace& trace, const SceneView* scene, double from_s, double to_s) {
  const double mm = infoOf(TraceChannel::kDepth).shown_per_si;
  plot.title = "depth";
  plot.quantity = PlotQuantity::kDepth;
  plot.unit = "mm";
  plot.downward = true;
  plot.series = {seriesOf(trace, TraceChannel::kDepth, kTipColour)};
  plot.share = 1.4F;
  plot.series.back().name.clear();
  if (scene == nullptr) return;
  if (scene->body) {
    addWays(plot, trace, *scene);
  } else {
    for (const LayerView& layer : scene->layers)
      plot.bands.push_back({layer.top_m * mm, layer.bottom_m * mm, layer.colour, layer.name});
    for (const TargetView& target : scene->targets) {
      plot.bands.push_back({target.top_m * mm, target.bottom_m * mm, kTargetColour, target.name});
      plot.bands.back().is_target = true;
    }
  }
  // at least down to the target, so that the remaining distance is visible
  double deepest_m = leastSpanOf(PlotQuantity::kDepth) / mm;
  for (const TargetView& target : scene->targets)
    deepest_m = std::max(deepest_m, depthAt(*scene, target.center_W_m) + 2 * target.radius_m);
  std::vector<PixelColumn> columns(64);
  trace.columns(TraceChannel::kDepth, from_s, to_s, columns);
  for (const PixelColumn& column : columns)
    if (!column.empty()) deepest_m = std::max(deepest_m, static_cast<double>(column.max) * 1.08);
  plot.low = -0.12 * deepest_m * mm;
  plot.high = deepest_m * mm;
}

}  // namespace

Plot gesturePlot(GesturePlot which, const GestureTrace& trace, const SceneView* scene, double from_s,
                 double to_s) {
  Plot plot;
  plot.from = from_s;
  plot.to = to_s;
  plot.marks = marksOf(trace, scene, from_s, to_s);
  for (const PlotGap& gap : trace.gaps())
    if (gap.to >= from_s && gap.from <= to_s) plot.gaps.push_back(gap);
  switch (which) {
    case GesturePlot::kForces: {
      plot.title = "force";
      plot.quantity = PlotQuantity::kForce;
      plot.unit = "N";
      plot.share = 1.4F;
      plot.series.push_back(seriesOf(trace, TraceChannel::kForce, kWhite));
      plot.series.back().name = "total";
      for (const EffectEntry* effect : effectsAsShown())
        if (effect->unit == "N")
          plot.series.push_back(seriesOf(trace, channelOf(effect->effect), colourOf(*effect)));
      break;
    }
    case GesturePlot::kDepth:
      addDepth(plot, trace, scene, from_s, to_s);
      break;
    case GesturePlot::kSpeed:
      plot.title = "speed";
      plot.quantity = PlotQuantity::kSpeed;
      plot.unit = "mm/s";
      plot.series = {seriesOf(trace, TraceChannel::kSpeed, kSkyBlue)};
      plot.series.back().name.clear();
      break;
    case GesturePlot::kAlignment:
      plot.title = "distance from own line";
      plot.quantity = PlotQuantity::kDistance;
      plot.unit = "mm";
      plot.low = 0;
      plot.series = {seriesOf(trace, TraceChannel::kLateralError, kReddishPurple)};
      plot.series.back().name.clear();
      plot.series.back().filled = true;
      break;
    case GesturePlot::kAngles:
      plot.title = "angles";
      plot.quantity = PlotQuantity::kAngle;
      plot.unit = "°";
      plot.low = 0;
      plot.series = {seriesOf(trace, TraceChannel::kAlpha, kBluishGreen, true),
                     seriesOf(trace, TraceChannel::kTilt, kOrange)};
      break;
    case GesturePlot::kPlaces:
      plot.title = "tip and wall";
      plot.quantity = PlotQuantity::kDepth;
      plot.unit = "mm";
      plot.share = 1.4F;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const auto tip = static_cast<TraceChannel>(static_cast<std::size_t>(TraceChannel::kTipX) + axis);
        const auto wall = static_cast<TraceChannel>(static_cast<std::size_t>(TraceChannel::kWallX) + axis);
        plot.series.push_back(seriesOf(trace, tip, kAxisColours[axis]));
        plot.series.push_back(seriesOf(trace, wall, mixed(kAxisColours[axis], kWhite, 0.45F), true));
      }
      break;
    case GesturePlot::kPlunger:
      plot.title = "plunger";
      plot.unit = "%";
      plot.low = 0;
      plot.high = 100;
      plot.series = {seriesOf(trace, TraceChannel::kPlunger, kBluishGreen)};
      plot.series.back().name.clear();
      plot.series.back().filled = true;
      break;
  }
  return plot;
}

std::vector<PlotRequirement> requirementsOf(const pb::Exercise& exercise) {
  std::vector<PlotRequirement> requirements;
  for (const auto& row : exercise.requirements())
    requirements.push_back({row.measure(), row.has_min() ? std::optional(row.min()) : std::nullopt,
                            row.has_max() ? std::optional(row.max()) : std::nullopt});
  return requirements;
}

std::vector<PlotRequirement> requirementsOf(std::span<const Measure> measures) {
  std::vector<PlotRequirement> requirements;
  for (const Measure& row : measures)
    if (row.min || row.max) requirements.push_back({row.name, row.min, row.max});
  return requirements;
}

void addLimits(Plot& plot, GesturePlot which, std::span<const PlotRequirement> requirements) {
  for (const JudgingMeasure& judging : kJudgingMeasures) {
    if (judging.plot != which) continue;
    for (const PlotRequirement& requirement : requirements) {
      if (roleOf(requirement.measure) != judging.role) continue;
      const std::size_t before = plot.limits.size();
      addLimits(plot, requirement, infoOf(judging.channel).shown_per_si);
      const std::size_t added = plot.limits.size();
      for (std::size_t i = before; i < added; ++i) {
        plot.limits[i].text += judging.more;
        if (judging.both_ways) plot.limits.push_back({-plot.limits[i].at, ""});
      }
    }
  }
}

void addLimits(Plot& plot, const PlotRequirement& requirement, double shown_per_si) {
  const MeasureKind* const kind = measureKind(requirement.measure);
  const std::string unit(kind == nullptr ? std::string_view() : kind->unit);
  for (const auto& [bound, word] : {std::pair{requirement.min, "at least "}, {requirement.max, "at most "}}) {
    if (!bound || !std::isfinite(*bound)) continue;
    const double at = *bound * shown_per_si;
    plot.limits.push_back({at, word + measureText(requirement.measure, *bound, unit)});
    // extend fixed axis ends
    if (plot.low && at < *plot.low) plot.low = at;
    if (plot.high && at > *plot.high) plot.high = at;
  }
}

}  // namespace needlelab
