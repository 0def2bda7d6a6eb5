// twoview_flights: renders a drone's flight through a furnished room, as a set folder for `twoview
// odometry`, with its exact poses, depths and surfaces. A test tool: it is not installed.

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "flights/route.h"

namespace {

using flights::BodyState;
using flights::Box;
using flights::Random;
using flights::Vec3;
using nlohmann::json;
namespace fs = std::filesystem;

constexpr double kDegree = 3.14159265358979323846 / 180;
constexpr int kWidth = 640, kHeight = 480;
constexpr int kFrames = 600;             // about that many of each flight
constexpr double kDepthPerMetre = 5000;  // levels of the depth pictures, as TUM's

struct Arguments {
  uint64_t seed = 0;
  std::string out;
  bool has_half_turn = false;
  int first_frame = 0, max_frames = 1000, depth_every = 50, quality = 92;
};

// How the camera of one flight forms its pictures.
struct Optics {
  tv_camera camera;
  double tilt_down;              // radians
  double exposure;               // seconds
  double blur, noise, vignette;  // sigma in pixels; sigma in grey levels; loss in the corners
  double target;                 // mean grey at which the automatic exposure aims
};

Optics optics_of(uint64_t seed) {
  Random random(seed * 31337 + 3);
  struct Lens {
    double focal, k1, k2, p1, p2;
  };
  const Lens lenses[] = {{520, 0, 0, 0, 0},         {460, 0, 0, 0, 0},
                         {420, -0.28, 0.075, 0, 0}, {535, -0.45, 0.22, 0.0005, -0.0004},
                         {480, -0.12, 0.02, 0, 0},  {390, -0.24, 0.05, -0.0006, 0.0003},
                         {560, 0.08, -0.12, 0, 0},  {440, 0, 0, 0, 0}};
  const Lens& lens = lenses[random.next() % 8];
  Optics o{};
  const double f = lens.focal * random.uniform(0.97, 1.03);
  o.camera = {lens.k1 != 0 ? TV_CAMERA_BROWN_CONRADY : TV_CAMERA_PINHOLE,
              kWidth,
              kHeight,
              0,
              f,
              f * random.uniform(0.998, 1.002),
              kWidth / 2.0 - 0.5 + random.uniform(-8, 8),
              kHeight / 2.0 - 0.5 + random.uniform(-8, 8),
              {lens.k1, lens.k2, lens.p1, lens.p2, 0, 0, 0, 0}};
  o.tilt_down = random.uniform(0, 10) * kDegree;
  o.exposure = random.uniform(0.003, 0.010);
  o.blur = random.uniform(0.45, 0.7);
  o.noise = random.uniform(1.2, 3);
  o.vignette = random.uniform(0.05, 0.3);
  o.target = random.uniform(90, 130);
  return o;
}

// Two of three flights have 25 frames a second, the others 30.
double frames_per_second(uint64_t seed) { return seed % 3 == 2 ? 30 : 25; }

room::Mat3 body_attitude(const BodyState& state) {
  return room::world_from_body(state.yaw, state.pitch, state.roll);
}

// The quaternion w x y z of a rotation, with w >= 0 (S. W. Shepperd, 1978).
std::array<double, 4> quaternion(const room::Mat3& R) {
  const double trace = R[0] + R[4] + R[8];
  std::array<double, 4> q;
  if (trace > 0) {
    const double s = 2 * std::sqrt(1 + trace);
    q = {s / 4, (R[7] - R[5]) / s, (R[2] - R[6]) / s, (R[3] - R[1]) / s};
  } else {
    const size_t i = R[4] > R[0] ? (R[8] > R[4] ? 2 : 1) : (R[8] > R[0] ? 2 : 0);
    const size_t j = (i + 1) % 3, k = (i + 2) % 3;
    const double s = 2 * std::sqrt(1 + R[4 * i] - R[4 * j] - R[4 * k]);
    q[0] = (R[3 * k + j] - R[3 * j + k]) / s;
    q[1 + i] = s / 4;
    q[1 + j] = (R[3 * j + i] + R[3 * i + j]) / s;
    q[1 + k] = (R[3 * k + i] + R[3 * i + k]) / s;
  }
  if (q[0] < 0) {
    for (double& value : q) value = -value;
  }
  return q;
}

std::string line(std::initializer_list<double> values, double time) {
  char text[32];
  std::snprintf(text, sizeof text, "%.9f", time);
  std::string out = text;
  for (const double value : values) {
    std::snprintf(text, sizeof text, " %.9f", value);
    out += text;
  }
  return out + "\n";
}

void write(const fs::path& path, const std::string& text) {
  std::ofstream file(path, std::ios::binary);
  file << text;
  if (!file.flush()) throw std::runtime_error("cannot write " + path.string());
}

class Flight {
 public:
  explicit Flight(const Arguments& a)
      : arguments_(a),
        optics_(optics_of(a.seed)),
        interior_(flights::furnished(a.seed)),
        route_(interior_, route_options(a)),
        noise_(a.seed * 65537 + 11) {
    // What stands in the way of the drone is taken out of the room.
    auto& boxes = interior_.boxes;
    boxes.erase(std::remove_if(boxes.begin() + 1, boxes.end(),
                               [&](const Box& box) { return route_.clearance(box) < 0.3; }),
                boxes.end());
    // The world begins below the drone, with x along its nose (drivers' source.h).
    const BodyState start = route_.at(0);
    const Vec3 origin{start.position[0], start.position[1], 0};
    Box frame;
    frame.yaw_rad = -start.yaw;
    const double c = std::cos(start.yaw), s = std::sin(start.yaw);
    const auto moved = [&](const Vec3& p) {
      const double x = p[0] - origin[0], y = p[1] - origin[1];
      return Vec3{c * x + s * y, c * y - s * x, p[2]};
    };
    for (Box& box : boxes) {
      box.centre = moved(box.centre);
      box.yaw_rad -= start.yaw;
    }
    for (flights::Lamp& lamp : interior_.lamps) lamp.position = moved(lamp.position);
    interior_.table = moved(interior_.table);
    route_.move_world(origin, start.yaw);
    body_from_camera_ = room::camera_pose(room::world_from_body(0, -optics_.tilt_down, 0),
                                          room::kForwardCamera, {0, 0, 0})
                            .world_from_camera;
  }

  void render() {
    const fs::path out = arguments_.out;
    fs::create_directories(out / "images");
    if (arguments_.depth_every > 0) fs::create_directories(out / "depth");
    const flights::Scene scene(interior_.boxes, interior_.lamps, arguments_.seed);
    const room::Eye eye(optics_.camera);
    const double interval = 1 / frames_per_second(arguments_.seed), first = 0.02;
    const int all = static_cast<int>((route_.seconds() - 2 * first) / interval);
    const int end = std::min(all, arguments_.first_frame + arguments_.max_frames);
    std::string names = "# timestamp filename\n";
    std::string poses =
        "# timestamp tx ty tz qx qy qz qw   (camera-to-world, optical frame: x right, y down, z "
        "forward; world: x forward at the start, y right, z down)\n";
    prepare_imu();
    for (int k = arguments_.first_frame; k < end; ++k) {
      const double time = first + interval * k;
      char name[32];
      std::snprintf(name, sizeof name, "%05d", k);
      const bool has_depth = arguments_.depth_every > 0 && k % arguments_.depth_every == 0;
      cv::Mat depth(kHeight, kWidth, CV_32F);
      const cv::Mat picture = expose(scene, eye, time, has_depth ? depth.ptr<float>() : nullptr);
      if (!cv::imwrite((out / "images" / name).string() + ".jpg", picture,
                       {cv::IMWRITE_JPEG_QUALITY, arguments_.quality}))
        throw std::runtime_error("cannot write pictures into " + arguments_.out);
      if (has_depth) {
        cv::Mat levels;
        depth.convertTo(levels, CV_16U, kDepthPerMetre);
        cv::imwrite((out / "depth" / name).string() + ".png", levels);
      }
      const room::CameraPose pose = camera_at(time);
      const auto q = quaternion(pose.world_from_camera);
      char text[64];
      std::snprintf(text, sizeof text, "%.9f images/%s.jpg\n", time, name);
      names += text;
      poses += line({pose.position[0], pose.position[1], pose.position[2], q[1], q[2], q[3], q[0]},
                    time);
      measure(scene, time);
    }
    write(out / "frames.txt", names);
    write(out / "groundtruth.txt", poses);
    write(out / "imu.txt", imu_);
    write(out / "cameras.yaml", camera_text());
    write(out / "surfaces.json", surfaces().dump(1) + "\n");
    write(out / "flight.json",
          description(std::max(end - arguments_.first_frame, 0)).dump(1) + "\n");
  }

 private:
  static flights::RouteOptions route_options(const Arguments& a) {
    flights::RouteOptions options;
    options.seed = a.seed;
    options.has_half_turn = a.has_half_turn;
    options.max_seconds = kFrames / frames_per_second(a.seed) + (a.has_half_turn ? 3.8 : 0);
    Random random(a.seed * 12289 + 7);
    options.tremble = random.uniform(0.3, 1.2);
    return options;
  }

  room::CameraPose camera_at(double time) const {
    const BodyState state = route_.at(time);
    return room::camera_pose(body_attitude(state), body_from_camera_, state.position);
  }

  // The picture whose exposure has its middle at `time`: the mean of up to four instants, as many
  // as the motion needs, through the lens' blur, the automatic exposure and the sensor's noise.
  cv::Mat expose(const flights::Scene& scene, const room::Eye& eye, double time, float* depth) {
    const room::CameraPose a = camera_at(time - optics_.exposure / 2);
    const room::CameraPose b = camera_at(time + optics_.exposure / 2);
    double along = 0, shift = 0;
    for (size_t k = 0; k < 3; ++k) {
      along += a.world_from_camera[3 * k + 2] * b.world_from_camera[3 * k + 2];
      shift += std::abs(a.position[k] - b.position[k]);
    }
    const double pixels = optics_.camera.fx * (std::acos(std::min(along, 1.0)) + shift / 1.5);
    const int instants = std::clamp(static_cast<int>(std::ceil(pixels / 1.2)), 1, 4);
    cv::Mat sum = cv::Mat::zeros(kHeight, kWidth, CV_32F), grey(kHeight, kWidth, CV_32F);
    for (int k = 0; k < instants; ++k) {
      const double at = time + optics_.exposure * ((k + 0.5) / instants - 0.5);
      scene.render(eye, camera_at(at), grey.ptr<float>());
      sum += grey;
    }
    if (depth != nullptr) scene.render(eye, camera_at(time), grey.ptr<float>(), depth);
    cv::GaussianBlur(sum, sum, cv::Size(), optics_.blur, optics_.blur);
    sum /= instants;
    const double wanted = std::clamp(optics_.target / std::max(cv::mean(sum)[0], 1.0), 0.5, 2.0);
    gain_ = gain_ == 0 ? wanted : gain_ * std::pow(wanted / gain_, 0.08);
    cv::Mat picture(kHeight, kWidth, CV_8U);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const double dx = (x - kWidth / 2.0) / (kWidth / 2.0);
        const double dy = (y - kHeight / 2.0) / (kWidth / 2.0);
        const double shade = 1 - optics_.vignette * (dx * dx + dy * dy) / 1.5625;
        picture.at<uint8_t>(y, x) =
            cv::saturate_cast<uint8_t>(gain_ * shade * static_cast<double>(sum.at<float>(y, x)));
      }
    }
    room::add_sensor_noise(picture.data, kWidth, kHeight, static_cast<int64_t>(picture.step),
                           optics_.noise, noise_.next());
    return picture;
  }

  // ---- what the drone's own sensors measure ----

  void prepare_imu() {
    for (double& angle : tilt_bias_) angle = 0.4 * kDegree * noise_.normal();
    velocity_scale_ = 1 + 0.01 * noise_.normal();
    const auto q = quaternion(body_from_camera_);
    char text[160];
    std::snprintf(text, sizeof text, "body_from_cam %.9f %.9f %.9f %.9f\n", q[0], q[1], q[2], q[3]);
    imu_ =
        "# A rotation w x y z, then a sample a line: timestamp; world_from_body as qw qx qy qz "
        "with "
        "its sigma (radians);\n"
        "# height above what is below and its sigma (metres); velocity vx vy vz on the body's axes "
        "and its sigma (m/s).\n"
        "# body: x forward, y right, z down; world: z down. nan: not measured.\n";
    imu_ += text;
  }

  void measure(const flights::Scene& scene, double time) {
    const BodyState state = route_.at(time);
    yaw_drift_ += 0.02 * kDegree * noise_.normal();
    const room::Mat3 measured =
        room::world_from_body(state.yaw + yaw_drift_ + 0.1 * kDegree * noise_.normal(),
                              state.pitch + tilt_bias_[0] + 0.2 * kDegree * noise_.normal(),
                              state.roll + tilt_bias_[1] + 0.2 * kDegree * noise_.normal());
    const auto q = quaternion(measured);
    const double height = scene.height_above_ground(state.position) + 0.01 * noise_.normal();
    const room::Mat3 R = body_attitude(state);
    double v[3];
    for (size_t k = 0; k < 3; ++k) {
      v[k] = velocity_scale_ * (R[k] * state.velocity[0] + R[3 + k] * state.velocity[1] +
                                R[6 + k] * state.velocity[2]) +
             0.05 * noise_.normal();
    }
    imu_ +=
        line({q[0], q[1], q[2], q[3], 0.7 * kDegree, height, 0.015, v[0], v[1], v[2], 0.055}, time);
  }

  // ---- files ----

  std::string camera_text() const {
    const tv_camera& c = optics_.camera;
    char text[400];
    std::snprintf(text, sizeof text,
                  "cam0:\n  image_width: %d\n  image_height: %d\n  fx: %.9g\n  fy: %.9g\n"
                  "  cx: %.9g\n  cy: %.9g\n  k1: %.9g\n  k2: %.9g\n  p1: %.9g\n  p2: %.9g\n"
                  "  k3: %.9g\n",
                  c.width, c.height, c.fx, c.fy, c.cx, c.cy, c.k[0], c.k[1], c.k[2], c.k[3],
                  c.k[4]);
    return text;
  }

  json surfaces() const {
    json boxes = json::array();
    for (const Box& box : interior_.boxes) {
      boxes.push_back({{"centre", box.centre},
                       {"half", box.half},
                       {"yaw_rad", box.yaw_rad},
                       {"is_room", box.is_room}});
    }
    return {{"boxes", boxes}};
  }

  json description(int count) const {
    json lamps = json::array();
    for (const flights::Lamp& lamp : interior_.lamps) lamps.push_back(lamp.position);
    return {{"seed", arguments_.seed},
            {"num_frames", count},
            {"frames_per_second", frames_per_second(arguments_.seed)},
            {"path_length", route_.path_length()},
            {"room_size", {2 * interior_.half_x, 2 * interior_.half_y, interior_.height}},
            {"num_boxes", interior_.boxes.size()},
            {"lamps", lamps},
            {"table", interior_.table},
            {"body_from_cam_wxyz", quaternion(body_from_camera_)},
            {"exposure_s", optics_.exposure},
            {"blur_px", optics_.blur},
            {"noise_grey", optics_.noise},
            {"depth_levels_per_metre", kDepthPerMetre},
            {"half_turn", arguments_.has_half_turn
                              ? json{route_.half_turn_begins(), route_.half_turn_ends()}
                              : json(nullptr)}};
  }

  Arguments arguments_;
  Optics optics_;
  flights::Interior interior_;
  flights::Route route_;
  Random noise_;
  room::Mat3 body_from_camera_{};
  double gain_ = 0;
  double tilt_bias_[2] = {0, 0}, yaw_drift_ = 0, velocity_scale_ = 1;
  std::string imu_;
};

}  // namespace

int main(int argc, char** argv) {
  Arguments a;
  CLI::App program{"Renders a drone's flight through a furnished room as a set folder."};
  program.add_option("--seed", a.seed, "room, path, lens and light; the same seed, the same bytes");
  program.add_option("-o,--output", a.out, "the folder")->required();
  program.add_flag("--half-turn", a.has_half_turn, "half a turn on the spot after two walls");
  program.add_option("--first-frame", a.first_frame, "leave out the first N frames")
      ->check(CLI::NonNegativeNumber);
  program.add_option("--max-frames", a.max_frames, "only N frames")->check(CLI::Range(1, 1000));
  program.add_option("--depth-every", a.depth_every, "a depth picture every N frames; 0: none")
      ->check(CLI::NonNegativeNumber);
  program.add_option("--quality", a.quality, "JPEG quality")->check(CLI::Range(1, 100));
  CLI11_PARSE(program, argc, argv);
  try {
    Flight(a).render();
  } catch (const std::exception& error) {
    std::cerr << "twoview_flights: " << error.what() << "\n";
    return 2;
  }
  return 0;
}
