#include "odometry/drone_frames.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "base/error.h"
#include "drone/link.h"
#include "recording/playback.h"
#include "recording/recording_input.h"
#include "recording/recording_pair.h"
#include "sources/stream_clock.h"

namespace cli {
namespace {

constexpr double kGapS = 0.25;  // longest time between two samples that are interpolated

// Adds what the drone measured at the frame's time, in the camera's terms.
void add_measurements(const FlightSample& at, const CameraMount& mount, SourceFrame& frame) {
  frame.world_from_cam = product(at.world_from_body, mount.body_from_camera);
  frame.attitude_sigma_rad = at.attitude_sigma_rad;
  if (at.altitude_m) {
    frame.height_m = *at.altitude_m - applied(at.world_from_body, mount.position)[2];
    frame.height_sigma_m = at.altitude_sigma;
  }
  if (at.velocity_m_s) {
    frame.velocity_m_s = applied(transposed(mount.body_from_camera), *at.velocity_m_s);
    frame.velocity_sigma_m_s = at.velocity_sigma;
  }
}

CameraMount mount_in(const std::string& camera_file) {
  return camera_file.empty() ? CameraMount{} : load_mount(camera_file);
}

double host_s(const tvs_frame& picture) { return static_cast<double>(picture.time.host_ns) * 1e-9; }

// Turns the driver's frames into those of a source, with times that rise.
class Frames {
 public:
  Frames(const FrameSource::Wanted& wanted, const FrameSource::Consumer& consume,
         const std::atomic<bool>& stop)
      : wanted_(wanted), consume_(consume), stop_(stop) {}

  // The frame with its time and gap; empty where it is left out.
  std::optional<SourceFrame> next(const tvs_frame& frame) {
    SourceFrame result;
    result.index = index_++;
    gap_ = gap_ || (frame.flags & (TVS_FRAME_GAP | TVS_FRAME_NEW_STREAM)) != 0;
    if (done) return {};
    const std::optional<double> time_s = clock_.next(host_s(frame));
    gap_ = gap_ || !time_s || clock_.began_anew();
    if (!time_s || !wanted_(result.index)) return {};
    result.time_s = *time_s;
    char name[40];
    std::snprintf(name, sizeof name, "frame_%06llu.png",
                  static_cast<unsigned long long>(frame.number));
    result.name = name;
    result.gap = gap_ && result.index > 0;
    gap_ = false;
    result.luma = cv::Mat(frame.image.height, frame.image.width, CV_8U,
                          const_cast<uint8_t*>(frame.image.data),
                          static_cast<size_t>(frame.image.stride_bytes));
    return result;
  }
  int num() const { return index_; }
  // Lines for the user about the clock.
  std::vector<std::string> notes() const {
    std::vector<std::string> notes;
    if (const int64_t count = clock_.num_left_out(); count > 0)
      notes.push_back(std::to_string(count) + (count == 1 ? " frame is" : " frames are") +
                      " left out: no later than the one before");
    if (const std::string note = clock_.note("the stream"); !note.empty()) notes.push_back(note);
    return notes;
  }
  // An exception must not pass through the driver's C code, so it is stored.
  void consume(const SourceFrame& frame) {
    try {
      if (!consume_(frame)) done = true;
    } catch (...) {
      failure = std::current_exception();
      done = true;
    }
    if (stop_) done = true;
  }
  void rethrow() const {
    if (failure) std::rethrow_exception(failure);
  }

  std::atomic<bool> done{false};
  std::exception_ptr failure;

 private:
  const FrameSource::Wanted& wanted_;
  const FrameSource::Consumer& consume_;
  const std::atomic<bool>& stop_;
  int index_ = 0;
  StreamClock clock_;
  bool gap_ = false;
};

// A source whose frames a driver gives.
class DriverSource : public FrameSource {
 public:
  std::vector<std::string> notes() const override { return notes_; }

 protected:
  // At the end of a run. A second run may have ended sooner.
  void end(const Frames& frames) {
    frames.rethrow();
    if (frames.num() < num_frames_) return;
    num_frames_ = frames.num();
    notes_ = frames.notes();
  }

 private:
  int num_frames_ = 0;
  std::vector<std::string> notes_;
};

class RecordingFrames : public DriverSource {
 public:
  RecordingFrames(const std::string& folder, const std::string& camera_file)
      : folder_(folder), mount_(mount_in(camera_file)), flight_(read_flight(folder)) {}

  void run(const Wanted& wanted, const Consumer& consume, const std::atomic<bool>& stop) override {
    Frames frames(wanted, consume, stop);
    LinkListener listener;
    listener.on_frame = [&](const tvs_frame& picture) {
      std::optional<SourceFrame> frame = frames.next(picture);
      if (!frame) return;
      const size_t idx = static_cast<size_t>(frame->index);
      if (idx < flight_.frames.size() && flight_.frames[idx].timed)
        if (const auto at = sample_at(flight_.log, host_s(picture), kGapS))
          add_measurements(*at, mount_, *frame);
      frames.consume(*frame);
    };
    play(folder_, listener, frames.done, 0);
    end(frames);
  }
  bool can_run_again() const override { return true; }
  int num_frames() const override { return static_cast<int>(flight_.frames.size()); }
  std::string kind() const override { return "a recording of a drone"; }
  std::vector<double> times() const override {
    std::vector<double> times;
    for (const RecordedFrame& frame : flight_.frames) times.push_back(frame.time_s);
    return times;
  }
  std::vector<std::string> files() const override {
    std::vector<std::string> files;
    for (const char* name :
         {"video.pave", "navdata.log", "vehicle.tlog", "attitude.tum", "frames.txt"})
      files.push_back((std::filesystem::path(folder_) / name).string());
    return files;
  }

 private:
  std::string folder_;
  CameraMount mount_;
  RecordedFlight flight_;
};

class DroneFrames : public DriverSource {
 public:
  DroneFrames(const DroneAddress& address, double seconds, const std::string& camera_file)
      : address_(address), seconds_(seconds), mount_(mount_in(camera_file)) {}

  void run(const Wanted& wanted, const Consumer& consume, const std::atomic<bool>& stop) override {
    Frames frames(wanted, consume, stop);
    std::optional<FlightSample> latest;
    LinkListener listener;
    listener.on_imu = [&](const tvs_imu& imu) {
      if ((imu.valid & TVS_IMU_ATTITUDE) != 0) latest = flight_sample(imu);
    };
    listener.on_frame = [&](const tvs_frame& picture) {
      std::optional<SourceFrame> frame = frames.next(picture);
      if (!frame) return;
      // What comes after the frame is not known yet: the newest sample is taken.
      if (latest && std::abs(latest->time_s - host_s(picture)) <= kGapS)
        add_measurements(*latest, mount_, *frame);
      frames.consume(*frame);
    };
    ardrone_session_options options;
    ardrone_session_options_init(&options);
    options.queue_frames = 0;
    const Decoder decoder;
    options.decoder = decoder.get();
    Link link(address_, options, listener);
    link.run([&] { return frames.done.load(); }, stop, seconds_);
    end(frames);
  }
  bool can_run_again() const override { return false; }
  int num_frames() const override { return -1; }
  std::string kind() const override { return "the drone at " + address_.host; }

 private:
  DroneAddress address_;
  double seconds_;
  CameraMount mount_;
};

class VehicleFrames : public DriverSource {
 public:
  VehicleFrames(const VehicleAddress& vehicle, double seconds, const std::string& camera_file,
                bool quiet)
      : vehicle_(vehicle), seconds_(seconds), mount_(mount_in(camera_file)), quiet_(quiet) {
    if (vehicle.estimates.given())
      estimates_.emplace(vehicle.estimates, mount_.body_from_camera, mount_.position);
  }

  void run(const Wanted& wanted, const Consumer& consume, const std::atomic<bool>& stop) override {
    Frames frames(wanted, consume, stop);
    FlightLog log;
    LinkListener listener;
    listener.on_imu = [&](const tvs_imu& imu) {
      if (log.size() > kMostSamples) log.erase(log.begin(), log.begin() + kMostSamples / 2);
      log.push_back(flight_sample(imu));
    };
    listener.on_frame = [&](const tvs_frame& picture) {
      std::optional<SourceFrame> frame = frames.next(picture);
      if (!frame) return;
      const auto at = sample_at(log, host_s(picture), kGapS);
      if (at) add_measurements(*at, mount_, *frame);
      if (estimates_)
        estimates_->begin(picture.time.host_ns, at ? at->velocity_m_s : std::nullopt,
                          at ? at->velocity_sigma : 0);
      frames.consume(*frame);
    };
    fly_vehicle(
        vehicle_, listener, [&] { return frames.done.load(); }, stop, seconds_, quiet_, &session_);
    session_ = nullptr;
    end(frames);
  }
  bool wants_found() const override { return estimates_.has_value(); }
  void found(const tv_odometry_state& state,
             const std::optional<std::array<double, 12>>& previous) override {
    if (session_) estimates_->send(session_, state, previous);
  }
  std::vector<std::string> notes() const override {
    std::vector<std::string> notes = DriverSource::notes();
    if (estimates_) notes.push_back(estimates_->note());
    return notes;
  }
  bool can_run_again() const override { return false; }
  int num_frames() const override { return -1; }
  std::string kind() const override { return "the vehicle at " + vehicle_.address; }

 private:
  static constexpr size_t kMostSamples = 400;
  VehicleAddress vehicle_;
  double seconds_;
  CameraMount mount_;
  bool quiet_;
  std::optional<VehicleEstimates> estimates_;
  tvm_session* session_ = nullptr;  // while it runs
};

}  // namespace

std::unique_ptr<FrameSource> open_vehicle(const VehicleAddress& vehicle, double seconds,
                                          const std::string& camera_file, bool quiet) {
  return std::make_unique<VehicleFrames>(vehicle, seconds, camera_file, quiet);
}

std::unique_ptr<FrameSource> open_recording(const std::string& folder,
                                            const std::string& camera_file) {
  return std::make_unique<RecordingFrames>(folder, camera_file);
}

std::unique_ptr<FrameSource> open_drone(const DroneAddress& address, double seconds,
                                        const std::string& camera_file) {
  return std::make_unique<DroneFrames>(address, seconds, camera_file);
}

}  // namespace cli
