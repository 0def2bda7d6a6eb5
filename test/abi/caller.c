/* A program on the public headers, compiled with those of one release and run on a library of
   another. It uses every struct that may grow, checks that the library writes nothing beyond a
   struct's end, and prints results that must be equal for all headers and libraries.

   usage: caller                 compiled with the headers of a release
          caller known|unknown   compiled with those of grow.py (TWOVIEW_ABI_GROWN): whether the
                                 library knows the fields that grow.py adds */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "twoview/alloc.h"
#include "twoview/twoview.h"

enum { WIDTH = 320, HEIGHT = 240, CAP = 500, GUARD = 256, PATTERN = 0x5A };

#define CHECK(condition)                                         \
  do {                                                           \
    if (!(condition)) {                                          \
      printf("line %d: %s is not true\n", __LINE__, #condition); \
      exit(1);                                                   \
    }                                                            \
  } while (0)

/* A struct type whose member `it` lies between guard bytes, which a write outside it changes. */
#define GUARDED(type)      \
  struct {                 \
    uint8_t before[GUARD]; \
    type it;               \
    uint8_t after[GUARD];  \
  }

static int is_pattern(const uint8_t *bytes, size_t count) {
  size_t k;
  for (k = 0; k < count; ++k) {
    if (bytes[k] != PATTERN) return 0;
  }
  return 1;
}

#define GUARDS_HOLD(guarded) \
  CHECK(is_pattern((guarded)->before, GUARD) && is_pattern((guarded)->after, GUARD))

#define INIT(init, guarded)                                  \
  do {                                                       \
    memset(guarded, PATTERN, sizeof *(guarded));             \
    init(&(guarded)->it);                                    \
    CHECK((guarded)->it.struct_size == sizeof(guarded)->it); \
    GUARDS_HOLD(guarded);                                    \
    CHECK_GROWN_ZERO((guarded)->it);                         \
  } while (0)

#ifdef TWOVIEW_ABI_GROWN
static int known;
#define CHECK_GROWN_ZERO(it)                                                          \
  CHECK((it).grown_number == 0 && (it).grown_other == 0 && (it).grown_more[0] == 0 && \
        (it).grown_more[1] == 0)
#define SPOIL_GROWN(it) memset(&(it).grown_number, PATTERN, sizeof(it) - offsetof_grown(it))
#define offsetof_grown(it) ((size_t)((const char *)&(it).grown_number - (const char *)&(it)))
/* A new field that is not zero: a library that does not know the field must return an error. */
#define REFUSES_UNKNOWN(field, call)                       \
  do {                                                     \
    (field).grown_more[1] = 1;                             \
    CHECK((call) == (known ? TV_OK : TV_ERR_STRUCT_SIZE)); \
    (field).grown_more[1] = 0;                             \
  } while (0)
#else
#define CHECK_GROWN_ZERO(it) (void)(it)
#define SPOIL_GROWN(it) (void)(it)
#define REFUSES_UNKNOWN(field, call) (void)0
#endif

static uint8_t images[2][WIDTH * HEIGHT];
static tv_keypoint keypoints[2][CAP];
static uint8_t descriptors[2][CAP * TV_DESCRIPTOR_BYTES];
static tv_correspondence matches[CAP], guided[CAP];
static double pixels[2][2 * CAP];
static float ratios[CAP];
static uint8_t mask[CAP];
static tv_point points[CAP];

static GUARDED(tv_limits) limits;
static GUARDED(tv_feature_options) feature;
static GUARDED(tv_features) features[2];
static GUARDED(tv_match_options) match;
static GUARDED(tv_guided_options) along;
static GUARDED(tv_pixel_pairs) pairs;
static GUARDED(tv_estimate_options) estimate;
static GUARDED(tv_two_view) pose;
static GUARDED(tv_evidence) evidence;
static GUARDED(tv_bundle_options) bundle;
static GUARDED(tv_bundle_result) adjusted;
static GUARDED(tv_view) views[2];
static GUARDED(tv_reconstruct_options) options;
static GUARDED(tv_reconstruction) cloud;

static unsigned next_random(void) {
  static unsigned state = 1;
  state = state * 1664525u + 1013904223u;
  return state >> 8;
}

/* Draws blocks at two depths, as a camera that moves to the right sees them. */
static void paint(void) {
  int k, x, y;
  for (k = 0; k < 3000; ++k) {
    const int left = (int)(next_random() % (WIDTH - 60)) + 40,
              top = (int)(next_random() % (HEIGHT - 8));
    const int side = 4 + (int)(next_random() % 5),
              shift = top < HEIGHT / 2 ? 3 + k % 5 : 18 + k % 5;
    const uint8_t grey = (uint8_t)next_random();
    for (y = top; y < top + side && y < HEIGHT; ++y) {
      for (x = left; x < left + side; ++x) {
        images[0][y * WIDTH + x] = grey;
        images[1][y * WIDTH + x - shift] = grey;
      }
    }
  }
}

static void init_all(void) {
  int v;
  INIT(tv_limits_init, &limits);
  INIT(tv_feature_options_init, &feature);
  INIT(tv_match_options_init, &match);
  INIT(tv_guided_options_init, &along);
  INIT(tv_pixel_pairs_init, &pairs);
  INIT(tv_estimate_options_init, &estimate);
  INIT(tv_two_view_init, &pose);
  INIT(tv_evidence_init, &evidence);
  INIT(tv_bundle_options_init, &bundle);
  INIT(tv_bundle_result_init, &adjusted);
  INIT(tv_reconstruct_options_init, &options);
  INIT(tv_reconstruction_init, &cloud);
  for (v = 0; v < 2; ++v) {
    INIT(tv_features_init, &features[v]);
    INIT(tv_view_init, &views[v]);
  }
  CHECK(limits.it.max_width == 640 && match.it.ratio == 0.92f);
  CHECK(bundle.it.loss == TV_LOSS_CAUCHY && bundle.it.max_iterations == 50);
  CHECK(estimate.it.confidence == 0.9999 && estimate.it.calibration0.refine == 0);
}

static tv_context *make_context(void) {
  tv_context *context = NULL;
  size_t size; /* used only with grown headers */
  (void)size;
  limits.it.max_width = WIDTH;
  limits.it.max_height = HEIGHT;
  limits.it.max_keypoints = CAP;
  feature.it.max_keypoints = CAP;
  REFUSES_UNKNOWN(limits.it, tv_context_size(&limits.it, &size));
  CHECK(tv_context_new(&context, &limits.it) == TV_OK);
  return context;
}

static int run_stages(tv_context *context, const tv_camera *camera) {
  int32_t num_matches = 0, num_guided = 0, v, k;
  uint64_t times[TV_NUM_STAGES + 2];
  tv_camera_pair corrected;
  tv_epipolar epipolar;
  for (v = 0; v < 2; ++v) {
    tv_image image;
    image.data = images[v];
    image.width = image.stride_bytes = WIDTH;
    image.height = HEIGHT;
    CHECK(tv_extract(context, &image, NULL, &feature.it, keypoints[v], descriptors[v], CAP,
                     &features[v].it.num) == TV_OK);
    features[v].it.keypoints = keypoints[v];
    features[v].it.descriptors = descriptors[v];
    views[v].it.image = image;
    views[v].it.camera = camera;
  }
  REFUSES_UNKNOWN(feature.it, tv_describe(context, &views[0].it.image, keypoints[0], 1, &feature.it,
                                          descriptors[0]));
  CHECK(tv_match(context, &features[0].it, &features[1].it, &match.it, matches, CAP,
                 &num_matches) == TV_OK);
  REFUSES_UNKNOWN(match.it, tv_match(context, &features[0].it, &features[1].it, &match.it, matches,
                                     CAP, &num_matches));
  REFUSES_UNKNOWN(features[1].it, tv_match(context, &features[0].it, &features[1].it, &match.it,
                                           matches, CAP, &num_matches));
  for (k = 0; k < num_matches; ++k) {
    pixels[0][2 * k] = keypoints[0][matches[k].idx0].x;
    pixels[0][2 * k + 1] = keypoints[0][matches[k].idx0].y;
    pixels[1][2 * k] = keypoints[1][matches[k].idx1].x;
    pixels[1][2 * k + 1] = keypoints[1][matches[k].idx1].y;
    ratios[k] = matches[k].ratio;
  }
  pairs.it.num = num_matches;
  pairs.it.pixels0 = pixels[0];
  pairs.it.pixels1 = pixels[1];
  pairs.it.ratios = ratios;
  SPOIL_GROWN(pose.it);
  SPOIL_GROWN(evidence.it);
  CHECK(tv_estimate_two_view(context, camera, camera, &pairs.it, &estimate.it, &pose.it,
                             &evidence.it, mask) == TV_OK);
  CHECK_GROWN_ZERO(pose.it);
  CHECK_GROWN_ZERO(evidence.it);
  GUARDS_HOLD(&pose);
  GUARDS_HOLD(&evidence);
  CHECK(evidence.it.struct_size == sizeof evidence.it);
  CHECK(evidence.it.essential_inliers == pose.it.num_inliers);
  CHECK(pose.it.struct_size == sizeof pose.it);
  REFUSES_UNKNOWN(estimate.it, tv_estimate_two_view(context, camera, camera, &pairs.it,
                                                    &estimate.it, &pose.it, &evidence.it, mask));
  REFUSES_UNKNOWN(pairs.it, tv_estimate_two_view(context, camera, camera, &pairs.it, &estimate.it,
                                                 &pose.it, &evidence.it, mask));
  CHECK(tv_corrected_pair(&pose.it, camera, camera, &corrected) == TV_OK);
  REFUSES_UNKNOWN(pose.it, tv_corrected_pair(&pose.it, camera, camera, &corrected));
  epipolar.camera0 = &corrected.camera0;
  epipolar.camera1 = &corrected.camera1;
  memcpy(epipolar.matrix, pose.it.E, sizeof epipolar.matrix);
  CHECK(tv_match_guided(context, &epipolar, &features[0].it, &features[1].it, &along.it, guided,
                        CAP, &num_guided) == TV_OK);
  REFUSES_UNKNOWN(along.it, tv_match_guided(context, &epipolar, &features[0].it, &features[1].it,
                                            &along.it, guided, CAP, &num_guided));
  CHECK(tv_triangulate(&corrected, &pairs.it, TV_TRIANGULATION_POLY, points) == TV_OK);
  REFUSES_UNKNOWN(pairs.it, tv_triangulate(&corrected, &pairs.it, TV_TRIANGULATION_POLY, points));
  SPOIL_GROWN(adjusted.it);
  CHECK(tv_adjust_two_view(context, &pairs.it, &bundle.it, &corrected, points, &adjusted.it) ==
        TV_OK);
  CHECK_GROWN_ZERO(adjusted.it);
  GUARDS_HOLD(&adjusted);
  printf("stages: %d and %d keypoints, %d matches, %d guided, %s %s, %d inliers, %a %a %a, %a\n",
         (int)features[0].it.num, (int)features[1].it.num, (int)num_matches, (int)num_guided,
         tv_kind_string((tv_kind)pose.it.kind), tv_verdict_string((tv_verdict)pose.it.verdict),
         (int)pose.it.num_inliers, pose.it.t[0], pose.it.t[1], pose.it.t[2], adjusted.it.rms_px);
  REFUSES_UNKNOWN(bundle.it, tv_adjust_two_view(context, &pairs.it, &bundle.it, &corrected, points,
                                                &adjusted.it));
  memset(times, PATTERN, sizeof times);
  CHECK(tv_context_take_times(context, times, TV_NUM_STAGES + 1) == TV_OK);
  CHECK(times[TV_NUM_STAGES] == 0 && is_pattern((uint8_t *)&times[TV_NUM_STAGES + 1], 8));
  return pose.it.t[0] < -0.99 && num_matches > 50;
}

static int run_reconstruct(tv_context *context) {
  SPOIL_GROWN(pose.it);
  SPOIL_GROWN(evidence.it);
  SPOIL_GROWN(cloud.it);
  options.it.feature = &feature.it;
  options.it.match = &match.it;
  options.it.estimate = &estimate.it;
  options.it.guided_matching = options.it.bundle_adjustment = 1;
  CHECK(tv_reconstruct(context, &views[0].it, &views[1].it, &options.it, &pose.it, &evidence.it,
                       &cloud.it) == TV_OK);
  CHECK_GROWN_ZERO(pose.it);
  CHECK_GROWN_ZERO(evidence.it);
  CHECK_GROWN_ZERO(cloud.it);
  GUARDS_HOLD(&pose);
  GUARDS_HOLD(&evidence);
  GUARDS_HOLD(&cloud);
  CHECK(cloud.it.struct_size == sizeof cloud.it);
  printf("tv_reconstruct: %d matches, %d points, %s, %a %a %a\n", (int)cloud.it.num_matches,
         (int)cloud.it.num_points, tv_kind_string((tv_kind)pose.it.kind), pose.it.t[0],
         pose.it.t[1], pose.it.t[2]);
  REFUSES_UNKNOWN(options.it, tv_reconstruct(context, &views[0].it, &views[1].it, &options.it,
                                             &pose.it, &evidence.it, &cloud.it));
  REFUSES_UNKNOWN(views[1].it, tv_reconstruct(context, &views[0].it, &views[1].it, &options.it,
                                              &pose.it, &evidence.it, &cloud.it));
  return pose.it.t[0] < -0.99 && cloud.it.num_points > 30;
}

int main(int argc, char **argv) {
  tv_camera camera = {TV_CAMERA_PINHOLE, WIDTH, HEIGHT, 0, 260, 260, 159.5, 119.5, {0}};
  tv_context *context;
#ifdef TWOVIEW_ABI_GROWN
  CHECK(argc == 2);
  known = strcmp(argv[1], "known") == 0;
#else
  (void)argc, (void)argv;
#endif
  paint();
  init_all();
  context = make_context();
  CHECK(run_stages(context, &camera));
  CHECK(run_reconstruct(context));
  tv_context_free(context);
  return 0;
}
