#include "api/camera_pair.h"

#include <initializer_list>

#include "base/math.h"
#include "geometry/essential.h"

namespace tv {

tv_status check_pair(const tv_camera_pair& pair) {
  for (const tv_camera* camera : {&pair.camera0, &pair.camera1}) {
    if (tv_camera_check(camera) != TV_OK) return TV_ERR_CAMERA;
  }
  const double *const R = pair.cam1_from_cam0_R, *const t = pair.cam1_from_cam0_t;
  if (!all_finite(R, 9) || !all_finite(t, 3)) return TV_ERR_NOT_FINITE;
  const bool moves = t[0] != 0.0 || t[1] != 0.0 || t[2] != 0.0;
  return is_rotation(R) && moves ? TV_OK : TV_ERR_ARGUMENT;
}

tv_status check_optional_cameras(const tv_camera* camera0, const tv_camera* camera1) {
  if ((camera0 == nullptr) != (camera1 == nullptr)) return TV_ERR_ARGUMENT;
  if (camera0 == nullptr) return TV_OK;
  const tv_status status = tv_camera_check(camera0);
  return status != TV_OK ? status : tv_camera_check(camera1);
}

}  // namespace tv
