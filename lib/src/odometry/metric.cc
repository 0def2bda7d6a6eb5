#include "odometry/metric.h"

#include <algorithm>
#include <cmath>

#include "base/math.h"
#include "geometry/essential.h"
#include "geometry/vector3.h"

namespace tv {
namespace {

// Relative standard deviations of the scale: the metre becomes the unit at the first, and is given
// up above the second.
constexpr double kLargestScaleSigma = 0.1, kLostScaleSigma = 0.2;
// Heights and velocities contradict each other above the quantile 0.99 of chi squared of one degree
// of freedom. They agree again below that of 0.9, so that the unit does not change to and fro.
constexpr double kContradicted = 6.63, kAgreed = 2.71;
// What the scales of the velocities and of the map itself may be off by, relative: added to the
// standard deviation.
constexpr double kScaleError = 0.01;
constexpr double kLeastChange = 0.002;  // of the scale, for which the map is rescaled
// The error of the map's way between two keyframes, along each axis, as a share of its length: 0.5
// to 1.7 % in the rendered flights 00 to 19.
constexpr double kWayError = 0.015;
// A way contradicts the velocities where it differs from theirs by more than this share, so many of
// their standard deviations, taken as equal errors, and this share of the median depth, which is
// the map's error. They are clear where they say this many standard deviations.
constexpr double kLargestShare = 0.25, kBounds = 2, kSeen = 0.003, kClear = 5;
constexpr double kLargestTilt = 0.1;  // radians, added to three standard deviations
// What drift may add to where a lost frame is found: median depths, and radians.
constexpr double kLargestSlip = 0.5, kLargestSwing = 0.375;
constexpr double kLargestMeasure = 1e7;  // metres, metres per second: above it, no sensor is right

bool is_usable(double sigma) { return sigma >= 1 / kLargestMeasure && sigma <= kLargestMeasure; }

// Changes the unit of the map to `scale` times the old unit.
void rescale(Odometry* odometry, double scale, Frame* frame) {
  Map& map = odometry->map;
  for (int32_t k = 0; k < map.num_keyframes; ++k) {
    MapKeyframe& keyframe = map.keyframes[k];
    if (keyframe.segment != odometry->segment) continue;
    scale_by(scale, keyframe.cam_from_world.t);
    keyframe.scale *= scale;
  }
  for (int32_t p = 0; p < map.end_points; ++p) {
    MapPoint& point = map.points[p];
    if (point.id < 0 || point.segment != odometry->segment) continue;
    scale_by(scale, point.position);
    for (float& x : point.seen_from) x = static_cast<float>(static_cast<double>(x) * scale);
  }
  scale_by(scale, frame->cam_from_world.t);
  scale_by(scale, odometry->motion.t);
  odometry->median_depth *= scale;
}

// The map's way since a travel began beside that of the velocities: the scalar products of the
// map's with itself, of both, and of the velocities' with itself.
struct Ways {
  double way[3], square, product, travel_sq;
};

Ways ways_to(const Travel& travel, const Rigid& cam_from_world) {
  Ways ways;
  centre_of(cam_from_world, ways.way);
  for (int c = 0; c < 3; ++c) ways.way[c] -= travel.from[c];
  ways.square = length_sq_of(ways.way);
  ways.product = dot(travel.way_m, ways.way);
  ways.travel_sq = length_sq_of(travel.way_m);
  return ways;
}

void add_evidence(const ScaleEvidence& more, ScaleEvidence* evidence) {
  evidence->product += more.product;
  evidence->square += more.square;
  evidence->noise += more.noise;
  evidence->total += more.total;
  evidence->num += more.num;
}

// Adapts the evidence to a unit of the map that is 1 / factor of the old one.
void stretch(double factor, ScaleEvidence* evidence) {
  evidence->product *= factor;
  evidence->square *= factor * factor;
  evidence->noise *= factor * factor;
}

// Adds the evidence on the segment's scale from the way since the keyframe before, by least squares
// of the sensors' way = scale x map's way. If the camera was lost in between, the map's way is only
// as good as the pose at which it was found, and is not used.
void add_way(Odometry* odometry, int32_t keyframe) {
  const MapKeyframe& own = odometry->map.keyframes[keyframe];
  const MapKeyframe& before = odometry->map.keyframes[keyframe - 1];
  if (own.segment != odometry->segment || before.segment != odometry->segment) return;
  if (!own.is_followed) return;
  // The way back to the keyframe before, in this camera's axes.
  const Rigid motion = motion_between(before.cam_from_world, own.cam_from_world);
  const double* back = motion.t;
  const double square = length_sq_of(back), noise = kWayError * kWayError * square;
  if (own.way_variance > 0) {
    const double weight = 1 / own.way_variance;
    add_evidence({-weight * dot(own.way_m, back), weight * square, 3 * weight * noise,
                  weight * length_sq_of(own.way_m), 3},
                 own.is_contrary ? &odometry->scale.contrary : &odometry->scale.velocity);
  }
  if (odometry->is_upright && own.height_sigma_m > 0 && before.height_sigma_m > 0) {
    double in_world[3];
    rotate_back(own.cam_from_world.R, back, in_world);
    const double climb = in_world[2], climb_m = own.height_m - before.height_m;
    const double weight = 1 / (own.height_sigma_m * own.height_sigma_m +
                               before.height_sigma_m * before.height_sigma_m);
    add_evidence({weight * climb_m * climb, weight * climb * climb, weight * noise,
                  weight * climb_m * climb_m, 1},
                 &odometry->scale.height);
  }
}

// The residuals' sum of squares is chi2. Where it is larger than their number, the sensor errs more
// than it states, and in proportion: heights have the steps of the ground. Where velocities have
// other directions than the map, as those that come late, the slope of their ways over the map's is
// too small, but that of the map's over theirs too large: what lies between the two, beyond the
// stated noise, is uncertain, too. So is by how much the map's own errors make the slope too small;
// in level flight the map climbs by little else, and heights say nothing.
ScaleEstimate estimate_of(const ScaleEvidence& evidence, int32_t source) {
  if (!(evidence.num > 0 && evidence.square > 2 * evidence.noise)) return {};
  const double slope = evidence.product / evidence.square;
  const double chi2 = evidence.total - slope * evidence.product;
  const double num = std::max(evidence.num - 1, 1.0);
  const double more = std::max(chi2 - num, 0.0);
  const double between = more > 0 && source == TV_SCALE_VELOCITY ? more / evidence.product : 0;
  const double bias = slope * evidence.noise / (evidence.square - evidence.noise);
  const double share = 1 / (1 + more / num + (between * between + bias * bias) * evidence.square);
  if (!(share > 0)) return {};
  return {source, share * evidence.product, share * evidence.square};
}

// Sets the sums to what a loaded map brought, without the keyframes' ways.
void begin_sums(MetricScale* scale) {
  scale->height = scale->velocity = scale->contrary = ScaleEvidence{};
  (scale->loaded_source == TV_SCALE_HEIGHT ? scale->height : scale->velocity) = scale->loaded;
}

// Whether heights and velocities contradict each other by more than their standard deviations.
bool is_contradicted(const MetricScale& known) {
  const ScaleEstimate h = height_estimate(known), v = velocity_estimate(known);
  if (h.source == TV_SCALE_UNIT || v.source == TV_SCALE_UNIT) return known.is_contradicted;
  const double height = h.product / h.square, velocity = v.product / v.square;
  const double difference = height - velocity;
  const double variance = 1 / h.square + 1 / v.square +
                          kScaleError * kScaleError * (height * height + velocity * velocity);
  if (!known.is_contradicted) return difference * difference > kContradicted * variance;
  // They count as agreeing only where a scale twice as large would have been a contradiction.
  const double larger = std::max(std::fabs(height), std::fabs(velocity));
  return difference * difference > kAgreed * variance ||
         4 * kContradicted * variance > larger * larger;
}

// Gives the segment the metre as its unit once the scale is known to a tenth, and follows it. Where
// the sensors contradict each other nobody knows which one is wrong: there is no metre then, and
// the unit stays what it was.
void settle_scale(Odometry* odometry, Frame* frame) {
  MetricScale* known = &odometry->scale;
  known->is_contradicted = is_contradicted(*known);
  const ScaleEstimate now = estimate_of(*known);
  const double most = known->source == TV_SCALE_UNIT ? kLargestScaleSigma : kLostScaleSigma;
  const double variance = now.square / (now.product * now.product);  // relative
  if (known->is_contradicted || !(now.product > 0) || !(variance <= most * most)) {
    known->source = TV_SCALE_UNIT;
    known->sigma = 0;
    return;
  }
  const double scale = now.product / now.square;
  known->sigma = std::sqrt(variance + kScaleError * kScaleError);
  known->source = now.source;
  known->was_known = true;
  if (std::fabs(scale - 1) < kLeastChange) return;
  rescale(odometry, scale, frame);
  stretch(scale, &known->loaded);
  gather_ways(odometry);
}

}  // namespace

void read_sensors(const tv_odometry_frame& input, Frame* frame) {
  const double sigmas[3] = {input.attitude_sigma_rad, input.height_sigma_m,
                            input.velocity_sigma_m_s};
  frame->sensors = Sensors{};
  Sensors* s = &frame->sensors;
  if (sigmas[0] > 0 && sigmas[0] <= kLargestMeasure && is_rotation(input.world_from_cam)) {
    std::copy_n(input.world_from_cam, 9, s->world_from_cam);
    s->attitude_sigma_rad = std::min(std::max(sigmas[0], 1e-4), 3.0);
  }
  if (is_usable(sigmas[1]) && std::fabs(input.height_m) <= kLargestMeasure) {
    s->height_m = input.height_m;
    s->height_sigma_m = sigmas[1];
  }
  const double* v = input.velocity_m_s;
  if (is_usable(sigmas[2]) && length_sq_of(v) <= kLargestMeasure * kLargestMeasure) {
    std::copy_n(input.velocity_m_s, 3, s->velocity_m_s);
    s->velocity_sigma_m_s = sigmas[2];
  }
}

bool check_attitude(const Odometry& odometry, Frame* frame) {
  Sensors* s = &frame->sensors;
  if (!odometry.is_upright || s->attitude_sigma_rad == 0) return true;
  // The angle between down as the map has it and as the attitude says.
  double down[3];
  rotate_back(frame->cam_from_world.R, s->world_from_cam + 6, down);
  const double tilt = acos(down[2]);
  if (tilt <= kLargestTilt + 3 * s->attitude_sigma_rad) return true;
  s->attitude_sigma_rad = 0;
  return false;
}

bool is_contrary(const Odometry& odometry, const Frame& frame) {
  const Travel& travel = odometry.travel;
  if (!travel.is_known) return false;
  const Ways ways = ways_to(travel, frame.cam_from_world);
  const ScaleEstimate known = estimate_of(odometry.scale);
  double scale = 0;  // a way against the velocities fits none
  if (odometry.scale.source != TV_SCALE_UNIT)
    scale = known.product / known.square;
  else if (ways.product > 0)
    scale = ways.product / ways.square;
  const double allowed = kBounds * travel.bound_m + kLargestShare * std::sqrt(ways.travel_sq) +
                         kSeen * odometry.median_depth * scale;
  return ways.travel_sq - scale * (2 * ways.product - scale * ways.square) > allowed * allowed;
}

void add_travel(Odometry* odometry, const Frame& frame) {
  const double seconds = frame.time_s - odometry->previous.time_s;
  const Sensors& s = frame.sensors;
  Travel* travel = &odometry->travel;
  travel->is_known = travel->is_known && s.velocity_sigma_m_s > 0;
  double in_world[3];
  rotate_back(frame.cam_from_world.R, s.velocity_m_s, in_world);
  for (int c = 0; c < 3; ++c) travel->way_m[c] += seconds * in_world[c];
  const double sigma = seconds * s.velocity_sigma_m_s;
  travel->variance += sigma * sigma;
  travel->bound_m += sigma;
}

void begin_travel(Odometry* odometry, const Rigid& cam_from_world, int32_t keyframe_id) {
  odometry->travel = Travel{};
  odometry->travel.is_known = true;
  odometry->travel.keyframe_id = keyframe_id;
  centre_of(cam_from_world, odometry->travel.from);
}

void measure_reach(const Odometry& odometry, const Frame& frame, Reach* reach) {
  Rigid attitude{};
  std::copy_n(frame.sensors.world_from_cam, 9, attitude.R);
  reach->axes = compose(attitude, frame.cam_from_world);
  reach->attitude_sigma_rad = frame.sensors.attitude_sigma_rad;
  reach->most_m = odometry.most_m;
}

void add_reach(Odometry* odometry, const Frame& frame, bool gap) {
  const Sensors& s = frame.sensors;
  const double fastest = length_of(s.velocity_m_s) + kBounds * s.velocity_sigma_m_s;
  const double way_m = fastest * (frame.time_s - odometry->last_time_s);
  odometry->most_m +=
      gap || s.velocity_sigma_m_s == 0 ? kLargestMeasure : std::min(way_m, kLargestMeasure);
}

bool is_reachable(const Odometry& odometry, const Frame& frame) {
  const Reach& from = odometry.confirmed;
  Reach now{};
  measure_reach(odometry, frame, &now);
  const int32_t k = find_keyframe(odometry.map, odometry.confirmed_id);
  if (k < 0 || odometry.map.keyframes[k].segment != odometry.segment) return true;
  const double allowed =
      (1 + kLargestShare) * (now.most_m - from.most_m) + kLargestSlip * odometry.median_depth;
  const double way = way_between(odometry.map.keyframes[k].cam_from_world, frame.cam_from_world);
  if (way > allowed && odometry.scale.source != TV_SCALE_UNIT) return false;
  const double sigma0 = from.attitude_sigma_rad, sigma1 = now.attitude_sigma_rad;
  return std::min(sigma0, sigma1) == 0 ||
         turn_between(from.axes, now.axes) <= kLargestSwing + 3 * (sigma0 + sigma1);
}

ScaleEstimate height_estimate(const MetricScale& scale) {
  return estimate_of(scale.height, TV_SCALE_HEIGHT);
}

// Ways that contradict the map are outliers while those that agree say more. Else nobody knows
// which are, and all of them count: velocities of the other sign then say a negative scale, and
// those that fit no scale an uncertain one.
ScaleEstimate velocity_estimate(const MetricScale& scale) {
  ScaleEvidence evidence = scale.velocity;
  if (scale.contrary.square > evidence.square) add_evidence(scale.contrary, &evidence);
  return estimate_of(evidence, TV_SCALE_VELOCITY);
}

ScaleEstimate estimate_of(const MetricScale& scale) {
  const ScaleEstimate a = height_estimate(scale), b = velocity_estimate(scale);
  const int32_t source = a.source | b.source | scale.loaded_source;
  return {source, a.product + b.product, a.square + b.square};
}

MetricScale scale_of(const ScaleEstimate& estimate, int32_t source, double sigma) {
  MetricScale scale{};
  scale.source = source;
  scale.was_known = source != TV_SCALE_UNIT;
  scale.sigma = sigma;
  if (!(estimate.square > 0)) return scale;
  scale.loaded_source = estimate.source;
  scale.loaded.product = estimate.product;
  scale.loaded.square = estimate.square;
  scale.loaded.total = estimate.product / estimate.square * estimate.product;
  scale.loaded.num = 1;
  begin_sums(&scale);
  return scale;
}

void join_scale(const MetricScale& other, double scale, Odometry* odometry) {
  MetricScale* own = &odometry->scale;
  ScaleEvidence more = other.loaded;
  stretch(scale, &more);
  add_evidence(more, &own->loaded);
  own->loaded_source |= other.loaded_source;
  own->is_contradicted |= other.is_contradicted;
  own->was_known |= other.was_known;
}

void change_scale(Odometry* odometry, int32_t from, int32_t to) {
  const bool is_known = odometry->other_segment == to;
  const bool was_contradicted = odometry->scale.is_contradicted;
  if (is_known || odometry->scale.source != TV_SCALE_UNIT || was_contradicted) {
    std::swap(odometry->scale, odometry->other_scale);
    odometry->other_segment = from;
  }
  if (!is_known) odometry->scale = MetricScale{};
  // The sensors are the same in every segment, so that a contradiction between them counts in the
  // next one, too.
  if (was_contradicted) {
    odometry->scale.is_contradicted = true;
    odometry->scale.source = TV_SCALE_UNIT;
    odometry->scale.sigma = 0;
  }
  odometry->travel.keyframe_id = -1;  // its axes were those of the other segment
  odometry->num_contrary = 0;
}

void enter_segment(Odometry* odometry, int32_t segment) {
  if (segment != odometry->segment) change_scale(odometry, odometry->segment, segment);
  odometry->segment = segment;
  odometry->is_upright = is_upright(odometry->map, segment);
}

void gather_ways(Odometry* odometry) {
  begin_sums(&odometry->scale);
  for (int32_t k = 1; k < odometry->map.num_keyframes; ++k) add_way(odometry, k);
}

void measure_scale(Odometry* odometry, Frame* frame) {
  Map& map = odometry->map;
  MapKeyframe& newest = map.keyframes[map.num_keyframes - 1];
  const Travel& travel = odometry->travel;
  newest.is_followed = travel.keyframe_id == (&newest)[-1].id;
  newest.is_contrary = travel.is_contrary;
  if (newest.is_followed && travel.is_known && travel.variance > 0) {
    Rigid turn = newest.cam_from_world;
    std::fill_n(turn.t, 3, 0.0);
    transform(turn, travel.way_m, newest.way_m);
    newest.way_variance = travel.variance;
    const double clear = kClear * travel.bound_m;
    odometry->velocity_trust += !travel.is_contrary && length_sq_of(travel.way_m) > clear * clear;
  }
  gather_ways(odometry);
  settle_scale(odometry, frame);
  begin_travel(odometry, newest.cam_from_world, newest.id);
}

}  // namespace tv
