#include "client/instructor/model/stored/report.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "client/instructor/model/live/session_scene.h"
#include "client/view/model/gesture_plots.h"
#include "client/view/model/palette.h"
#include "common/base/files/files.h"
#include "common/base/program.h"
#include "common/base/text/strict_json.h"
#include "common/base/text/text.h"
#include "common/base/time/clock.h"
#include "common/base/units.h"
#include "common/gesture/sample.h"
#include "common/haptics/gate/handle_stiffness.h"
#include "common/profile/layer_names.h"
#include "common/profile/profile.h"
#include "common/scoring/measures/measure_table.h"
#include "common/scoring/measures/syringe_events.h"
#include "common/scoring/targets/miss.h"

namespace needlelab {
namespace {

// --- data from the server

using ReplyJson = nlohmann::json;

std::string textIn(const ReplyJson& row, const char* key) {
  const auto found = row.find(key);
  return found != row.end() && found->is_string() ? printable(found->get<std::string>()) : std::string();
}

std::optional<double> numberIn(const ReplyJson& row, const char* key) {
  const auto found = row.find(key);
  return found != row.end() && found->is_number() ? std::optional(found->get<double>()) : std::nullopt;
}

/// Reads pairs in which both parts are numbers, so that no value moves to another attempt.
void readPairs(const ReplyJson& row, ProgressRow& into) {
  const auto attempts = row.find("attempts"), values = row.find("values");
  if (attempts == row.end() || values == row.end() || !attempts->is_array() || !values->is_array()) return;
  for (std::size_t i = 0; i < std::min(attempts->size(), values->size()); ++i) {
    if (!(*attempts)[i].is_number() || !(*values)[i].is_number()) continue;
    into.attempts.push_back((*attempts)[i].get<double>() + 1);  // the server counts from 0
    into.values.push_back((*values)[i].get<double>());
  }
}

class Collector {
 public:
  Collector(const LabCall& call, ReportData& data) : call_(call), data_(data) {}

  Status run() {
    const auto& description = data_.gesture->info.description();
    ASSIGN_OR_RETURN(data_.remarks, readRemarks(call_, description.session_id()));
    RETURN_IF_ERROR(readScore(description.session_id()));
    if (description.exercise_id().empty()) return {};
    RETURN_IF_ERROR(readExercise(description.exercise_id()));
    RETURN_IF_ERROR(readReference(description.exercise_id()));
    if (description.trainee().empty()) return {};
    return readProgress(description.trainee(), description.exercise_id(), description.session_id());
  }

 private:
  /// Notes a request that the server refused; returns an error if the connection was lost.
  Status refused(const Error& error, const char* what) {
    if (error.code == ErrorCode::kUnavailable || error.code == ErrorCode::kFailed) return error;
    data_.notes.push_back(std::string(what) + ": " + printable(error.message));
    return {};
  }

  Result<std::optional<pb::Reply>> ask(const pb::Request& request, const char* what) {
    auto reply = call_(request);
    if (reply.ok()) return std::optional<pb::Reply>(*std::move(reply));
    RETURN_IF_ERROR(refused(reply.error(), what));
    return std::optional<pb::Reply>();
  }

  Status readScore(const std::string& session) {
    pb::Request request;
    request.mutable_get_score()->set_session_id(session);
    ASSIGN_OR_RETURN(auto reply, ask(request, "score"));
    if (!reply) return {};
    const pb::Score& score = reply->score();
    if (auto measures = parseScore(score.measures_json()); measures.ok())
      data_.measures = *std::move(measures);
    else
      data_.notes.push_back("score: " + measures.error().message);
    data_.definition_version = score.definition_version();
    if (score.has_passed()) data_.passed = score.passed();
    data_.places = placeRowsOf(score.comparison_json());
    return {};
  }

  Status readExercise(const std::string& exercise_id) {
    const auto exercise = findExercise(call_, exercise_id);
    if (!exercise.ok()) return refused(exercise.error(), "exercise");
    if (!*exercise) return {};
    data_.exercise_name = printable((*exercise)->name());
    data_.exercise_text = printable((*exercise)->description());
    return {};
  }

  Status readReference(const std::string& exercise_id) {
    pb::Request request;
    request.mutable_get_reference()->set_exercise_id(exercise_id);
    ASSIGN_OR_RETURN(auto reply, ask(request, "reference"));
    if (reply) data_.bands.assign(reply->reference().bands().begin(), reply->reference().bands().end());
    return {};
  }

  Status readProgress(const std::string& trainee, const std::string& exercise_id,
                      const std::string& session) {
    pb::Request request;
    request.mutable_get_progress()->set_trainee(trainee);
    request.mutable_get_progress()->set_exercise_id(exercise_id);
    // The measures come with the first page; the attempt may be on a later one.
    for (bool is_first = true;; is_first = false) {
      ASSIGN_OR_RETURN(auto reply, ask(request, "progress"));
      if (!reply) return {};
      const pb::Progress& page = reply->progress();
      if (is_first) data_.progress = progressRowsOf(page.measures_json());
      for (const auto& attempt : page.attempts())
        if (attempt.session_id() == session) data_.attempt = attempt.number();
      if (data_.attempt || page.next_page().empty() || page.attempts().empty()) return {};
      request.mutable_get_progress()->set_page(page.next_page());
    }
  }

  const LabCall& call_;
  ReportData& data_;
};

// --- the page

/// On paper: two A4 pages for a usual lesson; facts, events and the measures without a requirement stand in
/// two columns, the latter without the experts.
constexpr const char* kStyle =
    "<style>body{font:15px/1.45 'DejaVu Sans',Verdana,sans-serif;color:#1b1f24;max-width:60em;margin:2em "
    "auto;padding:0 1em}h1{font-size:1.5em;margin:.1em 0}h2{font-size:1.15em;margin-top:1.6em;border-bottom:"
    "1px solid #bbb}table{border-collapse:collapse;width:100%}td,th{padding:.25em .6em;text-align:left;"
    "vertical-align:middle;border-bottom:1px solid #e3e6ea}th{font-weight:600}.n{text-align:right;"
    "white-space:nowrap}.v{font-size:1.1em;font-weight:700}.r td:nth-child(4){white-space:nowrap}.d{color:#59636e}.p{display:inline-block;width:"
    "350px;vertical-align:top}svg{max-width:100%;height:auto;display:inline-block;margin:.35em 0}svg text{"
    "font-size:11px;fill:#333}svg .h{font-weight:600;font-size:12px}svg .q{fill:#59636e}svg .g{stroke:#e3e6ea}"
    "svg .a{stroke:#59636e}svg .m{stroke:#59636e;stroke-dasharray:2 3}svg .s{fill:none;stroke-width:1.6;"
    "stroke-linejoin:round}@page{size:A4;margin:10mm 11mm}@media print{body{margin:0;padding:0;max-width:none;"
    "font-size:8.5pt;line-height:1.25}p{margin:.3em 0}h2{margin:.7em 0 .2em;break-after:avoid}tr,svg,.p{"
    "break-inside:avoid}td,th{padding:.1em .4em}svg{margin:0;display:block}.e svg{display:inline-block;width:105px}.e br{display:none}.c{columns:2;column-gap:5mm}.c .e{display:none}"
    ".p{width:32%}}</style>";

std::string heading(const std::string& words) {
  return "<h2>" + htmlText(words) + "</h2>\n";
}

std::string fact(const std::string& name, const std::string& value) {
  if (value.empty()) return {};
  return "<tr><td class='d'>" + htmlText(name) + "</td><td>" + htmlText(value) + "</td></tr>\n";
}

std::string verdictOf(const ReportData& data) {
  if (!data.passed) return data.measures.empty() ? "no score yet" : "nothing was required";
  return std::string(*data.passed ? "✔ " : "✘ ") + verdictName(data.passed);
}

std::string headOf(const ReportData& data) {
  const StoredGesture& gesture = *data.gesture;
  const auto& d = gesture.info.description();
  // an unreadable profile has no name
  const std::string& patient =
      gesture.scene.profile.name().empty() ? d.profile_id() : gesture.scene.profile.name();
  std::string out = "<p class='v'>" + htmlText(verdictOf(data)) + "</p>\n<h1>" +
                    htmlText(d.trainee().empty() ? "a trainee" : traineeName(d)) + ": " +
                    htmlText(data.exercise_name.empty() ? d.exercise_id() : data.exercise_name) +
                    "</h1>\n<p>Patient: " + htmlText(patient) + "</p>\n";
  if (const auto lowered = stiffnessShareText(stiffnessSharesOf(d), leftOut(d, gesture.scene.profile));
      !lowered.empty())
    out += "<p>" + htmlText(lowered) + "</p>\n";
  if (const auto miss = missOf(gesture.samples, gesture.events, gesture.scene.profile, gesture.scene.X_WL))
    out += "<p>" + htmlText(missText(*miss) + " " + missDirectionText(*miss)) + "</p>\n";
  if (!data.exercise_text.empty()) out += "<p>" + htmlText(data.exercise_text) + "</p>\n";
  out += "<div class='c'><table>\n" + fact("when", localTime(d.started_unix_ns(), TimeForm::kMinute)) +
         fact("station", d.station()) + fact("device", d.device()) +
         fact("attempt", data.attempt == 0 ? std::string() : std::to_string(data.attempt)) +
         fact("profile", fmt::format("revision {}", d.profile_revision())) +
         fact("force model", wordsOfName(d.axial_model())) + fact("engine", d.engine_version()) +
         fact("recording", fmt::format("{} samples", gesture.samples.size())) + "</table></div>\n";
  for (const auto& note : d.device_notes()) out += "<p class='d'>" + htmlText(note) + "</p>\n";
  for (const auto& note : gesture.notes) out += "<p class='d'>" + htmlText(note) + "</p>\n";
  for (const auto& note : data.notes) out += "<p class='d'>" + htmlText(note) + "</p>\n";
  return out;
}

/// Without name and value, which stand beside it: "above the experts' range, 1.9 N to 2.6 N (6 gestures)".
std::string expertPlaceCell(const ReportData& data, const Measure& measure) {
  const PlaceRow* const row = placeOf(data, measure.name);
  if (row == nullptr) return {};
  const std::size_t colon = row->words.rfind(": ");
  return svgPlace(row->marks) + "<br><span class='d'>" +
         htmlText(colon == std::string::npos ? row->words : row->words.substr(colon + 2)) + "</span>";
}

std::string measuresOf(const ReportData& data) {
  if (data.measures.empty()) return "<p>There is no score yet: the session must be closed first.</p>\n";
  const std::vector<std::string> names = layerNamesOf(data);
  std::string out;
  // required measures first
  for (const bool required : {true, false}) {
    std::string rows;
    for (const Measure& measure : data.measures) {
      if (measure.passed.has_value() != required || isOfTissueNotMet(measure)) continue;
      rows += "<tr>";
      if (required) rows += std::string("<td class='v'>") + (*measure.passed ? "✔" : "✘") + "</td>";
      rows += "<td>" + htmlText(measureWords(measure.name, names)) + "</td><td class='n'>" +
              htmlText(rowText(measure)) + "</td>";
      if (required)
        rows += "<td>" + htmlText(requirementText(measure.name, measure.unit, measure.min, measure.max)) +
                "</td>";
      if (!data.places.empty()) rows += "<td class='e'>" + expertPlaceCell(data, measure) + "</td>";
      rows += "</tr>\n";
    }
    if (rows.empty()) continue;
    out += std::string(required ? "<div class='r'>" : "<div class='c'>") + "<table>\n<tr>" +
           (required ? "<th></th>" : "") + "<th>" + (required ? "required measure" : "further measure") +
           "</th><th class='n'>value</th>" + (required ? "<th>required</th>" : "") +
           (data.places.empty() ? "" : "<th class='e'>beside the experts</th>") + "</tr>\n" + rows +
           "</table></div>\n";
  }
  return out + fmt::format("<p class='d'>Definitions of version {}.</p>\n", data.definition_version);
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
        event.kind != TraceEvent::Kind::kExit && event.kind != TraceEvent::Kind::kBoneContact &&
        event.kind != TraceEvent::Kind::kHubContact && event.kind != TraceEvent::Kind::kHazard &&
        event.kind != TraceEvent::Kind::kGap)
      continue;
    lines.push_back({event.time_s, wordsOf(event)});
  }
  std::stable_sort(lines.begin(), lines.end(), [](const Line& a, const Line& b) { return a.at_s < b.at_s; });
  if (lines.empty()) return "<p>Nothing.</p>\n";
  std::string out = "<div class='c'><table>\n";
  for (const Line& line : lines)
    out +=
        "<tr><td class='n'>" + clockText(line.at_s, 1) + "</td><td>" + htmlText(line.text) + "</td></tr>\n";
  return out + "</table></div>\n";
}

std::string progressOfTrainee(const ReportData& data) {
  std::string out;
  for (const std::string_view name : measuresIn(&MeasureKind::in_reports)) {
    const auto row = std::find_if(data.progress.begin(), data.progress.end(),
                                  [&](const ProgressRow& r) { return r.measure == name; });
    if (row == data.progress.end() || row->values.size() < 2) continue;
    Plot plot = progressPlot(data, *row);
    // the plot includes zero and the experts' whole range
    const auto [least, greatest] = std::minmax_element(plot.series[0].y.begin(), plot.series[0].y.end());
    AxisSpan span{std::min(0.0, *least), std::max(0.0, *greatest)};
    for (const PlotBand& band : plot.bands)
      span = {std::min(span.low, band.low), std::max(span.high, band.high)};
    span = fittedSpan(plot, span);
    plot.low = span.low;
    plot.high = span.high;
    out += fmt::format("<div class='p'>{}<br><span class='d'>{}</span></div>\n", svgPlot(plot, {340, 130}),
                       htmlText(row->words));
  }
  return out.empty() ? "<p>Fewer than two attempts have a score.</p>\n" : out;
}

std::vector<PlotMark> depthMarks(const ReportData& data) {
  const StoredGesture& gesture = *data.gesture;
  std::vector<PlotMark> marks;
  for (const pb::Annotation& remark : data.remarks)
    marks.push_back(
        {gesture.timeOfTick(remark.tick()), kDimText, "✎", remark.author() + ": " + remark.text()});
  for (const pb::SyringeEvent& event : gesture.events) {
    const bool in = event.kind() == pb::SyringeEvent::INJECTION;
    marks.push_back(
        {gesture.timeOfTick(event.begin_tick()), kDimText, in ? "▼" : "△", in ? "injection" : "aspiration"});
  }
  return marks;
}

/// The same plots as in the windows, over the whole gesture.
std::string gesturePlotsOf(const ReportData& data) {
  const StoredGesture& gesture = *data.gesture;
  if (gesture.trace.empty()) return {};
  const std::vector<PlotRequirement> requirements = requirementsOf(data.measures);
  std::string out;
  for (const GesturePlot which : {GesturePlot::kForces, GesturePlot::kDepth, GesturePlot::kSpeed,
                                  GesturePlot::kAlignment, GesturePlot::kAngles}) {
    // force components and α need the engine
    if (which == GesturePlot::kAngles && !gesture.scene.model) continue;
    Plot plot =
        gesturePlot(which, gesture.trace, gesture.scene.view.get(), gesture.first_s(), gesture.last_s());
    if (which == GesturePlot::kForces && !gesture.scene.model) plot.series.resize(1);
    if (which == GesturePlot::kAngles) plot.title = "tilt and its limit α";
    plot.marks = which == GesturePlot::kDepth ? depthMarks(data) : std::vector<PlotMark>();
    // a page shows the whole gesture
    plot.low.reset();
    plot.high.reset();
    addLimits(plot, which, requirements);
    out += svgPlot(plot, {720, 125}) + "\n";
  }
  return out;
}

std::optional<ExpertRange> rangeOf(const pb::ReferenceBand& band) {
  ReferenceBand own;
  own.name = band.measure();
  own.unit = band.unit();
  own.n = band.n();
  own.least = band.least();
  own.greatest = band.greatest();
  return expertRange(own);
}

}  // namespace

std::vector<std::string> layerNamesOf(const ReportData& data) {
  return layerNames(data.gesture->scene.profile);
}

std::vector<PlaceRow> placeRowsOf(const std::string& comparison_json) {
  std::vector<PlaceRow> rows;
  const auto list = readShallowJson<ReplyJson>(comparison_json);
  if (!list.is_array()) return rows;
  for (const auto& row : list) {
    if (!row.is_object() || textIn(row, "place").empty()) continue;
    const auto value = numberIn(row, "value"), least = numberIn(row, "least"),
               greatest = numberIn(row, "greatest");
    if (value && least && greatest && *least < *greatest)
      rows.push_back({textIn(row, "measure"), textIn(row, "words"), placeMarks({*least, *greatest}, *value)});
  }
  return rows;
}

const PlaceRow* placeOf(const ReportData& data, const std::string& measure) {
  const auto row = std::find_if(data.places.begin(), data.places.end(),
                                [&](const PlaceRow& r) { return r.measure == measure; });
  return row == data.places.end() ? nullptr : &*row;
}

std::vector<ProgressRow> progressRowsOf(const std::string& measures_json) {
  std::vector<ProgressRow> rows;
  const auto list = readShallowJson<ReplyJson>(measures_json);
  if (!list.is_array()) return rows;
  for (const auto& row : list) {
    if (!row.is_object()) continue;
    ProgressRow one{textIn(row, "measure"), textIn(row, "unit"), textIn(row, "words"), {}, {}};
    readPairs(row, one);
    if (!one.values.empty()) rows.push_back(std::move(one));
  }
  return rows;
}

Result<ReportData> collectReport(const LabCall& call, std::shared_ptr<const StoredGesture> gesture) {
  ReportData data;
  data.gesture = std::move(gesture);
  RETURN_IF_ERROR(Collector(call, data).run());
  return data;
}

Plot progressPlot(const ReportData& data, const ProgressRow& row) {
  const ShownUnit shown =
      formOf(row.measure) == MeasureForm::kShare ? ShownUnit{100, "%"} : shownUnitOf(row.unit);
  Plot plot;
  plot.title = measureWords(row.measure, data.gesture ? layerNamesOf(data) : std::vector<std::string>());
  plot.unit = shown.name;
  plot.quantity = quantityOfUnit(plot.unit);
  plot.from = 1;
  plot.to = std::max(2.0, row.attempts.empty() ? 2.0 : row.attempts.back()) + 0.001;
  plot.clock_axis = false;
  plot.x_unit = "attempt";
  plot.legend = false;
  for (const pb::ReferenceBand& band : data.bands)
    if (const auto range = band.measure() == row.measure ? rangeOf(band) : std::nullopt; range)
      plot.bands.push_back(
          {shown.per_si * range->least, shown.per_si * range->greatest, kBluishGreen, "experts"});
  PlotSeries series{"value", kSkyBlue, {}, false, false, row.attempts, row.values};
  for (double& value : series.y) value *= shown.per_si;
  plot.series.push_back(std::move(series));
  for (const PlotRequirement& requirement : requirementsOf(data.measures))
    if (requirement.measure == row.measure) addLimits(plot, requirement, shown.per_si);
  return plot;
}

std::string reportHtml(const ReportData& data) {
  std::string out = "<!DOCTYPE html>\n<html lang='en'>\n<head><meta charset='utf-8'><title>" +
                    htmlText(data.gesture->title()) + "</title>\n" + kStyle + "</head>\n<body>\n";
  out += headOf(data);
  out += heading("Measures") + measuresOf(data);
  out += heading("Events and remarks") + eventsOf(data);
  out += heading("The gesture") + gesturePlotsOf(data);
  out += heading("Progress at this exercise") + progressOfTrainee(data);
  out += "<p class='d'>needlelab " + programVersion() +
         ". Bar: from the least to the greatest value of the experts; diamond: this "
         "gesture.</p>\n</body>\n</html>\n";
  return out;
}

Status writeReport(const LabCall& call, const std::string& session_id, const std::filesystem::path& file,
                   const ScenePreparer& prepare) {
  ASSIGN_OR_RETURN(auto gesture, loadGesture(call, session_id, prepare));
  ASSIGN_OR_RETURN(const auto data, collectReport(call, std::move(gesture)));
  return writeFileAtomically(file, viewOf(reportHtml(data)));
}

Status writeSamplesCsv(const StoredGesture& gesture, const std::filesystem::path& file) {
  ASSIGN_OR_RETURN(auto growing, GrowingFile::create(file));
  constexpr std::size_t kAtOnce = 1u << 20;
  std::string text;
  appendSampleCsvHeader(text);
  for (const GestureSample& sample : gesture.samples) {
    appendSampleCsvRow(text, sample, gesture.samples.front().time_ns);
    if (text.size() < kAtOnce) continue;
    RETURN_IF_ERROR(growing.append(viewOf(text)));
    text.clear();
  }
  RETURN_IF_ERROR(growing.append(viewOf(text)));
  return growing.finish();
}

}  // namespace needlelab
