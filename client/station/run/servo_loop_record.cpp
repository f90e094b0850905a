// What a tick leaves behind: the sample, what others see of it, the black box, the statistics.
#include <bit>

#include "client/station/run/servo_loop.h"

namespace needlelab {

void ServoLoop::record(DeviceRead read, TickTimes& times) noexcept {
  publish(times);
  const bool raised = noteFault();
  BlackBoxTick* kept = nullptr;
  if (settings_.black_box != nullptr) {
    kept = &settings_.black_box->next();
    fill(*kept, read, times);
    if (raised) settings_.black_box->trigger(BlackBoxCause::kFault, chain_tick_.fault, chain_tick_.tick);
    if (storm_.note(times.missed))
      settings_.black_box->trigger(BlackBoxCause::kMissedTicks, chain_tick_.fault, chain_tick_.tick);
  }
  times.recorded_ns = clock_.nowNs();
  if (kept != nullptr) {
    kept->record_ns = times.recorded_ns - times.wrote_ns;
    settings_.black_box->commit();
  }

  stats_.read.add(times.read_ns - times.began_ns);
  stats_.engine.add(times.engine_ns());
  stats_.write.add(times.wrote_ns - times.computed_ns);
  stats_.record.add(times.recorded_ns - times.wrote_ns);
  stats_.device.add(times.device_ns());
  stats_.tick.add(times.recorded_ns - times.began_ns);
}

void ServoLoop::publish(const TickTimes& times) noexcept {
  const GestureSample sample = sampleOf(chain_tick_, times.due_ns, times.device_ns(), times.engine_ns());
  ++stats_.samples;
  for (std::uint32_t bits = sample.flags; bits != 0; bits &= bits - 1)
    ++stats_.flag_ticks[static_cast<std::size_t>(std::countr_zero(bits))];
  // a full ring counts what it refuses; the loop never waits for anybody
  ring_.push(sample);
  latest_.publish(sample);
}

// true when the gate raised a fault in this tick
bool ServoLoop::noteFault() noexcept {
  fault_.store(chain_tick_.fault, std::memory_order_relaxed);
  condition_.store(reading_.condition, std::memory_order_relaxed);
  const ForceGate& gate = chain_.gate();
  cause_lasts_.store(gate.causeLasts(), std::memory_order_relaxed);
  acknowledgement_stands_.store(gate.acknowledged(), std::memory_order_relaxed);
  if (chain_tick_.fault != Fault::kNone) ++stats_.fault_ticks;
  const std::uint64_t raised = gate.faultsRaised();
  stats_.noteFault(chain_tick_.fault, raised != stats_.faults, chain_tick_.tick);
  if (raised == stats_.faults) return false;
  if (stats_.faults == 0) stats_.first_fault = chain_tick_.fault;
  stats_.faults = raised;
  faults_.store(raised, std::memory_order_relaxed);
  return true;
}

void ServoLoop::fill(BlackBoxTick& kept, DeviceRead read, const TickTimes& times) const noexcept {
  const StepReport& report = chain_tick_.report;
  kept.tick = chain_tick_.tick;
  kept.missed_before = times.missed;
  kept.due_ns = times.due_ns;
  kept.late_ns = times.late_ns;
  kept.read_ns = times.read_ns - times.began_ns;
  kept.engine_ns = times.engine_ns();
  kept.write_ns = times.wrote_ns - times.computed_ns;
  kept.reading = reading_;
  kept.fresh = read == DeviceRead::kFresh;
  kept.X_WT = chain_tick_.X_WT;
  kept.wanted_W = report.wrench_W;
  kept.rendered_W = chain_tick_.rendered_W;
  kept.depth_m = report.depth_m;
  kept.insertion_m = report.insertion_m;
  kept.speed_mps = report.speed_mps;
  kept.flags = report.flags | chain_tick_.gate_flags;
  kept.layer = static_cast<std::int8_t>(report.layer);
  kept.phase = static_cast<std::uint8_t>(report.phase);
  kept.fault = static_cast<std::uint8_t>(chain_tick_.fault);
}

}  // namespace needlelab
