#include "room_model/plan_lines.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <utility>

namespace cli {
namespace {

// Two numbers agree where they differ by at most so many of their standard deviations.
constexpr double kAgreeSigmas = 3;
// Lengths in voxels. The surface is blurred over the truncation, five voxels: that near its end two
// lines meet.
constexpr double kMeetVoxels = 5, kNearVoxels = 2;
constexpr double kGapVoxels = 10, kShortestVoxels = 8;  // 30 and 24 cm at 3 cm
// The errors of vertices within so many voxels of each other are taken as one: three blocks, as in
// the library's planes.
constexpr double kPatchVoxels = 12;
constexpr double kVerticesOfCell = 6;  // one above the other, 18 cm at 3 cm, make a line
constexpr double kLeastArea = 320;   // of a line, in squares of a voxel: 0.29 square metres at 3 cm
constexpr double kCornerSine = 0.7;  // lines that are turned by 45 degrees or more make a corner

cv::Point2d direction_of(const cv::Point2d& normal) { return {-normal.y, normal.x}; }

// A part of a plane from above: the points p of normal . p = offset between two places along it.
struct Piece {
  cv::Point2d normal;
  double offset = 0;
  double begin = 0, end = 0;         // along direction_of(normal)
  double low = 0, high = 0;          // heights
  double area = 0;                   // that vertices cover
  double sigma = 0, sigma_turn = 0;  // of the offset of a patch, and of the direction in radians
  bool is_wall = false;
  std::vector<cv::Point3d> places;  // of its vertices: from above, and their heights

  cv::Point2d direction() const { return direction_of(normal); }
  cv::Point2d at(double along) const { return offset * normal + along * direction(); }
};

// A vertex of upright surface.
struct Upright {
  cv::Point3d place;       // from above, and its height
  cv::Point2d at, normal;  // from above
  bool is_taken = false;   // by a line
};

cv::Point2d flat(const Matrix3& axes, const Vector3& vector) {
  const Vector3 at = applied(axes, vector);
  return {at[0], at[1]};
}

Vector3 vector_of(const float values[3]) {
  return {static_cast<double>(values[0]), static_cast<double>(values[1]),
          static_cast<double>(values[2])};
}

std::vector<Upright> upright_surface(const RoomModel& model) {
  constexpr double kLeastLevel = 0.9;  // of a normal's length: 26 degrees
  std::vector<Upright> found;
  for (const tv_room_vertex& v : model.vertices) {
    const Vector3 at = applied(model.axes, vector_of(v.position));
    const cv::Point2d normal = flat(model.axes, vector_of(v.normal));
    const double level = cv::norm(normal);
    if (level > kLeastLevel)
      found.push_back({{at[0], at[1], at[2]}, {at[0], at[1]}, normal / level, false});
  }
  return found;
}

constexpr double kSameNormal = 0.9;  // cosine of 26 degrees

double away_from(const Piece& piece, const Upright& v) {
  return piece.normal.dot(v.at) - piece.offset;
}

// Assigns the vertices to planes: each vertex belongs to the nearest plane only.
void find_places(const std::vector<Upright>& surface, double voxel, std::vector<Piece>& planes) {
  for (const Upright& v : surface) {
    double nearest = kNearVoxels * voxel;
    Piece* best = nullptr;
    for (Piece& plane : planes) {
      const double away = std::abs(away_from(plane, v));
      if (plane.normal.dot(v.normal) > kSameNormal && away < nearest) nearest = away, best = &plane;
    }
    if (best != nullptr) best->places.push_back(v.place);
  }
}

// Fits a piece to its vertices by least squares. Where the fitted direction agrees with an axis of
// the room, the piece takes that of the axis.
void fit(double voxel, Piece& piece) {
  const double count = static_cast<double>(piece.places.size());
  const cv::Point2d direction = piece.direction();
  cv::Point2d middle;
  for (const cv::Point3d& p : piece.places) middle += cv::Point2d(p.x, p.y) / count;
  double var = 0, cov = 0, spread = 0;
  for (const cv::Point3d& p : piece.places) {
    const cv::Point2d from = cv::Point2d(p.x, p.y) - middle;
    const double along = direction.dot(from), away = piece.normal.dot(from);
    var += along * along / count;
    cov += along * away / count;
    spread += away * away / count;
  }
  const double patch = kPatchVoxels * voxel;
  piece.area = count * voxel * voxel;
  piece.sigma = std::sqrt(std::max(spread, 0.25 * voxel * voxel));
  piece.sigma_turn = piece.sigma / std::sqrt(var * std::max(1.0, piece.area / (patch * patch)));
  cv::Point2d normal = piece.normal - cov / var * direction;
  normal /= cv::norm(normal);
  const cv::Point2d axis = std::abs(normal.x) > std::abs(normal.y)
                               ? cv::Point2d(normal.x > 0 ? 1 : -1, 0)
                               : cv::Point2d(0, normal.y > 0 ? 1 : -1);
  if (std::abs(std::asin(normal.cross(axis))) <= kAgreeSigmas * piece.sigma_turn) normal = axis;
  piece.normal = normal;
  piece.offset = normal.dot(middle);
  piece.begin = piece.low = INFINITY;
  piece.end = piece.high = -INFINITY;
  for (const cv::Point3d& p : piece.places) {
    const double along = piece.direction().dot(cv::Point2d(p.x, p.y));
    piece.begin = std::min(piece.begin, along), piece.end = std::max(piece.end, along);
    piece.low = std::min(piece.low, p.z), piece.high = std::max(piece.high, p.z);
  }
}

// The stretches of a plane along which enough of it was measured.
void add_stretches(const Piece& plane, double voxel, std::vector<Piece>& pieces) {
  std::vector<std::pair<double, cv::Point3d>> places;
  for (const cv::Point3d& p : plane.places)
    places.emplace_back(plane.direction().dot(cv::Point2d(p.x, p.y)), p);
  std::sort(places.begin(), places.end(),
            [](const auto& a, const auto& b) { return a.first < b.first; });
  for (size_t begin = 0, end; begin < places.size(); begin = end) {
    for (end = begin + 1; end < places.size(); ++end)
      if (places[end].first - places[end - 1].first > kGapVoxels * voxel) break;
    const double length = places[end - 1].first - places[begin].first;
    if (length < kShortestVoxels * voxel ||
        static_cast<double>(end - begin) < kVerticesOfCell * length / voxel)
      continue;
    Piece piece = plane;
    piece.places.clear();
    for (size_t k = begin; k < end; ++k) piece.places.push_back(places[k].second);
    fit(voxel, piece);
    pieces.push_back(std::move(piece));
  }
}

std::vector<Piece> upright_planes(const RoomModel& model) {
  constexpr double kWallBehind = 0.03;  // as for tv_room_infer
  std::vector<Piece> planes;
  for (const tv_room_plane& plane : model.planes) {
    if (plane.kind != TV_ROOM_PLANE_UPRIGHT) continue;
    Piece piece;
    piece.normal = flat(model.axes, {plane.normal[0], plane.normal[1], plane.normal[2]});
    piece.normal /= cv::norm(piece.normal);
    piece.offset =
        piece.normal.dot(flat(model.axes, {plane.centre[0], plane.centre[1], plane.centre[2]}));
    piece.sigma = plane.sigma;
    piece.is_wall = plane.share_behind < kWallBehind;
    planes.push_back(piece);
  }
  return planes;
}

// The surface that faces one direction, counted in cells along it and in front of it.
class Raster {
 public:
  Raster(const std::vector<Upright>& surface, const cv::Point2d& normal, double voxel)
      : normal_(normal), along_(2 * voxel), away_(0.5 * voxel), voxel_(voxel) {
    cv::Point2d low(INFINITY, INFINITY), high(-INFINITY, -INFINITY);
    for (const Upright& v : surface) {
      const cv::Point2d p(direction_of(normal).dot(v.at), normal.dot(v.at));
      low = {std::min(low.x, p.x), std::min(low.y, p.y)};
      high = {std::max(high.x, p.x), std::max(high.y, p.y)};
    }
    low_ = low;
    if (surface.empty()) return;
    counts_ = cv::Mat::zeros(static_cast<int>((high.y - low.y) / away_) + 1,
                             static_cast<int>((high.x - low.x) / along_) + 1, CV_32F);
    for (const Upright& v : surface)
      if (!v.is_taken && normal.dot(v.normal) > kSameNormal) ++counts_.at<float>(cell_of(v.at));
  }

  // The stretch of a line that most of the surface lies on; of no area where there is none. A cell
  // of a line counts where the surface is not much denser a little before or behind it: else a line
  // between two fronts, one beside the other, would have most.
  Piece best() const {
    constexpr int kPeakRows = 9;  // four voxels
    constexpr double kLeastOfPeak = 0.7;
    Piece found;
    if (counts_.empty()) return found;
    const cv::Mat weights = (cv::Mat_<float>(5, 1) << 1, 2, 3, 2, 1) / 3;
    cv::Mat sums, peaks;
    cv::filter2D(counts_, sums, CV_32F, weights, {-1, -1}, 0, cv::BORDER_CONSTANT);
    cv::dilate(sums, peaks, cv::Mat::ones(kPeakRows, 1, CV_8U));
    sums.setTo(0, sums < kLeastOfPeak * peaks);
    for (int row = 0; row < sums.rows; ++row) take_best(row, sums.ptr<float>(row), found);
    return found;
  }

  void leave_out(const Upright& v) {
    if (normal_.dot(v.normal) > kSameNormal) --counts_.at<float>(cell_of(v.at));
  }

 private:
  cv::Point cell_of(const cv::Point2d& at) const {
    return {static_cast<int>((direction_of(normal_).dot(at) - low_.x) / along_),
            static_cast<int>((normal_.dot(at) - low_.y) / away_)};
  }

  void take_best(int row, const float* sums, Piece& found) const {
    const int num = counts_.cols, gap = static_cast<int>(kGapVoxels / 2);
    for (int begin = 0; begin < num; ++begin) {
      double count = 0;
      int end = begin;
      for (int x = begin; x < num && x - end <= gap; ++x) {
        if (static_cast<double>(sums[x]) < 2 * kVerticesOfCell) continue;
        count += static_cast<double>(sums[x]);
        end = x + 1;
      }
      if (end == begin) continue;
      const double area = count * voxel_ * voxel_;
      if (end - begin >= kShortestVoxels / 2 && area > found.area) {
        found.normal = normal_;
        found.offset = low_.y + (row + 0.5) * away_;
        found.begin = low_.x + begin * along_;
        found.end = low_.x + end * along_;
        found.area = area;
      }
      begin = end - 1;
    }
  }

  cv::Point2d normal_, low_;
  double along_, away_, voxel_;
  cv::Mat counts_;
};

// Takes from the surface the vertices that lie on a piece and those that are its blur; `places`
// becomes those that lie on it.
void take(double voxel, std::vector<Upright>& surface, Piece& piece, Raster* raster) {
  const double reach = std::max((kNearVoxels + 1) * voxel, kAgreeSigmas * piece.sigma);
  piece.places.clear();
  for (Upright& v : surface) {
    if (v.is_taken || piece.normal.dot(v.normal) < kSameNormal) continue;
    const double along = piece.direction().dot(v.at), away = std::abs(away_from(piece, v));
    if (along < piece.begin || along > piece.end || away > reach) continue;
    v.is_taken = true;
    if (raster != nullptr) raster->leave_out(v);
    if (away <= kNearVoxels * voxel) piece.places.push_back(v.place);
  }
}

// Fronts of furniture: the longest lines that face one direction, one after the other.
void add_fronts(const cv::Point2d& normal, double voxel, std::vector<Upright>& surface,
                std::vector<Piece>& pieces) {
  Raster raster(surface, normal, voxel);
  while (true) {
    Piece best = raster.best();
    if (!(best.area >= kLeastArea * voxel * voxel)) return;
    take(voxel, surface, best, &raster);
    if (best.places.empty()) return;
    add_stretches(best, voxel, pieces);
  }
}

// The directions that fronts of furniture may face: the room's axes, and the normals of planes that
// are at an angle to them.
std::vector<cv::Point2d> directions_of(const std::vector<Piece>& planes) {
  constexpr double kTurnedCosine = 0.985;  // 10 degrees
  std::vector<cv::Point2d> found = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
  for (const Piece& plane : planes)
    if (std::none_of(found.begin(), found.end(), [&plane](const cv::Point2d& normal) {
          return normal.dot(plane.normal) > kTurnedCosine;
        }))
      found.push_back(plane.normal);
  return found;
}

// Whether two pieces are of one surface: they face the same side, their directions agree within
// three standard deviations, along the wall they overlap or leave a gap of at most kGapVoxels, and
// in the middle of that overlap or gap they are at most three standard deviations apart.
bool are_one(const Piece& a, const Piece& b, double voxel) {
  if (a.normal.dot(b.normal) < 0.9) return false;
  const double turn = std::abs(std::asin(a.normal.cross(b.normal)));
  if (turn > kAgreeSigmas * std::hypot(a.sigma_turn, b.sigma_turn)) return false;
  const double ends[2] = {a.direction().dot(b.at(b.begin)), a.direction().dot(b.at(b.end))};
  const double from = std::max(a.begin, ends[0]), to = std::min(a.end, ends[1]);
  if (from - to > kGapVoxels * voxel) return false;
  const cv::Point2d middle = a.at(0.5 * (from + to));
  const double apart = std::abs(b.normal.dot(middle) - b.offset);
  return apart <= kAgreeSigmas * std::hypot(a.sigma, b.sigma);
}

// Joins two pieces into one, which takes the direction of the one that is known more precisely.
Piece joined(const Piece& a, const Piece& b, double voxel) {
  Piece one = a.sigma_turn < b.sigma_turn ? a : b;
  one.is_wall = a.is_wall || b.is_wall;
  one.places = a.places;
  one.places.insert(one.places.end(), b.places.begin(), b.places.end());
  fit(voxel, one);
  return one;
}

void join_all(std::vector<Piece>& pieces, double voxel) {
  for (size_t a = 0; a < pieces.size(); ++a) {
    for (size_t b = a + 1; b < pieces.size();) {
      if (!are_one(pieces[a], pieces[b], voxel)) {
        ++b;
        continue;
      }
      pieces[a] = joined(pieces[a], pieces[b], voxel);
      pieces.erase(pieces.begin() + static_cast<std::ptrdiff_t>(b));
      b = a + 1;  // the joined one is longer
    }
  }
}

// Whether nothing was looked at through a line, from its free side: then a wall may go on there.
bool is_hidden(const RoomModel& model, const cv::Point2d& from, const cv::Point2d& to,
               const cv::Point2d& normal) {
  constexpr double kBehindCells = 3;
  const double length = cv::norm(to - from), cell = model.free_cell;
  const int steps = static_cast<int>(length / cell);
  for (int k = 1; k < steps; ++k) {
    const cv::Point2d at = from + (k / static_cast<double>(steps)) * (to - from) -
                           kBehindCells * cell * normal - model.free_origin;
    const int x = static_cast<int>(std::floor(at.x / cell));
    const int y = static_cast<int>(std::floor(at.y / cell));
    if (x < 0 || y < 0 || x >= model.free_cells.cols || y >= model.free_cells.rows) continue;
    if (model.free_cells.at<uint8_t>(y, x) != 0) return false;
  }
  return true;
}

// Where an end of a piece meets another one.
struct Meeting {
  double along = 0;  // of the piece
  bool is_found = false;
  bool is_carried = false;  // beyond what was measured
};

Meeting meeting_of(const RoomModel& model, const std::vector<Piece>& pieces, size_t which,
                   bool at_begin) {
  constexpr double kFarthestVoxels = 50;  // that a wall is carried to a corner: 1.5 m at 3 cm
  const Piece& piece = pieces[which];
  const double end = at_begin ? piece.begin : piece.end;
  Meeting best;
  double nearest = kFarthestVoxels * model.voxel;
  for (size_t k = 0; k < pieces.size(); ++k) {
    const Piece& other = pieces[k];
    const double sine = piece.normal.cross(other.normal);
    if (k == which || std::abs(sine) < kCornerSine) continue;
    if (other.high < piece.low || other.low > piece.high) continue;
    // The point of piece that lies on other.
    const double along = (other.offset - piece.offset * piece.normal.dot(other.normal)) /
                         piece.direction().dot(other.normal);
    const double gap = std::abs(along - end);
    const double on_other = other.direction().dot(piece.at(along));
    const double beside = std::max({0.0, other.begin - on_other, on_other - other.end});
    const double meet = kMeetVoxels * model.voxel;
    const bool is_near = gap <= meet && beside <= meet;
    const bool is_longer = at_begin ? along < end : along > end;
    const bool is_corner = piece.is_wall && other.is_wall && is_longer &&
                           beside <= kFarthestVoxels * model.voxel &&
                           is_hidden(model, piece.at(end), piece.at(along), piece.normal);
    if (gap >= nearest || (!is_near && !is_corner)) continue;
    nearest = gap;
    best = {along, true, !is_near};
  }
  return best;
}

PlanLine line_of(const Piece& piece, double begin, double end, bool is_carried) {
  PlanLine line;
  line.a = piece.at(begin);
  line.b = piece.at(end);
  line.low = piece.low, line.high = piece.high;
  line.sigma = piece.sigma;
  line.is_wall = piece.is_wall;
  line.is_carried = is_carried;
  return line;
}

// Adds the parts of a wall between two measured parts where nothing was seen because something
// stands in front.
void add_hidden_parts(const RoomModel& model, const std::vector<Piece>& pieces,
                      std::vector<PlanLine>& lines) {
  for (const Piece& piece : pieces) {
    const Piece* next = nullptr;
    for (const Piece& other : pieces) {
      if (!piece.is_wall || !other.is_wall || piece.normal.dot(other.normal) < 0.9) continue;
      const cv::Point2d to = other.at(other.begin);
      const double apart = std::abs(piece.normal.dot(to) - piece.offset);
      if (piece.direction().dot(to) <= piece.end) continue;
      if (apart > kAgreeSigmas * std::hypot(piece.sigma, other.sigma)) continue;
      if (next == nullptr ||
          piece.direction().dot(to) < piece.direction().dot(next->at(next->begin)))
        next = &other;
    }
    if (next == nullptr) continue;
    const cv::Point2d from = piece.at(piece.end), to = next->at(next->begin);
    if (!is_hidden(model, from, to, piece.normal)) continue;
    PlanLine line = line_of(piece, piece.end, piece.end, true);
    line.b = to;
    lines.push_back(line);
  }
}

}  // namespace

cv::Point2d PlanLine::along() const { return (b - a) / cv::norm(b - a); }

cv::Point2d PlanLine::normal() const {
  const cv::Point2d direction = along();
  return {direction.y, -direction.x};
}

std::vector<PlanLine> plan_lines(const RoomModel& model) {
  std::vector<Piece> planes = upright_planes(model);
  std::vector<Upright> surface = upright_surface(model);
  find_places(surface, model.voxel, planes);
  std::vector<Piece> pieces;
  for (const Piece& plane : planes)
    if (plane.is_wall) add_stretches(plane, model.voxel, pieces);
  join_all(pieces, model.voxel);
  for (Piece wall : pieces) take(model.voxel, surface, wall, nullptr);
  for (const cv::Point2d& normal : directions_of(planes))
    add_fronts(normal, model.voxel, surface, pieces);
  join_all(pieces, model.voxel);
  std::vector<PlanLine> lines;
  const std::vector<Piece> measured = pieces;
  for (size_t k = 0; k < pieces.size(); ++k) {
    for (const bool at_begin : {true, false}) {
      const Meeting meeting = meeting_of(model, measured, k, at_begin);
      if (!meeting.is_found) continue;
      double& end = at_begin ? pieces[k].begin : pieces[k].end;
      if (meeting.is_carried)
        lines.push_back(at_begin ? line_of(pieces[k], meeting.along, end, true)
                                 : line_of(pieces[k], end, meeting.along, true));
      else
        end = meeting.along;
    }
  }
  add_hidden_parts(model, pieces, lines);
  for (const Piece& piece : pieces)
    if (piece.end > piece.begin) lines.push_back(line_of(piece, piece.begin, piece.end, false));
  return lines;
}

}  // namespace cli
