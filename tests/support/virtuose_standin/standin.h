/// Test control of the stand-in for the Virtuose's library: sets the device's surroundings and reads its true
/// state. Tests also call the vendor's own functions, as the programs do.
///
/// A stand-in is one device in one process. Until `standin_reset` it runs in real time with the script file
/// named by NEEDLELAB_STANDIN_SCRIPT, so that whole programs can be tested with it.
///
/// Commands (standin_command, and in scripts with the time before them, one a line, # comments; in s from the
/// first reading of a position on, so that a program may prepare as long as it likes; 0: from the beginning):
///   place X Y Z QX QY QZ QW       the handle and the hand's aim are there at once
///   hand X Y Z QX QY QZ QW T      the hand's aim goes there in T s, at constant speed
///   let_go | hold                 the hand leaves the handle alone, or takes it again (the sensor feels it)
///   dead_man 0|1                  the handle's sensor alone
///   switch 0|1                    the user's power switch
///   estop press|free              pressing it also switches off: the switch is to be pressed again
///   link_down T                   nothing arrives for T s
///   slow T                        each call takes T s, at most its time-out
///   daemon 0|1                    the vendor's service
///   version right|wrong           of the library against the device
///   overheat 0|1                  the motors' sensor, regardless of what was rendered
///   alarm BITS | failure BITS     further bits (any base)
///   button N 0|1                  N = 1-3
///   jump DX DY DZ                 the encoders slip
///   bad_turn S                    the reported quaternion is S times what it should be
///   fail CALL CODE                that call fails with that code from now on; 0: no longer
#pragma once

extern "C" {

/// A time from outside.
struct StandinTime {
  void* who;                               ///< passed to both
  double (*now_s)(void* who);              ///< since an arbitrary moment
  void (*wait)(void* who, double time_s);  ///< while a call waits for its answer; other calls may be made
};

/// The true state, in SI units and in the device's base frame.
struct StandinState {
  double position_m[3], orientation[4];  ///< of the handle; x y z w
  double velocity_mps[3];
  double commanded[6];  ///< the last wrench set by virtSetForce
  double felt[6];       ///< the wrench that acts on the handle in this millisecond
  int is_powered, is_permitted;
  long openings;      ///< virtOpen calls, successful or not
  int open_contexts;  ///< as counted by the service
  unsigned alarms;
  long exchanges, overruns;  ///< virtSetForce calls; calls that came too fast
};

/// A fresh device: switched on, held, at rest at the origin; virtual time. No script.
void standin_reset(void);
/// 0: real time from now on.
void standin_virtual_time(int on);
/// Everything runs in this time until the next reset.
void standin_time(const StandinTime* time);
/// Virtual time only.
void standin_advance(double seconds);
/// Returns 0, or −1 for an unknown command.
int standin_command(const char* command);
/// Replaces the script. Returns 0, or the number of the first invalid line.
int standin_script(const char* text);
void standin_state(StandinState* state);
/// Names of the setter calls since the reset, separated by blanks; consecutive repeats appear once.
const char* standin_calls(void);
/// CALL:CODE of each refused call since the reset, separated by blanks; consecutive repeats appear once.
const char* standin_complaints(void);
}
