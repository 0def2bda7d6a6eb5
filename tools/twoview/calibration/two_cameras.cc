#include "calibration/two_cameras.h"

#include <algorithm>

namespace cli {
namespace {

constexpr double kShare = 0.2, kPart = 0.5;
constexpr int kOwn = 4;  // fx fy cx cy may differ between the two
constexpr int kRounds = 30;
constexpr double kRank = 1e-6;  // a smaller share of the largest eigenvalue is not observed

// A division of the views: the change of the shared camera, and that of the second part beside it.
struct Division {
  std::vector<bool> is_second;
  cv::Mat first, second;
  double gain = 0;  // by how much the squared residuals fall
};

// The solution of M x = v for a positive semi-definite M, its rows and columns made of one size.
cv::Mat solved(const cv::Mat& M, const cv::Mat& v) {
  cv::Mat scale(M.rows, 1, CV_64F), x;
  for (int i = 0; i < M.rows; ++i)
    scale.at<double>(i) = 1 / std::sqrt(std::max(M.at<double>(i, i), 1e-12));
  cv::solve(M.mul(scale * scale.t()), v.mul(scale), x, cv::DECOMP_SVD);
  return x.mul(scale);
}

double change_of(const ViewForm& view, const cv::Mat& x) {
  return x.dot(view.information * x) - 2 * x.dot(view.gradient);
}

Division fitted(const std::vector<ViewForm>& views, std::vector<bool> is_second) {
  const int n = views[0].gradient.rows;
  cv::Mat M = cv::Mat::zeros(n + kOwn, n + kOwn, CV_64F), v = cv::Mat::zeros(n + kOwn, 1, CV_64F);
  for (size_t i = 0; i < views.size(); ++i) {
    const cv::Mat &H = views[i].information, &g = views[i].gradient;
    M(cv::Rect(0, 0, n, n)) += H;
    v.rowRange(0, n) += g;
    if (!is_second[i]) continue;
    M(cv::Rect(n, 0, kOwn, n)) += H.colRange(0, kOwn);
    M(cv::Rect(0, n, n, kOwn)) += H.rowRange(0, kOwn);
    M(cv::Rect(n, n, kOwn, kOwn)) += H(cv::Rect(0, 0, kOwn, kOwn));
    v.rowRange(n, n + kOwn) += g.rowRange(0, kOwn);
  }
  const cv::Mat x = solved(M, v);
  Division division{std::move(is_second), x.rowRange(0, n).clone(), {}, v.dot(x)};
  division.second = division.first.clone();
  division.second.rowRange(0, kOwn) += x.rowRange(n, n + kOwn);
  return division;
}

// The best division that is reached from view `begin` alone as the second part.
Division divided(const std::vector<ViewForm>& views, size_t begin) {
  std::vector<bool> is_second(views.size());
  is_second[begin] = true;
  Division best = fitted(views, is_second);
  for (int round = 0; round < kRounds; ++round) {
    for (size_t i = 0; i < views.size(); ++i)
      is_second[i] = change_of(views[i], best.second) < change_of(views[i], best.first);
    const auto count = std::count(is_second.begin(), is_second.end(), true);
    if (count == 0 || count == static_cast<std::ptrdiff_t>(views.size())) break;
    Division next = fitted(views, is_second);
    if (!(next.gain > best.gain)) break;
    best = std::move(next);
  }
  return best;
}

// By how much the squared residuals of a view fall with fx fy cx cy of its own.
double own_gain(const ViewForm& view) {
  const cv::Mat H = view.information(cv::Rect(0, 0, kOwn, kOwn));
  cv::Mat scale(kOwn, 1, CV_64F), values, vectors;
  for (int i = 0; i < kOwn; ++i)
    scale.at<double>(i) = 1 / std::sqrt(std::max(H.at<double>(i, i), 1e-12));
  cv::eigen(H.mul(scale * scale.t()), values, vectors);
  const cv::Mat along = vectors * view.gradient.rowRange(0, kOwn).mul(scale);
  double gain = 0;
  for (int i = 0; i < kOwn; ++i)
    if (values.at<double>(i) > kRank * values.at<double>(0))
      gain += along.at<double>(i) * along.at<double>(i) / values.at<double>(i);
  return gain;
}

}  // namespace

SecondCamera find_second_camera(const std::vector<ViewForm>& views) {
  SecondCamera result;
  if (views.size() < 3) return result;
  double sum_sq = 0, sum_own = 0;
  Division best;
  for (size_t i = 0; i < views.size(); ++i) {
    sum_sq += views[i].sum_sq;
    sum_own += own_gain(views[i]);
    Division division = divided(views, i);
    if (division.gain > best.gain) best = std::move(division);
  }
  if (!(best.gain > kShare * sum_sq) || !(best.gain > kPart * sum_own)) return result;
  const auto count = std::count(best.is_second.begin(), best.is_second.end(), true);
  const auto others = static_cast<std::ptrdiff_t>(views.size()) - count;
  // Where both parts have the same number of views, the one without the first view is named.
  const bool is_second_smaller = count < others || (count == others && !best.is_second[0]);
  for (size_t i = 0; i < views.size(); ++i)
    if (best.is_second[i] == is_second_smaller) result.views.push_back(i);
  for (int i = 0; i < kOwn; ++i)
    result.change[i] =
        (is_second_smaller ? 1 : -1) * (best.second.at<double>(i) - best.first.at<double>(i));
  return result;
}

}  // namespace cli
