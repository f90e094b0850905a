/* Steps the poses of a file through a profile's scene: run_poses PROFILE POSES OUT. POSES: rows of seven doubles; OUT: rows of
 * the report's doubles. Fails if the ticks of a real-time engine with its gate allocate, or differ from nl_run. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <needlelab/needlelab.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static _Thread_local int counts;       /* this thread is in its ticks */
static _Thread_local long allocated;   /* by them */
extern void* __libc_malloc(size_t);
void* malloc(size_t size) { return allocated += counts, __libc_malloc(size); }

static char error[500];
static void* must(void* made) {
  if (made) return made;
  fprintf(stderr, "%s\n", error);
  exit(2);
}

int main(int argc, char** argv) {
  FILE* in = argc == 4 ? fopen(argv[2], "rb") : NULL;
  FILE* out = in ? fopen(argv[3], "wb") : NULL;
  if (!out) return fprintf(stderr, "usage: run_poses PROFILE POSES OUT\n"), 2;
  static double poses[7 * 200000];
  const size_t n = fread(poses, 7 * sizeof(double), 200000, in);

  nl_profile* profile = must(nl_profile_read(argv[1], error, sizeof error));
  nl_scene* scene = must(nl_scene_of_profile(profile, 1000, NULL, error, sizeof error));
  nl_engine* engine = must(nl_engine_create(scene, error, sizeof error));
  nl_engine* restarted = must(nl_engine_create(scene, error, sizeof error));
  nl_engine* live = must(nl_engine_create_realtime(scene, 0, error, sizeof error));
  const nl_limits limits = nl_default_limits();
  nl_gate* gate = must(nl_gate_create(&limits, 1000, error, sizeof error));

  nl_report* reports = must(malloc(n * sizeof *reports));
  nl_run(engine, poses, n, NULL, reports, sizeof *reports);
  for (size_t i = 0; i < n; ++i) fwrite(&reports[i].wrench, sizeof(double), 22, out);
  if (fclose(out) != 0) return perror(argv[3]), 2;

  /* half, a snapshot, the other half: the same bits, and the same state at the end */
  double* force = must(malloc(3 * n * sizeof *force));
  nl_run(restarted, poses, n / 2, force, NULL, 0);
  nl_engine* snapshot = must(nl_engine_create(scene, error, sizeof error));
  if (!nl_engine_copy(snapshot, restarted)) return fprintf(stderr, "no snapshot\n"), 1;
  if (!nl_engine_restart(restarted)) return fprintf(stderr, "no restart\n"), 1;
  nl_run(snapshot, poses + 7 * (n / 2), n - n / 2, force + 3 * (n / 2), NULL, 0);
  for (size_t i = 0; i < n; ++i)
    if (memcmp(force + 3 * i, reports[i].wrench.force_n, 3 * sizeof(double)) != 0)
      return fprintf(stderr, "tick %zu: a snapshot continues otherwise\n", i), 1;
  if (nl_engine_hash(snapshot) != nl_engine_hash(engine)) return fprintf(stderr, "another hash\n"), 1;

  /* a device loop: nothing is allocated; in layers the forces are those above (in a body, while the paths are in time) */
  counts = 1;
  nl_engine_destroy(must(nl_engine_create(scene, error, sizeof error)));
  counts = 0;
  if (!allocated) return fprintf(stderr, "allocations are not counted\n"), 1;
  allocated = 0;
  const int in_layers = nl_engine_copy(live, restarted); /* both are new; refused where a worker finds the paths */
  nl_report report = {.size = sizeof report};
  for (size_t i = 0; i < n; ++i) {
    nl_pose tip;
    memcpy(&tip, poses + 7 * i, sizeof tip);
    nl_wrench wanted = {{0}, {0}}, allowed;
    counts = 1;
    if (nl_gate_admit(gate, &tip, 1, 0, 1)) nl_step(live, &tip, &wanted);
    nl_get_report(live, &report);
    nl_gate_apply(gate, &wanted, &allowed);
    counts = 0;
    if (in_layers && memcmp(wanted.force_n, reports[i].wrench.force_n, sizeof wanted.force_n) != 0)
      return fprintf(stderr, "tick %zu: the device loop has another force\n", i), 1;
    if (i % 16 == 0) nanosleep(&(struct timespec){0, 100000}, NULL); /* for the worker */
  }
  if (allocated) return fprintf(stderr, "%ld allocations in ticks\n", allocated), 1;
  if (nl_gate_fault(gate)) return fprintf(stderr, "fault: %s\n", nl_fault_text(nl_gate_fault(gate))), 1;
  printf("%zu ticks\n", n);
  return 0;
}
