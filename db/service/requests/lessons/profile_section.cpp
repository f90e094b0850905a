#include "db/service/requests/lessons/profile_section.h"

#include <cmath>
#include <memory>
#include <utility>

#include "common/anatomy/field_body.h"
#include "common/anatomy/field_section.h"
#include "common/anatomy/inner_point.h"
#include "common/haptics/surface.h"
#include "common/profile/scene_of_profile.h"
#include "common/profile/structure_kinds.h"
#include "common/profile/volume.h"

namespace needlelab::handlers {
namespace {

constexpr double kPoint_m = 0.25e-3;
constexpr int kColumns = 416, kSectionRows = 320;
constexpr double kAbove_m = 0.012;    // the drawing begins this far outside of the skin
constexpr double kAtOrigin_m = 2e-3;  // a skin this near to the origin is the entry that the author meant
constexpr double kAside_m = 3e-3;     // a needle's end or a target farther off the normal turns the cut

/// Where the first target is: its point to aim at, or the deepest one of its structure. Nothing without a
/// target.
std::optional<Vec3> firstTarget_m(const pb::Profile& profile, const Field& field) {
  if (profile.targets_size() == 0) return std::nullopt;
  const pb::Target& target = profile.targets(0);
  if (target.has_center_m()) return vectorOf(target.center_m());
  const auto& structures = profile.volume().structures();
  for (int i = 0; i < structures.size(); ++i) {
    if (structures[i].id() != target.structure()) continue;
    const auto inner = innerPoint(fieldSpecOf(profile.volume()), field, static_cast<StructureIndex>(i));
    if (inner) return inner->at_m;
  }
  return std::nullopt;
}

void add(Vec3 v, google::protobuf::RepeatedField<double>& to) {
  for (const double number : {v.x, v.y, v.z}) to.Add(number);
}

}  // namespace

Status addSection(const pb::Profile& profile, pb::ProfileSection& section,
                  const std::optional<NeedleEntry>& needle) {
  ASSIGN_OR_RETURN(Field field, fieldOf(profile.volume()));
  const auto shared = std::make_shared<const FieldBody>(std::move(field));
  const FieldBody& body = *shared;
  const std::optional<Vec3> target_m = firstTarget_m(profile, body.field());
  Vec3 entry_m = needle ? needle->tip_m : Vec3{};
  if (!needle && target_m && std::fabs(body.depth(entry_m)) > kAtOrigin_m) entry_m = *target_m;
  entry_m = nearestSkin(BodyLimb{shared, {}}, entry_m, {0, 0, -1});
  Vec3 up = body.normal(entry_m);
  if (up == Vec3{}) up = {0, 0, 1};

  const auto level = [&](Vec3 way) { return way - up * dot(up, way); };
  Vec3 across = needle ? level(needle->axis) * profile.needle().length_m() : Vec3{};
  if (norm(across) < kAside_m && target_m) across = level(*target_m - entry_m);
  if (norm(across) < kAside_m) across = level({0, 1, 0});
  if (norm(across) < 1e-6) across = level({1, 0, 0});
  across = normalized(across);

  const double wide_m = kColumns * kPoint_m, high_m = kSectionRows * kPoint_m;
  const SectionFrame frame{entry_m - across * (0.5 * wide_m) + up * (kAbove_m - high_m), across * wide_m,
                           up * high_m, kColumns, kSectionRows};
  const FieldSection cut = sectionOf(body.field(), frame);

  add(frame.corner_m, *section.mutable_corner_m());
  add(across, *section.mutable_across());
  add(up, *section.mutable_upward());
  section.set_point_m(kPoint_m);
  section.set_columns(kColumns);
  section.set_rows(kSectionRows);
  for (const pb::Volume::Structure& structure : profile.volume().structures()) {
    auto* const named = section.add_structures();
    named->set_name(structure.layer().has_name() ? structure.layer().name() : structure.id());
    named->set_tissue(pb::Layer::Tissue_Name(tissueOf(structure)));
    named->set_kind(pb::Volume::Structure::Kind_Name(kindOf(structure)));
  }
  for (int y = 0; y < kSectionRows; ++y) {
    int from = 0;
    for (int x = 1; x <= kColumns; ++x) {
      if (x < kColumns && cut.at(x, y) == cut.at(from, y)) continue;
      const StructureIndex here = cut.at(from, y);
      section.add_runs(here == kOutside ? 0u : 1u + here);
      section.add_runs(static_cast<std::uint32_t>(x - from));
      from = x;
    }
  }
  return {};
}

}  // namespace needlelab::handlers
