#include "simulator/camera_loop.h"

namespace simulator {

CameraLoop::CameraLoop(const ServerOptions& options, const room::Room& room)
    : options_(options), room_(room), thread_([this] { work(); }) {}

CameraLoop::~CameraLoop() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void CameraLoop::expose(const FlightState& truth, int64_t uptime_ns, bool is_720p) {
  const std::lock_guard<std::mutex> lock(mutex_);
  wish_.truth = truth;
  wish_.uptime_ns = uptime_ns;
  wish_.width = is_720p ? 1280 : 640;
  wish_.height = is_720p ? 720 : 360;
  has_wish_ = true;
  changed_.notify_all();
}

std::deque<CodedFrame> CameraLoop::take() {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::deque<CodedFrame> done;
  done.swap(done_);
  return done;
}

void CameraLoop::work() {
  for (;;) {
    CodedFrame wanted;
    {
      std::unique_lock<std::mutex> lock(mutex_);
      changed_.wait(lock, [this] { return stop_ || has_wish_; });
      if (stop_) return;
      wanted = wish_;
      has_wish_ = false;
    }
    CodedFrame made = make(wanted);
    const std::lock_guard<std::mutex> lock(mutex_);
    done_.push_back(std::move(made));
  }
}

CodedFrame CameraLoop::make(const CodedFrame& wanted) {
  CodedFrame frame = wanted;
  if (!film_ || film_->width() != frame.width) {
    tv_camera camera = options_.camera;
    tv_camera_scale(&options_.camera, static_cast<double>(frame.width) / options_.camera.width,
                    &camera);
    film_ = std::make_unique<Film>(frame.width, frame.height, options_.frames_per_second,
                                   frame.width > 640 ? 6000 : 2500);
    if (!options_.painter) eye_ = std::make_unique<room::Eye>(camera);
    luma_.resize(static_cast<size_t>(frame.width) * static_cast<size_t>(frame.height));
  }
  if (options_.painter) {
    options_.painter(frame.truth, num_made_, frame.width, frame.height, luma_.data());
  } else {
    room_.render(*eye_,
                 room::camera_pose(world_from_body(frame.truth), options_.body_from_camera,
                                   frame.truth.position),
                 luma_.data(), frame.width);
    room::add_sensor_noise(luma_.data(), frame.width, frame.height, frame.width,
                           options_.pixel_noise, options_.seed + num_made_);
  }
  frame.packet = film_->encode(luma_.data(), frame.width);
  ++num_made_;
  return frame;
}

}  // namespace simulator
