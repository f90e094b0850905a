/* A device loop of your own: pose in, gate, engine, gate, wrench out, a thousand times a second. Here the "device" is a
 * hand that pushes a needle 20 mm into a phantom and pulls it out; put your driver's calls in its two places.
 *   cc device_loop.c $(pkg-config --cflags --libs needlelab-haptics) -lm -o device_loop && ./device_loop */
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <needlelab/haptics.h>
#include <stdio.h>
#include <time.h>

static nl_pose read_device(int tick) { /* your driver: the tip's pose in W */
  nl_pose tip = {{0, 0, 0.005 - 0.025 * 0.5 * (1 - cos(tick * 2 * 3.14159265 / 4000))}, {1, 0, 0, 0}}; /* points down */
  return tip;
}
static void write_device(const nl_wrench* wrench) { /* your driver: force and torque on the hand */
  (void)wrench;
}

int main(void) {
  char error[300];
  nl_layer layers[2] = {nl_default_layer(), nl_default_layer()}; /* skin, muscle */
  layers[0].thickness_m = 0.002, layers[0].cutting_force_n = 2.0, layers[0].attracted_force_n = 0.8;
  layers[1].thickness_m = 0.050, layers[1].cutting_force_n = 1.2, layers[1].attracted_force_n = 0.5;
  const char* effects[] = {"CUTTING", "ATTRACTED"};
  nl_scene_def def = nl_default_scene_def();
  def.layers = layers, def.layer_count = 2, def.effects = effects, def.effect_count = 2;

  nl_scene* scene = nl_scene_create(&def, 1000, error, sizeof error);
  nl_limits limits = nl_default_limits(); /* your device's */
  nl_gate* gate = nl_gate_create(&limits, 1000, error, sizeof error);
  nl_engine* engine = scene ? nl_engine_create_realtime(scene, 20, error, sizeof error) : NULL;
  if (!gate || !engine) return fprintf(stderr, "%s\n", error), 1;

  nl_report report = {.size = sizeof report};
  struct timespec due;
  clock_gettime(CLOCK_MONOTONIC, &due);
  for (int tick = 0; tick < 4000; ++tick) {
    const nl_pose tip = read_device(tick);
    nl_wrench wanted = {{0, 0, 0}, {0, 0, 0}}, allowed;
    if (nl_gate_fault(gate)) nl_gate_note_outside(gate, nl_scene_depth_m(scene, tip.p_m) <= 0);
    if (nl_gate_admit(gate, &tip, 1, 0, 1)) nl_step(engine, &tip, &wanted);
    nl_gate_apply(gate, &wanted, &allowed);
    write_device(&allowed);
    if (tick % 250 == 0) {
      nl_get_report(engine, &report);
      printf("%4d ms  %5.1f mm in  %6.2f N along z\n", tick, report.insertion_m * 1e3, allowed.force_n[2]);
    }
    due.tv_nsec += 1000000;
    if (due.tv_nsec >= 1000000000) due.tv_nsec -= 1000000000, ++due.tv_sec;
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL);
  }
  nl_engine_destroy(engine), nl_gate_destroy(gate), nl_scene_destroy(scene);
  return 0;
}
