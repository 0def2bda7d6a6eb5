#include "report/report.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "report/assets.h"
#include "report/html.h"
#include "report/ply.h"

namespace cli {
namespace {

using Json = nlohmann::ordered_json;

std::string number_of(const Json& value, const char* format) {
  return value.is_number() ? formatted(format, value.get<double>()) : "&ndash;";
}

// Where camera 1 stands, in the frame of camera 0: each distance with its direction in words.
std::string direction_card(const Outcome& outcome) {
  const Vector3 c =
      applied(transposed(rotation_of(outcome.two_view)), translation_of(outcome.two_view));
  const double unit = -unit_of(outcome);
  const char* const directions[3][2] = {{"right", "left"}, {"down", "up"}, {"forward", "back"}};
  std::string text;
  for (size_t i = 0; i < 3; ++i) {
    const double distance = unit * c[i];
    text += (i > 0 ? ", " : "") + formatted("%.2f", std::abs(distance)) +
            (outcome.scale ? " m " : " ") + directions[i][distance < 0];
  }
  return card(text, "", "where camera 1 stands, seen from camera 0", "card wide");
}

std::string cards(const Outcome& outcome) {
  const Json& j = outcome.json;
  std::string text =
      card(std::to_string(outcome.reconstruction.num_points), "", "points in the cloud");
  if (outcome.dense) {
    text += card(std::to_string(outcome.dense->size()), "", "dense points");
    if (!outcome.dense->empty()) {
      text += card(number_of(j["dense_sigma_median_percent"], "%.2f"), "%",
                   "1 sigma of a dense point's distance by its match, median");
      text += card(number_of(j["dense_pose_sigma_median_percent"], "%.2f"), "%",
                   "1 sigma of a dense point's distance by the pose, median");
    }
  }
  text += card(std::to_string(outcome.two_view.num_inliers),
               "of " + std::to_string(outcome.two_view.num_matches), "matches that agree");
  const tv_two_view& v = outcome.two_view;
  if (v.has_R)
    text += card(formatted("%.2f", rotation_error_deg(rotation_of(v), {1, 0, 0, 0, 1, 0, 0, 0, 1})),
                 "deg", "rotation between the views");
  if (has_full_pose(v)) text += direction_card(outcome);
  if (v.has_covariance) {
    const Uncertainty sigma = uncertainty_deg(v);
    text += card(sigma_in_words(sigma.rotation), "deg", "1 sigma of the rotation");
    text += card(sigma_in_words(sigma.direction), "deg", "1 sigma of the direction");
  }
  if (v.has_R && v.has_t)
    text += card(formatted("%.2g", 100 * v.probability_wrong), "%",
                 std::string("probability that the rotation is off by more than 5 deg") +
                     (focal_length_is_uncertain(v) ? ", if the focal length is right" : ""));
  text += card(number_of(j["median_parallax_deg"], "%.2f"), "deg", "median parallax");
  text += card(number_of(j["rms_reprojection_px"], "%.2f"), "px", "reprojection, rms");
  const double* shift = outcome.two_view.principal_point_shift;
  if (shift[0] != 0 || shift[1] != 0)
    text += card(formatted("%+.1f, ", shift[0]) + formatted("%+.1f", shift[1]), "px",
                 "the principal point is off; pose and points are of the corrected camera");
  if (focal_length_is_uncertain(outcome.two_view))
    text += card(formatted("%.1f", 100 * outcome.two_view.focal_sigma), "%",
                 "focal length uncertain: calibrate the camera");
  const Json& truth = j["truth"];
  if (truth.is_object()) {
    text += card(number_of(truth["rotation_error_deg"], "%.3f"), "deg", "rotation error");
    text += card(number_of(truth["translation_error_deg"], "%.2f"), "deg", "direction error");
    if (truth["depth_error_median_percent"].is_number())
      text +=
          card(number_of(truth["depth_error_median_percent"], "%.2f"), "%", "depth error, median");
    if (truth.contains("dense_depth_error_median_percent"))
      text += card(number_of(truth["dense_depth_error_median_percent"], "%.2f"), "%",
                   "depth error of the dense points, median");
  }
  if (j["imu"].is_object())
    text += card(number_of(j["imu"]["rotation_difference_deg"], "%.2f"), "deg",
                 "between the IMU's rotation and the cameras'");
  if (outcome.scale)
    text += card(formatted("%.3f", outcome.scale->baseline_m),
                 "&plusmn; " + formatted("%.3f", outcome.scale->sigma_m) + " m",
                 "between the cameras, by " + outcome.scale->source);
  text += card(number_of(j["timings_ms"]["total"], "%.1f"), "ms", "computing time");
  return text;
}

std::string leaf_text(const Json& value) {
  if (value.is_null()) return "&ndash;";
  if (value.is_string()) return escaped(value.get<std::string>());
  if (value.is_number_float()) return formatted("%.6g", value.get<double>());
  return escaped(value.dump(-1, ' ', false, Json::error_handler_t::replace));
}

// The text of a row-major matrix, one line a row.
std::string matrix_text(const Json& list, size_t columns) {
  // Numbers of one size have six decimals; F, of which some are 1e-7, has six digits of each.
  const auto is_plain = [](const Json& v) {
    const double size = v.is_number() ? std::abs(v.get<double>()) : 0;
    return size == 0 || (size >= 1e-3 && size < 1e4);
  };
  const bool fixed = list.size() != 9 || std::all_of(list.begin(), list.end(), is_plain);

  std::string text;
  for (size_t i = 0; i < list.size(); ++i) {
    const char* format = columns == 5 ? "%10.2e" : fixed ? "%12.6f" : "%14.6e";
    text += list[i].is_number() ? formatted(format, list[i].get<double>()) : "     -";
    if (i + 1 < list.size()) text += (i + 1) % columns == 0 ? "\n" : " ";
  }
  return text;
}

std::string row(const std::string& name, const Json& value) {
  std::string text;
  if (value.is_array()) {
    for (const Json& item : value) text += (text.empty() ? "" : ", ") + leaf_text(item);
    if (text.empty()) text = "&ndash;";
  } else {
    text = leaf_text(value);
  }
  return "<tr><th>" + name + "</th><td>" + text + "</td></tr>\n";
}

std::string table(const std::string& title, const std::string& rows) {
  return "<table><caption>" + title + "</caption>\n" + rows + "</table>\n";
}

std::string object_table(const std::string& title, const Json& object) {
  std::string rows;
  for (const auto& [key, value] : object.items()) rows += row(key, value);
  return table(title, rows);
}

std::string matrix(const std::string& name, const Json& list, size_t columns) {
  return list.is_array() ? "<figure><figcaption>" + name + "</figcaption><pre>" +
                               matrix_text(list, columns) + "</pre></figure>\n"
                         : "";
}

// The HTML of R, t and the values derived from them, side by side.
std::string matrices(const Json& j) {
  std::string text = matrix("R", j["R"], 3) + matrix("t", j["t"], 1) + matrix("E", j["E"], 3) +
                     matrix("F", j["F"], 3) + matrix("H", j["H"], 3);
  if (j["alternative"].is_object())
    text += matrix("alternative R", j["alternative"]["R"], 3) +
            matrix("alternative t", j["alternative"]["t"], 1);
  text += matrix("covariance, rad&sup2; (w0 w1 w2 a b)", j["covariance"], 5);
  return text.empty() ? "" : "<div class=\"matrices\">\n" + text + "</div>\n";
}

// The camera of each image as used, at the size of the image as used, and where it is from.
std::string camera_table(const Outcome& outcome) {
  std::string rows;
  for (size_t i = 0; i < 2; ++i) {
    const std::string name = "camera " + std::to_string(i);
    if (!outcome.has_cameras) {
      rows += row(name, "none given");
      continue;
    }
    const Json& origin = outcome.json["cameras"][i];
    if (origin["source"] == "file") {
      rows += row(name, "file " + origin["file"].get<std::string>());
    } else {
      const std::string focal =
          formatted("%.4g mm as for 35 mm film", origin["focal_35mm"].get<double>());
      const std::string from = origin["source"] == "exif"        ? "EXIF data: "
                               : origin["source"] == "estimated" ? "none given, searched around "
                                                                 : "--focal-35mm: ";
      rows += row(name, from + focal);
    }
    const tv_camera& camera = outcome.camera[i];
    const double values[] = {camera.fx, camera.fy, camera.cx, camera.cy};
    const char* const names[] = {"fx", "fy", "cx", "cy"};
    for (size_t k = 0; k < 4; ++k) rows += row(names[k], formatted("%.2f px", values[k]));
  }
  return table("Cameras as given, at the size used", rows);
}

std::string tables(const Outcome& outcome) {
  const Json& j = outcome.json;
  Json shown = j;
  shown["verdict"] = verdict_in_words(outcome.two_view);  // result.json has the library's word
  std::string found;
  for (const char* key :
       {"image_size0", "image_size1", "num_keypoints", "num_matches", "num_inliers", "config",
        "verdict", "reasons", "probability_wrong", "num_points", "num_dense_points",
        "median_parallax_deg", "rms_reprojection_px", "principal_point_shift_px", "scale",
        "scale_sigma", "num_iterations"})
    found += row(key, shown[key]);
  std::string text = table("What was found", found);
  text += camera_table(outcome);
  if (j["truth"].is_object()) text += object_table("Against the truth", j["truth"]);
  if (j["imu"].is_object()) text += object_table("Against the IMU", j["imu"]);
  if (j.contains("recording")) text += object_table("Out of the recording", j["recording"]);
  text += object_table("Inliers of each model", j["evidence"]);
  if (j["principal_point"].is_object())
    text += object_table("The principal point", j["principal_point"]);
  if (j["camera_misfit"].is_object())
    text += object_table("Against the camera as given", j["camera_misfit"]);
  text += object_table("Time, ms", j["timings_ms"]);
  text += object_table("Options as used", j["options"]);
  return text;
}

Json camera_json(const Outcome& outcome, int camera, double size) {
  const Frustum frustum = frustum_of(outcome, camera, size);
  return {{"centre", frustum.centre}, {"corners", frustum.corners}};
}

std::string cloud_section(const Outcome& outcome, const std::vector<CloudPoint>& cloud) {
  if (cloud.empty()) return "";
  const std::string unit = outcome.scale ? "metres" : "baselines, the distance between the cameras";
  return "<section>\n<h2>The cloud</h2>\n<div class=\"stage\"><canvas id=\"cloud\"></canvas>\n"
         "<div class=\"buttons\"><button id=\"view-front\">front</button>"
         "<button id=\"view-side\">side</button><button id=\"view-top\">top</button></div></div>\n"
         "<p class=\"hint screen\">Drag to turn, wheel or pinch to zoom, shift and drag to move, "
         "double "
         "click "
         "to start again. Camera 0 is white, camera 1 orange; x right, y down, z forward. Lengths "
         "are in " +
         unit + ".</p>\n</section>\n";
}

std::string cloud_script(const Outcome& outcome, const std::vector<CloudPoint>& cloud) {
  if (cloud.empty()) return "";
  std::string points, colours;
  std::vector<double> depths;
  for (const CloudPoint& p : cloud) {
    for (const double value : {p.x, p.y, p.z}) append_float(points, static_cast<float>(value));
    for (const uint8_t value : {p.red, p.green, p.blue}) colours += static_cast<char>(value);
    depths.push_back(p.z);
  }
  const double size = 0.11 * std::abs(percentile(depths, 0.5));
  const Json data = {{"points", base64(points)},
                     {"colours", base64(colours)},
                     {"cameras", {camera_json(outcome, 0, size), camera_json(outcome, 1, size)}}};
  return "<script type=\"application/json\" id=\"cloud-data\">" + data.dump() +
         "</script>\n<script>\n" + kReportScript + "</script>\n";
}

std::string figure_section(const Figure& figure) {
  return "<section>\n<h2>" + figure.title + "</h2>\n<figure><img alt=\"" + figure.title +
         "\" src=\"data:image/" + (figure.is_photo ? "jpeg" : "png") + ";base64," +
         base64(figure.is_photo ? jpeg_bytes(figure.picture) : png_bytes(figure.picture)) +
         "\">\n<figcaption>" + figure.caption + "</figcaption></figure>\n</section>\n";
}

}  // namespace

std::string report_html(const Outcome& outcome, const std::vector<CloudPoint>& cloud,
                        const std::vector<Figure>& figures) {
  const tv_two_view& v = outcome.two_view;
  const std::string name0 = escaped(outcome.picture[0].name),
                    name1 = escaped(outcome.picture[1].name);
  const std::string reasons = reasons_in_words(outcome);
  std::string sections;
  for (const Figure& figure : figures) sections += figure_section(figure);
  const char* const classes[] = {"poor", "fair", "good"};
  return filled(
      kReportPage,
      {{"title", name0 + " and " + name1 + ": twoview"},
       {"style", kReportStyle},
       {"images", name0 + " <small>and</small> " + name1},
       {"verdict_class", classes[v.verdict]},
       {"verdict", verdict_in_words(v)},
       {"verdict_words", escaped(kind_in_words(v.kind) + (reasons.empty() ? "" : ": " + reasons))},
       {"advice", bullets("advice", advice_on(outcome))},
       {"notes", bullets("notes", outcome.notes)},
       {"cards", cards(outcome)},
       {"cloud", cloud_section(outcome, cloud)},
       {"figures", sections},
       {"matrices", matrices(outcome.json)},
       {"tables", tables(outcome)},
       {"json", escaped(json_text(outcome.json))},
       {"version", tv_version_string()},
       {"script", cloud_script(outcome, cloud)},
       {"print", kPrintScript}});
}

}  // namespace cli
