#include "verbs/evaluate_tables.h"

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <vector>

namespace cli {
namespace {

using Json = nlohmann::ordered_json;
constexpr const char* kThresholds[] = {"5", "10", "20"};  // degrees, keys of an AUC

// A field of a CSV table (RFC 4180): null is empty, and text is quoted where it has to be.
std::string csv_field(const Json& value) {
  if (value.is_null()) return "";
  if (!value.is_string()) return value.dump();
  std::string text = value.get<std::string>();
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  for (size_t at = 0; (at = text.find('"', at)) != std::string::npos; at += 2)
    text.insert(at, "\"");
  return "\"" + text + "\"";
}

// Text with the characters that LaTeX reserves written out.
std::string tex_text(const std::string& text) {
  std::string result;
  for (const char c : text) {
    if (std::string_view("&%$#_{}").find(c) != std::string_view::npos)
      result += std::string("\\") + c;
    else if (c == '~' || c == '^')
      result += std::string("\\") + c + "{}";
    else if (c == '\\')
      result += "\\textbackslash{}";
    else
      result += c;
  }
  return result;
}

// twoview and the user's systems, each with the keys of a system.
std::vector<Json> rows_of(const Json& report) {
  const auto has_no_pose = [](const Json& pair) { return pair["pose_error_deg"].is_null(); };
  const Json& pairs = report["pairs"];
  const bool has_truth = !report["auc"]["5"].is_null();
  std::vector<Json> rows = {
      {{"name", report["options"]["matches"].is_null() ? "twoview" : "twoview on given matches"},
       {"auc", report["auc"]},
       {"auc_signed", report["auc_signed"]},
       {"median_pose_error_deg", report["median_pose_error_deg"]},
       {"num_without_pose",
        has_truth ? Json(std::count_if(pairs.begin(), pairs.end(), has_no_pose)) : Json()}}};
  for (const Json& system : report["systems"]) rows.push_back(system);
  return rows;
}

std::string number(const Json& value, const char* format) {
  if (!value.is_number()) return "--";
  char text[32];
  std::snprintf(text, sizeof text, format, value.get<double>());
  return text;
}

}  // namespace

std::string pairs_csv(const Json& report) {
  constexpr const char* kKeys[] = {"name0",
                                   "name1",
                                   "rotation_error_deg",
                                   "translation_error_deg",
                                   "translation_error_signed_deg",
                                   "pose_error_deg",
                                   "num_matches",
                                   "num_inliers",
                                   "precision",
                                   "config",
                                   "verdict",
                                   "probability_wrong",
                                   "time_ms"};
  std::string text;
  for (const char* const key : kKeys) text += (text.empty() ? "" : ",") + std::string(key);
  for (const Json& system : report["systems"])
    text += "," + csv_field("pose_error_deg " + system["name"].get<std::string>());
  text += ",error\n";
  for (const Json& pair : report["pairs"]) {
    std::string line;
    for (const char* const key : kKeys) line += csv_field(pair[key]) + ",";
    for (const Json& system : report["systems"]) {
      const Json own = pair.value("systems", Json::object());
      const std::string name = system["name"];
      line += (own.contains(name) ? csv_field(own[name]["pose_error_deg"]) : "") + ",";
    }
    text += line + csv_field(pair.value("error", Json())) + "\n";
  }
  return text;
}

std::string systems_csv(const Json& report) {
  std::string text =
      "system,auc_5,auc_10,auc_20,auc_signed_5,auc_signed_10,auc_signed_20,median_pose_error_deg,"
      "num_without_pose\n";
  for (const Json& row : rows_of(report)) {
    text += csv_field(row["name"]);
    for (const char* const auc : {"auc", "auc_signed"})
      for (const char* const threshold : kThresholds) text += "," + csv_field(row[auc][threshold]);
    text += "," + csv_field(row["median_pose_error_deg"]) + "," +
            csv_field(row["num_without_pose"]) + "\n";
  }
  return text;
}

std::string systems_tex(const Json& report) {
  const std::vector<Json> rows = rows_of(report);
  std::string text = "% Needs \\usepackage{booktabs}. Pairs: " + report["num_pairs"].dump() +
                     "\n\\begin{tabular}{lrrrrr}\n\\toprule\nsystem & AUC@5 & AUC@10 & AUC@20 & "
                     "median [deg] & no pose \\\\\n\\midrule\n";
  for (const Json& row : rows) {
    text += tex_text(row["name"].get<std::string>());
    for (const char* const threshold : kThresholds) {
      const Json& value = row["auc"][threshold];
      const bool is_best = std::all_of(rows.begin(), rows.end(), [&](const Json& other) {
        return !value.is_null() && !(other["auc"][threshold] > value);
      });
      const std::string cell = number(value, "%.1f");
      text += is_best ? " & \\textbf{" + cell + "}" : " & " + cell;
    }
    text += " & " + number(row["median_pose_error_deg"], "%.2f") + " & " +
            number(row["num_without_pose"], "%.0f") + " \\\\\n";
  }
  return text + "\\bottomrule\n\\end{tabular}\n";
}

}  // namespace cli
