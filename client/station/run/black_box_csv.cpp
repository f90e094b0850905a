#include "client/station/run/black_box_csv.h"

#include "common/base/csv.h"

namespace needlelab {
namespace {

/// Writes a row, or the names of its columns: one list for both, so that they cannot differ.
class Row {
 public:
  Row(std::string& out, bool names) : out_(out), names_(names) {}
  void whole(const char* name, auto value) {
    begin();
    out_ += names_ ? std::string(name) : std::to_string(value);
  }
  void real(const std::string& name, double value) {
    begin();
    if (names_)
      out_ += name;
    else
      appendNumber(out_, value);
  }
  void vector(const char* name, Vec3 v, const char* unit) {
    const std::string n = name, u = unit;
    real(n + "_x" + u, v.x);
    real(n + "_y" + u, v.y);
    real(n + "_z" + u, v.z);
  }
  void pose(const char* frames, const Pose& X) {
    const std::string f = frames;
    vector(("p_" + f).c_str(), X.p, "_m");
    real("q_" + f + "_x", X.q.x);
    real("q_" + f + "_y", X.q.y);
    real("q_" + f + "_z", X.q.z);
    real("q_" + f + "_w", X.q.w);
  }
  void wrench(const char* what, const Wrench& w) {
    const std::string n = what;
    vector((n + "_force_W").c_str(), w.force_N, "_N");
    vector((n + "_torque_W").c_str(), w.torque_Nm, "_Nm");
  }
  void end() { out_ += '\n'; }

 private:
  void begin() {
    if (!first_) out_ += ',';
    first_ = false;
  }
  std::string& out_;
  bool names_, first_ = true;
};

void write(Row row, const BlackBoxTick& t) {
  row.whole("tick", t.tick);
  row.whole("missed_before", t.missed_before);
  row.whole("due_ns", t.due_ns);
  row.whole("late_ns", t.late_ns);
  row.whole("read_ns", t.read_ns);
  row.whole("engine_ns", t.engine_ns);
  row.whole("write_ns", t.write_ns);
  row.whole("record_ns", t.record_ns);
  row.whole("fresh", static_cast<int>(t.fresh));
  row.whole("condition", t.reading.condition);
  row.whole("buttons", t.reading.buttons);
  row.real("plunger", t.reading.plunger);
  row.real("handle_speed_mps", t.reading.speed_mps);
  row.pose("WH", t.reading.X_WH);
  row.pose("WT", t.X_WT);
  row.whole("phase", static_cast<int>(t.phase));
  row.whole("layer", static_cast<int>(t.layer));
  row.real("depth_m", t.depth_m);
  row.real("insertion_m", t.insertion_m);
  row.real("speed_mps", t.speed_mps);
  row.wrench("wanted", t.wanted_W);
  row.wrench("rendered", t.rendered_W);
  row.whole("flags", t.flags);
  row.whole("fault", static_cast<int>(t.fault));
  row.end();
}

}  // namespace

std::string blackBoxCsv(const std::vector<BlackBoxTick>& ticks) {
  constexpr std::size_t kRowBytes = 600;
  std::string text;
  text.reserve((ticks.size() + 1) * kRowBytes);
  write(Row(text, true), {});
  for (const BlackBoxTick& tick : ticks) write(Row(text, false), tick);
  return text;
}

std::string blackBoxText(const BlackBoxDump& dump) {
  const char* cause = dump.cause == BlackBoxCause::kFault ? faultText(dump.fault)
                                                          : "20 ms of ticks were missed within a short time";
  std::string text =
      "black box " + std::to_string(dump.number) + ": " + cause + ", at tick " + std::to_string(dump.tick);
  if (dump.triggers > 1) text += ", and " + std::to_string(dump.triggers - 1) + " more in the same stretch";
  return text;
}

}  // namespace needlelab
