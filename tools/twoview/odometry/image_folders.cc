// Folders of images as sources of frames. All formats become one list of times and files.

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>

#include "base/error.h"
#include "base/matrix.h"
#include "base/output.h"
#include "files/camera_doubts.h"
#include "files/camera_file.h"
#include "files/camera_formats.h"
#include "files/camera_set.h"
#include "files/exif.h"
#include "files/folder.h"
#include "files/image_file.h"
#include "files/mixed_names.h"
#include "files/sequence_order.h"
#include "files/yaml_values.h"
#include "odometry/frames.h"
#include "odometry/measurements.h"
#include "odometry/numbers.h"

namespace cli {
namespace {

namespace fs = std::filesystem;
constexpr size_t kMaxFileBytes = 1 << 28;

struct Listed {
  double time_s;
  std::string name;     // relative to the source's folder
  std::string problem;  // why it cannot be used; empty where nothing is known against it
};

bool is_file(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(path, error);
}

bool is_folder(const fs::path& path) {
  std::error_code error;
  return fs::is_directory(path, error);
}

// What the formats have in common.
struct Folder {
  std::string path, kind;
  std::vector<Listed> frames;
  NamedCameras cameras;     // of cameras.yaml; may be empty
  std::string camera_name;  // in messages
  std::string truth;
  std::optional<std::array<double, 12>> body_from_camera;
  std::optional<Measurements> measurements;
  std::vector<std::string> files;
  std::vector<LeftOut> left_out;
  std::vector<std::string> notes;  // of its files
};

class ImageFolder : public FrameSource {
 public:
  explicit ImageFolder(Folder folder) : folder_(std::move(folder)) {}

  int turn_deg() const override { return is_turned_ ? 0 : turn_deg_; }
  void run(const Wanted& wanted, const Consumer& consume, const std::atomic<bool>& stop) override {
    std::optional<double> before_s;
    for (size_t k = 0; k < folder_.frames.size() && !stop; ++k) {
      const Listed& listed = folder_.frames[k];
      SourceFrame frame;
      frame.index = static_cast<int>(k);
      if (!wanted(frame.index)) continue;
      frame.name = listed.name;
      frame.time_s = listed.time_s;
      try {
        if (!listed.problem.empty()) throw BadInput(listed.problem);
        const std::string file = (fs::path(folder_.path) / listed.name).string();
        Picture picture = load_picture(file);
        if (picture.turn_deg != 0) turn_deg_ = picture.turn_deg;
        if (is_turned_) turn(picture, -picture.turn_deg / 90);
        frame.luma = picture.luma;
        frame.colour = picture.colour;
        if (picture.turn_deg == 0 && !picture.is_16bit) frame.file = file;
        frame.exif = picture.exif;
        has_stretched_ = has_stretched_ || picture.is_stretched;
        has_more_ = has_more_ || picture.has_more;
      } catch (const BadInput& e) {
        frame.problem = e.what();
      }
      if (folder_.measurements) folder_.measurements->add_to(frame);
      if (folder_.measurements && before_s) folder_.measurements->add_turn(*before_s, frame);
      before_s = frame.time_s;
      if (!consume(frame)) return;
    }
  }
  // As for films: a camera of the turned size belongs to the turned pictures.
  void fit(tv_camera& camera) override {
    if (folder_.frames.empty()) return;
    const cv::Size size = header_size((fs::path(folder_.path) / folder_.frames[0].name).string());
    is_turned_ =
        size.width != size.height && camera.width == size.height && camera.height == size.width;
  }
  bool can_run_again() const override { return true; }
  int num_frames() const override { return static_cast<int>(folder_.frames.size()); }
  std::string kind() const override { return folder_.kind; }
  std::optional<tv_camera> camera(const SourceFrame& frame, int width, int height) const override {
    if (folder_.cameras.empty()) return {};
    const tv_camera* const entry = choose_camera(folder_.cameras, frame.name, nullptr);
    if (!entry) throw BadInput(folder_.camera_name + ": no entry fits image " + frame.name);
    require_size(*entry, folder_.camera_name, width, height, frame.name);
    return *entry;
  }
  std::string truth_file() const override { return folder_.truth; }
  std::vector<double> times() const override {
    std::vector<double> times;
    for (const Listed& listed : folder_.frames) times.push_back(listed.time_s);
    return times;
  }
  std::vector<std::string> names() const override {
    std::vector<std::string> names;
    for (const Listed& listed : folder_.frames) names.push_back(listed.name);
    return names;
  }
  std::vector<double> focals_35mm() const override {
    std::vector<double> focals;
    for (const Listed& listed : folder_.frames) {
      const std::string file = (fs::path(folder_.path) / listed.name).string();
      const cv::Size size = header_size(file);
      if (!listed.problem.empty() || size.area() == 0) continue;
      const ExifFocal exif = exif_focal(read_file(file, kMaxFileBytes), size.width, size.height);
      if (exif.focal_35mm > 0) focals.push_back(exif.focal_35mm);
    }
    return focals;
  }
  std::optional<std::array<double, 12>> body_from_camera() const override {
    return folder_.body_from_camera;
  }
  std::vector<std::string> files() const override { return folder_.files; }
  std::vector<std::string> notes() const override {
    std::vector<std::string> notes = folder_.notes;
    if (!folder_.left_out.empty()) notes.push_back(left_out_words(folder_.left_out, folder_.path));
    if (has_stretched_) notes.push_back(kStretchedNote);
    if (has_more_) notes.push_back(kMoreNote);
    if (turn_deg_ != 0)
      notes.push_back(is_turned_
                          ? "the pictures are turned as a viewer does (EXIF): the camera is of "
                            "that size"
                          : stored_words(turn_deg_) + " (EXIF): so is the map");
    return notes;
  }

 private:
  Folder folder_;
  bool has_stretched_ = false, has_more_ = false;
  int turn_deg_ = 0;        // of a picture, by EXIF
  bool is_turned_ = false;  // the camera is of the pictures as a viewer turns them
};

// Reads lines `time name` and checks that the times rise; `scale` makes them seconds. The name is
// looked for below each of `folders`, which are relative to the source's folder.
void read_list(Folder& folder, const std::string& file, double scale, std::string_view separators,
               const std::vector<std::string>& folders) {
  const std::string path = (fs::path(folder.path) / file).string();
  const std::string text = read_file(path, kMaxFileBytes);
  for (const TextLine& line : lines_of(text)) {
    const std::string where = path + ": line " + std::to_string(line.number);
    const std::vector<std::string_view> words = words_of(line.text, separators);
    Listed listed{};
    if (words.size() != 2 || !to_number(words[0], listed.time_s))
      throw BadInput(where + " is not a time and a file's name");
    listed.time_s *= scale;
    if (!folder.frames.empty() && !(listed.time_s > folder.frames.back().time_s))
      throw BadInput(where + ": its time is not later than that of the frame before");
    const std::string name(words[1]);
    listed.name = (fs::path(folders[0]) / name).string();
    for (const std::string& below : folders) {
      const std::string candidate = (fs::path(below) / name).string();
      if (!is_file(fs::path(folder.path) / candidate)) continue;
      listed.name = candidate;
      break;
    }
    folder.frames.push_back(listed);
  }
  if (folder.frames.empty()) throw BadInput(path + ": no frame in it");
  folder.files.push_back(path);
}

void add_note(Folder& folder, const std::string& note) {
  if (!note.empty()) folder.notes.push_back(note);
}

// A line where a list names a file more than once; else empty.
std::string repeated_words(const Folder& folder) {
  std::set<std::string> names;
  std::string first;
  size_t count = 0;
  for (const Listed& listed : folder.frames) {
    if (names.insert(listed.name).second) continue;
    if (++count == 1) first = listed.name;
  }
  if (count == 0) return "";
  return folder.files.back() + " names " + std::to_string(count) +
         (count == 1 ? " picture" : " pictures") + " again, the first " + first +
         ": a picture was taken once";
}

// What the subfolders of a folder hold, which is not used; empty where they hold no pictures.
std::string subfolder_words(const fs::path& root) {
  size_t num_folders = 0, num_pictures = 0;
  std::string first;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(root, error)) {
    const std::string name = entry.path().filename().string();
    if (!entry.is_directory(error) || name[0] == '.') continue;
    size_t count = 0;
    for (const fs::directory_entry& inner : fs::directory_iterator(entry.path(), error))
      count += has_picture_ending(inner.path());
    if (count == 0) continue;
    num_pictures += count;
    if (++num_folders == 1 || name < first) first = name;
  }
  if (num_folders == 0) return "";
  return std::to_string(num_pictures) + (num_pictures == 1 ? " picture" : " pictures") + " in " +
         (num_folders == 1 ? "the subfolder "
                           : std::to_string(num_folders) + " subfolders, the first ") +
         first;
}

void add_cameras(Folder& folder) {
  const std::string path = (fs::path(folder.path) / "cameras.yaml").string();
  if (!is_file(path)) return;
  std::vector<std::string> left_out;
  folder.cameras = load_camera_set(path, &left_out);
  add_note(folder, left_out_note(path, left_out));
  folder.camera_name = path;
  folder.files.push_back(path);
}

void add_truth(Folder& folder, const std::string& name) {
  const std::string path = (fs::path(folder.path) / name).string();
  if (!is_file(path)) return;
  folder.truth = path;
  folder.files.push_back(path);
}

void add_measurements(Folder& folder) {
  const std::string path = (fs::path(folder.path) / "imu.txt").string();
  if (!is_file(path)) return;
  folder.measurements = Measurements::read(path);
  std::vector<double> times_s;
  for (const Listed& listed : folder.frames) times_s.push_back(listed.time_s);
  add_note(folder, folder.measurements->note(times_s));
  folder.files.push_back(path);
}

// The camera of EuRoC's sensor.yaml: resolution, intrinsics, distortion_model,
// distortion_coefficients, and T_BS, which is body_from_camera.
void add_euroc_camera(Folder& folder) {
  const std::string path = (fs::path(folder.path) / "mav0/cam0/sensor.yaml").string();
  if (!is_file(path)) return;
  const CameraFile file = load_camera_file(path);
  folder.cameras.emplace_back("cam0", file.of(""));
  folder.camera_name = path;
  folder.files.push_back(path);
  add_note(folder, file.note());
  if (!file.root["T_BS"]) return;
  const std::vector<double> T = numbers_at(file.root, "T_BS", path);
  if (T.size() != 16)
    throw BadInput(path + ": T_BS has " + std::to_string(T.size()) + " numbers, not 16");
  const Matrix3 R =
      made_rotation({T[0], T[1], T[2], T[4], T[5], T[6], T[8], T[9], T[10]}, path + ": T_BS");
  folder.body_from_camera = {R[0], R[1], R[2], T[3], R[3], R[4],
                             R[5], T[7], R[6], R[7], R[8], T[11]};
}

// The camera of KITTI's calib.txt: the line of P0, 12 numbers.
void add_kitti_camera(Folder& folder) {
  const std::string path = (fs::path(folder.path) / "calib.txt").string();
  if (!is_file(path)) return;
  const std::string text = read_file(path, 1 << 20);
  for (const TextLine& line : lines_of(text)) {
    const std::vector<std::string_view> words = words_of(line.text);
    if (words[0] != "P0:" && words[0] != "P_rect_00:") continue;
    const std::string where = path + ": line " + std::to_string(line.number);
    std::array<double, 12> P{};
    bool good = words.size() == 13;
    for (size_t k = 0; good && k < 12; ++k) good = to_number(words[k + 1], P[k]);
    if (!good) throw BadInput(where + " is not P0: and 12 numbers");
    tv_camera camera{};
    camera.model = TV_CAMERA_PINHOLE;
    camera.fx = P[0];
    camera.cx = P[2];
    camera.fy = P[5];
    camera.cy = P[6];
    camera.width = camera.height = 1;  // calib.txt does not say them
    check(tv_camera_check(&camera), where);
    folder.cameras.emplace_back("P0", camera);
    folder.camera_name = path;
    folder.files.push_back(path);
    return;
  }
  throw BadInput(path + ": no line P0");
}

// Leaves out what is not of the size that most pictures have, by their headers. A frame that a list
// names stays, as one that cannot be used, since it has a time.
void leave_out_other_sizes(Folder& folder, bool are_listed) {
  std::vector<cv::Size> sizes;
  for (const Listed& listed : folder.frames)
    sizes.push_back(header_size((fs::path(folder.path) / listed.name).string()));
  const cv::Size usual = most_frequent(sizes);
  std::vector<Listed> kept;
  for (size_t k = 0; k < sizes.size(); ++k) {
    Listed& listed = folder.frames[k];
    if (sizes[k].area() > 0 && sizes[k] != usual) {
      const std::string why = other_size_words(sizes[k], usual);
      if (are_listed)
        listed.problem = "frame " + listed.name + " " + why;
      else
        folder.left_out.push_back({listed.name, why});
      if (!are_listed) continue;
    }
    kept.push_back(std::move(listed));
  }
  folder.frames = std::move(kept);
}

void read_kitti(Folder& folder) {
  const fs::path path = folder.path;
  const std::string times = (path / "times.txt").string();
  FolderPictures pictures = pictures_of(path / "image_0");
  const std::vector<std::string>& names = pictures.names;
  folder.left_out = std::move(pictures.left_out);
  if (names.empty()) throw BadInput((path / "image_0").string() + ": no image in it");
  const std::string text = read_file(times, kMaxFileBytes);
  const std::vector<TextLine> lines = lines_of(text);
  if (lines.size() != names.size())
    throw BadInput(times + " has " + std::to_string(lines.size()) + " times, but image_0 has " +
                   std::to_string(names.size()) + " images");
  for (size_t k = 0; k < names.size(); ++k) {
    Listed listed{0, "image_0/" + names[k], ""};
    const std::string where = times + ": line " + std::to_string(lines[k].number);
    if (!to_number(lines[k].text, listed.time_s)) throw BadInput(where + " is not a time");
    if (k > 0 && !(listed.time_s > folder.frames.back().time_s))
      throw BadInput(where + ": its time is not later than that of the frame before");
    folder.frames.push_back(listed);
  }
  folder.files.push_back(times);
  add_note(folder, pictures.note);
  add_kitti_camera(folder);
}

// KITTI's calib.txt gives no image size: the camera takes that of the images, which its principal
// point must fit.
class KittiFolder : public ImageFolder {
 public:
  explicit KittiFolder(Folder folder)
      : ImageFolder(Folder(folder)), cameras_(std::move(folder.cameras)) {}
  std::optional<tv_camera> camera(const SourceFrame& frame, int width, int height) const override {
    if (cameras_.empty()) return {};
    tv_camera camera = cameras_[0].second;
    camera.width = width;
    camera.height = height;
    const std::string where = "image " + frame.name + ": P0 of calib.txt";
    refuse_exchanged(camera, where);
    refuse_other_scale(camera, where);
    return camera;
  }

 private:
  NamedCameras cameras_;
};

void refuse_fps(double fps, const Folder& folder) {
  if (fps > 0)
    throw BadInput("--fps is for a folder of images without times, or a film: " + folder.path +
                   " is " + folder.kind + ", which has times");
}

// A folder of images in the order of their names, at a rate that the user gives.
void read_pictures(Folder& folder, double fps, bool is_sequence) {
  const fs::path root = folder.path;
  FolderPictures pictures = pictures_of(root);
  const std::vector<std::string>& names = pictures.names;
  folder.left_out = std::move(pictures.left_out);
  if (names.empty() && !folder.left_out.empty())
    throw BadInput(folder.path +
                   " holds no image that is read: " + left_out_words(folder.left_out, folder.path));
  const std::string below = subfolder_words(root);
  if (names.empty())
    throw BadInput(folder.path +
                   " holds neither frames.txt, rgb.txt, mav0/cam0/data.csv, image_0, video.pave "
                   "nor any image" +
                   (below.empty() ? "" : ", but " + below));
  if (!(fps > 0))
    throw BadInput("--fps is required: " + folder.path + " holds images without times");
  for (const std::string& name : names) folder.frames.push_back({0, name, ""});
  leave_out_other_sizes(folder, false);
  std::vector<std::string> kept;
  for (const Listed& listed : folder.frames) kept.push_back(listed.name);
  if (const std::string kinds = mixed_names(kept); is_sequence && !kinds.empty())
    throw BadInput(folder.path + " holds pictures with the same numbers " + kinds +
                   ": of several cameras or takes, or copies? Give those of one, in a folder of "
                   "their own");
  if (is_sequence) {
    SequenceOrder order = sequence_order(root, kept);
    kept = std::move(order.names);
    add_note(folder, order.note);
  }
  for (size_t k = 0; k < kept.size(); ++k)
    folder.frames[k] = {static_cast<double>(k) / fps, kept[k], ""};
  add_note(folder, jump_words(kept));
  add_note(folder, pictures.note);
  if (!below.empty()) add_note(folder, "not used: " + below);
  add_cameras(folder);
}

}  // namespace

std::unique_ptr<FrameSource> open_image_folder(const std::string& path, double fps, bool with_imu,
                                               bool is_sequence) {
  Folder folder;
  folder.path = path;
  const fs::path root = path;
  if (is_file(root / "frames.txt")) {
    folder.kind = "a set folder (frames.txt)";
    refuse_fps(fps, folder);
    read_list(folder, "frames.txt", 1, "", {"", "images"});
    add_note(folder, repeated_words(folder));
    add_cameras(folder);
    add_truth(folder, "groundtruth.txt");
    if (with_imu) add_measurements(folder);
  } else if (is_file(root / "rgb.txt")) {
    folder.kind = "a TUM RGB-D folder (rgb.txt)";
    refuse_fps(fps, folder);
    read_list(folder, "rgb.txt", 1, "", {""});
    add_cameras(folder);
    add_truth(folder, "groundtruth.txt");
  } else if (is_file(root / "mav0/cam0/data.csv")) {
    folder.kind = "an EuRoC folder (mav0/cam0)";
    refuse_fps(fps, folder);
    read_list(folder, "mav0/cam0/data.csv", 1e-9, ",", {"mav0/cam0/data"});
    add_euroc_camera(folder);
    add_truth(folder, "mav0/state_groundtruth_estimate0/data.csv");
  } else if (is_folder(root / "image_0")) {
    folder.kind = "a KITTI folder (image_0, times.txt)";
    refuse_fps(fps, folder);
    read_kitti(folder);
    leave_out_other_sizes(folder, true);
    return std::make_unique<KittiFolder>(std::move(folder));
  } else {
    folder.kind = "a folder of images";
    read_pictures(folder, fps, is_sequence);
    return std::make_unique<ImageFolder>(std::move(folder));
  }
  leave_out_other_sizes(folder, true);
  return std::make_unique<ImageFolder>(std::move(folder));
}

}  // namespace cli
