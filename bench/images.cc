#include "images.h"

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <sstream>

namespace bench {
namespace {

struct Source {
  const char *folder, *name0, *name1;
};

std::string data_folder() {
  const char* data = std::getenv("TWOVIEW_DATA");
  return data ? data : BENCH_SOURCE_DIR "/../shared/data";
}

tv_camera pinhole(const cv::Mat& image, const double K[9]) {
  tv_camera camera;
  std::memset(&camera, 0, sizeof camera);
  camera.model = TV_CAMERA_PINHOLE;
  camera.width = image.cols, camera.height = image.rows;
  camera.fx = K[0], camera.cx = K[2], camera.fy = K[4], camera.cy = K[5];
  return camera;
}

cv::Mat read_luma(const std::string& path) { return cv::imread(path, cv::IMREAD_GRAYSCALE); }

// Reads the pair from its line of pairs.txt: names, quarter turns, K0, K1, 4x4 transform. Returns
// false if the file has no such line or the images are turned.
bool read_line(const Source& source, double K[2][9], Pair* pair) {
  std::ifstream file(data_folder() + "/" + source.folder + "/pairs.txt");
  for (std::string text; std::getline(file, text);) {
    std::istringstream line(text);
    std::string name0, name1;
    int turns[2];
    double T[16];
    line >> name0 >> name1 >> turns[0] >> turns[1];
    if (name0 != source.name0 || name1 != source.name1) continue;
    for (int k = 0; k < 18; ++k) line >> K[k / 9][k % 9];
    for (double& value : T) line >> value;
    if (!line || turns[0] != 0 || turns[1] != 0) return false;
    for (int i = 0; i < 3; ++i) {
      for (int k = 0; k < 3; ++k) pair->R[3 * i + k] = T[4 * i + k];
      pair->t[i] = T[4 * i + 3];
    }
    pair->has_truth = true;
    return true;
  }
  return false;
}

bool read_from_data(const Source& source, Pair* pair) {
  double K[2][9];
  if (!read_line(source, K, pair)) return false;
  for (int v = 0; v < 2; ++v) {
    const char* name = v == 0 ? source.name0 : source.name1;
    pair->image[v] = read_luma(data_folder() + "/" + source.folder + "/images/" + name);
    if (pair->image[v].empty()) return false;
    pair->camera[v] = pinhole(pair->image[v], K[v]);
  }
  return true;
}

// Reads Middlebury's Motorcycle, a rectified pair: its cameras differ only in cx (the numbers are
// those of scripts/demo_truth.py). Returns false if the images are missing.
bool read_motorcycle(Pair* pair) {
  const char* const names[2] = {"motorcycle_left.png", "motorcycle_right.png"};
  const double cx[2] = {311.193, 342.279};
  for (int v = 0; v < 2; ++v) {
    pair->image[v] = read_luma(std::string(BENCH_SOURCE_DIR "/.cache/motorcycle/") + names[v]);
    if (pair->image[v].empty()) return false;
    const double K[9] = {994.978, 0, cx[v], 0, 994.978, 254.877, 0, 0, 1};
    pair->camera[v] = pinhole(pair->image[v], K);
  }
  const double R[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, t[3] = {-1, 0, 0};
  std::memcpy(pair->R, R, sizeof R);
  std::memcpy(pair->t, t, sizeof t);
  pair->has_truth = true;
  return true;
}

// Scales both images to cover width x height pixels, then cuts this size out of their middle.
void fit(Pair* pair, int width, int height) {
  for (int v = 0; v < 2; ++v) {
    cv::Mat& image = pair->image[v];
    const double scale = std::max(1.0 * width / image.cols, 1.0 * height / image.rows);
    tv_camera camera = pair->camera[v];
    if (scale != 1) {
      const cv::Size size(cvRound(scale * image.cols), cvRound(scale * image.rows));
      cv::Mat scaled;
      cv::resize(image, scaled, size, 0, 0, scale < 1 ? cv::INTER_AREA : cv::INTER_LINEAR);
      image = scaled;
      tv_camera_scale(&pair->camera[v], scale, &camera);
    }
    const int x = (image.cols - width) / 2, y = (image.rows - height) / 2;
    image = image(cv::Rect(x, y, width, height)).clone();
    camera.cx -= x, camera.cy -= y;
    camera.width = width, camera.height = height;
    pair->camera[v] = camera;
  }
}

Pair load(Size size) {
  const bool vga = size == Size::kVga;
  const Source source =
      vga ? Source{"tum_fr3_office", "1341847981.726650.png", "1341847983.738736.png"}
          : Source{"strecha_fountain_P11", "0004.jpg", "0005.jpg"};
  const int width = vga ? 640 : 1280, height = vga ? 480 : 720;
  Pair pair;
  if (!read_from_data(source, &pair) && !read_motorcycle(&pair)) {
    std::fprintf(stderr,
                 "no images: neither %s/%s (TWOVIEW_DATA) nor .cache/motorcycle "
                 "(scripts/bootstrap)\n",
                 data_folder().c_str(), source.folder);
    std::exit(1);
  }
  fit(&pair, width, height);
  pair.name = std::to_string(width) + "x" + std::to_string(height);
  return pair;
}

}  // namespace

const Pair& pair_of(Size size) {
  static const Pair vga = load(Size::kVga), hd = load(Size::kHd);
  return size == Size::kVga ? vga : hd;
}

tv_image view_of(const cv::Mat& image) {
  return tv_image{image.data, image.cols, image.rows, static_cast<int64_t>(image.step)};
}

}  // namespace bench
