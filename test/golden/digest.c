/* Prints digests of every output of the library for pairs of images, for scripts/determinism: two
   builds that print the same lines gave the same bits.

   digest [--without-c] PAIR...   for each pair and each kernel set of this CPU, or each but the C
                                  set: `pair set part digest`, a part being the outputs of a few
                                  calls
   PAIR is what determinism.py writes: a line of text, `width height`, a line of numbers for each
   camera (fx fy cx cy k1 k2 p1 p2 k3), and the bytes of both images.

   Structs are digested field by field, since padding has no defined value; floating point by its
   bits. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../support/calls.h"
#include "twoview/alloc.h"
#include "twoview/twoview.h"

/* Structs that programs exchange, and that ctypes declares, must have one layout on every CPU:
   these are all structs without pointers. */
#define LAYOUT(type, bytes, last, offset) \
  _Static_assert(sizeof(type) == bytes && offsetof(type, last) == offset, #type)
LAYOUT(tv_limits, 32, max_effort, 28);
LAYOUT(tv_keypoint, 24, level, 20);
LAYOUT(tv_feature_options, 56, reserved, 52);
LAYOUT(tv_correspondence, 16, ratio, 12);
LAYOUT(tv_match_options, 16, max_distance, 12);
LAYOUT(tv_guided_options, 20, neighbourhood_px, 16);
LAYOUT(tv_camera, 112, k, 48);
LAYOUT(tv_calibration, 24, reserved, 20);
LAYOUT(tv_estimate_options, 160, reserved, 156);
LAYOUT(tv_two_view, 920, focal_sigma, 912);
LAYOUT(tv_evidence, 120, camera_direction_rad, 112);
LAYOUT(tv_point, 40, reserved, 36);
LAYOUT(tv_bundle_options, 24, hold_pose, 20);
LAYOUT(tv_bundle_result, 256, noise_px, 248);
LAYOUT(tv_absolute_pose_options, 96, gravity_sigma_rad, 88);
LAYOUT(tv_absolute_pose, 544, seed, 536);
LAYOUT(tv_window_view, 104, fixed, 100);
LAYOUT(tv_observation, 32, reserved, 28);
LAYOUT(tv_pose_prior, 392, information, 104);
LAYOUT(tv_gravity_prior, 40, sigma_rad, 32);
LAYOUT(tv_distance_prior, 24, sigma, 16);
LAYOUT(tv_window_options, 40, reserved, 36);
LAYOUT(tv_window_result, 80, noise_px, 72);
LAYOUT(tv_odometry_options, 40, reserved, 36);
LAYOUT(tv_odometry_state, 632, reserved_end, 628);
LAYOUT(tv_keyframe, 128, num_observations, 124);
LAYOUT(tv_map_point, 112, covariance, 40);
LAYOUT(tv_map_observation, 24, reserved, 20);
LAYOUT(tv_camera_pair, 320, cam1_from_cam0_t, 296);
LAYOUT(tv_dense_point, 40, grey, 36);
LAYOUT(tv_room_options, 24, max_distance, 16);
LAYOUT(tv_room_state, 72, max, 48);
LAYOUT(tv_room_vertex, 40, reserved, 36);
LAYOUT(tv_room_triangle, 12, idx_vertex, 0);
LAYOUT(tv_room_mesh_options, 88, max_sigma, 80);
LAYOUT(tv_room_plane, 88, reserved, 84);
LAYOUT(tv_room_plane_options, 48, gravity_sigma_rad, 40);

enum { MAX_KEYPOINTS = 600, NUM_METHODS = TV_TRIANGULATION_MIDPOINT + 1 };

typedef struct pair {
  const char *name;
  tv_camera camera[2];
  tv_image image[2];
} pair;

static void fail(const char *what, tv_status status) {
  fprintf(stderr, "digest: %s: %s\n", what, tv_status_string(status));
  exit(2);
}

static void must(const char *what, tv_status status) {
  if (status != TV_OK) fail(what, status);
}

/* The hash (FNV-1a, 64 bits) of all bytes added since start(). */
static uint64_t digest;

static void start(void) { digest = 14695981039346656037u; }

static void add_bytes(const void *bytes, size_t count) {
  const uint8_t *b = (const uint8_t *)bytes;
  size_t k;
  for (k = 0; k < count; ++k) digest = (digest ^ b[k]) * 1099511628211u;
}

static void add_int(int64_t value) { add_bytes(&value, sizeof value); }
static void add_float(float value) { add_bytes(&value, sizeof value); }
static void add_doubles(const double *values, size_t count) {
  add_bytes(values, count * sizeof values[0]);
}
static void add_double(double value) { add_doubles(&value, 1); }

static void print(const pair *p, tv_context *context, const char *part) {
  printf("%s %s %s %016llx\n", p->name, tv_kernels_string(tv_context_kernels(context)), part,
         (unsigned long long)digest);
}

static void add_keypoints(const tv_keypoint *keypoints, const uint8_t *descriptors, int32_t count) {
  int32_t k;
  add_int(count);
  for (k = 0; k < count; ++k) {
    add_float(keypoints[k].x);
    add_float(keypoints[k].y);
    add_float(keypoints[k].size);
    add_float(keypoints[k].angle_rad);
    add_float(keypoints[k].score);
    add_int(keypoints[k].level);
  }
  if (descriptors) add_bytes(descriptors, (size_t)count * TV_DESCRIPTOR_BYTES);
}

static void add_matches(const tv_correspondence *matches, int32_t count) {
  int32_t k;
  add_int(count);
  for (k = 0; k < count; ++k) {
    add_int(matches[k].idx0);
    add_int(matches[k].idx1);
    add_int(matches[k].dist_sq);
    add_float(matches[k].ratio);
  }
}

static void add_two_view(const tv_two_view *r, const tv_evidence *e) {
  add_int(r->kind);
  add_int(r->verdict);
  add_int(r->reasons);
  add_int(r->num_matches);
  add_int(r->num_inliers);
  add_bytes(&r->has_R, 8); /* the eight flags from has_R on */
  add_int(r->num_iterations);
  add_doubles(r->R, 9);
  add_doubles(r->t, 3);
  add_doubles(r->E, 9);
  add_doubles(r->F, 9);
  add_doubles(r->H, 9);
  add_doubles(r->alternative_R, 9);
  add_doubles(r->alternative_t, 3);
  add_doubles(r->covariance, 25);
  add_doubles(r->alternative_covariance, 25);
  add_int(e->essential_inliers);
  add_int(e->fundamental_inliers);
  add_int(e->homography_inliers);
  add_int(e->rotation_inliers);
  add_double(e->coverage);
  add_double(r->median_parallax_rad);
  add_double(r->rms_error_px);
  add_double(r->noise_px);
  add_int((int64_t)r->seed);
  add_doubles(r->principal_point_shift, 2);
  add_double(e->principal_point_chi2);
  add_doubles(e->principal_point_asked_px, 2);
  add_doubles(e->principal_point_asked_covariance, 3);
  add_double(r->probability_wrong);
  add_doubles(&e->agreement, 2); /* and region_shift_rad */
  add_double(r->focal_scale);
  add_double(r->focal_sigma);
  add_doubles(&e->camera_chi2, 3); /* and camera_turn_rad, camera_direction_rad */
}

static void add_points(const tv_point *points, int32_t count) {
  int32_t k;
  for (k = 0; k < count; ++k) {
    add_doubles(points[k].position, 3);
    add_float(points[k].angle_rad);
    add_float(points[k].error_px);
    add_int(points[k].status);
  }
}

static void add_bundle(const tv_bundle_result *r) {
  add_int(r->num_points);
  add_int(r->num_iterations);
  add_int(r->converged);
  add_int(r->has_covariance);
  add_double(r->initial_cost);
  add_double(r->final_cost);
  add_double(r->initial_rms_px);
  add_double(r->rms_px);
  add_doubles(r->covariance, 25);
  add_double(r->noise_px);
}

static void add_camera(const tv_camera *camera) {
  double pixels[64][2], rays[64][3];
  uint8_t inside[64];
  tv_camera scaled;
  double angle;
  int k;
  for (k = 0; k < 64; ++k) { /* a grid of 8 x 8 pixels that reaches beyond the image */
    pixels[k][0] = camera->width * (0.16 * (k % 8) - 0.05);
    pixels[k][1] = camera->height * (0.16 * (k / 8) - 0.05);
  }
  must("valid_angle", tv_camera_valid_angle(camera, &angle));
  add_double(angle);
  must("unproject_points", tv_camera_unproject_points(camera, pixels[0], 64, rays[0], inside));
  add_doubles(rays[0], sizeof rays / sizeof(double));
  add_bytes(inside, sizeof inside);
  for (k = 0; k < 64; ++k) {
    double back[2] = {0, 0}, flat[2] = {0, 0}, jacobian[6] = {0};
    add_int(tv_camera_project(camera, rays[k], back, jacobian));
    add_doubles(back, 2);
    add_doubles(jacobian, 6);
    add_int(tv_camera_unproject(camera, pixels[k], rays[k], jacobian));
    add_doubles(jacobian, 6);
    add_int(tv_camera_undistort(camera, pixels[k], flat));
    add_doubles(flat, 2);
  }
  must("project_points", tv_camera_project_points(camera, rays[0], 64, pixels[0], inside));
  add_doubles(pixels[0], sizeof pixels / sizeof(double));
  add_bytes(inside, sizeof inside);
  must("scale", tv_camera_scale(camera, 0.37, &scaled));
  add_int(scaled.width);
  add_int(scaled.height);
  add_doubles(&scaled.fx, 4);
}

/* Cameras: the pair's own, and both distortion models with strong lenses. */
static void digest_cameras(const pair *p, tv_context *context) {
  static const double brown[8] = {-0.32, 0.12, 0.001, -0.0007, 0.01, 0.02, -0.01, 0.001};
  static const double fisheye[8] = {-0.02, 0.01, -0.004, 0.0006, 0, 0, 0, 0};
  tv_camera lens = p->camera[0];
  start();
  add_camera(&p->camera[0]);
  add_camera(&p->camera[1]);
  lens.model = TV_CAMERA_BROWN_CONRADY;
  memcpy(lens.k, brown, sizeof lens.k);
  add_camera(&lens);
  lens.model = TV_CAMERA_KANNALA_BRANDT;
  memcpy(lens.k, fisheye, sizeof lens.k);
  add_camera(&lens);
  print(p, context, "camera");
}

typedef struct features {
  tv_keypoint keypoints[2][MAX_KEYPOINTS];
  uint8_t descriptors[2][MAX_KEYPOINTS * TV_DESCRIPTOR_BYTES];
  int32_t count[2];
} features;

static void extract(const pair *p, tv_context *context, const tv_feature_options *options,
                    features *f) {
  int v;
  for (v = 0; v < 2; ++v) {
    must("extract", tv_extract(context, &p->image[v], NULL, options, f->keypoints[v],
                               f->descriptors[v], MAX_KEYPOINTS, &f->count[v]));
    add_keypoints(f->keypoints[v], f->descriptors[v], f->count[v]);
  }
}

/* Runs every option of a feature stage with two values at least. `f` holds the result of the
   default options at the end. */
static void digest_features(const pair *p, tv_context *context, features *f) {
  tv_feature_options options;
  tv_feature_options_init(&options);
  options.max_keypoints = MAX_KEYPOINTS;
  start();
  for (options.arc = 10; options.arc <= 12; ++options.arc) {
    options.levels = options.arc - 8;
    options.scale_factor = options.arc == 11 ? 1.37f : 2.0f;
    options.cell_px = options.arc == 12 ? 40 : 0;
    options.threshold = 2 * options.arc;
    options.min_threshold = options.arc == 10 ? 0 : 3;
    options.subpixel = options.arc != 11;
    options.pooling = options.arc == 11;
    options.orientation = options.arc == 12 ? TV_ORIENTATION_UPRIGHT : TV_ORIENTATION_GRADIENT;
    options.descriptor = options.arc == 12 ? TV_NORMALISATION_ROOTSIFT : TV_NORMALISATION_SIFT;
    options.keypoint_size = (float)options.arc - 6.5f;
    extract(p, context, &options, f);
  }
  print(p, context, "features_options");
  tv_feature_options_init(&options);
  options.max_keypoints = MAX_KEYPOINTS;
  start();
  extract(p, context, &options, f);
  print(p, context, "features");
}

typedef struct matched {
  tv_correspondence matches[MAX_KEYPOINTS];
  double pixels[2][2 * MAX_KEYPOINTS];
  float ratios[MAX_KEYPOINTS];
  int32_t count;
} matched;

static void digest_matches(const pair *p, tv_context *context, const features *f, matched *m) {
  int32_t k, v;
  start();
  must("match", match_rows(context, f->descriptors[0], f->count[0], f->descriptors[1], f->count[1],
                           NULL, m->matches, MAX_KEYPOINTS, &m->count));
  add_matches(m->matches, m->count);
  print(p, context, "matches");
  for (k = 0; k < m->count; ++k) {
    const int32_t index[2] = {m->matches[k].idx0, m->matches[k].idx1};
    for (v = 0; v < 2; ++v) {
      m->pixels[v][2 * k] = f->keypoints[v][index[v]].x;
      m->pixels[v][2 * k + 1] = f->keypoints[v][index[v]].y;
    }
    m->ratios[k] = m->matches[k].ratio;
  }
}

static void estimate_with(const tv_camera *camera0, const tv_camera *camera1, tv_context *context,
                          const matched *m, const tv_estimate_options *options,
                          tv_two_view *result) {
  uint8_t inliers[MAX_KEYPOINTS];
  tv_evidence evidence;
  tv_two_view_init(result);
  must("estimate_two_view",
       estimate_evidence(context, camera0, camera1, m->pixels[0], m->pixels[1], m->ratios, m->count,
                         options, result, &evidence, inliers));
  add_two_view(result, &evidence);
  add_bytes(inliers, (size_t)m->count);
}

static void estimate(const pair *p, tv_context *context, const matched *m, int calibrated,
                     const tv_estimate_options *options, tv_two_view *result) {
  estimate_with(calibrated ? &p->camera[0] : NULL, calibrated ? &p->camera[1] : NULL, context, m,
                options, result);
}

static double uniform(uint64_t *seed, double low, double high) {
  *seed = *seed * 6364136223846793005u + 1442695040888963407u;
  return low + (high - low) * (double)(*seed >> 33) / 2147483648.0;
}

/* Simulated matches of one camera that turns by 23 degrees and moves. The principal point that
   the library gets is wrong, and the estimate must find that; few real pairs turn enough for
   this. First a pinhole, then a lens with distortion. */
static void digest_principal_point(const pair *p, tv_context *context) {
  static matched m;
  /* With u = 0.2: cosine = (1 - u^2) / (1 + u^2), sine = 2 u / (1 + u^2). */
  const double cosine = 0.96 / 1.04, sine = 0.4 / 1.04;
  tv_camera camera = p->camera[0];
  tv_two_view moved;
  tv_estimate_options options;
  uint64_t seed = 1;
  int lens, k, v;
  tv_estimate_options_init(&options);
  options.calibration0.center_sigma = 0.01;
  options.calibration0.refine = TV_REFINE_PRINCIPAL_POINT;
  start();
  for (lens = 0; lens < 2; ++lens) {
    camera.model = lens ? TV_CAMERA_BROWN_CONRADY : TV_CAMERA_PINHOLE;
    memset(camera.k, 0, sizeof camera.k);
    camera.k[0] = lens ? -0.3 : 0;
    for (m.count = k = 0; k < 400; ++k) {
      const double z = uniform(&seed, 2, 8), x = z * uniform(&seed, -0.4, 0.4),
                   y = z * uniform(&seed, -0.3, 0.3);
      const double points[2][3] = {
          {x, y, z}, {cosine * x + sine * z - 0.7, y + 0.1, cosine * z - sine * x + 0.7}};
      for (v = 0; v < 2; ++v) {
        double pixel[2];
        must("project", tv_camera_project(&camera, points[v], pixel, NULL));
        m.pixels[v][2 * m.count] = pixel[0] + uniform(&seed, -0.1, 0.1);
        m.pixels[v][2 * m.count + 1] = pixel[1] + uniform(&seed, -0.1, 0.1);
      }
      m.ratios[m.count++] = 0.5f;
    }
    camera.cx += 0.03 * camera.fx;
    camera.cy -= 0.02 * camera.fy;
    estimate_with(&camera, &camera, context, &m, &options, &moved);
    if (moved.principal_point_shift[0] == 0) fail("the principal point stayed", TV_OK);
    camera = p->camera[0];
  }
  print(p, context, "principal_point");
}

static void digest_estimates(const pair *p, tv_context *context, const matched *m,
                             tv_two_view *pose) {
  static const char *const names[] = {"five_point", "eight_point", "seven_point", "upright"};
  tv_estimate_options options;
  tv_two_view with_gravity;
  int32_t method;
  for (method = TV_SOLVER_UPRIGHT; method >= TV_SOLVER_FIVE_POINT;
       --method) { /* the five-point solver comes last, since its pose is returned */
    tv_estimate_options_init(&options);
    options.method = method;
    options.max_iterations = 2000;
    if (method == TV_SOLVER_UPRIGHT) {
      options.gravity0[1] = options.gravity1[1] = 1;
      options.gravity_sigma_rad = 0.02;
    }
    start();
    if (method == TV_SOLVER_EIGHT_POINT || method == TV_SOLVER_SEVEN_POINT) {
      estimate(p, context, m, 0, &options, pose);
    }
    estimate(p, context, m, 1, &options, pose);
    print(p, context, names[method - TV_SOLVER_FIVE_POINT]);
  }
  tv_estimate_options_init(&options);
  options.fixed_iterations = 40;
  /* Gravity is used as a prior, with directions that are wrong for this pair. */
  options.gravity0[1] = options.gravity1[1] = 1;
  options.gravity0[0] = 0.1;
  options.gravity_sigma_rad = 0.05;
  start();
  estimate(p, context, m, 1, &options, &with_gravity);
  print(p, context, "gravity");
  digest_principal_point(p, context);
}

/* The absolute pose from simulated matches, a third of them wrong: each camera model,
   with sigmas, with gravity, and of a plane, the last two of them with ratios. */
static void digest_absolute_pose(const pair *p, tv_context *context) {
  static double pixels[2 * MAX_KEYPOINTS], points[3 * MAX_KEYPOINTS];
  static float sigmas[MAX_KEYPOINTS], ratios[MAX_KEYPOINTS];
  static uint8_t inliers[MAX_KEYPOINTS];
  tv_camera camera = p->camera[0];
  tv_pixel_points matches;
  tv_absolute_pose_options options;
  tv_absolute_pose r;
  uint64_t seed = 3;
  int part, k;
  start();
  for (part = 0; part < 6; ++part) {
    camera.model = part % 3;
    memset(camera.k, 0, sizeof camera.k);
    camera.k[0] = part % 3 == 0 ? 0 : -0.02;
    tv_pixel_points_init(&matches);
    for (k = 0; k < MAX_KEYPOINTS; ++k) {
      const double x = uniform(&seed, -0.4, 0.4), y = uniform(&seed, -0.3, 0.3),
                   z = part == 5 ? 4 + x : uniform(&seed, 2, 8);
      const double seen[3] = {x * z, y * z, z};
      must("project", tv_camera_project(&camera, seen, pixels + 2 * k, NULL));
      pixels[2 * k] += uniform(&seed, -1, 1) * (k % 3 == 0 ? 100 : 1);
      pixels[2 * k + 1] += uniform(&seed, -1, 1);
      points[3 * k] = seen[1] - 5;
      points[3 * k + 1] = seen[2] + 70;
      points[3 * k + 2] = seen[0];
      sigmas[k] = (float)uniform(&seed, 1, 3);
      ratios[k] = (float)uniform(&seed, 0, 1);
    }
    matches.num = MAX_KEYPOINTS;
    matches.pixels = pixels;
    matches.points = points;
    if (part >= 3) matches.sigmas = sigmas;
    if (part >= 4) matches.ratios = ratios;
    tv_absolute_pose_options_init(&options);
    if (part == 4) { /* a little off */
      options.gravity_in_world[1] = options.gravity_in_camera[2] = 1;
      options.gravity_in_camera[0] = 0.01;
      options.gravity_sigma_rad = 0.01;
    }
    tv_absolute_pose_init(&r);
    must("absolute_pose",
         tv_estimate_absolute_pose(context, &camera, &matches, &options, &r, inliers));
    if (!r.has_pose) fail("no absolute pose", TV_OK);
    add_int(r.verdict);
    add_int(r.reasons);
    add_int(r.num_inliers);
    add_int(r.num_iterations);
    add_doubles(r.R, 9);
    add_doubles(r.t, 3);
    add_int(r.has_alternative);
    add_doubles(r.alternative_R, 9);
    add_doubles(r.alternative_t, 3);
    add_doubles(r.covariance, 36);
    add_double(r.coverage);
    add_double(r.rms_error_px);
    add_double(r.noise_px);
    add_bytes(inliers, sizeof inliers);
  }
  print(p, context, "absolute_pose");
}

/* A view at the height y = -0.1 k, turned about y by the angle whose half has the tangent u. */
static tv_window_view window_view(int k, double x, double z, double u) {
  const double cosine = (1 - u * u) / (1 + u * u), sine = 2 * u / (1 + u * u);
  const double R[9] = {cosine, 0, -sine, 0, 1, 0, sine, 0, cosine};
  tv_window_view view;
  int i;
  memset(&view, 0, sizeof view);
  memcpy(view.R, R, sizeof R);
  for (i = 0; i < 3; ++i) view.t[i] = -(R[3 * i] * x - 0.1 * k * R[3 * i + 1] + R[3 * i + 2] * z);
  return view;
}

enum { VIEWS = 8, POINTS = 80, SEEN_BY = 5 }; /* a point is seen by SEEN_BY consecutive views */

typedef struct window_data {
  tv_window_view views[VIEWS], truth[VIEWS];
  double points[3 * POINTS];
  tv_observation observations[SEEN_BY * POINTS];
  tv_pose_prior pose_prior;
  tv_gravity_prior gravity_priors[VIEWS];
  tv_distance_prior distance_prior;
} window_data;

/* Views on an arc, points, pixels with noise, every 20th one of them off by up to wrong_px, and a
   start that is off. */
static void make_window(const tv_camera *camera, double wrong_px, uint64_t *seed, window_data *d) {
  double dx, dz;
  int v, k, i;
  memset(d, 0, sizeof *d);
  for (v = 0; v < VIEWS; ++v) {
    d->truth[v] = window_view(v, 0.3 * v, 0.02 * v * v, -0.02 * v);
    /* One after the other: compilers differ in the order in which they evaluate arguments. */
    dx = uniform(seed, -0.02, 0.02);
    dz = uniform(seed, -0.02, 0.02);
    d->views[v] = window_view(v, 0.3 * v + dx, 0.02 * v * v + dz, -0.021 * v);
    d->gravity_priors[v].idx_view = v;
    d->gravity_priors[v].down[1] = 9.81;
    d->gravity_priors[v].down[2] = uniform(seed, -0.05, 0.05);
    d->gravity_priors[v].sigma_rad = 0.01;
  }
  d->pose_prior.idx_view = 1;
  memcpy(d->pose_prior.R, d->truth[1].R, sizeof d->pose_prior.R);
  memcpy(d->pose_prior.t, d->truth[1].t, sizeof d->pose_prior.t);
  for (i = 0; i < 6; ++i) d->pose_prior.information[7 * i] = 1e4;
  d->distance_prior.idx_view1 = VIEWS - 1;
  d->distance_prior.distance = 2.5;
  d->distance_prior.sigma = 0.01;
  for (k = 0; k < SEEN_BY * POINTS; ++k) {
    const int point = k / SEEN_BY, view = point % (VIEWS - SEEN_BY + 1) + k % SEEN_BY;
    tv_observation *o = &d->observations[k];
    double *X = d->points + 3 * point, seen[3];
    const double *R = d->truth[view].R;
    if (k % SEEN_BY == 0) {
      X[2] = uniform(seed, 3, 9);
      X[0] = 1 + X[2] * uniform(seed, -0.2, 0.2);
      X[1] = X[2] * uniform(seed, -0.2, 0.2);
    }
    for (i = 0; i < 3; ++i) {
      seen[i] = R[3 * i] * X[0] + R[3 * i + 1] * X[1] + R[3 * i + 2] * X[2] + d->truth[view].t[i];
    }
    must("project", tv_camera_project(camera, seen, o->pixel, NULL));
    o->pixel[0] += uniform(seed, -1, 1) * (k % 20 == 3 ? wrong_px : 1);
    o->pixel[1] += uniform(seed, -1, 1);
    o->idx_view = view;
    o->idx_point = point;
    o->sigma = (float)uniform(seed, 1, 2);
  }
  for (k = 0; k < 3 * POINTS; ++k) d->points[k] += uniform(seed, -0.1, 0.1);
}

/* The window's bundle adjustment: each camera model and loss, with wrong pixels where there is a
   loss, without priors, with each kind of prior, and with two held views. */
static void digest_window(const pair *p, tv_context *context) {
  static _Alignas(TV_CONTEXT_ALIGNMENT) uint8_t memory[1 << 18];
  static window_data d;
  static double covariances[36 * VIEWS];
  static float errors_px[SEEN_BY * POINTS];
  tv_camera camera = p->camera[0];
  tv_window window;
  tv_window_options options;
  tv_window_result r;
  uint64_t seed = 5;
  int part, k;
  start();
  for (part = 0; part < 9; ++part) {
    camera.model = part % 3;
    memset(camera.k, 0, sizeof camera.k);
    camera.k[0] = part % 3 == 0 ? 0 : -0.02;
    make_window(&camera, part < 3 ? 1 : 30, &seed, &d);
    tv_window_init(&window);
    window.num_cameras = 1;
    window.num_views = VIEWS;
    window.num_points = POINTS;
    window.num_observations = SEEN_BY * POINTS;
    window.cameras = &camera;
    window.views = d.views;
    window.points = d.points;
    window.observations = d.observations;
    window.pose_priors = &d.pose_prior;
    window.gravity_priors = d.gravity_priors;
    window.distance_priors = &d.distance_prior;
    window.num_pose_priors = part == 3;
    window.num_gravity_priors = part == 4 || part == 5 ? VIEWS : 0;
    window.num_distance_priors = part == 5 || part == 6;
    d.views[0].fixed = d.views[2].fixed = part >= 7;
    tv_window_options_init(&options);
    options.loss = part / 3;
    tv_window_result_init(&r);
    must("adjust_window",
         tv_adjust_window(memory, sizeof memory, &window, &options, covariances, errors_px, &r));
    if (!r.converged || !r.has_covariance) fail("the window did not converge", TV_OK);
    for (k = 0; k < VIEWS; ++k) {
      add_doubles(d.views[k].R, 9);
      add_doubles(d.views[k].t, 3);
    }
    add_doubles(d.points, 3 * POINTS);
    add_doubles(covariances, 36 * VIEWS);
    for (k = 0; k < SEEN_BY * POINTS; ++k) add_float(errors_px[k]);
    add_int(r.num_views);
    add_int(r.num_points);
    add_int(r.num_observations);
    add_int(r.num_iterations);
    add_double(r.initial_cost);
    add_double(r.final_cost);
    add_double(r.initial_rms_px);
    add_double(r.rms_px);
    add_double(r.noise_px);
  }
  print(p, context, "window");
}

/* The odometry over a flight that is made of the pair's first picture: the upper half passes slowly
   and the lower half faster, as walls at two distances do. */
static void digest_odometry(const pair *p, tv_context *context) {
  enum { FRAMES = 16, KEYPOINTS = 300 };
  static uint8_t saved[1 << 21];
  const tv_image *from = &p->image[0];
  const int32_t width = from->width, height = from->height;
  tv_odometry *odometry;
  tv_odometry_options options;
  tv_odometry_frame frame;
  tv_odometry_state state;
  tv_camera camera = p->camera[0];
  size_t bytes;
  void *memory;
  uint8_t *allocated;
  uint8_t *pixels = (uint8_t *)malloc((size_t)width * (size_t)height);
  int k, x, y;
  camera.model = TV_CAMERA_PINHOLE;
  memset(camera.k, 0, sizeof camera.k);
  tv_odometry_options_init(&options);
  options.max_keypoints = KEYPOINTS;
  options.max_keyframes = 12;
  options.max_points = 2000;
  options.kernels = (int32_t)tv_context_kernels(context);
  must("odometry_size", tv_odometry_size(&camera, &options, &bytes));
  allocated = (uint8_t *)malloc(bytes + TV_CONTEXT_ALIGNMENT);
  if (!allocated || !pixels) fail("memory", TV_ERR_MEMORY);
  memset(allocated, (int)options.kernels, bytes); /* what the memory held does not matter */
  memory = allocated + (TV_CONTEXT_ALIGNMENT - (uintptr_t)allocated % TV_CONTEXT_ALIGNMENT) %
                           TV_CONTEXT_ALIGNMENT;
  must("odometry_init", tv_odometry_init(&odometry, &camera, &options, memory, bytes));
  start();
  tv_odometry_frame_init(&frame);
  frame.image.data = pixels;
  frame.image.width = width;
  frame.image.height = height;
  frame.image.stride_bytes = width;
  for (k = 0; k < FRAMES; ++k) {
    for (y = 0; y < height; ++y) {
      const int shift = (y < height / 2 ? 3 : 8) * k;
      for (x = 0; x < width; ++x) {
        pixels[y * width + x] = from->data[y * from->stride_bytes + (x + shift) % width];
      }
    }
    frame.time_s = k;
    tv_odometry_state_init(&state);
    must("odometry_track", tv_odometry_track(odometry, &frame, &state));
    add_int(state.status);
    add_int(state.reasons);
    add_int(state.num_inliers);
    add_doubles(state.world_from_cam_R, 9);
    add_doubles(state.world_from_cam_t, 3);
    add_doubles(state.cam_from_world_covariance, 36);
  }
  /* Of a real picture the flight may not begin; that of the rendered scene does. */
  if (strcmp(p->name, "scene") == 0 && state.num_keyframes < 3) fail("no map", TV_OK);
  must("odometry_save", tv_odometry_save(odometry, saved, sizeof saved, &bytes));
  add_bytes(saved, bytes);
  print(p, context, "odometry");
  free(allocated);
  free(pixels);
}

static void digest_guided(const pair *p, tv_context *context, const features *f,
                          const tv_two_view *pose) {
  static tv_correspondence found[MAX_KEYPOINTS];
  int32_t count;
  start();
  must("match_guided",
       match_rows_guided(context, &p->camera[0], &p->camera[1], pose->E, f->keypoints[0],
                         f->descriptors[0], f->count[0], f->keypoints[1], f->descriptors[1],
                         f->count[1], NULL, found, MAX_KEYPOINTS, &count));
  add_matches(found, count);
  must("match_guided",
       match_rows_guided(context, NULL, NULL, pose->F, f->keypoints[0], f->descriptors[0],
                         f->count[0], f->keypoints[1], f->descriptors[1], f->count[1], NULL, found,
                         MAX_KEYPOINTS, &count));
  add_matches(found, count);
  print(p, context, "guided");
}

static void digest_points(const pair *p, tv_context *context, const matched *m,
                          const tv_two_view *pose, tv_point *points) {
  static const char *const names[NUM_METHODS] = {"poly",      "poly_abs",        "linear_eigen",
                                                 "linear_ls", "iterative_eigen", "iterative_ls",
                                                 "midpoint"};
  static double corrected[2][2 * MAX_KEYPOINTS], covariances[9 * MAX_KEYPOINTS];
  const tv_camera_pair cameras = pair_of(&p->camera[0], &p->camera[1], pose->R, pose->t);
  uint8_t valid[MAX_KEYPOINTS];
  int32_t method;
  for (method = 0; method < NUM_METHODS; ++method) {
    start();
    must("triangulate", triangulate_pixels(&cameras, m->pixels[0], m->pixels[1], m->count,
                                           (tv_triangulation)method, points));
    add_points(points, m->count);
    if (method <= TV_TRIANGULATION_POLY_ABS) {
      must("correct_matches",
           correct_pixels_of(&cameras, m->pixels[0], m->pixels[1], m->count,
                             (tv_triangulation)method, corrected[0], corrected[1], valid));
      add_doubles(corrected[0], 2 * (size_t)m->count);
      add_doubles(corrected[1], 2 * (size_t)m->count);
      add_bytes(valid, (size_t)m->count);
    }
    print(p, context, names[method]);
  }
  start();
  must("point_covariances",
       tv_point_covariances(&cameras, points, m->count, 0.5,
                            pose->has_covariance ? pose->covariance : NULL, covariances));
  add_doubles(covariances, 9 * (size_t)m->count);
  print(p, context, "point_covariances");
}

static void digest_dense(const pair *p, tv_context *context, const matched *m,
                         const tv_two_view *pose, const tv_point *sparse) {
  enum { MOST = 20000 };
  static tv_dense_point points[MOST];
  const tv_camera_pair cameras = pair_of(&p->camera[0], &p->camera[1], pose->R, pose->t);
  tv_dense_options options;
  size_t bytes;
  uint8_t *block;
  uintptr_t start_of_memory;
  int32_t num;
  start();
  tv_dense_options_init(&options);
  options.max_cells = 60000;
  options.max_steps = 64;
  options.sparse = sparse;
  options.num_sparse = m->count;
  must("dense_size", tv_dense_size(&p->camera[0], &p->camera[1], &options, &bytes));
  block = (uint8_t *)malloc(bytes + TV_CONTEXT_ALIGNMENT);
  if (block == NULL) fail("dense", TV_ERR_MEMORY);
  start_of_memory = (uintptr_t)block + TV_CONTEXT_ALIGNMENT - 1;
  start_of_memory -= start_of_memory % TV_CONTEXT_ALIGNMENT;
  must("densify", tv_densify((void *)start_of_memory, bytes, &cameras, p->image, &options, points,
                             MOST, &num));
  add_bytes(&num, sizeof num);
  add_bytes(points, (size_t)num * sizeof *points);
  free(block);
  print(p, context, "dense");
}

/* The depth map of the first image from both. */
static void digest_depth(const pair *p, tv_context *context, const tv_two_view *pose) {
  tv_depth_options options;
  tv_depth_view views[2];
  tv_depth_arrays arrays;
  tv_camera map;
  size_t bytes, num;
  uint8_t *block;
  uintptr_t memory;
  int i, r;
  start();
  tv_depth_options_init(&options);
  options.max_pixels = 20000;
  options.near_depth = 2; /* in baselines */
  options.far_depth = 60;
  memset(views, 0, sizeof views);
  for (i = 0; i < 2; ++i) {
    views[i].image = p->image[i];
    views[i].camera = &p->camera[i];
  }
  /* R and t map camera 0 to camera 1. */
  for (i = 0; i < 3; ++i) {
    views[0].world_from_cam_R[4 * i] = 1;
    for (r = 0; r < 3; ++r) {
      views[1].world_from_cam_R[3 * i + r] = pose->R[3 * r + i];
      views[1].world_from_cam_t[i] -= pose->R[3 * r + i] * pose->t[r];
    }
  }
  must("depth_map_camera", tv_depth_map_camera(&p->camera[0], &options, &map));
  must("depth_size", tv_depth_size(&p->camera[0], &options, &bytes));
  num = (size_t)map.width * (size_t)map.height;
  block = (uint8_t *)malloc(bytes + TV_CONTEXT_ALIGNMENT + 10 * num + 4);
  if (block == NULL) fail("depth", TV_ERR_MEMORY);
  memory = (uintptr_t)block + TV_CONTEXT_ALIGNMENT - 1;
  memory -= memory % TV_CONTEXT_ALIGNMENT;
  arrays.distance = (float *)(memory + (bytes + 3) / 4 * 4);
  arrays.sigma = arrays.distance + num;
  arrays.witnesses = (uint8_t *)(arrays.sigma + num);
  arrays.grey = arrays.witnesses + num;
  must("sweep_depth", tv_sweep_depth((void *)memory, bytes, views, 2, &options, &arrays));
  add_bytes(arrays.distance, 10 * num);
  free(block);
  print(p, context, "depth");
}

enum { ROOM_SIDE = 160, ROOM_PIXELS = ROOM_SIDE * ROOM_SIDE };

/* What the pair's camera, reduced, sees in a box from a place within, turned by a quarter around
   its y axis `turns` times, as a chessboard of 24 pixels: distances and texture, or neither. */
typedef struct box_view {
  tv_depth_map map;
  float distance[ROOM_PIXELS];
  uint8_t pixels[ROOM_PIXELS];
} box_view;

static void see_box(const tv_camera *camera, int turns, box_view *v) {
  static const double low[3] = {-0.71, -0.52, -0.77}, high[3] = {0.69, 0.53, 0.83};
  static const double cosines[4] = {1, 0, -1, 0}, sines[4] = {0, 1, 0, -1};
  const double R[9] = {cosines[turns], 0, sines[turns], 0, 1, 0, -sines[turns], 0, cosines[turns]};
  const double t[3] = {0.06 * turns - 0.09, 0.03 * turns, 0.07};
  int32_t k;
  tv_depth_map_init(&v->map);
  v->map.camera = camera;
  memcpy(v->map.world_from_cam_R, R, sizeof R);
  memcpy(v->map.world_from_cam_t, t, sizeof t);
  v->map.width = v->map.stride = camera->width;
  v->map.height = camera->height;
  v->map.distance = v->distance;
  v->map.pixels = v->pixels;
  v->map.pixel_stride_bytes = camera->width;
  v->map.channels = 1;
  for (k = 0; k < camera->width * camera->height; ++k) {
    const double pixel[2] = {k % camera->width, k / camera->width};
    const int textured = (k % camera->width / 24 + k / camera->width / 24) % 2;
    double ray[3], nearest = 1e9;
    int i, wall = 0;
    v->distance[k] = 0;
    v->pixels[k] = 0;
    if (tv_camera_unproject(camera, pixel, ray, NULL) != TV_OK) continue;
    for (i = 0; i < 3; ++i) {
      const double d = (R[3 * i] * ray[0] + R[3 * i + 1] * ray[1]) + R[3 * i + 2] * ray[2];
      const double to = d == 0 ? 1e9 : ((d > 0 ? high[i] : low[i]) - t[i]) / d;
      if (to < nearest) nearest = to, wall = i;
    }
    v->pixels[k] = (uint8_t)(textured ? (k * 37 + k / 7 * 11) % 256 : 150 + 20 * wall);
    if (textured) v->distance[k] = (float)nearest;
  }
}

/* Four maps added and one removed, the planes, what is inferred along them, the mesh, and the mesh
   with voxels of twice the side. */
static void digest_room(const pair *p, tv_context *context) {
  enum { MOST = 60000, BYTES = 8 << 20 };
  static box_view views[4], inferred[4];
  static float sigma[4][ROOM_PIXELS];
  static tv_room_vertex vertices[MOST];
  static tv_room_triangle triangles[2 * MOST];
  static uint8_t block[BYTES + TV_CONTEXT_ALIGNMENT], scratch[8 * ROOM_PIXELS];
  uint8_t *memory = block + TV_CONTEXT_ALIGNMENT - (uintptr_t)block % TV_CONTEXT_ALIGNMENT;
  uint8_t *aligned = scratch + TV_CONTEXT_ALIGNMENT - (uintptr_t)scratch % TV_CONTEXT_ALIGNMENT;
  tv_room_plane planes[8];
  tv_room_plane_options options;
  tv_room_infer_options of_infer;
  tv_camera camera;
  tv_room *room;
  int32_t k, num, num_triangles;
  start();
  must("scale", tv_camera_scale(&p->camera[0],
                                ROOM_SIDE / (double)(p->camera[0].width > p->camera[0].height
                                                         ? p->camera[0].width
                                                         : p->camera[0].height),
                                &camera));
  must("room_init", tv_room_init(&room, NULL, memory, BYTES));
  for (k = 0; k < 4; ++k) {
    see_box(&camera, k, &views[k]);
    must("room_add", tv_room_add(room, &views[k].map));
  }
  must("room_remove", tv_room_remove(room, &views[1].map));
  tv_room_plane_options_init(&options);
  options.gravity[1] = 1;
  options.min_area = 0.05;
  must("room_planes", tv_room_find_planes(room, &options, planes, 8, &num));
  add_int(num);
  add_bytes(planes, (size_t)num * sizeof *planes);
  tv_room_infer_options_init(&of_infer);
  of_infer.planes = planes;
  of_infer.num_planes = num;
  for (k = 0; k < 4; ++k) {
    int32_t pixels;
    inferred[k] = views[k];
    must("room_infer",
         tv_room_infer(room, aligned, sizeof scratch - TV_CONTEXT_ALIGNMENT, &views[k].map,
                       &of_infer, inferred[k].distance, sigma[k], &pixels));
    add_int(pixels);
    inferred[k].map.distance = inferred[k].distance;
    inferred[k].map.sigma = sigma[k];
    inferred[k].map.inferred = 1;
    must("room_add inferred", tv_room_add(room, &inferred[k].map));
  }
  must("room_see", tv_room_see_through(room, &views[0].map));
  for (k = 0; k < 2; ++k) {
    if (k == 1) must("room_coarsen", tv_room_coarsen(room));
    must("room_mesh",
         tv_room_mesh(room, NULL, vertices, MOST, &num, triangles, 2 * MOST, &num_triangles));
    add_int(num);
    add_int(num_triangles);
    add_bytes(vertices, (size_t)num * sizeof *vertices);
    add_bytes(triangles, (size_t)num_triangles * sizeof *triangles);
  }
  print(p, context, "room");
}

static void digest_bundle(const pair *p, tv_context *context, const matched *m,
                          const tv_two_view *pose, const tv_point *points) {
  static tv_point adjusted[MAX_KEYPOINTS];
  tv_bundle_options options;
  tv_bundle_result result;
  tv_camera_pair cameras;
  start();
  tv_bundle_options_init(&options);
  options.max_iterations = 12;
  for (options.loss = TV_LOSS_NONE; options.loss <= TV_LOSS_CAUCHY; ++options.loss) {
    cameras = pair_of(&p->camera[0], &p->camera[1], pose->R, pose->t);
    memcpy(adjusted, points, sizeof adjusted);
    tv_bundle_result_init(&result);
    must("adjust_two_view", adjust_pixels(context, m->pixels[0], m->pixels[1], m->count, &options,
                                          &cameras, adjusted, &result));
    add_bundle(&result);
    add_doubles(cameras.cam1_from_cam0_R, 9);
    add_doubles(cameras.cam1_from_cam0_t, 3);
    add_points(adjusted, m->count);
  }
  print(p, context, "bundle");
}

/* Digests tv_reconstruct with the options switched on that are off by default. */
static void digest_reconstruct(const pair *p, tv_context *context, int32_t align_matches,
                               const char *stage) {
  tv_reconstruct_options options;
  tv_feature_options feature;
  tv_view view[2];
  tv_two_view pose;
  tv_evidence evidence;
  tv_reconstruction cloud;
  int v;
  tv_feature_options_init(&feature);
  feature.max_keypoints = MAX_KEYPOINTS;
  tv_reconstruct_options_init(&options);
  options.feature = &feature;
  options.guided_matching = options.bundle_adjustment = 1;
  options.align_matches = align_matches;
  for (v = 0; v < 2; ++v) {
    view[v] = view_of(p->image[v], &p->camera[v], NULL);
  }
  tv_two_view_init(&pose);
  tv_evidence_init(&evidence);
  tv_reconstruction_init(&cloud);
  start();
  must("reconstruct",
       tv_reconstruct(context, &view[0], &view[1], &options, &pose, &evidence, &cloud));
  add_two_view(&pose, &evidence);
  for (v = 0; v < 2; ++v) {
    add_keypoints(cloud.keypoints[v], cloud.descriptors[v], cloud.num_keypoints[v]);
  }
  add_matches(cloud.matches, cloud.num_matches);
  add_bytes(cloud.inlier_mask, (size_t)cloud.num_matches);
  add_points(cloud.points, cloud.num_matches);
  add_int(cloud.num_points);
  print(p, context, stage);
}

/* Digests the rungs with squeezed views, in a context of their own, with few keypoints, since the
   emulated ARM is slow. */
static void digest_effort(const pair *p, const tv_limits *limits) {
  static const int32_t keypoints_of_rung[4] = {0, 0, 200, 100};
  tv_reconstruct_options options;
  tv_feature_options feature;
  tv_view view[2];
  tv_context *context;
  tv_limits with_effort = *limits;
  int32_t rung;
  int v;
  with_effort.max_effort = 3;
  must("context", tv_context_new(&context, &with_effort));
  tv_feature_options_init(&feature);
  tv_reconstruct_options_init(&options);
  options.feature = &feature;
  for (v = 0; v < 2; ++v) {
    view[v] = view_of(p->image[v], &p->camera[v], NULL);
  }
  start();
  for (rung = 2; rung < 4; ++rung) {
    tv_two_view pose;
    tv_evidence evidence;
    tv_reconstruction found;
    options.effort = rung;
    feature.max_keypoints = keypoints_of_rung[rung];
    tv_two_view_init(&pose);
    tv_evidence_init(&evidence);
    tv_reconstruction_init(&found);
    must("effort", tv_reconstruct(context, &view[0], &view[1], &options, &pose, &evidence, &found));
    add_two_view(&pose, &evidence);
    for (v = 0; v < 2; ++v) {
      add_keypoints(found.keypoints[v], found.descriptors[v], found.num_keypoints[v]);
      add_bytes(found.tilts[v], (size_t)found.num_keypoints[v]);
    }
    add_matches(found.matches, found.num_matches);
    add_bytes(found.inlier_mask, (size_t)found.num_matches);
    add_points(found.points, found.num_matches);
  }
  print(p, context, "effort");
  tv_context_free(context);
}

/* The sizes of a context and of an odometry depend on their limits only, and the high water mark on
   the data only. */
static void digest_memory(const pair *p, tv_context *context, const tv_limits *limits) {
  tv_odometry_options options;
  size_t bytes = 0;
  start();
  must("size", tv_context_size(limits, &bytes));
  add_int((int64_t)bytes);
  add_int((int64_t)tv_context_high_water(context));
  tv_odometry_options_init(&options);
  must("odometry_size", tv_odometry_size(&p->camera[0], &options, &bytes));
  add_int((int64_t)bytes);
  print(p, context, "memory");
}

static void digest_pair(const pair *p, int32_t kernels) {
  static features f;
  static matched m;
  static tv_point points[MAX_KEYPOINTS];
  tv_two_view pose;
  tv_limits limits;
  tv_context *context;
  tv_status status;
  tv_limits_init(&limits);
  limits.max_width = p->image[0].width;
  limits.max_height = p->image[0].height;
  limits.max_keypoints = MAX_KEYPOINTS;
  limits.kernels = kernels;
  status = tv_context_new(&context, &limits);
  if (status == TV_ERR_KERNELS) return;
  must("context", status);
  digest_cameras(p, context);
  digest_features(p, context, &f);
  digest_matches(p, context, &f, &m);
  digest_estimates(p, context, &m, &pose);
  if (!pose.has_R || !pose.has_t) fail("this pair has no pose", TV_OK);
  digest_guided(p, context, &f, &pose);
  digest_points(p, context, &m, &pose, points);
  digest_dense(p, context, &m, &pose, points);
  digest_depth(p, context, &pose);
  digest_bundle(p, context, &m, &pose, points);
  digest_absolute_pose(p, context);
  digest_window(p, context);
  /* One picture is enough, and the emulated ARM is slow. */
  if (strcmp(p->name, "scene") == 0 || strcmp(p->name, "motorcycle") == 0) {
    digest_odometry(p, context);
    digest_room(p, context);
    digest_effort(p, &limits);
  }
  digest_reconstruct(p, context, 0, "reconstruct");
  digest_reconstruct(p, context, 1, "aligned");
  digest_memory(p, context, &limits);
  tv_context_free(context);
}

static void read_camera(FILE *file, tv_camera *camera, int32_t width, int32_t height) {
  int k;
  memset(camera, 0, sizeof *camera);
  camera->width = width;
  camera->height = height;
  if (fscanf(file, "%lf %lf %lf %lf", &camera->fx, &camera->fy, &camera->cx, &camera->cy) != 4) {
    fail("no camera in the file", TV_OK);
  }
  for (k = 0; k < 5; ++k) {
    if (fscanf(file, "%lf", &camera->k[k]) != 1) fail("no distortion in the file", TV_OK);
    if (camera->k[k] != 0) camera->model = TV_CAMERA_BROWN_CONRADY;
  }
}

static pair read_pair(const char *path) {
  FILE *file = fopen(path, "rb");
  const char *name = strrchr(path, '/');
  int width, height, v;
  pair p;
  p.name = name ? name + 1 : path;
  if (!file || fscanf(file, "%d %d", &width, &height) != 2) fail(path, TV_OK);
  for (v = 0; v < 2; ++v) read_camera(file, &p.camera[v], width, height);
  if (fgetc(file) != '\n') fail(path, TV_OK);
  for (v = 0; v < 2; ++v) {
    const size_t bytes = (size_t)width * (size_t)height;
    uint8_t *data = (uint8_t *)malloc(bytes);
    if (!data || fread(data, 1, bytes, file) != bytes) fail(path, TV_OK);
    p.image[v].data = data;
    p.image[v].width = width;
    p.image[v].height = height;
    p.image[v].stride_bytes = width;
  }
  fclose(file);
  return p;
}

int main(int argc, char **argv) {
  const int without_c = argc > 1 && strcmp(argv[1], "--without-c") == 0;
  int a;
  for (a = 1 + without_c; a < argc; ++a) {
    const pair p = read_pair(argv[a]);
    int32_t kernels = without_c ? TV_KERNELS_C + 1 : TV_KERNELS_C;
    for (; kernels <= TV_KERNELS_NEON; ++kernels) digest_pair(&p, kernels);
    free((void *)(uintptr_t)p.image[0].data);
    free((void *)(uintptr_t)p.image[1].data);
  }
  return 0;
}
