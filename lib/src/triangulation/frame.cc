#include "triangulation/frame.h"

namespace tv {
namespace {

RayFrame image_plane_frame(const tv_camera& model, const Vec3& ray) {
  const double x = ray[0] / ray[2];
  const double y = ray[1] / ray[2];
  return RayFrame{Vec3(x, y, 1.0),
                  {Vec3(-1.0, 0.0, x), Vec3(0.0, -1.0, y)},
                  {Vec3(1.0, 0.0, 0.0), Vec3(0.0, 1.0, 0.0)},
                  Vec3(0.0, 0.0, 1.0),
                  {1.0 / model.fx, 1.0 / model.fy}};
}

RayFrame sphere_frame(const tv_camera& model, const Vec3& ray) {
  Vec3 u, v;
  complete_basis(ray, &u, &v);
  const double pixel = 1.0 / std::sqrt(model.fx * model.fy);
  return RayFrame{
      ray, {Vec3(-u[0], -u[1], -u[2]), Vec3(-v[0], -v[1], -v[2])}, {u, v}, ray, {pixel, pixel}};
}

}  // namespace

RayFrame frame_of(const Camera& camera, const Vec3& ray) {
  return has_image_plane(camera) ? image_plane_frame(camera.model, ray)
                                 : sphere_frame(camera.model, ray);
}

}  // namespace tv
