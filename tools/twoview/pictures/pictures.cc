#include "pictures/pictures.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <opencv2/imgproc.hpp>

#include "pictures/canvas.h"

namespace cli {
namespace {

constexpr int kMaxLines = 110;  // most matches drawn; more are unreadable

std::string counted(int count, const char* noun) {
  return std::to_string(count) + " " + noun +
         (count == 1                                  ? ""
          : noun[std::string(noun).size() - 1] == 'h' ? "es"
                                                      : "s");
}

// Returns the list, or `most` evenly spaced elements if it has more.
std::vector<int> thinned(const std::vector<int>& list, int most) {
  const int count = static_cast<int>(list.size());
  if (count <= most) return list;
  std::vector<int> few;
  for (int i = 0; i < most; ++i)
    few.push_back(list[static_cast<size_t>(static_cast<int64_t>(i) * count / most)]);
  return few;
}

}  // namespace

cv::Mat keypoints_picture(const Picture& picture, const std::vector<tv_keypoint>& keypoints) {
  const double scale = std::min(1600.0 / picture.luma.cols, 3.0);
  cv::Mat grey, sheet;
  cv::resize(picture.luma, grey,
             cv::Size(std::max(1, int(std::lround(picture.luma.cols * scale))),
                      std::max(1, int(std::lround(picture.luma.rows * scale)))),
             0, 0, scale < 1 ? cv::INTER_AREA : cv::INTER_LINEAR);
  grey.convertTo(grey, CV_8U, 0.8);
  cv::cvtColor(grey, sheet, cv::COLOR_GRAY2BGR);
  int levels = 1;
  for (const tv_keypoint& k : keypoints) levels = std::max(levels, k.level + 1);
  // Weak keypoints are drawn first, so that strong ones lie on top.
  for (auto k = keypoints.rbegin(); k != keypoints.rend(); ++k) {
    const cv::Point2d at((k->x + 0.5) * scale - 0.5, (k->y + 0.5) * scale - 0.5);
    const double radius = std::max(2.0, k->size * scale / 2);
    const Colour colour = levels == 1 ? ink::accent : turbo(double(k->level) / (levels - 1));
    put_ring(sheet, at, radius, colour);
    put_line(sheet, at, at + radius * cv::Point2d(std::cos(k->angle_rad), std::sin(k->angle_rad)),
             colour);
  }
  cv::Mat page(sheet.rows + 74, std::max(sheet.cols + 24, 560), CV_8UC3, ink::paper);
  sheet.copyTo(page(cv::Rect(12, 34, sheet.cols, sheet.rows)));
  put_text(page, fitted(plain_letters(picture.name), 11, page.cols - 24.0), {12, 23}, 11,
           ink::text);
  const double base = page.rows - 15.0;
  const std::string count = counted(static_cast<int>(keypoints.size()), "keypoint");
  put_text(page, count, {12, base}, 11, ink::text);
  double x = 12 + text_width(count, 11) + 36;
  for (int level = 0; level < levels && x < page.cols - 90; ++level, x += 92) {
    put_disc(page, {x, base - 5}, 5,
             levels == 1 ? ink::accent : turbo(double(level) / (levels - 1)));
    put_text(page, "level " + std::to_string(level), {x + 11, base}, 10, ink::faint);
  }
  return page;
}

cv::Mat matches_picture(const Picture& picture0, const Picture& picture1,
                        const tv_keypoint* keypoints0, const tv_keypoint* keypoints1,
                        const tv_correspondence* matches, int count, const uint8_t* inlier_mask) {
  PairSheet pair(picture0.luma, picture1.luma, 0.8);
  std::vector<int> good, bad;
  for (int i = 0; i < count; ++i) (!inlier_mask || inlier_mask[i] ? good : bad).push_back(i);

  const auto end0 = [&](int i) {
    const tv_keypoint& k = keypoints0[matches[i].idx0];
    return pair.at(0, k.x, k.y);
  };
  const auto end1 = [&](int i) {
    const tv_keypoint& k = keypoints1[matches[i].idx1];
    return pair.at(1, k.x, k.y);
  };
  const auto moved = [&](int i) {
    const tv_keypoint &a = keypoints0[matches[i].idx0], &b = keypoints1[matches[i].idx1];
    return std::hypot(double(a.x) - b.x, double(a.y) - b.y);
  };
  std::vector<double> lengths;
  for (const int i : good) lengths.push_back(moved(i));
  const double low = lengths.empty() ? 0 : percentile(lengths, 0.02);
  const double high = lengths.empty() ? 1 : percentile(lengths, 0.98);
  const auto colour_of = [&](int i) {
    return turbo((moved(i) - low) / std::max(high - low, 1e-9));
  };

  const std::vector<int> bad_lines = thinned(bad, kMaxLines / 3),
                         good_lines = thinned(good, kMaxLines);
  cv::Mat layer = pair.sheet().clone();
  for (const int i : bad_lines) put_line(layer, end0(i), end1(i), ink::bad);
  cv::addWeighted(layer, 0.3, pair.sheet(), 0.7, 0, pair.sheet());
  layer = pair.sheet().clone();
  for (const int i : good_lines) put_line(layer, end0(i), end1(i), colour_of(i));
  cv::addWeighted(layer, 0.6, pair.sheet(), 0.4, 0, pair.sheet());
  for (const int i : bad)
    for (const cv::Point2d& p : {end0(i), end1(i)}) put_disc(pair.sheet(), p, 1.7, ink::bad);
  for (const int i : good)
    for (const cv::Point2d& p : {end0(i), end1(i)}) put_disc(pair.sheet(), p, 2.2, colour_of(i));

  std::string caption = counted(count, "match");
  if (inlier_mask)
    caption += ": " + counted(int(good.size()), "inlier") + ", " + std::to_string(bad.size()) +
               " rejected (red)";
  if (good_lines.size() < good.size())
    caption += "; " + std::to_string(good_lines.size()) + " drawn as lines";
  if (!good.empty()) {
    char range[64];
    std::snprintf(range, sizeof range, "; colour: moved %.0f to %.0f px", low, high);
    caption += range;
  }
  pair.label(picture0.name, picture1.name, caption);
  return pair.sheet();
}

}  // namespace cli
