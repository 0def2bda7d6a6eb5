// The tables of an evaluation as CSV and for LaTeX, from its report.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace cli {

// A row for each pair: names, errors, numbers of matches, kind, verdict, time; what is not known is
// empty.
std::string pairs_csv(const nlohmann::ordered_json& report);

// A row for twoview and for each of the user's systems: AUC, signed AUC, median error, pairs
// without a pose. The table for LaTeX needs the package booktabs; the best AUC is bold.
std::string systems_csv(const nlohmann::ordered_json& report);
std::string systems_tex(const nlohmann::ordered_json& report);

}  // namespace cli
