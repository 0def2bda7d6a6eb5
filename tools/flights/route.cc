#include "flights/route.h"

#include <algorithm>
#include <cmath>

namespace flights {
namespace {

constexpr double kPi = 3.14159265358979323846, kGravity = 9.81;
constexpr double kSmoothPosition = 0.28, kSmoothYaw = 0.6;  // seconds, sigma of a Gaussian
constexpr double kPause = 3.8, kTurning = 1.8;              // seconds, of a half turn

struct Waypoint {
  double x, y, height;
  bool looks_at_table;
  bool has_pause;
};

// The mean of the values around each one, weighted by a Gaussian; the ends are continued.
void smooth(std::vector<double>& values, double sigma) {
  const int reach = static_cast<int>(3 * sigma);
  std::vector<double> weights;
  double sum = 0;
  for (int k = -reach; k <= reach; ++k) {
    weights.push_back(std::exp(-0.5 * k * k / (sigma * sigma)));
    sum += weights.back();
  }
  const int count = static_cast<int>(values.size());
  std::vector<double> out(values.size());
  for (int i = 0; i < count; ++i) {
    double mean = 0;
    for (int k = -reach; k <= reach; ++k) {
      mean += weights[static_cast<size_t>(k + reach)] *
              values[static_cast<size_t>(std::clamp(i + k, 0, count - 1))];
    }
    out[static_cast<size_t>(i)] = mean / sum;
  }
  values = std::move(out);
}

// A sum of sines between 1 and 5 Hz.
std::vector<double> vibration(Random& random, size_t count, double step, double amplitude) {
  std::vector<double> values(count, 0.0);
  for (int wave = 0; wave < 6; ++wave) {
    const double hertz = random.uniform(0.8, 5), phase = random.uniform(0, 2 * kPi);
    for (size_t i = 0; i < count; ++i) {
      values[i] +=
          amplitude / 2.5 * std::sin(phase + 2 * kPi * hertz * step * static_cast<double>(i));
    }
  }
  return values;
}

std::vector<Waypoint> plan(const Interior& in, Random& random, bool has_half_turn) {
  const double margin = random.uniform(1.2, 1.4);
  const double hx = in.half_x - margin, hy = in.half_y - margin;
  const double radius = std::max(1.15, std::min({1.45, 0.95 * hx, 0.95 * hy}));
  const double low = random.uniform(1.1, 1.4), high = random.uniform(1.3, 1.7);
  std::vector<Waypoint> points;
  const double start = random.uniform(-0.8, -0.3) * hx;
  points.push_back({start, -hy, low, false, false});
  points.push_back({hx, -hy, high, false, false});
  points.push_back({hx, hy, low, false, false});
  points.push_back({0, hy, high, false, has_half_turn});
  points.push_back({-hx, hy, high, false, false});
  points.push_back({-hx, -hy, low, false, false});
  points.push_back({start, -hy, low, false, false});
  const double from = std::atan2(-hy - in.table[1], start - in.table[0]);
  for (int k = 0; k <= 24; ++k) {
    const double angle = from + 2 * kPi * k / 24;
    points.push_back({in.table[0] + radius * std::cos(angle),
                      in.table[1] + radius * std::sin(angle), high + 0.1 * std::sin(angle), true,
                      false});
  }
  points.push_back({start, -hy, low, true, false});
  if (random.uniform(0, 1) < 0.5) {  // the other way round
    for (Waypoint& point : points) point.x = -point.x;
    // The table is not in the very middle: the circle keeps its distance to it well enough.
  }
  return points;
}

double nearest_turn(double angle, double to) {
  return angle + 2 * kPi * std::round((to - angle) / (2 * kPi));
}

}  // namespace

Route::Route(const Interior& interior, const RouteOptions& options) {
  Random random(options.seed * 104729 + 5);
  const std::vector<Waypoint> points = plan(interior, random, options.has_half_turn);
  double length = 0;
  for (size_t i = 1; i < points.size(); ++i)
    length += std::hypot(points[i].x - points[i - 1].x, points[i].y - points[i - 1].y);
  const double pauses = options.has_half_turn ? kPause : 0;
  const double ground_time = 0.3, climb_speed = 0.7, final_time = 2.2;
  const double climb_time = (points[0].height - 0.15) / climb_speed;
  const double left = options.max_seconds - pauses - ground_time - climb_time - 0.4 - final_time;
  const double speed = std::max(random.uniform(0.8, 1.3), length / left);
  // The nose points along the path, or away from it, or into the room.
  const double offsets[] = {0, random.uniform(0.4, 0.9), -random.uniform(0.4, 0.9)};
  const double nose = offsets[random.next() % 3];

  std::vector<double> x, y, z, yaw, extra;
  double turned = 0, heading = 0;
  const auto add = [&](double px, double py, double height, double towards) {
    yaw.push_back(yaw.empty() ? towards : nearest_turn(towards, yaw.back()));
    x.push_back(px);
    y.push_back(py);
    z.push_back(-height);
    extra.push_back(turned);
  };
  heading = std::atan2(points[1].y - points[0].y, points[1].x - points[0].x);
  const double first_yaw = heading + nose;
  for (double t = 0; t < ground_time; t += kStep) add(points[0].x, points[0].y, 0.15, first_yaw);
  for (double t = 0; t < climb_time + 0.4; t += kStep) {
    const double climbed = std::min(0.15 + climb_speed * t, points[0].height);
    add(points[0].x, points[0].y, climbed, first_yaw);
  }
  for (size_t i = 1; i < points.size(); ++i) {
    const Waypoint &a = points[i - 1], &b = points[i];
    const double leg = std::hypot(b.x - a.x, b.y - a.y);
    heading = std::atan2(b.y - a.y, b.x - a.x);
    for (double s = 0; s < leg; s += speed * kStep) {
      const double px = a.x + (b.x - a.x) * s / leg, py = a.y + (b.y - a.y) * s / leg;
      const double towards = b.looks_at_table
                                 ? std::atan2(interior.table[1] - py, interior.table[0] - px)
                                 : heading + nose;
      add(px, py, a.height + (b.height - a.height) * s / leg, towards);
    }
    if (!b.has_pause) continue;
    turn_begins_ = kStep * static_cast<double>(x.size()) + (kPause - kTurning) / 2;
    turn_ends_ = turn_begins_ + kTurning;
    for (double t = 0; t < kPause; t += kStep) {
      const double part = std::clamp((t - (kPause - kTurning) / 2) / kTurning, 0.0, 1.0);
      turned = kPi * 0.5 * (1 - std::cos(kPi * part));
      add(b.x, b.y, b.height, heading + nose);
    }
  }
  // At the end the drone looks as it did at the start; `extra` holds what the half turn added.
  for (double t = 0; t < final_time; t += kStep) {
    const Waypoint& end = points.back();
    add(end.x, end.y, end.height,
        t > 0.1 ? nearest_turn(first_yaw - turned, yaw.back()) : yaw.back());
  }
  const double position_sigma = kSmoothPosition / kStep, yaw_sigma = kSmoothYaw / kStep;
  for (std::vector<double>* values : {&x, &y, &z}) smooth(*values, position_sigma);
  smooth(yaw, yaw_sigma);
  const double shake = options.has_half_turn ? 0 : 0.004 * options.tremble;
  std::vector<double> shakes[3], trembles[3];
  for (auto& values : shakes) values = vibration(random, x.size(), kStep, shake);
  for (auto& values : trembles)
    values = vibration(random, x.size(), kStep, 0.010 * options.tremble);
  for (size_t i = 0; i < x.size(); ++i) {
    // Standing on the floor, nothing trembles.
    const double air = std::clamp((-z[i] - 0.16) / 0.3, 0.0, 1.0);
    BodyState state{};
    state.position = {x[i] + air * shakes[0][i], y[i] + air * shakes[1][i],
                      z[i] + air * shakes[2][i]};
    state.yaw = yaw[i] + extra[i];
    states_.push_back(state);
    tremble_angle_.push_back({air * trembles[0][i], air * trembles[1][i], air * trembles[2][i]});
  }
  derive();
}

// Velocities by central differences; tilt such that gravity and thrust give the acceleration.
void Route::derive() {
  const size_t count = states_.size();
  const size_t reach = 8;  // samples: accelerations of single millimetres of vibration are left out
  for (size_t i = 0; i < count; ++i) {
    const size_t a = i == 0 ? 0 : i - 1, b = std::min(i + 1, count - 1);
    const double dt = kStep * static_cast<double>(b - a);
    for (size_t k = 0; k < 3; ++k)
      states_[i].velocity[k] = (states_[b].position[k] - states_[a].position[k]) / dt;
  }
  std::vector<double> pitch, roll;
  for (size_t i = 0; i < count; ++i) {
    const size_t a = i < reach ? 0 : i - reach, b = std::min(i + reach, count - 1);
    const double dt = kStep * static_cast<double>(b - a);
    const double ax = (states_[b].velocity[0] - states_[a].velocity[0]) / dt;
    const double ay = (states_[b].velocity[1] - states_[a].velocity[1]) / dt;
    const double c = std::cos(states_[i].yaw), s = std::sin(states_[i].yaw);
    pitch.push_back(-std::atan((c * ax + s * ay) / kGravity));
    roll.push_back(std::atan((c * ay - s * ax) / kGravity));
  }
  smooth(pitch, 0.08 / kStep);
  smooth(roll, 0.08 / kStep);
  for (size_t i = 0; i < count; ++i) {
    states_[i].yaw += tremble_angle_[i][0];
    states_[i].pitch = pitch[i] + tremble_angle_[i][1];
    states_[i].roll = roll[i] + tremble_angle_[i][2];
  }
}

BodyState Route::at(double time) const {
  const double index = std::clamp(time / kStep, 0.0, static_cast<double>(states_.size()) - 1.001);
  const size_t i = static_cast<size_t>(index);
  const double b = index - static_cast<double>(i), a = 1 - b;
  const BodyState &p = states_[i], &q = states_[i + 1];
  BodyState state{};
  for (size_t k = 0; k < 3; ++k) {
    state.position[k] = a * p.position[k] + b * q.position[k];
    state.velocity[k] = a * p.velocity[k] + b * q.velocity[k];
  }
  state.yaw = a * p.yaw + b * q.yaw;
  state.pitch = a * p.pitch + b * q.pitch;
  state.roll = a * p.roll + b * q.roll;
  return state;
}

double Route::path_length() const {
  double length = 0;
  for (size_t i = 1; i < states_.size(); ++i) {
    const Vec3 &a = states_[i - 1].position, &b = states_[i].position;
    length += std::hypot(b[0] - a[0], b[1] - a[1], b[2] - a[2]);
  }
  return length;
}

void Route::move_world(const Vec3& origin, double yaw_rad) {
  const double c = std::cos(yaw_rad), s = std::sin(yaw_rad);
  const auto turn = [&](const Vec3& v) {
    return Vec3{c * v[0] + s * v[1], c * v[1] - s * v[0], v[2]};
  };
  for (BodyState& state : states_) {
    state.position = turn({state.position[0] - origin[0], state.position[1] - origin[1],
                           state.position[2] - origin[2]});
    state.velocity = turn(state.velocity);
    state.yaw -= yaw_rad;
  }
}

double Route::clearance(const Box& box) const {
  double least = HUGE_VAL;
  for (size_t i = 0; i < states_.size(); i += 8)
    least = std::min(least, distance_to_solid(box, states_[i].position));
  return least;
}

}  // namespace flights
