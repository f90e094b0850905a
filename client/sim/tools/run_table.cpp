#include "client/sim/tools/run_table.h"

#include <fmt/core.h>

#include "common/base/text/csv.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/scene_model.h"

namespace needlelab {

std::string runHeader() {
  std::string header =
      "t_s,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,wx_m,wy_m,wz_m,phase,layer,depth_m,insertion_m,alpha_rad,"
      "lateral_error_m";
  for (const EffectEntry* effect : effectsAsShown())
    if (effect->unit == "N") header += fmt::format(",{}_n", effect->term);
  return header + "\n";
}

void appendRunRow(std::string& out, double t_s, const StepReport& report, double needle_length_m) {
  const auto number = [&out](double value) {
    appendNumber(out, value);
    out += ',';
  };
  const auto vector = [&number](Vec3 v) { number(v.x), number(v.y), number(v.z); };
  number(t_s);
  vector(report.wrench_W.force_N);
  vector(report.wrench_W.torque_Nm);
  vector(report.p_wall_W_m);
  out += phaseName(report.phase);
  out += ',';
  out += std::to_string(report.layer);
  out += ',';
  number(report.depth_m);
  number(report.insertion_m);
  number(orientationLimitAngle(needle_length_m, report.insertion_m));
  appendNumber(out, report.lateral_error_m);
  for (const EffectEntry* effect : effectsAsShown()) {
    if (effect->unit != "N") continue;
    out += ',';
    appendNumber(out, effect->value(report));
  }
  out += '\n';
}

}  // namespace needlelab
