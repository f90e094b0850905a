#include "client/sim/accuracy/report.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>

#include "client/sim/accuracy/panel_layout.h"
#include "client/sim/accuracy/recommendation.h"
#include "client/sim/accuracy/row_group.h"
#include "common/base/program.h"
#include "common/base/text.h"

namespace needlelab {
namespace {

std::string number(const std::optional<double>& value, double scale = 1) {
  if (!value) return {};
  // %g switches to powers of ten above 999: keep a table's numbers plain
  return std::abs(*value * scale) >= 1000 ? fmt::format("{:.0f}", *value * scale)
                                          : fmt::format("{:.3g}", *value * scale);
}

// "210/260/900 (25/30/60)": of ticks, and of an empty call
std::string tailText(const TickQuantiles& ticks, const TickQuantiles& empty) {
  return fmt::format("{}/{}/{} ({}/{}/{})", number(ticks.p50_ns), number(ticks.p99_ns), number(ticks.p999_ns),
                     number(empty.p50_ns), number(empty.p99_ns), number(empty.p999_ns));
}

std::string rangeText(const CostInterval& cost) {
  return number(cost.low) + "–" + number(cost.high);
}

struct Column {
  const char* title;
  std::function<std::string(const AccuracyRow&, bool on_front)> cell;
};

const std::vector<Column>& columns() {
  using Row = AccuracyRow;
  static const std::vector<Column> all = {
      {"choice", [](const Row& r, bool) { return choiceOf(r); }},
      {"numbers", [](const Row& r, bool) { return number(r.parameters); }},
      {"rms error [N]", [](const Row& r, bool) { return number(r.rms_error_n); }},
      {"± [N]", [](const Row& r, bool) { return number(r.rms_error_spread_n); }},
      {"max [N]", [](const Row& r, bool) { return number(r.max_error_n); }},
      {"step [N]", [](const Row& r, bool) { return number(r.max_step_n); }},
      {"K margin", [](const Row& r, bool) { return number(r.stiffness_margin); }},
      {"rms [µm]", [](const Row& r, bool) { return number(r.rms_error_m, 1e6); }},
      {"bytes/sample", [](const Row& r, bool) { return number(r.bytes_per_sample); }},
      {"kB/s", [](const Row& r, bool) { return number(r.bytes_per_s, 1e-3); }},
      {"latency [ms]", [](const Row& r, bool) { return number(r.latency_ms); }},
      {"p99 [ms]", [](const Row& r, bool) { return number(r.latency_p99_ms); }},
      {"felt K [N/m]", [](const Row& r, bool) { return number(r.felt_stiffness_N_per_m); }},
      {"price [ns]",
       [](const Row& r, bool) { return r.cost ? number(r.cost->cost_ns.value) : std::string(); }},
      {"of 5 runs",
       [](const Row& r, bool) {
         return r.cost ? rangeText(r.cost->cost_ns) : r.runs_ns ? rangeText(*r.runs_ns) : std::string();
       }},
      {"instr.", [](const Row& r, bool) { return number(r.instructions); }},
      {"hot p50/p99/p99.9 (empty) [ns]",
       [](const Row& r, bool) { return r.cost ? tailText(r.cost->hot, r.cost->hot_empty) : std::string(); }},
      {"flushed (empty)",
       [](const Row& r, bool) {
         return r.cost ? tailText(r.cost->flushed, r.cost->flushed_empty) : std::string();
       }},
      {"after 1 ms (empty)",
       [](const Row& r, bool) {
         return r.cost ? tailText(r.cost->slept, r.cost->slept_empty) : std::string();
       }},
      {"made in [s]", [](const Row& r, bool) { return number(r.precompute_s); }},
      {"median [ns]", [](const Row& r, bool) { return r.cost ? std::string() : number(r.median_ns); }},
      {"p99 [ns]", [](const Row& r, bool) { return r.cost ? std::string() : number(r.p99_ns); }},
      {"core [%]", [](const Row& r, bool) { return number(r.cpu_share, 100); }},
      {"fits", [](const Row& r, bool) { return !r.fits_rate   ? ""
                                               : *r.fits_rate ? "yes"
                                                              : "NO"; }},
      {"front", [](const Row&, bool on_front) { return on_front ? "*" : ""; }},
      {"votes", [](const Row& r, bool) { return r.own_law   ? "own law"
                                                : r.advises ? ""
                                                            : "no"; }},
      {"variant", [](const Row& r, bool) { return r.variant; }},
      {"uncertainty", [](const Row& r, bool) { return r.uncertainty; }},
  };
  return all;
}

using Cells = std::vector<std::vector<std::string>>;

Cells cellsOf(const RowGroup& group) {
  Cells cells(columns().size());
  const std::vector<bool> front = paretoFront(group);
  for (std::size_t c = 0; c < columns().size(); ++c)
    for (std::size_t r = 0; r < group.rows.size(); ++r)
      cells[c].push_back(columns()[c].cell(*group.rows[r], front[r]));
  return cells;
}

void appendTable(std::string& out, const Cells& cells) {
  const std::size_t rows = cells.front().size();
  std::vector<std::string> lines(rows + 1);
  for (std::size_t c = 0; c < cells.size(); ++c) {
    if (std::all_of(cells[c].begin(), cells[c].end(), [](const std::string& s) { return s.empty(); }))
      continue;
    std::size_t width = countCharacters(columns()[c].title);
    for (const std::string& cell : cells[c]) width = std::max(width, countCharacters(cell));
    // texts to the left, numbers to the right
    const bool left = c == 0 || c + 2 >= cells.size();
    for (std::size_t r = 0; r <= rows; ++r) {
      const std::string cell = r == 0 ? columns()[c].title : cells[c][r - 1];
      const std::string space(width - countCharacters(cell), ' ');
      lines[r] += "  " + (left ? cell + space : space + cell);
    }
  }
  for (std::string& line : lines) {
    line.erase(line.find_last_not_of(' ') + 1);
    out += line + "\n";
  }
}

// a sentence of `cannot_show`, and the rows that say it
struct Limit {
  std::string sentence;
  std::vector<std::string> names;
};
std::vector<Limit> limitsOf(const RowGroup& group) {
  std::vector<Limit> limits;
  for (std::size_t i = 0; i < group.rows.size(); ++i) {
    const std::string& text = group.rows[i]->cannot_show;
    for (std::size_t from = 0; from < text.size();) {
      const std::size_t end = std::min(text.find(". ", from), text.size());
      const std::string sentence = text.substr(from, end - from);
      auto at = std::find_if(limits.begin(), limits.end(),
                             [&](const Limit& limit) { return limit.sentence == sentence; });
      if (at == limits.end()) {
        limits.push_back({sentence, {}});
        at = std::prev(limits.end());
      }
      at->names.push_back(group.names[i]);
      from = end + 2;
    }
  }
  return limits;
}

std::string limitText(const Limit& limit, const RowGroup& group) {
  std::string text = "cannot show";
  if (limit.names.size() < group.rows.size())
    for (std::size_t i = 0; i < limit.names.size(); ++i) text += ", " + limit.names[i];
  return text + ": " + limit.sentence;
}

}  // namespace

std::string wrapped(std::string_view text, std::size_t width, std::string_view indent) {
  std::string out, line(indent);
  bool empty = true;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find(' '), text.size());
    const std::string_view word = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (word.empty()) continue;
    if (!empty && countCharacters(line) + 1 + countCharacters(word) > width) {
      out += line + "\n";
      line = indent;
      empty = true;
    }
    line += (empty ? "" : " ") + std::string(word);
    empty = false;
  }
  return empty ? out : out + line + "\n";
}

std::string accuracyTables(const AccuracyRows& rows) {
  std::string out;
  for (const RowGroup& group : groupsOf(rows)) {
    out += std::string(nameOf(group.study)) + " · " + group.scene +
           (group.model.empty() ? "" : " · " + group.model) + "\n";
    out += wrapped("against: " + group.reference, 120, "  ");
    appendTable(out, cellsOf(group));
    for (const Limit& limit : limitsOf(group)) out += wrapped(limitText(limit, group), 120, "  ");
    out += "\n";
  }
  return out;
}

std::string accuracyCsv(const AccuracyRows& rows) {
  std::string out;
  const auto names = jsonOf(AccuracyRow{});
  for (const auto& item : names.items()) out += (out.empty() ? "" : ",") + item.key();
  out += "\n";
  for (const AccuracyRow& row : rows) {
    std::string line;
    const auto object = jsonOf(row);
    for (const auto& item : object.items()) {
      if (!line.empty() || item.key() != "study") line += ",";
      if (item.value().is_null()) continue;
      if (!item.value().is_string()) {
        line += item.value().dump();
        continue;
      }
      line += '"';
      for (const char c : item.value().get<std::string>())
        line += c == '"' ? std::string("\"\"") : std::string(1, c);
      line += '"';
    }
    out += line + "\n";
  }
  return out;
}

namespace {

// the two measures of a row that a diagram shows
struct Axes {
  const char *x_title, *y_title, *x_unit, *y_unit;
  std::optional<double> (*x)(const AccuracyRow&);
  std::optional<double> (*y)(const AccuracyRow&);
};

std::optional<double> scaled(const std::optional<double>& value, double scale) {
  return value ? std::optional(*value * scale) : std::nullopt;
}

constexpr auto kCost_s = [](const AccuracyRow& r) {
  const auto cost = costOf_ns(r);
  return cost ? std::optional(cost->value * 1e-9) : std::nullopt;
};
constexpr auto kError_N = [](const AccuracyRow& r) { return r.rms_error_n; };

constexpr char kTickTitle[] = "time of a tick with flushed caches, less an empty call";

// `once`: the price is paid before the lesson
Axes timeAxes(AccuracyStudy study, bool once) {
  const char* x = study == AccuracyStudy::kModel     ? kTickTitle
                  : study == AccuracyStudy::kRate    ? "processor time for 1 ms of the lesson, caches flushed"
                  : study == AccuracyStudy::kStorage ? "time to encode and decode a sample"
                  : study == AccuracyStudy::kLive    ? "processor time for a sample, station and viewer"
                  : once                             ? "time to make the mesh, once, before the lesson"
                                                     : "time of a tick (median to p99, hot)";
  const char* y = study == AccuracyStudy::kLive   ? "force seen late: rms error"
                  : study == AccuracyStudy::kMesh ? "rms error of force (bar: of the finest itself)"
                                                  : "rms error of force";
  return {x, y, "s", "N", kCost_s, kError_N};
}

const Axes kBytesAxes = {
    "bytes a sample", "rms error of force", "B", "N", [](const AccuracyRow& r) { return r.bytes_per_sample; },
    kError_N};
const Axes kLatencyAxes = {"bandwidth, framing and TLS included",
                           "latency, p99",
                           "B/s",
                           "s",
                           [](const AccuracyRow& r) { return r.bytes_per_s; },
                           [](const AccuracyRow& r) { return scaled(r.latency_p99_ms, 1e-3); }};
const Axes kStepAxes = {kTickTitle, "greatest step of force in a tick",
                        "s",        "N",
                        kCost_s,    [](const AccuracyRow& r) { return r.max_step_n; }};

// a name that fits beside a point: a variant by its beginning
std::string shortName(const AccuracyRow& row, const std::string& name) {
  const std::string choice = choiceOf(row);
  if (name == choice) return name;
  return choice + " (" + row.variant.substr(0, row.variant.find_first_of(",:;")) + ")";
}

// the rows of a group that have both measures; names of series `first` on
void addPoints(Panel& panel, const RowGroup& group, const Axes& axes, bool named) {
  const std::size_t first = panel.series.size();
  panel.series.push_back(group.scene);
  std::vector<std::size_t> shown;
  std::vector<CostError> measures;
  for (std::size_t i = 0; i < group.rows.size(); ++i) {
    const auto x = axes.x(*group.rows[i]), y = axes.y(*group.rows[i]);
    if (!x || !y || !std::isfinite(*x) || !std::isfinite(*y)) continue;
    shown.push_back(i);
    measures.push_back({*x, *y});
  }
  const bool over_time = axes.y == kError_N && axes.x == kCost_s;
  const std::vector<bool> group_front = paretoFront(group), own_front = paretoFront(measures);
  for (std::size_t k = 0; k < shown.size(); ++k) {
    const AccuracyRow& row = *group.rows[shown[k]];
    const bool is_front = over_time ? group_front[shown[k]] : own_front[k];
    PanelPoint point;
    point.x = measures[k].cost, point.y = measures[k].error;
    point.series = first;
    point.fits = row.fits_rate.value_or(true);
    point.front = is_front;
    if (axes.y == kError_N) point.spread = row.rms_error_spread_n;
    if (const auto cost = costOf_ns(row); axes.x == kCost_s && cost && cost->high > cost->low)
      point.x_range = {cost->low * 1e-9, cost->high * 1e-9};
    if (named) {
      point.label =
          group.study == AccuracyStudy::kMesh ? choiceOf(row) : shortName(row, group.names[shown[k]]);
      if (row.own_law) point.label += " (own law)";
      if (measures[k].error == 0)
        point.label += group.study == AccuracyStudy::kMesh ? " (comparator)" : " (no error)";
    }
    panel.points.push_back(std::move(point));
  }
}

Panel panelOf(const std::vector<const RowGroup*>& groups, const Axes& axes) {
  Panel panel;
  panel.x_title = axes.x_title, panel.y_title = axes.y_title;
  panel.x_unit = axes.x_unit, panel.y_unit = axes.y_unit;
  for (std::size_t s = 0; s < groups.size(); ++s) addPoints(panel, *groups[s], axes, s == 0);
  panel.under_title =
      (groups.size() == 1 ? groups[0]->scene + ", " : std::string()) + "against " + groups[0]->reference;
  if (groups[0]->study == AccuracyStudy::kMesh)
    panel.under_title = groups[0]->rows[0]->variant + ", " + panel.under_title;
  const auto& noticed = groups[0]->rows[0]->noticeable_n;
  if (noticed && axes.y != kLatencyAxes.y) {
    panel.level = *noticed;
    panel.level_name = "a hand notices " + siText(*noticed, "N");
  }
  return panel;
}

// groups of a model each alone (nine names fill a diagram), and of meshes (each has its price); others by
// reference, their scenes together
std::vector<std::vector<const RowGroup*>> diagramsOf(AccuracyStudy study,
                                                     const std::vector<RowGroup>& groups) {
  std::vector<std::vector<const RowGroup*>> diagrams;
  for (const RowGroup& group : groups) {
    if (group.study != study || !group.compares()) continue;
    auto same = std::find_if(diagrams.begin(), diagrams.end(), [&](const auto& diagram) {
      return study != AccuracyStudy::kModel && study != AccuracyStudy::kMesh &&
             diagram[0]->reference == group.reference && diagram[0]->model == group.model;
    });
    if (same == diagrams.end())
      diagrams.push_back({&group});
    else
      same->push_back(&group);
  }
  return diagrams;
}

// the group in which the greatest steps differ most
const RowGroup* mostSteps(const std::vector<std::vector<const RowGroup*>>& diagrams) {
  const RowGroup* found = nullptr;
  double widest = 1;
  for (const auto& diagram : diagrams) {
    double least = 0, most = 0;
    for (const AccuracyRow* row : diagram[0]->rows) {
      if (!row->max_step_n || *row->max_step_n <= 0) continue;
      least = least == 0 ? *row->max_step_n : std::min(least, *row->max_step_n);
      most = std::max(most, *row->max_step_n);
    }
    if (least > 0 && most / least > widest) {
      widest = most / least;
      found = diagram[0];
    }
  }
  return found;
}

std::vector<Panel> panelsOf(AccuracyStudy study, const std::vector<RowGroup>& groups) {
  std::vector<Panel> panels;
  const auto add = [&](Panel panel, const std::string& title) {
    panel.title = title;
    if (!panel.points.empty()) panels.push_back(std::move(panel));
  };
  auto diagrams = diagramsOf(study, groups);
  if (diagrams.empty()) return panels;
  constexpr std::size_t kMost = 5;
  if (diagrams.size() > kMost) diagrams.resize(kMost);
  for (const auto& diagram : diagrams) {
    AccuracyRows own;
    for (const AccuracyRow* row : diagram[0]->rows) own.push_back(*row);
    const bool once = diagram[0]->rows[0]->precompute_s.has_value();
    add(panelOf(diagram, timeAxes(study, once)), findingOf(study, own));
  }
  if (study == AccuracyStudy::kStorage) add(panelOf(diagrams[0], kBytesAxes), "Bytes for accuracy");
  if (study == AccuracyStudy::kLive) add(panelOf(diagrams[0], kLatencyAxes), "Bandwidth for being on time");
  if (study == AccuracyStudy::kModel)
    if (const RowGroup* steps = mostSteps(diagrams))
      add(panelOf({steps}, kStepAxes), "Continuity: a step is felt, whatever the mean error");
  return panels;
}

struct Grid {
  std::size_t columns = 1, rows = 1;
  double cell_width = 0, cell_height = 0;
};

AccuracyPicture pictureOf(const std::string& name, const std::string& title, const std::vector<Panel>& panels,
                          const Grid& grid, const std::string& text_cell) {
  constexpr double kHead = 48, kFoot = 40;
  const double width = static_cast<double>(grid.columns) * grid.cell_width;
  const double height = static_cast<double>(grid.rows) * grid.cell_height + kHead + kFoot;
  PlotBlocks data;
  for (std::size_t i = 0; i < panels.size(); ++i) {
    const auto column = static_cast<double>(i % grid.columns), row = static_cast<double>(i / grid.columns);
    addPanel(panels[i],
             {column * grid.cell_width, height - kHead - (row + 1) * grid.cell_height, grid.cell_width,
              grid.cell_height},
             i, data);
  }
  if (!text_cell.empty()) {
    const auto i = grid.columns * grid.rows - 1;
    const double left = static_cast<double>(i % grid.columns) * grid.cell_width + 60;
    double y = height - kHead - static_cast<double>(i / grid.columns) * grid.cell_height - 40;
    std::string rest = text_cell;
    while (!rest.empty()) {
      const std::size_t end = rest.find('\n');
      if (end != 0) data.row("text", {left, y}, {rest.substr(0, end)});
      y -= 22;
      rest.erase(0, end == std::string::npos ? rest.size() : end + 1);
    }
  }
  return {name, data.text(), {{"title", title}, {"width", width}, {"height", height}}};
}

// the text in the corner of the overview
std::string summaryText(const AccuracyRows& rows) {
  const auto advice = recommendation(rows);
  if (advice.empty()) return {};
  return wrapped(advice.back(), 70, "") + "\n" +
         wrapped(
             "Each diagram: error against time, both logarithmic; down and to the left is better. The title "
             "is the choice that the report's rule takes; the rules and all rows, with comparator, "
             "uncertainty and what they cannot show: needlelab-sim accuracy.",
             70, "") +
         "\n" + wrapped("Measured on " + machineText() + ".", 70, "");
}

constexpr std::array<const char*, 5> kTitles = {"What a model of the tissue costs, and what it gives",
                                                "What a finer FEM mesh costs, and what it gives",
                                                "What a faster haptic loop costs, and what it gives",
                                                "What a finer stored resolution costs, and what it gives",
                                                "What live frames cost, and how late they are"};

}  // namespace

std::vector<AccuracyPicture> accuracyPictures(const AccuracyRows& rows) {
  const std::vector<RowGroup> groups = groupsOf(rows);
  std::vector<AccuracyPicture> pictures;
  std::vector<Panel> firsts;
  for (std::size_t s = 0; s < kAccuracyStudyNames.size(); ++s) {
    const auto panels = panelsOf(static_cast<AccuracyStudy>(s), groups);
    if (panels.empty()) continue;
    // of the models' scenes the second is the fuller one
    firsts.push_back(s == 0 && panels.size() > 2 ? panels[1] : panels[0]);
    const std::size_t columns = panels.size() == 1 ? 1 : panels.size() <= 4 ? 2 : 3;
    const Grid grid{columns, (panels.size() + columns - 1) / columns, columns == 1 ? 1200.0 : 800.0, 600};
    pictures.push_back(
        pictureOf("accuracy_" + std::string(kAccuracyStudyNames[s]), kTitles[s], panels, grid, {}));
  }
  if (firsts.size() < 2) return pictures;
  const std::size_t columns = firsts.size() < 4 ? 2 : 3;
  const Grid grid{columns, firsts.size() / columns + 1, 800, 560};
  pictures.push_back(pictureOf("accuracy", "What accuracy costs in time", firsts, grid, summaryText(rows)));
  return pictures;
}

}  // namespace needlelab
