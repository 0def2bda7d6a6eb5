// Tests of reconstruct --recording: flights of the simulated drone through the room, compared with
// the simulator's truth.
#include <unistd.h>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <vector>

#include "base/error.h"
#include "encode.h"
#include "files/camera_file.h"
#include "pair/reconstruct_pair.h"
#include "recording/recording.h"
#include "recording/recording_pair.h"
#include "room/room.h"
#include "simulator/film.h"
#include "simulator/firmware.h"

#include <unity.h>  // comes last, since unity.h defines isnan and isinf as macros

using namespace cli;
using simulator::FlightState;

namespace {

namespace fs = std::filesystem;
constexpr int64_t kMs = 1000000;
constexpr double kDegrees = 57.29577951308232;
constexpr int kWidth = 640, kHeight = 360;
// A lens similar to that of the AR.Drone's front camera.
const tv_camera kCamera{TV_CAMERA_BROWN_CONRADY, kWidth, kHeight, 0, 560, 560, 320, 180,
                        {-0.5, 0.25, 0, 0, 0}};
const char kFly[] = "290718208";

// The pilot's commands after the take-off, and the errors of the sensors.
struct Plan {
  const char* name;
  simulator::Vec3 start;
  float roll, pitch, climb, turn;
  simulator::Sensors sensors;
  int picture_delay_ms = 40;
};

simulator::Sensors sensors(double altitude_factor, double velocity_factor) {
  simulator::Sensors s;
  s.altitude_factor = altitude_factor;
  s.velocity_factor = velocity_factor;
  return s;
}

// The velocity of the sideways flight is 2 per cent too large, the altitude of the climb 1 per
// cent; the flight forward has both errors.
const Plan kSideways{"sideways", {0, -2, 0}, 0.25F, 0, 0, 0, sensors(1, 1.02)};
const Plan kForward{"forward", {-1.5, 0, 0}, 0, -0.25F, 0, 0.1F, sensors(1.01, 1.02)};
const Plan kClimbing{"climbing", {0, 1, 0}, 0, 0, 0.6F, 0, sensors(1.01, 1)};
// Pictures arrive without delay, as over the loopback: each arrives before the attitude sample that
// follows its instant.
const Plan kPrompt{"prompt", {0, -2, 0}, 0.25F, 0, 0, 0, sensors(1, 1), 0};

int32_t bits(float value) {
  int32_t word;
  std::memcpy(&word, &value, sizeof word);
  return word;
}

// A drone that flies a plan; its pictures and packets are recorded as `drone record` does.
struct Flown {
  fs::path folder;
  std::vector<FlightState> truth;  // the drone's true state at each picture
};

const room::Room& the_room() {
  static const room::Room room;
  return room;
}

class Flyer {
 public:
  explicit Flyer(const Plan& plan, const fs::path& folder)
      : plan_(plan),
        recording_(folder, false),
        drone_(the_room(), plan.start, 0, plan.sensors, now_) {
    drone_.receive_hello(now_);
    send("CONFIG", "\"general:navdata_demo\",\"FALSE\"");
    send("CTRL", "5,0");
  }

  std::vector<FlightState> fly() {
    const int64_t begin = now_;
    for (int64_t ms = 0; ms < 7500; ms += 5) {
      now_ = begin + ms * kMs;
      drone_.advance(now_);
      if (ms % 30 == 0) send("REF", kFly);
      if (ms % 30 == 0 && ms > 4000) steer();
      while (const auto packet = drone_.next_navdata(now_)) record_navdata(*packet);
      if (ms >= 3900 && ms % 100 == 0) record_picture();
    }
    return truth_;
  }

 private:
  void send(const std::string& name, const std::string& arguments) {
    drone_.receive_commands(
        "AT*" + name + "=" + std::to_string(++sequence_) + "," + arguments + "\r", now_);
  }
  void steer() {
    std::string arguments = "1";
    for (const float stick : {plan_.roll, plan_.pitch, plan_.climb, plan_.turn})
      arguments += "," + std::to_string(bits(stick));
    send("PCMD", arguments);
  }
  void record_navdata(const std::vector<uint8_t>& packet) {
    tvs_imu imu{};  // only its time is set: the reader decodes the packet itself
    imu.time.received_ns = now_ + 3 * kMs;
    recording_.add_navdata(packet.data(), packet.size(), imu);
  }
  void record_picture() {
    const FlightState& state = drone_.truth();
    std::vector<uint8_t> luma(kWidth * kHeight);
    the_room().render(
        eye_,
        room::camera_pose(simulator::world_from_body(state), room::kForwardCamera, state.position),
        luma.data(), kWidth);
    room::add_sensor_noise(luma.data(), kWidth, kHeight, kWidth, 1.5, truth_.size() + 1);
    const simulator::FilmPacket coded = film_.encode(luma.data(), kWidth);
    ardrone_pave_packet packet{};
    packet.header.version = 2;
    packet.header.codec = ARDRONE_PAVE_H264;
    packet.header.header_size = 68;
    packet.header.payload_size = static_cast<uint32_t>(coded.payload.size());
    packet.header.encoded_width = packet.header.display_width = kWidth;
    packet.header.encoded_height = packet.header.display_height = kHeight;
    packet.header.frame_number = static_cast<uint32_t>(truth_.size()) + 1;
    packet.header.timestamp_ms = static_cast<uint32_t>(drone_.uptime_ns(now_) / kMs);
    packet.header.total_chunks = packet.header.total_slices = 1;
    packet.header.frame_type = coded.is_key ? ARDRONE_PAVE_IDR : ARDRONE_PAVE_P;
    packet.header.sps_size = coded.sps_bytes;
    packet.header.pps_size = coded.pps_bytes;
    std::vector<uint8_t> bytes(coded.payload.size() + ARDRONE_PAVE_MAX_HEADER);
    TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_encode_pave(&packet.header, coded.payload.data(),
                                                      bytes.data(), bytes.size(), &packet.size));
    packet.bytes = bytes.data();
    tvs_time time{};
    time.host_ns = time.received_ns = now_ + plan_.picture_delay_ms * kMs;
    recording_.add_packet(packet, time);
    truth_.push_back(state);
  }

  const Plan& plan_;
  int64_t now_ = 5000 * kMs;
  int sequence_ = 0;
  Recording recording_;
  simulator::Firmware drone_;
  room::Eye eye_{kCamera};
  simulator::Film film_{kWidth, kHeight, 10, 4000};
  std::vector<FlightState> truth_;
};

// Returns the recording of a plan; each plan is flown once.
const Flown& flown(const Plan& plan) {
  static std::vector<std::pair<const Plan*, Flown>> all;
  for (const auto& [known, flight] : all)
    if (known == &plan) return flight;
  const fs::path folder =
      fs::temp_directory_path() /
      ("twoview_test_recording_" + std::string(plan.name) + "_" + std::to_string(::getpid()));
  fs::remove_all(folder);
  Flown flight{folder, {}};
  flight.truth = Flyer(plan, folder).fly();
  all.emplace_back(&plan, flight);
  return all.back().second;
}

// A pair of pictures of a flight, its reconstruction, and the truth.
struct Result {
  Outcome outcome;
  std::vector<std::optional<MetricScale>> scales;
  double rotation_error_deg, imu_difference_deg, imu_sigma_deg, true_baseline_m;
};

Result reconstructed(const Flown& flight, const RecordedFlight& read, RecordingPair pair,
                     Session& session, const Options& options) {
  Result result;
  result.outcome.has_cameras = true;
  for (int k = 0; k < 2; ++k) {
    result.outcome.picture[k] = pair.picture[k];
    result.outcome.camera[k] = kCamera;
  }
  Options own = options;
  const CameraMount mount;
  TEST_ASSERT_TRUE(set_gravity(read, pair.frame, mount, own.estimate));
  reconstruct_pair(session, own, result.outcome);
  result.scales = scales_of(read, pair.frame, mount, result.outcome);
  room::CameraPose pose[2];
  for (int k = 0; k < 2; ++k) {
    const FlightState& truth = flight.truth[pair.frame[k].number - 1];
    pose[k] =
        room::camera_pose(simulator::world_from_body(truth), room::kForwardCamera, truth.position);
  }
  Matrix3 R;
  Vector3 t;
  room::relative_pose(pose[0], pose[1], R, t);
  result.rotation_error_deg = rotation_error_deg(rotation_of(result.outcome.two_view), R);
  result.true_baseline_m = norm(t);
  const auto imu =
      imu_json(read, pair.frame, mount, result.outcome.two_view, true, best_scale(result.scales));
  result.imu_difference_deg = imu["rotation_difference_deg"].get<double>();
  result.imu_sigma_deg = imu["sigma_deg"].get<double>();
  return result;
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

// Pairs of pictures 0.8 s and 1.4 s apart, along the whole flight (a picture each 0.1 s).
std::vector<Result> all_pairs(const Plan& plan) {
  const Flown& flight = flown(plan);
  const RecordedFlight read = read_flight(flight.folder);
  TEST_ASSERT_EQUAL_UINT64(flight.truth.size(), read.frames.size());
  const Options options;
  Session session(options);
  std::vector<Result> results;
  for (int apart : {8, 14})
    for (int first = 4; first + apart < static_cast<int>(read.frames.size()); first += 3)
      results.push_back(reconstructed(
          flight, read, pair_of(flight.folder, read, first, first + apart), session, options));
  return results;
}

// Checks the cameras' rotation against the truth, and the noisy IMU's rotation against the
// cameras'.
void check_rotations(const std::vector<Result>& results) {
  std::vector<double> errors, differences;
  size_t within = 0;
  for (const Result& r : results) {
    errors.push_back(r.rotation_error_deg);
    differences.push_back(r.imu_difference_deg);
    within += r.imu_difference_deg < 2 * r.imu_sigma_deg;
  }
  std::printf(
      "    %zu pairs: rotation error %.3f deg, difference to the IMU %.3f deg (medians; %zu within "
      "2 sigma)\n",
      results.size(), median(errors), median(differences), within);
  TEST_ASSERT_TRUE(results.size() >= 10);
  TEST_ASSERT_TRUE(median(errors) < 0.3);
  TEST_ASSERT_TRUE(10 * within >= 9 * results.size());
}

// Checks a source's scale against the truth, or that of the source with the least sigma (`source`
// empty). Most pairs must have a scale.
void check_scales(const std::vector<Result>& results, const std::string& source) {
  std::vector<double> errors;
  size_t covered = 0;
  for (const Result& r : results) {
    std::optional<MetricScale> scale = best_scale(r.scales);
    if (!source.empty()) {
      scale.reset();
      for (const auto& one : r.scales)
        if (one && one->source == source) scale = one;
    }
    if (!scale) continue;
    const double error = std::abs(scale->baseline_m - r.true_baseline_m);
    errors.push_back(error / r.true_baseline_m);
    covered += error <= 2 * scale->sigma_m;
  }
  TEST_ASSERT_TRUE_MESSAGE(4 * errors.size() > 3 * results.size(), "few pairs have this scale");
  std::printf(
      "    scale by %s, %zu of %zu pairs: off by %.2f %% (median), %.2f %% at most, %zu within 2 "
      "sigma\n",
      source.empty() ? "the surest" : source.c_str(), errors.size(), results.size(),
      100 * median(errors), 100 * *std::max_element(errors.begin(), errors.end()), covered);
  TEST_ASSERT_TRUE(median(errors) < 0.03);
  TEST_ASSERT_TRUE(10 * covered >= 9 * errors.size());
}

void test_a_sideways_flight() {
  const std::vector<Result> results = all_pairs(kSideways);
  check_rotations(results);
  check_scales(results, "velocity");
  check_scales(results, "floor");
  check_scales(results, "");
}

void test_a_forward_flight() {
  const std::vector<Result> results = all_pairs(kForward);
  check_rotations(results);
  check_scales(results, "velocity");
  check_scales(results, "floor");
  check_scales(results, "");
}

void test_a_climbing_flight() {
  const std::vector<Result> results = all_pairs(kClimbing);
  check_rotations(results);
  check_scales(results, "altitude");
  check_scales(results, "");
}

// The drone hardly moves between the first two frames, so the velocity must give no scale.
void test_a_pair_that_hardly_moved_has_no_scale_by_velocity() {
  const Flown& flight = flown(kSideways);
  const RecordedFlight read = read_flight(flight.folder);
  const Options options;
  Session session(options);
  const Result r =
      reconstructed(flight, read, pair_of(flight.folder, read, 0, 1), session, options);
  for (const auto& scale : r.scales) TEST_ASSERT_TRUE(!scale || scale->source != "velocity");
}

void test_the_best_pair_is_found_and_believed() {
  const Flown& flight = flown(kForward);
  const RecordedFlight read = read_flight(flight.folder);
  const Options options;
  Session session(options);
  const RecordingPair pair =
      choose_pair(flight.folder, read, kCamera, CameraMount(), session, options, Progress(false));
  std::printf("    frames %d and %d: %s\n", pair.frame[0].index, pair.frame[1].index,
              pair.why.c_str());
  const Result r = reconstructed(flight, read, pair, session, options);
  TEST_ASSERT_EQUAL_INT(TV_VERDICT_OK, r.outcome.two_view.verdict);
  TEST_ASSERT_TRUE(r.rotation_error_deg < 0.3);
  TEST_ASSERT_TRUE(r.outcome.two_view.median_parallax_rad * kDegrees > 1.5);
}

void test_a_picture_that_comes_before_its_attitude_has_one() {
  const RecordedFlight read = read_flight(flown(kPrompt).folder);
  TEST_ASSERT_TRUE(read.frames.size() > 30);
  for (const RecordedFrame& frame : read.frames) TEST_ASSERT_TRUE(frame.timed);
  check_rotations(all_pairs(kPrompt));
}

void test_a_frame_that_is_not_there_is_refused() {
  const Flown& flight = flown(kSideways);
  const RecordedFlight read = read_flight(flight.folder);
  try {
    pair_of(flight.folder, read, 0, 10000);
    TEST_FAIL();
  } catch (const BadInput& e) {
    TEST_ASSERT_NOT_NULL(std::strstr(e.what(), "no frame 10000"));
  }
}

struct Ran {
  int status;
  std::string text;  // what the program printed, stdout and stderr together
};

// Runs the twoview program with these arguments and waits for its end.
Ran run(const std::string& arguments) {
  const std::string command =
      std::string(std::getenv("TWOVIEW_PROGRAM")) + " reconstruct " + arguments + " 2>&1";
  FILE* pipe = ::popen(command.c_str(), "r");
  TEST_ASSERT_NOT_NULL(pipe);
  Ran ran;
  char part[4096];
  for (size_t got; (got = std::fread(part, 1, sizeof part, pipe)) > 0;) ran.text.append(part, got);
  ran.status = WEXITSTATUS(::pclose(pipe));
  return ran;
}

std::string write_camera(const Flown& flight, const std::string& more) {
  const std::string path = (flight.folder / "camera.yaml").string();
  std::ofstream(path) << camera_yaml(kCamera) << more;
  return path;
}

std::string text_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

void test_the_program_tells_metres() {
  const Flown& flight = flown(kSideways);
  const std::string camera = write_camera(flight, "camera_in_body: [0, 0, 0]\n");
  const fs::path out = flight.folder / "out";
  const Ran ran = run("--recording " + flight.folder.string() + " --frames 10 24 --camera " +
                      camera + " --json -o " + out.string());
  TEST_ASSERT_EQUAL_INT_MESSAGE(0, ran.status, ran.text.c_str());
  const auto json = nlohmann::json::parse(ran.text);
  TEST_ASSERT_EQUAL_STRING("metric", json["scale"].get<std::string>().c_str());
  const std::vector<double> t = json["t"];
  const FlightState &a = flight.truth[10], &b = flight.truth[24];
  const double truth = std::hypot(b.position[0] - a.position[0], b.position[1] - a.position[1],
                                  b.position[2] - a.position[2]);
  TEST_ASSERT_DOUBLE_WITHIN(0.03 * truth, truth, std::hypot(t[0], t[1], t[2]));
  TEST_ASSERT_TRUE(json["scale_sigma"].get<double>() > 0);
  TEST_ASSERT_TRUE(json["imu"]["gravity_used"].get<bool>());
  TEST_ASSERT_TRUE(json["imu"]["rotation_difference_deg"].get<double>() < 1);
  TEST_ASSERT_TRUE(json["imu"]["scale_source"].is_string());
  const std::string report = text_of(out / "report.html");
  TEST_ASSERT_TRUE(report.find("Against the IMU") != std::string::npos);
  TEST_ASSERT_TRUE(report.find("are in metres") != std::string::npos);
  // A mount given on the command line takes precedence over the file's.
  const Ran turned =
      run("--recording " + flight.folder.string() + " --frames 10 24 --camera " + camera +
          " --body-from-camera 1,0,0,0,1,0,0,0,1 --json -o " + out.string());
  const auto other = nlohmann::json::parse(turned.text.substr(turned.text.find('{')));
  TEST_ASSERT_EQUAL_DOUBLE(1, other["recording"]["body_from_camera"][0].get<double>());
}

void check_refused(const std::string& arguments, const char* word) {
  const Ran ran = run(arguments + " -o " + (fs::temp_directory_path() / "twoview_never").string());
  TEST_ASSERT_EQUAL_INT_MESSAGE(2, ran.status, ran.text.c_str());
  TEST_ASSERT_NOT_NULL_MESSAGE(std::strstr(ran.text.c_str(), word), ran.text.c_str());
  TEST_ASSERT_EQUAL_INT_MESSAGE(
      1, static_cast<int>(std::count(ran.text.begin(), ran.text.end(), '\n')), ran.text.c_str());
}

void test_what_does_not_fit_together_is_refused_in_a_line() {
  const Flown& flight = flown(kSideways);
  const std::string folder = flight.folder.string(),
                    camera = " --camera " + write_camera(flight, "");
  check_refused("--recording " + folder, "--camera");
  check_refused("a.png b.png --recording " + folder + camera, "not both");
  check_refused("a.png b.png --frames 1 2" + camera, "--recording");
  check_refused("a.png" + camera, "B");
  check_refused("--recording " + folder + "/nowhere" + camera, "no recording in");
  check_refused("--recording " + folder + camera + " --frames 3 4000", "no frame 4000");
  check_refused("--recording " + folder + camera + " --frames 3", "--frames");
  check_refused("--recording " + folder + camera + " --body-from-camera 1,0,0,0,1,0,0,0,-1",
                "no rotation");
  check_refused("--recording " + folder + " --camera " +
                    write_camera(flight, "body_from_camera: [1, 2, 3]\n"),
                "3 numbers, not 9");
}

}  // namespace

void setUp(void) {}
void tearDown(void) {}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_a_sideways_flight);
  RUN_TEST(test_a_forward_flight);
  RUN_TEST(test_a_climbing_flight);
  RUN_TEST(test_a_pair_that_hardly_moved_has_no_scale_by_velocity);
  RUN_TEST(test_the_best_pair_is_found_and_believed);
  RUN_TEST(test_a_picture_that_comes_before_its_attitude_has_one);
  RUN_TEST(test_a_frame_that_is_not_there_is_refused);
  RUN_TEST(test_the_program_tells_metres);
  RUN_TEST(test_what_does_not_fit_together_is_refused_in_a_line);
  const int failures = UNITY_END();
  for (const Plan* plan : {&kSideways, &kForward, &kClimbing}) {
    std::error_code ignored;
    fs::remove_all(flown(*plan).folder, ignored);
  }
  return failures;
}
