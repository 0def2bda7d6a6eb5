#include "recording/recording.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>
#include <nlohmann/json.hpp>

#include <cerrno>
#include <cstring>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <vector>

#include "base/error.h"
#include "base/output.h"

namespace cli {
namespace {

namespace fs = std::filesystem;

std::string reason() { return std::strerror(errno); }

void put_little_endian(uint64_t value, int bytes, std::string& out) {
  for (int k = 0; k < bytes; ++k) out += static_cast<char>(value >> (8 * k) & 255);
}

}  // namespace

GrowingFile::GrowingFile(const fs::path& path)
    : name_(path.string()),
      descriptor_(::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666)) {
  if (descriptor_ < 0) throw BadInput("cannot write " + name_ + ": " + reason());
}

GrowingFile::~GrowingFile() { ::close(descriptor_); }

void GrowingFile::append(const void* bytes, size_t size) {
  const char* at = static_cast<const char*>(bytes);
  size_t left = size;
  while (left > 0) {
    const ssize_t written = ::write(descriptor_, at, left);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) {
      const std::string why = reason();
      if (::ftruncate(descriptor_, size_) != 0) {
      }  // a failed truncation is ignored: readers stop at the last complete entry
      throw BadInput("cannot write " + name_ + ": " + why + "; what was recorded before is kept");
    }
    at += written;
    left -= static_cast<size_t>(written);
  }
  size_ += static_cast<int64_t>(size);
}

void refuse_second_recording(const fs::path& folder) {
  throw BadInput(folder.string() + " holds a recording already: name another folder");
}

void make_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw BadInput("cannot make " + folder.string() + ": " + error.message());
}

void write_frame(const fs::path& folder, const tvs_frame& frame) {
  const cv::Mat luma(frame.image.height, frame.image.width, CV_8U,
                     const_cast<uint8_t*>(frame.image.data),
                     static_cast<size_t>(frame.image.stride_bytes));
  std::vector<uint8_t> png;
  cv::imencode(".png", luma, png, {cv::IMWRITE_PNG_COMPRESSION, 1});
  char name[32];
  std::snprintf(name, sizeof name, "%06llu.png", static_cast<unsigned long long>(frame.number));
  std::error_code ignored;
  fs::remove(folder / name, ignored);
  GrowingFile(folder / name).append(png.data(), png.size());
}

const char kAttitudeHead[] =
    "# time tx ty tz qx qy qz qw, body to world; seconds of the host's clock; tz is "
    "-altitude where it is known, else 0; tx and ty are 0\n";

std::string attitude_line(const tvs_imu& imu) {
  if ((imu.valid & TVS_IMU_ATTITUDE) == 0) return "";
  const double* q = imu.attitude.world_from_body;
  const double down = (imu.valid & TVS_IMU_ALTITUDE) != 0 ? -imu.altitude_m : 0.0;
  char line[256];
  std::snprintf(line, sizeof line, "%.9f 0 0 %.4f %.9f %.9f %.9f %.9f\n",
                static_cast<double>(imu.time.host_ns) * 1e-9, down + 0.0, q[1], q[2], q[3], q[0]);
  return line;
}

Recording::Recording(const fs::path& folder, bool with_frames)
    : folder_(folder), with_frames_(with_frames), made_folder_(!fs::exists(folder)) {
  make_folder(folder);
  if (fs::exists(folder / "video.pave") || fs::exists(folder / "navdata.log"))
    refuse_second_recording(folder);
  video_ = std::make_unique<GrowingFile>(folder / "video.pave");
  navdata_ = std::make_unique<GrowingFile>(folder / "navdata.log");
  attitude_ = std::make_unique<GrowingFile>(folder / "attitude.tum");
  frames_ = std::make_unique<GrowingFile>(folder / "frames.txt");
  attitude_->append(kAttitudeHead);
  if (with_frames) make_folder(folder / "frames");
}

Recording::~Recording() = default;

void Recording::add_navdata(const uint8_t* bytes, size_t size, const tvs_imu& imu) {
  std::string entry;
  put_little_endian(static_cast<uint64_t>(imu.time.received_ns), 8, entry);
  put_little_endian(size, 4, entry);
  entry.append(reinterpret_cast<const char*>(bytes), size);
  navdata_->append(entry);
  attitude_->append(attitude_line(imu));
}

void Recording::add_packet(const ardrone_pave_packet& packet, const tvs_time& time) {
  video_->append(packet.bytes, packet.size);
  char line[128];
  std::snprintf(line, sizeof line, "%lld %lld %u %d\n", static_cast<long long>(time.host_ns),
                static_cast<long long>(time.device_ns), packet.header.frame_number,
                packet.header.frame_type == ARDRONE_PAVE_IDR);
  frames_->append(line);
}

void Recording::add_frame(const tvs_frame& frame) {
  if (with_frames_) write_frame(folder_ / "frames", frame);
}

void Recording::discard() {
  std::error_code ignored;
  for (auto* file : {&video_, &navdata_, &attitude_, &frames_}) file->reset();
  for (const char* name : {"video.pave", "navdata.log", "attitude.tum", "frames.txt"})
    fs::remove(folder_ / name, ignored);
  if (with_frames_) fs::remove(folder_ / "frames", ignored);  // not where a picture is in it
  if (made_folder_) fs::remove(folder_, ignored);
}

void Recording::add_summary(const std::string& json) {
  OutputSet files(folder_);
  files.add("summary.json", json);
  files.commit();
}

}  // namespace cli
