/* Programs that call one part of the library, for scripts/footprint, which defines one of PROGRAM_*
   and links them with --gc-sections: what each carries of the library is its size. They are not
   run. */
#include <twoview/twoview.h>

#define CAP 100

static unsigned char memory[1 << 20];

int main(void) {
  tv_limits limits;
  tv_context *context;
  int32_t num = 0;
  tv_limits_init(&limits);
  if (tv_context_init(&context, &limits, memory, sizeof memory) != TV_OK) return 1;
#if defined(PROGRAM_detect) || defined(PROGRAM_match)
  static tv_keypoint keypoints[CAP];
  const tv_image image = {memory, 640, 480, 640};
  if (tv_detect(context, &image, NULL, NULL, keypoints, CAP, &num) != TV_OK) return 1;
#endif
#if defined(PROGRAM_match)
  static unsigned char descriptors[CAP * TV_DESCRIPTOR_BYTES];
  static tv_correspondence matches[CAP];
  tv_features features = {0};
  if (tv_extract(context, &image, NULL, NULL, keypoints, descriptors, CAP, &num) != TV_OK) return 1;
  features.keypoints = keypoints;
  features.descriptors = descriptors;
  features.num = num;
  if (tv_match(context, &features, &features, NULL, matches, CAP, &num) != TV_OK) return 1;
#elif defined(PROGRAM_pose)
  static tv_pixel_pairs pairs;
  static tv_two_view pose;
  if (tv_estimate_two_view(context, NULL, NULL, &pairs, NULL, &pose, NULL, NULL) != TV_OK) return 1;
#elif defined(PROGRAM_reconstruct)
  static tv_view views[2];
  static tv_two_view pose;
  static tv_reconstruction cloud;
  if (tv_reconstruct(context, &views[0], &views[1], NULL, &pose, NULL, &cloud) != TV_OK) return 1;
#elif defined(PROGRAM_track)
  static tv_camera camera;
  static tv_odometry_options options;
  static tv_odometry_frame frame;
  static tv_odometry_state state;
  tv_odometry *odometry;
  tv_odometry_options_init(&options);
  if (tv_odometry_init(&odometry, &camera, &options, memory, sizeof memory) != TV_OK) return 1;
  if (tv_odometry_track(odometry, &frame, &state) != TV_OK) return 1;
#endif
  return num;
}
