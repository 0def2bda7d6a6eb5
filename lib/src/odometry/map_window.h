// A part of the map as a window of bundle adjustment: its keyframes are the views.
#pragma once

#include "odometry/odometry.h"
#include "twoview/window.h"

namespace tv {

// The most that a window holds.
struct WindowSizes {
  int32_t views, points, observations;
};

// A window with the arrays that it points to. `views`, `keyframes` and so on are in the same order.
struct MapWindow {
  WindowSizes sizes;
  tv_window model;
  tv_window_view* views;
  int32_t* keyframes;  // of each view
  double* points;
  int32_t* places;   // of each point in the map
  int32_t* numbers;  // of each place in the map: its point here, or -1
  tv_observation* observations;
  int32_t* keypoints;            // of each observation
  double* planes;                // x, y on the plane z = 1 of each observation, or NaN
  tv_gravity_prior* gravity;     // room for one of each view
  tv_distance_prior* distances;  // as many
  float* sines_sq;               // of each point, of the largest angle between its rays
  float* errors;                 // of each observation, in pixels, after the adjustment
  double* covariances;           // 36 of each view, or null
  int32_t max_iterations;        // of the adjustment
  double damping;                // of its first step (adjust/window.h)
  tv_window_result result;
};

size_t map_window_bytes(const tv_odometry_options& options, const WindowSizes& sizes);
MapWindow make_map_window(const Odometry& odometry, const WindowSizes& sizes, Arena& arena);

void add_view(const Map& map, int32_t keyframe, bool fixed, MapWindow* window);
// The point must not be in the window, and the window must have room for it.
void add_map_point(const Map& map, int32_t place, MapWindow* window);
// Adds the observations of the window's points in its views, as far as there is room.
void add_observations(const Odometry& odometry, MapWindow* window);

// Adjusts the window, with the directions of gravity that were measured in views that are not held.
// False: nothing has changed. The map stays as it is.
bool adjust_map_window(const Odometry& odometry, MapWindow* window, Arena& arena);

// The pose of a view of the window.
Rigid pose_of(const MapWindow& window, int32_t view);

// Copies the adjusted positions of the points to the map.
void keep_positions(const MapWindow& window, Map* map);
// Removes the observations that do not fit from the map, and stores how uncertain the points'
// depths are.
void drop_outliers(const MapWindow& window, Odometry* odometry);

}  // namespace tv
