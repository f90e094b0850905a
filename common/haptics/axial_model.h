/// Models of the force along the trajectory (FORCE_MODEL.md, "Axial models"), and the parameters that an
/// author sets for each.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string_view>
#include <vector>

namespace needlelab {

struct NeedleCompliance;

/// The model of the force along u. Append only: profiles and recordings name the models.
enum class AxialModel : std::uint8_t {
  kEnhancedTrackingWall,
  kTrackingWall,
  kDirect,
  kVoigt,
  kGodObject,
  kFirstOrder,
  kStatistical,
  kPrecomputed,
  kFem,
  kOkamura,
  kDahl
};
inline constexpr std::size_t kAxialModelCount = 11;
inline constexpr std::array<std::string_view, kAxialModelCount> kAxialModelNames = {"ENHANCED_TRACKING_WALL",
                                                                                    "TRACKING_WALL",
                                                                                    "DIRECT",
                                                                                    "VOIGT",
                                                                                    "GOD_OBJECT",
                                                                                    "FIRST_ORDER",
                                                                                    "STATISTICAL",
                                                                                    "PRECOMPUTED",
                                                                                    "FEM",
                                                                                    "OKAMURA",
                                                                                    "DAHL"};
constexpr std::string_view axialModelName(AxialModel model) {
  return kAxialModelNames[static_cast<std::size_t>(model)];
}

struct DirectSpec {
  double stiffness_N_per_m = 500;  ///< (0, 10000]
  bool step_at_layers = true;      ///< true: at most the layer's cutting force; false: unlimited
};

struct VoigtSpec {
  double stiffness_N_per_m = 500;  ///< K, (0, 10000]
  double damping_Ns_per_m = 5;     ///< B, [0, 1000]
  /// 0: ẋ over one tick. Otherwise over an adaptive window that bridges this much position noise, [0, 1e-3]
  /// m. For studies; no profile sets it.
  double velocity_noise_m = 0;
};

struct GodObjectSpec {
  double stiffness_N_per_m = 500;  ///< (0, 10000]
};

/// Parameters of one layer.
struct FirstOrderSpec {
  double stiffness_N_per_m = 0;  ///< up to puncture, (0, 10000]
  double puncture_force_N = 0;   ///< (0, 50]
  double cutting_force_N = 0;    ///< after puncture, [0, 50]
  double friction_N_per_m = 0;   ///< per inserted length, [0, 1e4]
};

/// The shaft's friction against the motion in one direction, per inserted length.
struct ShaftFrictionSpec {
  double kinetic_N_per_m = 0;    ///< [0, 1e4]
  double static_N_per_m = 0;     ///< OKAMURA: at rest, from kinetic to 1e4
  double viscous_Ns_per_m2 = 0;  ///< added to kinetic, per speed, [0, 1e5]
};

/// Parameters of one layer, for OKAMURA and DAHL.
struct OkamuraSpec {
  double linear_N_per_m = 0;      ///< force up to puncture: linear·z + quadratic·z², [0, 10000]
  double quadratic_N_per_m2 = 0;  ///< [0, 1e9]; not both 0
  double puncture_force_N = 0;    ///< (0, 50]
  double cutting_force_N = 0;     ///< after puncture, [0, 50]
  ShaftFrictionSpec in, out;      ///< friction on the way in and on the way out
};

struct StatisticalSpec {
  struct Row {
    double depth_m = 0;  ///< increasing, [0, 1]
    double mean_N = 0;   ///< [0, 50]
    double sd_N = 0;     ///< [0, 50]
  };
  std::vector<Row> table;              ///< 1-256 rows
  double correlation_length_m = 3e-3;  ///< of the normal score along the depth, (0, 1]
  std::uint64_t seed = 0;
  double mean_factor = 1;       ///< patient factor: scales mean and sd, (0, 10]
  double thickness_factor = 1;  ///< patient factor: scales the table's depths, (0, 10]
};

struct PrecomputedSpec {
  struct Row {
    double depth_m = 0;      ///< increasing, [0, 1]
    double cutting_N = 0;    ///< magnitude on the way in, [0, 50]
    double attracted_N = 0;  ///< magnitude on the way out, [0, 50]
  };
  std::vector<Row> table;  ///< 1-1024 rows
};

/// Linear elasticity of one layer, for FEM.
struct FemLayerSpec {
  double young_Pa = 0;          ///< E, [100, 1e9]
  double poisson = 0;           ///< ν, [0, 0.49]
  double friction_N_per_m = 0;  ///< shaft friction per inserted length, [0, 1e4]
  double cutting_N = 0;         ///< at the tip, [0, 50]
};

struct FemSpec {
  std::int32_t nodes = 3000;         ///< of the mesh, [100, 200000]
  std::vector<FemLayerSpec> layers;  ///< one for each layer of the scene
  /// The compliance computed by common/fem: `compile` refuses a FEM scene without it. Shared, never changed.
  std::shared_ptr<const NeedleCompliance> compliance;
};

}  // namespace needlelab
