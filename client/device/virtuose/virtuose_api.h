/// The vendor's C library for the Virtuose, loaded at run time: we neither ship nor link it.
#pragma once

#include <string>

#include "common/base/result.h"

namespace needlelab {

/// A connection handle of the vendor's library.
using VirtContext = void*;

/// Numbers of the vendor's interface that we use.
enum VirtuoseConstant : int {
  kVirtIndexingNone = 2,  ///< the position is the handle's own; dead man and offset button do not change it
  kVirtImpedance = 3,     ///< command type: forces to the device, positions from it
};

/// The library's functions by name. Each returns 0 or −1 (then `virtGetErrorCode` gives the reason), except
/// `virtOpen` (null on failure; get its code with a null context) and the two error calls. Poses are x y z qx
/// qy qz qw, wrenches force then torque, speeds linear then angular; SI, floats.
struct VirtuoseApi {
  VirtContext (*virtOpen)(const char* address) = nullptr;
  int (*virtClose)(VirtContext) = nullptr;
  int (*virtGetErrorCode)(VirtContext) = nullptr;
  const char* (*virtGetErrorMessage)(int code) = nullptr;
  int (*virtSetIndexingMode)(VirtContext, int mode) = nullptr;
  int (*virtSetForceFactor)(VirtContext, float factor) = nullptr;
  int (*virtSetSpeedFactor)(VirtContext, float factor) = nullptr;
  int (*virtSetTimeStep)(VirtContext, float step_s) = nullptr;
  int (*virtSetTimeoutValue)(VirtContext, float timeout_s) = nullptr;
  int (*virtSetBaseFrame)(VirtContext, float pose[7]) = nullptr;
  int (*virtSetObservationFrame)(VirtContext, float pose[7]) = nullptr;
  int (*virtSetCommandType)(VirtContext, int type) = nullptr;
  int (*virtSetPowerOn)(VirtContext, int permitted) = nullptr;
  int (*virtSaturateTorque)(VirtContext, float force_N, float torque_Nm) = nullptr;
  int (*virtGetPosition)(VirtContext, float pose[7]) = nullptr;
  int (*virtGetSpeed)(VirtContext, float speed[6]) = nullptr;
  int (*virtSetForce)(VirtContext, float wrench[6]) = nullptr;
  int (*virtGetButton)(VirtContext, int button, int* pressed) = nullptr;
  int (*virtGetDeadMan)(VirtContext, int* held) = nullptr;
  int (*virtGetEmergencyStop)(VirtContext, int* operational) = nullptr;
  int (*virtGetPowerOn)(VirtContext, int* on) = nullptr;
  int (*virtGetAlarm)(VirtContext, unsigned* bits) = nullptr;
  int (*virtGetFailure)(VirtContext, unsigned* bits) = nullptr;

  // for messages only; null in libraries without them
  int (*virtAPIVersion)(int* major, int* minor) = nullptr;
  int (*virtGetControlerVersion)(VirtContext, int* major, int* minor) = nullptr;

  std::string path;  ///< of the loaded library
};

/// The environment variable with the library's file name, and the default name.
inline constexpr const char* kVirtuoseLibraryVariable = "NEEDLELAB_VIRTUOSE_LIBRARY";
inline constexpr const char* kVirtuoseLibraryName = "libVirtuoseAPI.so";

/// Loads `file` (a path, or a name for the system's search) and finds every function. Never unloads the
/// library, because it may have threads. Errors: kNotFound when loading fails, kVersion when functions are
/// missing (the message names all of them); both with advice.
Result<VirtuoseApi> loadVirtuoseApi(const std::string& file);

/// Loads the file in NEEDLELAB_VIRTUOSE_LIBRARY, else kVirtuoseLibraryName. A wrong file in the variable is
/// an error.
Result<VirtuoseApi> loadVirtuoseApi();

/// e.g. "3.98"; empty when the library does not say.
std::string virtuoseLibraryVersion(const VirtuoseApi& api);

}  // namespace needlelab
