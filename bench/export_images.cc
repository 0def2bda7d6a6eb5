// Writes the image pairs of images.h to a folder, where bench/python_peers.py reads them.
// usage: bench_export_images DIR
#include <cstdio>
#include <opencv2/imgcodecs.hpp>

#include "images.h"

namespace {

void write(const std::string& folder, const bench::Pair& pair) {
  cv::FileStorage file(folder + "/" + pair.name + ".json", cv::FileStorage::WRITE);
  file << "R" << cv::Mat(3, 3, CV_64F, const_cast<double*>(pair.R)).reshape(1, 1);
  file << "t" << cv::Mat(1, 3, CV_64F, const_cast<double*>(pair.t));
  for (int v = 0; v < 2; ++v) {
    const std::string number = std::to_string(v);
    const tv_camera& c = pair.camera[v];
    file << "K" + number << cv::Mat(cv::Matx<double, 1, 4>(c.fx, c.fy, c.cx, c.cy));
    cv::imwrite(folder + "/" + pair.name + "_" + number + ".pgm", pair.image[v]);
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: bench_export_images DIR\n");
    return 2;
  }
  write(argv[1], bench::pair_of(bench::Size::kVga));
  write(argv[1], bench::pair_of(bench::Size::kHd));
  return 0;
}
