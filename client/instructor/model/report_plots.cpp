#include "client/instructor/model/report_plots.h"

#include <array>
#include <string>

#include "client/view/model/palette.h"

namespace needlelab {
namespace {

SvgSeries seriesOf(const StoredGesture& gesture, TraceChannel channel, std::string name, Rgb colour,
                   bool dashed = false) {
  return {std::move(name), colour, gesture.trace.source(channel), dashed};
}

SvgPlot plotOf(const StoredGesture& gesture, TraceChannel channel) {
  SvgPlot plot;
  plot.title = std::string(infoOf(channel).name);
  plot.unit = std::string(infoOf(channel).unit);
  plot.x_title = "s";
  plot.from = gesture.first_s();
  plot.to = gesture.last_s();
  return plot;
}

SvgPlot forces(const StoredGesture& gesture) {
  SvgPlot plot = plotOf(gesture, TraceChannel::kForce);
  plot.series.push_back(seriesOf(gesture, TraceChannel::kForce, "all", kBlack));
  if (!gesture.scene.model) return plot;  // without the engine there are no parts
  bool dashed = false;
  for (const EffectEntry* effect : effectsAsShown()) {
    if (effect->unit != "N") continue;
    plot.series.push_back(
        seriesOf(gesture, channelOf(effect->effect), std::string(effect->term), colourOf(*effect), dashed));
    dashed = !dashed;
  }
  return plot;
}

SvgPlot depth(const StoredGesture& gesture, const std::vector<pb::Annotation>& remarks) {
  SvgPlot plot = plotOf(gesture, TraceChannel::kDepth);
  plot.downward = true;
  plot.series.push_back(seriesOf(gesture, TraceChannel::kDepth, "depth", kBlack));
  if (gesture.scene.view) {
    for (const LayerView& layer : gesture.scene.view->layers)
      plot.bands.push_back({1e3 * layer.top_m, 1e3 * layer.bottom_m, tissueColour(layer.tissue), layer.name});
  }
  for (const pb::Annotation& remark : remarks)
    plot.marks.push_back({gesture.timeOfTick(remark.tick()), "✎", remark.author() + ": " + remark.text()});
  for (const pb::SyringeEvent& event : gesture.events) {
    const bool in = event.kind() == pb::SyringeEvent::INJECTION;
    plot.marks.push_back(
        {gesture.timeOfTick(event.begin_tick()), in ? "▼" : "△", in ? "injection" : "aspiration"});
  }
  return plot;
}

}  // namespace

std::vector<SvgPlot> reportPlots(const StoredGesture& gesture, const std::vector<pb::Annotation>& remarks) {
  if (gesture.trace.empty()) return {};
  std::vector<SvgPlot> plots = {forces(gesture), depth(gesture, remarks)};
  for (const TraceChannel channel : {TraceChannel::kSpeed, TraceChannel::kLateralError}) {
    plots.push_back(plotOf(gesture, channel));
    plots.back().series.push_back(seriesOf(gesture, channel, plots.back().title, kBlue));
  }
  if (gesture.scene.model) {
    SvgPlot angles = plotOf(gesture, TraceChannel::kAlpha);
    angles.title = "tilt and its limit α";
    angles.series.push_back(seriesOf(gesture, TraceChannel::kTilt, "tilt", kBlue));
    angles.series.push_back(seriesOf(gesture, TraceChannel::kAlpha, "α", kVermillion, true));
    plots.push_back(std::move(angles));
  }
  return plots;
}

}  // namespace needlelab
