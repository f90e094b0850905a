/// Rows of hard cases as JSON and as a table for a person.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "client/sim/stability/case.h"

namespace needlelab {

/// The fields of DESIGN §5, and `quantity` and `note`.
nlohmann::ordered_json rowsJson(const std::vector<CaseRow>& rows);

/// One line a case, one column a model: what was measured, marked where it chatters (~) or diverges (!);
/// below it each case's quantity, the notes, and in which cases another model does no worse than the enhanced
/// tracking wall. `rows` case by case, each with the same models.
std::string rowsText(const std::vector<CaseRow>& rows);

/// Short names of models for column heads: "wall", "wall 2018", "direct", …
std::string_view shortName(AxialModel model);
/// A number with three significant digits; "0" below 1e-9, "-" where there is none.
std::string shortNumber(std::optional<double> value);

/// The rows of one case, in order; and all cases' names in order.
std::vector<std::string> caseNames(const std::vector<CaseRow>& rows);
const CaseRow* rowOf(const std::vector<CaseRow>& rows, const std::string& case_name, AxialModel model);

/// One sentence: in how many cases the wall is stable, and which models chatter or diverge most.
std::string findingOf(const std::vector<CaseRow>& rows);

}  // namespace needlelab
