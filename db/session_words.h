/// What a station wrote with a session in words of its own. An erasure takes it out of the person's sessions,
/// and looks for names in that of others.
#pragma once

#include <string>

#include "common/base/result.h"
#include "db/connection.h"
#include "db/pseudonyms.h"
#include "needlelab/types.pb.h"

namespace needlelab {

/// Leaves what an erased person's session needs: ids, times, rate, resolution and the engine's version. A
/// station may put a name into all else, also into fields that this version does not know.
void clearStationWords(pb::SessionDescription& description);

/// Makes descriptions of one person's sessions those of erased sessions. Does not own the connection. Thread:
/// as its Connection.
class ErasedDescriptions {
 public:
  enum class Names {
    kAll,      ///< those of an erasure that is under way
    kSomeGone  ///< of a person who was erased before: nobody knows the full name any more
  };
  /// `others` of the names stay nowhere: nothing reads an id of a session that has no recording.
  ErasedDescriptions(Connection& connection, ErasedNames names, Names known = Names::kAll);
  /// clearStationWords(), the pseudonym in the place of the trainee, and ids and version without the person's
  /// names. An id of a stored profile, course or exercise stays (ErasureStore's reply names it). A text that
  /// has the letters of a name even then, or would be longer than kMaxNameBytes, becomes the pseudonym. With
  /// kSomeGone, so does each other id, and a version that has more than digits and points.
  Status erase(pb::SessionDescription& description);

 private:
  [[nodiscard]] std::string without(const std::string& text) const;
  Result<bool> isStored(const std::string& id);
  Connection& connection_;
  ErasedNames names_;
  NameSearch search_;
  bool some_gone_;
};

/// All texts of a description, one a line, but for session, station and trainee. Where it has fields that
/// this version does not know, all of its bytes, too.
std::string wordsOf(pb::SessionDescription description);

}  // namespace needlelab
