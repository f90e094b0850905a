/// The vendor's C library for the Virtuose, found at run time: we neither ship nor link it.
#pragma once

#include <string>

#include "common/base/result.h"

namespace needlelab {

/// A connection, as the vendor's library hands it out.
using VirtContext = void*;

/// Numbers of the vendor's interface that we use.
enum VirtuoseConstant : int {
  kVirtIndexingNone = 2,  ///< the position is the handle's own; dead man and offset button do not change it
  kVirtImpedance = 3,     ///< command type: forces to the device, positions from it
};

/// The library's functions by name. Each gives 0 or −1 (then `virtGetErrorCode` says why), except `virtOpen`
/// (null when it failed; its code is asked for with a null context) and the two error calls. Poses are x y z
/// qx qy qz qw, wrenches force then torque, speeds linear then angular; SI, floats.
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

/// The environment variable that names the library's file, and the name that is searched without it.
inline constexpr const char* kVirtuoseLibraryVariable = "NEEDLELAB_VIRTUOSE_LIBRARY";
inline constexpr const char* kVirtuoseLibraryName = "libVirtuoseAPI.so";

/// Loads `file` (a path, or a name for the system's search) and finds every function. A library once loaded
/// stays: the vendor's may have threads. Errors: kNotFound when it cannot be loaded, kVersion when functions
/// are missing (all of them are named); both say what to do.
Result<VirtuoseApi> loadVirtuoseApi(const std::string& file);

/// The file that NEEDLELAB_VIRTUOSE_LIBRARY names, else kVirtuoseLibraryName. A variable that names a wrong
/// file is an error; it is not ignored.
Result<VirtuoseApi> loadVirtuoseApi();

/// e.g. "3.98"; empty when the library does not say.
std::string virtuoseLibraryVersion(const VirtuoseApi& api);

}  // namespace needlelab
