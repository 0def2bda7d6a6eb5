// Cameras and streams by their names as sources of frames.

#include <chrono>
#include <thread>

#include "odometry/frames.h"
#include "sources/camera_source.h"

namespace cli {
namespace {

class Stream : public FrameSource {
 public:
  explicit Stream(const std::string& name)
      : name_(name), camera_(name, CameraSource::Kind::kLive) {}
  void run(const Wanted& wanted, const Consumer& consume, const std::atomic<bool>& stop) override {
    const tvs_frame_source source = camera_.frames();
    int64_t start_ns = -1;
    for (int index = 0; !stop;) {
      tvs_frame picture{};
      picture.struct_size = sizeof picture;
      const tvs_status status = source.next(source.user, &picture);
      if (status == TVS_NONE) {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
        continue;
      }
      if (status != TVS_OK) return;
      if (start_ns < 0) start_ns = picture.time.host_ns;
      SourceFrame frame;
      frame.index = index++;
      frame.time_s = static_cast<double>(picture.time.host_ns - start_ns) * 1e-9;
      frame.name = "frame_" + std::to_string(picture.number) + ".png";
      frame.gap = frame.index > 0 && (picture.flags & TVS_FRAME_GAP) != 0;
      frame.luma = cv::Mat(picture.image.height, picture.image.width, CV_8U,
                           const_cast<uint8_t*>(picture.image.data),
                           static_cast<size_t>(picture.image.stride_bytes));
      const bool goes_on = !wanted(frame.index) || consume(frame);
      source.release(source.user, &picture);
      if (!goes_on) return;
    }
  }
  bool can_run_again() const override { return false; }
  int num_frames() const override { return -1; }
  std::string kind() const override { return "camera " + name_; }

 private:
  std::string name_;
  CameraSource camera_;
};

}  // namespace

std::unique_ptr<FrameSource> open_camera(const std::string& name) {
  return std::make_unique<Stream>(name);
}

}  // namespace cli
