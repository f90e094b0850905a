#include "client/view/model/aids.h"

namespace needlelab {

AidSet::AidSet(const AidList& aids) {
  for (const int number : aids)
    if (pb::Exercise::Aid_IsValid(number) && number != pb::Exercise::AID_UNSPECIFIED)
      set(static_cast<pb::Exercise::Aid>(number), true);
}

AidList AidSet::list() const {
  AidList aids;
  for (int number = pb::Exercise::Aid_MIN; number <= pb::Exercise::Aid_MAX; ++number)
    if (pb::Exercise::Aid_IsValid(number) && has(static_cast<pb::Exercise::Aid>(number))) aids.Add(number);
  return aids;
}

AidSet usualAidSet() {
  return AidSet(usualAids());
}

AidSet allAidSet() {
  AidSet all;
  for (int number = pb::Exercise::Aid_MIN; number <= pb::Exercise::Aid_MAX; ++number)
    if (pb::Exercise::Aid_IsValid(number) && number != pb::Exercise::AID_UNSPECIFIED)
      all.set(static_cast<pb::Exercise::Aid>(number), true);
  return all;
}

std::string_view aidWord(pb::Exercise::Aid aid) {
  switch (aid) {
    case pb::Exercise::PHASE:
      return "phase of the insertion";
    case pb::Exercise::LAYER:
      return "current layer";
    case pb::Exercise::DEPTH:
      return "depth";
    case pb::Exercise::FORCE:
      return "force";
    case pb::Exercise::ULTRASOUND:
      return "ultrasound picture";
    case pb::Exercise::TISSUES:
      return "tissues, cut open";
    case pb::Exercise::ANATOMY:
      return "target and hazards";
    case pb::Exercise::GUIDES:
      return "insertion line and cone";
    case pb::Exercise::ARROWS:
      return "force arrows";
    case pb::Exercise::ALIGNMENT:
      return "alignment";
    default:
      return "unknown aid";
  }
}

}  // namespace needlelab
