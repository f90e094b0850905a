/// A scene for display, all in W: for the 3-D view, the ultrasound slice and the plots' layer bands. Also the
/// aids that select the displayed parts.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "client/view/model/palette.h"
#include "common/anatomy/tube_axes.h"
#include "common/base/result.h"
#include "common/haptics/needle_spec.h"
#include "common/haptics/scene_spec.h"
#include "common/profile/aid_list.h"
#include "common/profile/planned_line.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

class FieldBody;
class StructureRegion;
struct NeedleLine;

struct LayerView {
  pb::Volume::Structure::Kind kind = pb::Volume::Structure::OTHER;
  Rgb colour;
  std::string name;  ///< for people: "ligamentum flavum", "skin" (common/profile/layer_names.h)
  /// Depth δ below the surface, [top, bottom). In a volume 0 and 0: depth does not tell the structure.
  double top_m = 0;
  double bottom_m = 0;   ///< as drawn; in the engine the last layer has no end
  double cutting_N = 0;  ///< f_cut
  bool has_membrane = false;
  std::shared_ptr<const TubeAxes> tubes = nullptr;  ///< its fibres run along them, in L
  Vec3 fibre_L;                                     ///< its fibres run this way; 0 0 0: not known
};

struct TargetView {
  std::string name;
  Vec3 center_W_m;
  double radius_m = 0;
  Vec3 middle_W_m,
      normal_W;  ///< middle of the relevant part; the surface's unit normal there, outwards
  double top_m = 0,
         bottom_m = 0;         ///< depth range at its centre: the ball's, limited to its tissues
  std::uint32_t layers = ~0U;  ///< a bit for each layer that counts
  bool is_structure = false;   ///< of a volume: those layers alone, not the ball
};

/// A ball (a = b) or a capsule of `radius_m` about the segment a-b.
struct HazardView {
  std::string name;
  pb::Hazard::Kind kind = pb::Hazard::OTHER;
  Vec3 a_W_m, b_W_m;
  double radius_m = 0;
  std::shared_ptr<const StructureRegion> structure = nullptr;  ///< as in Region: the ball is inside of it
};

/// The profile's words for a direction, "towards the head".
struct DirectionView {
  Vec3 way_W;  ///< unit
  std::string words;
};

/// Immutable after construction. Thread: any may read.
struct SceneView {
  std::string profile_id, profile_name;
  Limb limb_W;  ///< a plane's normal is a unit vector
  /// Of a profile with a volume: `limb_W` is its body, and `layers` are its structures, in no order of depth.
  std::shared_ptr<const FieldBody> body;
  std::vector<LayerView> layers;    ///< 1-32, from the skin inward
  std::vector<double> layer_end_m;  ///< as in Anatomy
  std::vector<TargetView> targets;
  std::vector<HazardView> hazards;
  NeedleSpec needle;                      ///< diameter 0 if unknown
  double cap_radius_m = 0;                ///< of the needle's cap, with PALPATION; 0: it has none
  std::string landmark;                   ///< name of the bone to find by feel; empty: none
  std::vector<DirectionView> directions;  ///< along the axes of L, those that the profile names
  double max_force_N = 10;                ///< the profile's limit: scales force arrows
  Pose X_WL;
  /// The view's focus: the surface point above the first target, otherwise above the limb's middle; and the
  /// unit normal there, out of the tissue.
  Vec3 focus_W_m, focus_normal_W;
  /// The unit direction from the focus to the first target, or straight in.
  Vec3 way_W;
  double extent_m = 0.1;  ///< radius about the focus for the initial view: target, needle, limb
};

/// `profile`: as it ran (with an exercise's own needle already applied, as in
/// SessionDescription.profile_json). `X_WL`: pose of the profile's frame in W; its quaternion is normalised.
/// Errors: kInvalidInput for a profile that did not come from `parseProfile` or a placement that is not
/// finite.
Result<SceneView> sceneViewOf(const pb::Profile& profile, const Pose& X_WL = {});

/// Depth of a point below the nearest skin, negative outside.
double depthAt(const SceneView& scene, Vec3 p_W_m);
/// Returns the index of the layer at depth δ; −1 outside, and in a volume.
int layerAt(const SceneView& scene, double depth_m);
/// Returns the index of the layer, in a volume of the structure, at a point of W; −1 outside.
int layerAt(const SceneView& scene, Vec3 p_W_m);
/// "skin", "deltoid muscle", …; "outside" for −1, "?" for an index that the scene does not have.
const std::string& layerName(const SceneView& scene, int layer);
/// What lies on a needle's line; depths are along the needle, from where it goes in.
struct TissuesOnLine {
  struct Tissue {
    int layer = 0;
    double top_m = 0, bottom_m = 0;
    /// Whether a tip whose sample has this layer is in it; path and sample may differ by 1 mm.
    [[nodiscard]] bool holds(int tip_layer, double tip_m) const {
      return layer == tip_layer && tip_m >= top_m - 1e-3 && tip_m <= bottom_m + 1e-3;
    }
  };
  struct Aim {
    std::string name;  ///< of the target; off the line "bursa, beside the line"; empty: a further piece
    double top_m = 0, bottom_m = 0;  ///< off the line both are the place nearest to its centre
  };
  std::vector<Tissue> tissues;
  std::vector<Aim> targets;  ///< each piece of each target
};
/// The tissues of the path that the engine stepped on; without one, where the line meets them in the scene,
/// to 0.1 mm.
TissuesOnLine tissuesOnLine(const SceneView& scene, const NeedleLine& line, double reach_m);
/// How deep a column of the tissues shows, in m: a fifth beyond the deepest target; without targets, to the
/// end of the layers or of the needle, whichever is less.
double ladderDepth_m(const SceneView& scene, double insertion_m = 0);
/// Whether a target is that structure: then one of the two names is enough.
bool isTarget(const SceneView& scene, int layer);
/// The line from the focus to the first target, or straight in.
NeedleLine lineToTarget(const SceneView& scene);

/// Returns the middle of the needle's opening, where an injection leaves: `openingBehindTip_m` behind the
/// tip.
Vec3 openingOf(const SceneView& scene, Vec3 tip_W_m, Quat q_WT);
/// Returns the diameter to draw: the needle's, or 0.8 mm if unknown.
double drawnDiameter_m(const SceneView& scene);
/// Returns the distance between a hazard's (or target's) surface and the straight shaft from tip to `skin`;
/// negative inside.
double distanceToHazard_m(const HazardView& hazard, Vec3 tip_W_m, Vec3 skin_W_m);
/// Returns the hazard that is a structure and holds this point of W; null if there is none.
const HazardView* hazardAt(const SceneView& scene, Vec3 p_W_m);

/// Returns how far a drawn line continues into the tissue from `entry_W_m` along the unit vector
/// `direction_W`: the needle's length, but at least slightly beyond the foot of the farthest target on the
/// line.
double lineReach_m(const SceneView& scene, Vec3 entry_W_m, Vec3 direction_W);

/// Picture of a planned line, in W.
struct PlanView {
  Vec3 entry_W_m;
  Vec3 from_W_m, to_W_m;       ///< half a needle's length before the entry, `lineReach_m` after it
  std::vector<Vec3> ring_W_m;  ///< corners of a circle on the skin about the entry; the last connects to the
                               ///< first
};
PlanView planViewOf(const SceneView& scene, const PlannedLine& plan_W);
/// Returns the exercise's planned line in W; nullopt without a plan or if the exercise is for another
/// patient.
std::optional<PlannedLine> planOn(const SceneView& scene, const pb::Exercise& exercise);
/// Like planOn, for drawing.
std::optional<PlanView> planViewOf(const SceneView& scene, const pb::Exercise& exercise);

/// A plane shown by a picture: a cut or an ultrasound slice. `to_viewer_W` is its unit normal.
struct PicturePlane {
  Vec3 place_W_m, to_viewer_W;
};
/// Returns the distance from the plane to the hazard's nearest point: positive in front of the plane (on the
/// viewer's side), negative behind it, 0 if the plane cuts the hazard.
double offPlane_m(const HazardView& hazard, const PicturePlane& plane);
/// Returns the opacity of a hazard at that distance: 1 within 1 mm, then halved every 8 mm.
double offPlaneOpacity(double off_plane_m);
/// Returns "artery", or, more than 1 mm off the plane, "artery, 8 mm behind" or "…, 8 mm in front".
std::string hazardLabel(const HazardView& hazard, double off_plane_m);

/// The set of active aids; cheap to query and to compare in each frame. See common/profile/aid_list.h for the
/// aids that an exercise allows and their names.
class AidSet {
 public:
  constexpr AidSet() = default;  ///< no aids
  explicit AidSet(const AidList& aids);
  [[nodiscard]] constexpr bool has(pb::Exercise::Aid aid) const { return (bits_ & bit(aid)) != 0; }
  constexpr void set(pb::Exercise::Aid aid, bool on) { bits_ = on ? bits_ | bit(aid) : bits_ & ~bit(aid); }
  /// Returns the aids in numerical order, as messages require.
  [[nodiscard]] AidList list() const;
  friend constexpr bool operator==(const AidSet&, const AidSet&) = default;

 private:
  static constexpr std::uint32_t bit(pb::Exercise::Aid aid) { return 1u << static_cast<unsigned>(aid); }
  std::uint32_t bits_ = 0;
};

/// All aids except ULTRASOUND and STEPS, as `usualAids`.
AidSet usualAidSet();
/// All aids, for onlookers.
AidSet allAidSet();

/// A name for people: "ultrasound picture". JSON uses pb::Exercise::Aid_Name.
std::string_view aidWord(pb::Exercise::Aid aid);

}  // namespace needlelab
