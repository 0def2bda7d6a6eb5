#include "room_model/plan.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <opencv2/imgproc.hpp>
#include <set>

#include "pictures/canvas.h"

namespace cli {
namespace {

constexpr int kFewestRays = 3;          // through a cell that is free: single ones may be wrong
constexpr double kLeastPart = 0.05;     // of the largest piece of floor, for another one to count
constexpr size_t kFewestHeights = 3;    // voxels above each other, of what stands
constexpr double kUprightNormal = 0.3;  // the most of a normal's length along `up`: 17 degrees

Vector3 position_of(const tv_room_vertex& v) {
  return {static_cast<double>(v.position[0]), static_cast<double>(v.position[1]),
          static_cast<double>(v.position[2])};
}

Vector3 normal_of(const tv_room_vertex& v) {
  return {static_cast<double>(v.normal[0]), static_cast<double>(v.normal[1]),
          static_cast<double>(v.normal[2])};
}

cv::Point2d from_above(const Matrix3& axes, const Vector3& point) {
  const Vector3 at = applied(axes, point);
  return {at[0], at[1]};
}

// 255 in each cell from which a wall is met in three of the four directions along the axes.
cv::Mat between_walls(const RoomModel& model, const RoomPlan& plan) {
  cv::Mat walls = cv::Mat::zeros(model.free_cells.size(), CV_8U);
  for (const PlanLine& line : plan.lines)
    if (line.is_wall)
      cv::line(walls, cv::Point((line.a - model.free_origin) / model.free_cell),
               cv::Point((line.b - model.free_origin) / model.free_cell), 255);
  cv::Mat met = cv::Mat::zeros(walls.size(), CV_8U);
  const auto sweep = [&](int num_lines, int length, const auto& cell) {
    for (int line = 0; line < num_lines; ++line) {
      for (const bool backwards : {false, true}) {
        bool is_met = false;
        for (int k = 0; k < length; ++k) {
          const cv::Point at = cell(line, backwards ? length - 1 - k : k);
          is_met = is_met || walls.at<uint8_t>(at) != 0;
          met.at<uint8_t>(at) = static_cast<uint8_t>(met.at<uint8_t>(at) + (is_met ? 1 : 0));
        }
      }
    }
  };
  sweep(walls.rows, walls.cols, [](int line, int k) { return cv::Point(k, line); });
  sweep(walls.cols, walls.rows, [](int line, int k) { return cv::Point(line, k); });
  return met >= 3;
}

// Clears the cells behind walls, where there is no room: errors of depth reach there.
void clear_behind_walls(const RoomModel& model, const RoomPlan& plan, cv::Mat& cells) {
  for (const PlanLine& line : plan.lines) {
    if (!line.is_wall) continue;
    const cv::Point2d along = line.along(), normal = line.normal();
    const double length = cv::norm(line.b - line.a);
    for (int y = 0; y < cells.rows; ++y) {
      for (int x = 0; x < cells.cols; ++x) {
        const cv::Point2d from_a =
            model.free_origin + model.free_cell * cv::Point2d(x + 0.5, y + 0.5) - line.a;
        const double place = along.dot(from_a);
        if (place > 0 && place < length && normal.dot(from_a) < 0) cells.at<uint8_t>(y, x) = 0;
      }
    }
  }
}

void add_floor(const RoomModel& model, RoomPlan& plan) {
  cv::Mat cells = model.free_cells | between_walls(model, plan);
  clear_behind_walls(model, plan, cells);
  std::vector<std::vector<cv::Point>> outlines;
  cv::findContours(cells.clone(), outlines, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_SIMPLE);
  double most = 0;
  for (const auto& outline : outlines) most = std::max(most, cv::contourArea(outline));
  cv::Mat kept = cv::Mat::zeros(cells.size(), CV_8U);
  for (const auto& outline : outlines) {
    if (cv::contourArea(outline) < kLeastPart * most) continue;
    cv::drawContours(kept, std::vector<std::vector<cv::Point>>{outline}, 0, 255, cv::FILLED);
    std::vector<cv::Point2d> points;
    for (const cv::Point& p : outline)
      points.push_back(model.free_origin + model.free_cell * cv::Point2d(p.x + 0.5, p.y + 0.5));
    plan.floor.push_back(std::move(points));
  }
  plan.area = cv::countNonZero(kept) * model.free_cell * model.free_cell;
}

// Rows of cells in which upright surface stands, one voxel above the other. At the edge of a hole
// in a floor or a ceiling a vertex or two are turned by chance, at one height.
void add_upright(const RoomModel& model, RoomPlan& plan) {
  const double cell = 1.5 * model.voxel;
  const auto index = [](double value, double side) {
    return static_cast<int>(std::floor(value / side));
  };
  std::map<std::pair<int, int>, std::set<int>> heights;  // of row and column, in voxels
  for (const tv_room_vertex& v : model.vertices) {
    if (std::abs(dot(normal_of(v), model.up)) > kUprightNormal) continue;
    const Vector3 at = applied(model.axes, position_of(v));
    heights[{index(at[1], cell), index(at[0], cell)}].insert(index(at[2], model.voxel));
  }
  std::set<std::pair<int, int>> cells;  // row and column: in the order of rows
  for (const auto& [place, levels] : heights)
    if (levels.size() >= kFewestHeights) cells.insert(place);
  for (auto first = cells.begin(); first != cells.end();) {
    auto next = std::next(first);
    int length = 1;
    while (next != cells.end() && next->first == first->first &&
           next->second == first->second + length) {
      ++length;
      ++next;
    }
    plan.upright.emplace_back(cell * first->second, cell * first->first, cell * length, cell);
    first = next;
  }
}

// The number of the form 1, 2 or 5 times a power of ten that is nearest below.
double round_below(double value) {
  const double power = std::pow(10.0, std::floor(std::log10(value)));
  for (const double digit : {5.0, 2.0})
    if (digit * power <= value) return digit * power;
  return power;
}

// A drawing on a sheet in pixels, of which both formats are made.
struct Shape {
  enum Kind { kArea, kLine, kBox, kText } kind;
  std::vector<cv::Point2d> points;
  double size = 1;     // width of a line, height of capitals; pixels
  const char* colour;  // "#rrggbb"
  std::string text;
};
struct Drawing {
  int width = 0, height = 0;  // pixels
  std::vector<Shape> shapes;
};

const char* const kPaper = "#ffffff";
const char* const kFloor = "#e8eef4";
const char* const kUpright = "#a9b4bf";
const char* const kPath = "#3f86d6";
const char* const kWall = "#1b222b";
const char* const kOther = "#5b6673";

std::string short_number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

// A line from one pixel to another; of dashes where it was carried.
void add_line(const PlanLine& line, const cv::Point2d& from, const cv::Point2d& to,
              Drawing& sheet) {
  constexpr double kDash = 12;  // pixels, with what follows
  const int dashes = line.is_carried ? static_cast<int>(cv::norm(to - from) / kDash) + 1 : 1;
  const double drawn = line.is_carried ? 0.5 : 1;
  for (int k = 0; k < dashes; ++k)
    sheet.shapes.push_back({Shape::kLine,
                            {from + (k / static_cast<double>(dashes)) * (to - from),
                             from + ((k + drawn) / dashes) * (to - from)},
                            line.is_wall ? 5.0 : 2.5,
                            line.is_wall ? kWall : kOther,
                            ""});
}

Drawing drawing_of(const RoomPlan& plan, const RoomScene& scene, const RoomModel& model) {
  constexpr double kSide = 820, kMargin = 40, kFoot = 70;  // pixels
  double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
  const auto include = [&](const cv::Point2d& p) {
    low[0] = std::min(low[0], p.x);
    low[1] = std::min(low[1], p.y);
    high[0] = std::max(high[0], p.x);
    high[1] = std::max(high[1], p.y);
  };
  for (const auto& outline : plan.floor) std::for_each(outline.begin(), outline.end(), include);
  for (const PlanLine& line : plan.lines) include(line.a), include(line.b);
  std::for_each(plan.path.begin(), plan.path.end(), include);
  if (!(high[0] > low[0]))
    for (const cv::Rect2d& cells : plan.upright) include(cells.tl()), include(cells.br());
  Drawing sheet;
  if (!(high[0] > low[0]) || !(high[1] > low[1])) return {320, 120, {}};
  const double scale = kSide / std::max(high[0] - low[0], high[1] - low[1]);
  sheet.width = static_cast<int>(std::ceil(scale * (high[0] - low[0]) + 2 * kMargin));
  sheet.height = static_cast<int>(std::ceil(scale * (high[1] - low[1]) + 2 * kMargin + kFoot));
  sheet.width = std::max(sheet.width, 420);
  const auto at = [&](const cv::Point2d& p) {
    return cv::Point2d(kMargin + scale * (p.x - low[0]), kMargin + scale * (high[1] - p.y));
  };
  const auto all_at = [&](const std::vector<cv::Point2d>& points) {
    std::vector<cv::Point2d> placed;
    for (const cv::Point2d& p : points) placed.push_back(at(p));
    return placed;
  };
  for (const auto& outline : plan.floor)
    sheet.shapes.push_back({Shape::kArea, all_at(outline), 1, kFloor, ""});
  for (const cv::Rect2d& cells : plan.upright)
    if (cells.x >= low[0] && cells.y >= low[1] && cells.br().x <= high[0] &&
        cells.br().y <= high[1])
      sheet.shapes.push_back({Shape::kBox,
                              {at({cells.x, cells.br().y}), at({cells.br().x, cells.y})},
                              1,
                              kUpright,
                              ""});
  sheet.shapes.push_back({Shape::kLine, all_at(plan.path), 1.2, kPath, ""});
  for (const PlanLine& line : plan.lines) add_line(line, at(line.a), at(line.b), sheet);
  const std::string unit = scene.is_metric ? " m" : "";
  const double bar = round_below(0.25 * sheet.width / scale);
  const double y = sheet.height - 34, x = kMargin;
  sheet.shapes.push_back({Shape::kLine, {{x, y}, {x + scale * bar, y}}, 3, kWall, ""});
  for (const double end : {x, x + scale * bar})
    sheet.shapes.push_back({Shape::kLine, {{end, y - 6}, {end, y + 6}}, 2, kWall, ""});
  sheet.shapes.push_back({Shape::kText, {{x, y - 12}}, 10, kWall, short_number(bar) + unit});
  const std::string words =
      short_number(plan.area) + (scene.is_metric ? " m2" : " squares of the path's unit") +
      " of floor; " + short_number(model.size[0]) + " x " + short_number(model.size[1]) + unit;
  sheet.shapes.push_back({Shape::kText, {{x, y + 24}}, 10, kOther, words});
  return sheet;
}

std::string point_text(const cv::Point2d& p) {
  char text[48];
  std::snprintf(text, sizeof text, "%.1f,%.1f", p.x, p.y);
  return text;
}

cv::Scalar bgr_of(const char* colour) {
  unsigned value = 0;
  std::sscanf(colour, "#%x", &value);
  return cv::Scalar(value & 255, value >> 8 & 255, value >> 16 & 255);
}

}  // namespace

FreeArea::FreeArea(const RoomModel& model) : axes_(model.axes), near_(4 * model.voxel) {
  constexpr int kMostCells = 1000;  // a side
  double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
  for (const tv_room_vertex& v : model.vertices) {
    const Vector3 point = position_of(v);
    surface_.push_back(key_of(point));
    const Vector3 at = applied(axes_, point);
    for (size_t k = 0; k < 2; ++k) {
      low[k] = std::min(low[k], at[k]);
      high[k] = std::max(high[k], at[k]);
    }
  }
  std::sort(surface_.begin(), surface_.end());
  surface_.erase(std::unique(surface_.begin(), surface_.end()), surface_.end());
  if (surface_.empty()) return;
  const double side = std::max(high[0] - low[0], high[1] - low[1]);
  cell_ = std::max(1.5 * model.voxel, side / kMostCells);
  origin_ = {low[0] - cell_, low[1] - cell_};
  counts_ = cv::Mat::zeros(static_cast<int>((high[1] - low[1]) / cell_) + 3,
                           static_cast<int>((high[0] - low[0]) / cell_) + 3, CV_8U);
}

int64_t FreeArea::key_of(const Vector3& point) const {
  int64_t key = 0;
  for (const double value : point)
    key = key << 21 | (static_cast<int64_t>(std::floor(value / near_)) & 0x1fffff);
  return key;
}

void FreeArea::add_ray(const Vector3& centre, const Vector3& hit) {
  if (!std::binary_search(surface_.begin(), surface_.end(), key_of(hit))) return;
  const cv::Point2d from = (from_above(axes_, centre) - origin_) / cell_;
  const cv::Point2d to = (from_above(axes_, hit) - origin_) / cell_;
  const int steps = static_cast<int>(std::max(std::abs(to.x - from.x), std::abs(to.y - from.y)));
  for (int k = 0; k <= steps; ++k) {
    const cv::Point2d at = from + (k / std::max(1.0, static_cast<double>(steps))) * (to - from);
    const int x = static_cast<int>(std::floor(at.x)), y = static_cast<int>(std::floor(at.y));
    if (x < 0 || y < 0 || x >= counts_.cols || y >= counts_.rows) continue;
    uint8_t& count = counts_.at<uint8_t>(y, x);
    if (count < 255) ++count;
  }
}

cv::Mat FreeArea::cells() const {
  if (counts_.empty()) return cv::Mat::zeros(1, 1, CV_8U);
  cv::Mat free = counts_ >= kFewestRays;
  cv::morphologyEx(free, free, cv::MORPH_CLOSE, cv::Mat::ones(3, 3, CV_8U));
  return free;
}

RoomPlan plan_of(const RoomScene& scene, const RoomModel& model) {
  RoomPlan plan;
  plan.lines = plan_lines(model);
  add_floor(model, plan);
  add_upright(model, plan);
  for (const RoomView& view : scene.views) plan.path.push_back(from_above(model.axes, view.t));
  return plan;
}

std::string plan_svg(const RoomPlan& plan, const RoomScene& scene, const RoomModel& model) {
  const Drawing sheet = drawing_of(plan, scene, model);
  const std::string width = std::to_string(sheet.width), height = std::to_string(sheet.height);
  std::string svg = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"" + width + "\" height=\"" +
                    height + "\" viewBox=\"0 0 " + width + " " + height +
                    "\" font-family=\"sans-serif\">\n<rect width=\"100%\" height=\"100%\" fill=\"" +
                    kPaper + "\"/>\n";
  for (const Shape& shape : sheet.shapes) {
    std::string points;
    for (const cv::Point2d& p : shape.points) points += (points.empty() ? "" : " ") + point_text(p);
    const std::string colour = shape.colour, size = short_number(shape.size);
    switch (shape.kind) {
      case Shape::kArea:
        svg += "<polygon fill=\"" + colour + "\" points=\"" + points + "\"/>\n";
        break;
      case Shape::kLine:
        svg += "<polyline fill=\"none\" stroke=\"" + colour + "\" stroke-width=\"" + size +
               "\" points=\"" + points + "\"/>\n";
        break;
      case Shape::kBox: {
        const cv::Point2d sides = shape.points[1] - shape.points[0];
        const std::string corner = point_text(shape.points[0]), box = point_text(sides);
        const size_t comma = corner.find(','), middle = box.find(',');
        svg += "<rect x=\"" + corner.substr(0, comma) + "\" y=\"" + corner.substr(comma + 1) +
               "\" width=\"" + box.substr(0, middle) + "\" height=\"" + box.substr(middle + 1) +
               "\" fill=\"" + colour + "\"/>\n";
        break;
      }
      case Shape::kText: {
        const size_t comma = points.find(',');
        svg += "<text x=\"" + points.substr(0, comma) + "\" y=\"" + points.substr(comma + 1) +
               "\" font-size=\"" + short_number(1.4 * shape.size) + "\" fill=\"" + colour + "\">" +
               shape.text + "</text>\n";
        break;
      }
    }
  }
  return svg + "</svg>\n";
}

cv::Mat plan_picture(const RoomPlan& plan, const RoomScene& scene, const RoomModel& model) {
  const Drawing drawing = drawing_of(plan, scene, model);
  cv::Mat sheet(drawing.height, drawing.width, CV_8UC3, bgr_of(kPaper));
  for (const Shape& shape : drawing.shapes) {
    const cv::Scalar colour = bgr_of(shape.colour);
    switch (shape.kind) {
      case Shape::kArea: {
        std::vector<cv::Point> points(shape.points.begin(), shape.points.end());
        cv::fillPoly(sheet, std::vector<std::vector<cv::Point>>{points}, colour, cv::LINE_AA);
        break;
      }
      case Shape::kLine:
        for (size_t k = 1; k < shape.points.size(); ++k)
          put_line(sheet, shape.points[k - 1], shape.points[k], colour,
                   std::max(1, static_cast<int>(std::lround(shape.size))));
        break;
      case Shape::kBox:
        cv::rectangle(sheet, shape.points[0], shape.points[1], colour, cv::FILLED);
        break;
      case Shape::kText: put_text(sheet, shape.text, shape.points[0], shape.size, colour); break;
    }
  }
  return sheet;
}

}  // namespace cli
