/// The closed loop of the hard cases: the simulated Virtuose and hand, the gate, and a force source in place
/// of the engine. With the engine as source and no jitter it gives the same bits as SimulatedDevice and
/// HapticChain.
#pragma once

#include <cstdint>
#include <vector>

#include "client/device/simulated_device.h"
#include "client/sim/stability/force_source.h"

namespace needlelab {

struct PlantOptions {
  SimulatedDeviceOptions device;  ///< its delay is in whole ticks of `rate_hz`; no tool
  double rate_hz = 1000;
  double jitter_share = 0;   ///< a tick comes late by up to this share of a period, [0, 1)
  double missing_share = 0;  ///< share of ticks in which the device gives no update, [0, 1)
  std::uint64_t seed = 1;    ///< of jitter and missing ticks
};

/// All that one tick saw and did. Positions and forces are in W.
struct PlantTick {
  double time_s = 0;
  bool stepped = false;   ///< false: no update, or the gate rejected the sample; report as of the tick before
  TipSample seen;         ///< the tip as the encoders say
  Vec3 p_W_m, v_W_mps;    ///< the tip as it is
  Vec3 p_wanted_W_m;      ///< where the hand wants it, tremor included
  StepReport report;      ///< forces before the gate
  Vec3 rendered_force_N;  ///< after the gate
  std::uint32_t gate_flags = 0;
  double slant = 1;     ///< c of the source, see ForceSource::slant
  double energy_J = 0;  ///< ∫ f·v dt of the rendered force since the start: what the device gave to the hand
};

struct PlantRun {
  double rate_hz = 0;
  double axial_stiffness_N_per_m = 0;
  std::vector<PlantTick> ticks;
  Fault fault = Fault::kNone;  ///< the first that the gate raised; the run goes on without force
};

/// Runs the plan to its end. Deterministic. Errors: kInvalidInput, as of SimulatedDevice::open.
Result<PlantRun> runPlant(ForceSource& source, const HandPlan& plan, const PlantOptions& options);

}  // namespace needlelab
