#include "client/instructor/model/report.h"

#include <algorithm>
#include <cmath>

#include "client/instructor/model/html_text.h"
#include "client/instructor/model/report_plots.h"
#include "client/instructor/model/svg_plot.h"
#include "client/view/model/axis_ticks.h"
#include "common/base/files.h"
#include "common/base/text.h"
#include "common/gesture/sample_csv.h"
#include "common/scoring/measure_table.h"
#include "common/scoring/syringe_events.h"

namespace needlelab {
namespace {

constexpr const char* kStyle =
    "<style>body{font:15px/1.45 'DejaVu Sans',Verdana,sans-serif;color:#1b1f24;max-width:60em;margin:2em "
    "auto;"
    "padding:0 "
    "1em}h1{font-size:1.5em;margin-bottom:.1em}h2{font-size:1.15em;margin-top:2em;border-bottom:1px solid "
    "#bbb}table{border-collapse:collapse;width:100%}td,th{padding:.25em "
    ".6em;text-align:left;vertical-align:middle;"
    "border-bottom:1px solid "
    "#e3e6ea}th{font-weight:600}.n{text-align:right;white-space:nowrap}.v{font-size:1.1em;"
    "font-weight:700}.d{color:#59636e}svg{max-width:100%;height:auto;display:inline-block;margin:.35em 0}svg "
    "text{"
    "font-size:11px;fill:#333}svg .h{font-weight:600;font-size:12px}svg .q{fill:#59636e}svg "
    ".g{stroke:#e3e6ea}svg .a{"
    "stroke:#59636e}svg .m{stroke:#59636e;stroke-dasharray:2 3}svg "
    ".s{fill:none;stroke-width:1.6;stroke-linejoin:"
    "round}@media print{body{margin:0}h2{break-after:avoid}tr,svg{break-inside:avoid}}</style>";

std::string heading(const std::string& words) {
  return "<h2>" + htmlText(words) + "</h2>\n";
}

std::string fact(const std::string& name, const std::string& value) {
  if (value.empty()) return {};
  return "<tr><td class='d'>" + htmlText(name) + "</td><td>" + htmlText(value) + "</td></tr>\n";
}

std::string verdictOf(const ReportData& data) {
  if (!data.passed) return data.measures.empty() ? "no score yet" : "nothing was required";
  return *data.passed ? "✔ passed" : "✘ not passed";
}

std::string headOf(const ReportData& data) {
  const StoredGesture& gesture = *data.gesture;
  const auto& d = gesture.info.description();
  std::string out = "<h1>" + htmlText(d.trainee().empty() ? "a trainee" : d.trainee()) + ": " +
                    htmlText(data.exercise_name.empty() ? d.exercise_id() : data.exercise_name) +
                    "</h1>\n<p class='v'>" + htmlText(verdictOf(data)) + "</p>\n";
  if (!data.exercise_text.empty()) out += "<p>" + htmlText(data.exercise_text) + "</p>\n";
  out += "<table>\n" + fact("session", gesture.id) + fact("when and what", gesture.title()) +
         fact("station", d.station()) + fact("device", d.device()) +
         fact("attempt", data.attempt == 0 ? std::string() : std::to_string(data.attempt)) +
         fact("patient", gesture.scene.profile.name()) +
         fact("profile", d.profile_id() + ", revision " + std::to_string(d.profile_revision())) +
         fact("force model", d.axial_model()) + fact("engine", d.engine_version()) +
         fact("recording", formatted("%zu samples, %.1f s", gesture.samples.size(),
                                     gesture.last_s() - gesture.first_s())) +
         "</table>\n";
  for (const auto& note : d.device_notes()) out += "<p class='d'>" + htmlText(note) + "</p>\n";
  for (const auto& note : gesture.notes) out += "<p class='d'>" + htmlText(note) + "</p>\n";
  for (const auto& note : data.notes) out += "<p class='d'>" + htmlText(note) + "</p>\n";
  return out;
}

std::string requiredText(const Measure& measure) {
  if (measure.min && measure.max)
    return valueText(*measure.min, measure.unit) + " to " + valueText(*measure.max, measure.unit);
  if (measure.min) return "at least " + valueText(*measure.min, measure.unit);
  if (measure.max) return "at most " + valueText(*measure.max, measure.unit);
  return {};
}

std::string standingOf(const ReportData& data, const Measure& measure) {
  const auto band = std::find_if(data.bands.begin(), data.bands.end(),
                                 [&](const pb::ReferenceBand& b) { return b.measure() == measure.name; });
  if (band == data.bands.end() || !measure.measured) return {};
  const bool known = band->has_p10() && band->has_p90();
  std::string out = svgStanding({band->least(), band->greatest(), band->mean(), measure.value,
                                 known ? band->p10() : 0, known ? band->p90() : 0});
  const auto row = std::find_if(data.standings.begin(), data.standings.end(),
                                [&](const StandingRow& r) { return r.measure == measure.name; });
  if (row != data.standings.end()) out += "<br><span class='d'>" + htmlText(row->words) + "</span>";
  return out;
}

std::string measuresOf(const ReportData& data) {
  if (data.measures.empty()) return "<p>There is no score yet: the session must be closed first.</p>\n";
  std::string out = "<table>\n<tr><th></th><th>measure</th><th class='n'>value</th><th>required</th>";
  out += data.bands.empty() ? "</tr>\n" : "<th>beside the experts</th></tr>\n";
  // what was required first
  for (const bool required : {true, false}) {
    for (const Measure& measure : data.measures) {
      if (measure.passed.has_value() != required) continue;
      const char* const sign = !required ? "" : *measure.passed ? "✔" : "✘";
      out += std::string("<tr><td class='v'>") + sign + "</td><td title='" + htmlText(measure.words) + "'>" +
             htmlText(measureWords(measure.name)) + "</td><td class='n'>" +
             htmlText(measure.measured ? valueText(measure.value, measure.unit) : std::string("–")) +
             "</td><td>" + htmlText(requiredText(measure)) + "</td>" +
             (data.bands.empty() ? std::string() : "<td>" + standingOf(data, measure) + "</td>") + "</tr>\n";
    }
  }
  return out + formatted("</table>\n<p class='d'>Definitions of version %u.</p>\n", data.definition_version);
}

std::string eventsOf(const ReportData& data) {
  struct Line {
    double at_s;
    std::string text;
  };
  std::vector<Line> lines;
  const StoredGesture& gesture = *data.gesture;
  for (const auto& event : gesture.events)
    lines.push_back({gesture.timeOfTick(event.begin_tick()), eventText(event)});
  for (const auto& remark : data.remarks)
    lines.push_back(
        {gesture.timeOfTick(remark.tick()), "remark by " + remark.author() + ": " + remark.text()});
  for (const TraceEvent& event : gesture.trace.events()) {
    if (event.kind != TraceEvent::Kind::kFault && event.kind != TraceEvent::Kind::kEntry &&
        event.kind != TraceEvent::Kind::kExit)
      continue;
    lines.push_back({event.time_s, std::string(wordOf(event.kind))});
  }
  std::stable_sort(lines.begin(), lines.end(), [](const Line& a, const Line& b) { return a.at_s < b.at_s; });
  if (lines.empty()) return "<p>Nothing.</p>\n";
  std::string out = "<table>\n";
  for (const Line& line : lines)
    out +=
        "<tr><td class='n'>" + clockText(line.at_s, 1) + "</td><td>" + htmlText(line.text) + "</td></tr>\n";
  return out + "</table>\n";
}

std::string progressOfTrainee(const ReportData& data) {
  // the measures that a teacher looks at first
  constexpr std::string_view kShown[] = {"elapsed_s",         "peak_force_n",     "largest_lateral_error_m",
                                         "target_distance_m", "tissue_damage_m2", "dtw_distance_m"};
  std::string out;
  for (const std::string_view name : kShown) {
    const auto row = std::find_if(data.progress.begin(), data.progress.end(),
                                  [&](const ProgressRow& r) { return r.measure == name; });
    if (row == data.progress.end() || row->values.size() < 2) continue;
    const MeasureKind* const kind = measureKind(name);
    const double shown = row->unit == "m" ? 1000 : row->unit == "m^2" ? 1e4 : 1;
    SvgProgress plot;
    plot.title = kind == nullptr ? std::string(name) : std::string(kind->words);
    plot.unit = row->unit == "m" ? "mm" : row->unit == "m^2" ? "cm²" : row->unit;
    plot.attempts = row->attempts;
    for (const double v : row->values) plot.values.push_back(v * shown);
    for (const pb::ReferenceBand& band : data.bands) {
      if (band.measure() != name) continue;
      plot.band_low = shown * (band.has_p10() ? band.p10() : band.least());
      plot.band_high = shown * (band.has_p90() ? band.p90() : band.greatest());
    }
    out += "<div style='display:inline-block;width:350px;vertical-align:top'>" + svgProgress(plot) +
           "<br><span class='d'>" + htmlText(row->words) + "</span></div>\n";
  }
  return out.empty() ? "<p>Fewer than two attempts have a score.</p>\n" : out;
}

}  // namespace

std::string reportHtml(const ReportData& data) {
  std::string out = "<!DOCTYPE html>\n<html lang='en'>\n<head><meta charset='utf-8'><title>" +
                    htmlText(data.gesture->title()) + "</title>\n" + kStyle + "</head>\n<body>\n";
  out += headOf(data);
  out += heading("Measures") + measuresOf(data);
  out += heading("The gesture");
  for (const SvgPlot& plot : reportPlots(*data.gesture, data.remarks)) out += svgPlot(plot) + "\n";
  out += heading("Events and remarks") + eventsOf(data);
  out += heading("Progress at this exercise") + progressOfTrainee(data);
  out += "<p class='d'>needlelab " NEEDLELAB_VERSION
         ". Green: where most of the experts are (10 to 90 %); grey: all of them; line: their mean; diamond: "
         "this "
         "gesture.</p>\n</body>\n</html>\n";
  return out;
}

Status writeReport(const LabCall& call, const std::string& session_id, const std::filesystem::path& file,
                   const ScenePreparer& prepare) {
  auto gesture = loadGesture(call, session_id, prepare);
  if (!gesture.ok()) return gesture.error();
  const auto data = collectReport(call, *std::move(gesture));
  if (!data.ok()) return data.error();
  return writeFileAtomically(file, viewOf(reportHtml(*data)));
}

Status writeSamplesCsv(const StoredGesture& gesture, const std::filesystem::path& file) {
  auto growing = GrowingFile::create(file);
  if (!growing.ok()) return growing.error();
  constexpr std::size_t kAtOnce = 1u << 20;
  std::string text;
  appendSampleCsvHeader(text);
  for (const GestureSample& sample : gesture.samples) {
    appendSampleCsvRow(text, sample, gesture.samples.front().time_ns);
    if (text.size() < kAtOnce) continue;
    if (auto done = growing->append(viewOf(text)); !done.ok()) return done;
    text.clear();
  }
  if (auto done = growing->append(viewOf(text)); !done.ok()) return done;
  return growing->finish();
}

}  // namespace needlelab
