#include "adjust/window_observation.h"

#include "base/math.h"

namespace tv {

bool make_observation(const Camera& camera, const tv_observation& given, const double* plane,
                      WindowObservation* out) {
  if (!all_finite(given.pixel, 2)) return false;
  const bool sphere = !has_image_plane(camera);
  const Vec2 given_pixel(given.pixel[0], given.pixel[1]);
  Vec3 ray;
  if (sphere) {
    if (!unproject(camera, given_pixel, &ray, nullptr)) return false;
  } else {
    Vec2 at;
    if (plane != nullptr && plane[0] == plane[0])
      at = Vec2(plane[0], plane[1]);
    else if (!undistort(camera, given_pixel, &at))
      return false;
    ray = Vec3(at[0], at[1], 1.0);
  }
  Vec2 pixel;
  Mat23 J;
  if (!project(camera, ray, &pixel, &J)) return false;
  const double sigma = given.sigma == 0.0f ? 1.0 : static_cast<double>(given.sigma);
  for (int i = 0; i < 6; ++i) out->J[i] = J(i % 2, i / 2) / sigma;
  for (int i = 0; i < 3; ++i) out->n[i] = sphere ? ray[i] : i == 2 ? 1.0 : 0.0;
  return true;
}

void LossSum::add(double s) {
  const double c = options_->loss_scale_px, c_sq = c * c;
  if (options_->loss == TV_LOSS_HUBER && s > c_sq) {
    sum_ += 2.0 * c * std::sqrt(s) - c_sq;
  } else if (options_->loss != TV_LOSS_CAUCHY) {
    sum_ += s;
  } else {
    const double u = s / c_sq;
    if (u < 1e-4) {  // log(1 + u) by its series, exact to rounding
      sum_ += c_sq * (u * (1.0 - u * (0.5 - u * (1.0 / 3.0 - 0.25 * u))));
    } else {
      product_ *= 1.0 + u;
      if (product_ > 1e150) {
        sum_ += c_sq * log(product_);
        product_ = 1.0;
      }
    }
  }
}

double LossSum::value() const {
  const double c = options_->loss_scale_px;
  return product_ > 1.0 ? sum_ + c * c * log(product_) : sum_;
}

}  // namespace tv
