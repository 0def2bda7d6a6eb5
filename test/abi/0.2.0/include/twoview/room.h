/* twoview: a room, fused from depth maps into a surface, in the caller's memory.

   Space is divided into voxels, which exist in blocks of 4 x 4 x 4 near the surface only. A voxel
   holds integer sums over the depth maps that saw it: of its signed distance from the surface,
   truncated and weighted by the inverse of the variance, of the weights, of the colours, and of how
   many maps saw the surface near it and how many saw through it. Since the sums are integers, a map
   is removed as exactly as it was added, and a keyframe that has moved is removed at its old pose
   and added at the new one. The surface is where the mean distance is 0. Sources: B. Curless, M.
   Levoy, "A volumetric method for building complex models from range images", SIGGRAPH 1996; M.
   Niessner et al., "Real-time 3D reconstruction at scale using voxel hashing", TOG 2013; S. F. F.
   Gibson, "Constrained elastic surface nets", MICCAI 1998. Formulas and tests:
   docs/algorithms/room.md.

   A library that was built with TWOVIEW_ROOM=OFF has none of these functions: the program does not
   link. */
#ifndef TWOVIEW_ROOM_H
#define TWOVIEW_ROOM_H

#include <stddef.h>
#include <stdint.h>

#include "twoview/camera.h"

TV_BEGIN_DECLS

/* A room, and the memory that it works in. One thread uses it at a time. */
typedef struct tv_room tv_room;

/* How many depth maps a room can hold. */
#define TV_ROOM_MAX_MAPS 2047
/* The least memory of a room, in bytes. */
#define TV_ROOM_MIN_BYTES 262144
/* Memory in bytes that holds a furnished room of 8 x 6 x 3 m with the default options. */
#define TV_ROOM_DEFAULT_BYTES 67108864

/* Options of a room. Filled by tv_room_options_init. */
typedef struct tv_room_options {
  /* The caller's sizeof, set by tv_room_options_init. */
  uint32_t struct_size;
  /* How many voxels before and behind the measured surface a map is fused, [2, 8], default 3. More
     average coarser errors out, take more memory, and make objects that are thinner vanish. */
  int32_t truncation_voxels;
  /* The side of a voxel in the unit of the poses, above 0, default 0.03. Memory grows with the
     inverse of its square. */
  double voxel;
  /* Distances above it are not fused, in the unit of the poses; 0 (default): no limit. */
  double max_distance;
} tv_room_options;

/* Writes the default options into a struct of struct_size bytes; null is allowed. Programs call
   tv_room_options_init. */
TV_API void tv_room_options_init_sized(tv_room_options *options, size_t struct_size);
/* Writes the default options; null is allowed. */
#define tv_room_options_init(options) tv_room_options_init_sized((options), sizeof *(options))

/* The distance of what each pixel of an image shows, with the image's camera and pose. Filled by
   tv_depth_map_init with zeros, and then by the caller; what it points to is read during a call
   only, its arrays row by row, `stride` elements apart. The image may be a reduced one: its camera
   is then the reduced one, too (tv_camera_scale). */
typedef struct tv_depth_map {
  /* The caller's sizeof, set by tv_depth_map_init. */
  uint32_t struct_size;
  /* Width and height in pixels, [1, 16384]: those of the camera (else TV_ERR_CAMERA). */
  int32_t width, height;
  /* Elements from the start of a row to the start of the next one, in `distance`, `sigma` and
     `witnesses`; at least `width`. */
  int32_t stride;
  /* The camera, of any model. */
  const tv_camera *camera;
  /* The pose: x_world = R x_cam + t. R is a row-major 3x3 rotation to within 1e-6; the unit of t is
     that of the room. */
  double world_from_cam_R[9], world_from_cam_t[3];
  /* The distance from the camera's centre along the pixel's ray, in the unit of the poses. Where it
     is unknown: 0, or any number that is not finite or not above 0. (From a depth z along the
     optical axis: z over the third component of the pixel's unit ray.) */
  const float *distance;
  /* The standard deviation of each distance; null: a hundredth of the distance. A pixel whose sigma
     is not finite or not above 0 is unknown. */
  const float *sigma;
  /* How many other images confirmed each distance; null: 1 for all. Pixels of 0 witnesses are
     unknown. */
  const uint8_t *witnesses;
  /* The image that the map lies on: `channels` bytes a pixel, red green blue or grey; null: none,
     and the surface stays grey. */
  const uint8_t *pixels;
  /* Bytes from the start of a row of `pixels` to the start of the next one. */
  int64_t pixel_stride_bytes;
  /* 1 (grey) or 3 (red, green, blue); not read without pixels. */
  int32_t channels;
  /* 1: no view measured these distances, they were inferred (tv_room_infer). They make surface only
     where nothing was measured and two maps or more agree, and its vertices say so. Else 0. */
  int32_t inferred;
  /* A byte a pixel, 0 where the image shows nothing of the scene: beyond the edge of its lens, on
     an overlay, on the vehicle. The pixel is unknown there whatever its distance, and nothing is
     inferred. Of a map of tv_sweep_depth its `grey` is such a mask. Null: all pixels show it. */
  const uint8_t *mask;
  /* Bytes from the start of a row of `mask` to the start of the next one; not read without it. */
  int64_t mask_stride_bytes;
} tv_depth_map;

/* Writes zeros, and the size, into a struct of struct_size bytes; null is allowed. Programs call
   tv_depth_map_init. */
TV_API void tv_depth_map_init_sized(tv_depth_map *map, size_t struct_size);
/* Writes zeros, and struct_size; null is allowed. */
#define tv_depth_map_init(map) tv_depth_map_init_sized((map), sizeof *(map))

/* Makes an empty room in `memory`, which starts at a multiple of TV_CONTEXT_ALIGNMENT, has at least
   TV_ROOM_MIN_BYTES, and is the room's until the caller uses it for something else; nothing else
   has to be freed. How many blocks the room can hold follows from size_bytes: 1.1 KB each.
   room: receives a pointer to it. options: null means the defaults.
   Returns TV_ERR_NULL, TV_ERR_STRUCT_SIZE, TV_ERR_ARGUMENT (an option), TV_ERR_NOT_FINITE (an
   option), TV_ERR_ALIGNMENT, TV_ERR_MEMORY. */
TV_API tv_status tv_room_init(tv_room **room, const tv_room_options *options, void *memory,
                              size_t size_bytes);

/* Fuses a depth map.
   map: initialised by tv_depth_map_init; with its camera, its pose and its distances.
   Where the room has no memory left for the blocks that the map needs, TV_ERR_CAPACITY is returned
   and the room is as it was before; it can go on without what one map alone saw (tv_room_prune), or
   with a coarser voxel (tv_room_coarsen).
   The weight of a pixel is 16 (voxel / sigma)^2, rounded, at most 64; pixels of weight 0 are
   unknown. What lies nearer to the camera than the surface by more than the truncation, and by 3
   sigma, is seen through: a voxel that many maps see through, against the weight with which others
   saw a surface there, is free. Maps see through the blocks that exist; blocks that later maps make
   are not seen through by this one.
   The result has the same bits on every CPU. Takes at most width x height x truncation steps and a
   step for each voxel of the room in view; about 10 ms for a map of 320 x 240 and voxels of 3 cm on
   a desktop core.
   Returns TV_ERR_NULL, TV_ERR_STRUCT_SIZE, TV_ERR_ARGUMENT (the map or R), TV_ERR_NOT_FINITE (R or
   t), TV_ERR_CAMERA, TV_ERR_CAPACITY, TV_ERR_LIMITS (the room holds TV_ROOM_MAX_MAPS maps). */
TV_API tv_status tv_room_add(tv_room *room, const tv_depth_map *map);

/* Removes a map that was added with the same camera, pose and contents: the sums are then those of
   a room to which it was never added, bit for bit. TV_ERR_ARGUMENT where the room holds no such
   map: none was added, it was removed already, or tv_room_coarsen has fixed it. How many maps saw
   through a voxel is counted since its block was made: where a removal leaves no surface in a
   block, the block is freed with these counts. Takes the time of tv_room_add. Returns TV_ERR_NULL,
   TV_ERR_STRUCT_SIZE, TV_ERR_ARGUMENT (the map or R, or no such map), TV_ERR_NOT_FINITE (R or t),
   TV_ERR_CAMERA. */
TV_API tv_status tv_room_remove(tv_room *room, const tv_depth_map *map);

/* Doubles the voxel, which leaves about three quarters of the memory free. The surface is as it
   was, but for the coarser voxel. The maps that are in the room stay in it for ever: tv_room_remove
   does not know them any more. Returns TV_ERR_NULL, TV_ERR_LIMITS (after 16 times). */
TV_API tv_status tv_room_coarsen(tv_room *room);

/* Frees the memory of what fewer than min_maps maps measured: the blocks without a voxel in which
   that many saw a surface. With the min_maps of tv_room_mesh_options they hold no surface; in a
   flight it is half of all blocks with 2. Inferred blocks stay. Maps that lose a part so are still
   removed exactly. Where others measure the same place later on, tv_room_see_through adds the lost
   part again: called for each map before tv_room_prune, and again at the end, it makes the voxels
   that min_maps maps saw what they are in unlimited memory.
   min_maps: [1, 255]. num_freed: receives the number of blocks; null is allowed.
   Takes a step for each voxel. Returns TV_ERR_NULL, TV_ERR_ARGUMENT (min_maps). */
TV_API tv_status tv_room_prune(tv_room *room, int32_t min_maps, int32_t *num_freed);

/* Adds a map that the room holds to the blocks that were made since it was added, as if it were
   added after them: it sees through them, and takes back what tv_room_prune freed of its surface.
   What was inferred has to stand up to this: call it for each map after the inferred ones were
   added. The map has the camera, the pose and the contents with which it was added. Takes the time
   of tv_room_add at most.
   Returns TV_ERR_NULL, TV_ERR_STRUCT_SIZE, TV_ERR_ARGUMENT (the map or R, or the room holds no such
   map), TV_ERR_NOT_FINITE (R or t), TV_ERR_CAMERA. */
TV_API tv_status tv_room_see_through(tv_room *room, const tv_depth_map *map);

/* What is in a room. */
typedef struct tv_room_state {
  /* The caller's sizeof, set by tv_room_state_init. */
  uint32_t struct_size;
  /* How many maps the room holds, those that tv_room_coarsen fixed included. */
  int32_t num_maps;
  /* How many blocks of 4 x 4 x 4 voxels there are, and how many there is memory for. */
  int32_t num_blocks, cap_blocks;
  /* The side of a voxel now, in the unit of the poses. */
  double voxel;
  /* The box of all blocks in the world, in the unit of the poses; zeros where there are none. */
  double min[3], max[3];
} tv_room_state;

/* Writes zeros, and the size, into a struct of struct_size bytes; null is allowed. Programs call
   tv_room_state_init. */
TV_API void tv_room_state_init_sized(tv_room_state *state, size_t struct_size);
/* Writes zeros, and struct_size; null is allowed. */
#define tv_room_state_init(state) tv_room_state_init_sized((state), sizeof *(state))

/* Writes what is in a room. Returns TV_ERR_NULL, TV_ERR_STRUCT_SIZE. */
TV_API tv_status tv_room_get_state(const tv_room *room, tv_room_state *state);

/* A vertex of the surface. */
typedef struct tv_room_vertex {
  /* Position in the world, in the unit of the poses. */
  float position[3];
  /* The unit normal, towards the free side. */
  float normal[3];
  /* The standard deviation of the position along the normal, in the unit of the poses, from the
     sigmas of the maps as if they were independent of each other. */
  float sigma;
  /* Red, green, blue: the mean of what the maps' images show there. */
  uint8_t rgb[3];
  /* 1: no view measured it, it was inferred; else 0. */
  uint8_t inferred;
  /* How many maps saw the surface there. */
  int32_t num_maps;
  /* Always 0. */
  int32_t reserved;
} tv_room_vertex;

/* A triangle of the surface. */
typedef struct tv_room_triangle {
  /* The indices of its vertices, anticlockwise as seen from the free side. */
  int32_t idx_vertex[3];
} tv_room_triangle;

/* The most planes of a room. */
#define TV_ROOM_MAX_PLANES 64

/* How a plane lies, where gravity is known. */
typedef enum tv_room_plane_kind {
  /* Oblique, or gravity is not known. */
  TV_ROOM_PLANE_OTHER = 0,
  /* A wall, a cupboard's door: upright to within 10 degrees. */
  TV_ROOM_PLANE_UPRIGHT = 1,
  /* A floor, a ceiling, a table: level to within 10 degrees. */
  TV_ROOM_PLANE_LEVEL = 2
} tv_room_plane_kind;

/* A plane of the room's measured surface. */
typedef struct tv_room_plane {
  /* The unit normal, towards the free side. */
  double normal[3];
  /* normal . x of its points, in the unit of the poses. */
  double offset;
  /* The middle of what was measured of it, in the unit of the poses. */
  double centre[3];
  /* How much was measured of it, in squares of the unit. */
  double area;
  /* The root mean square of the distances of its blocks' surfaces from it. */
  double sigma;
  /* Which share of the measured surface (min_maps_behind) lies behind it by more than four voxels,
     [0, 1]: next to nothing for a wall of the room, and more for a table or a cupboard. */
  double share_behind;
  /* A tv_room_plane_kind. */
  int32_t kind;
  /* Always 0. */
  int32_t reserved;
} tv_room_plane;

/* Options of tv_room_mesh. Filled by tv_room_mesh_options_init. */
typedef struct tv_room_mesh_options {
  /* The caller's sizeof, set by tv_room_mesh_options_init. */
  uint32_t struct_size;
  /* The fewest maps that have seen the surface at a voxel, [1, 255], default 1. */
  int32_t min_maps;
  /* Connected pieces of fewer triangles are left out, [0, 2^31), default 64. */
  int32_t min_piece_triangles;
  /* 1: only what was measured; 0 (default): what was inferred, too. */
  int32_t measured_only;
  /* Only blocks that touch this box of the world, in the unit of the poses, make triangles; zeros
     (default): all. */
  double min[3], max[3];
  /* num_planes of tv_room_find_planes, which are flat to within a third of a voxel: a vertex that
     lies on one within 1.5 of its standard deviations, and is turned by less than 45 degrees, is
     drawn to the nearest of them, as by a measurement. Its sigma is that of both. Null (default):
     none. They are read during the call only. */
  const tv_room_plane *planes;
  /* [0, TV_ROOM_MAX_PLANES], default 0. */
  int32_t num_planes;
  /* Must be 0. */
  int32_t reserved;
  /* Triangles of a vertex with a larger sigma are left out, in the unit of the poses; 0 (default):
     none are. */
  double max_sigma;
} tv_room_mesh_options;

/* Writes the default options into a struct of struct_size bytes; null is allowed. Programs call
   tv_room_mesh_options_init. */
TV_API void tv_room_mesh_options_init_sized(tv_room_mesh_options *options, size_t struct_size);
/* Writes the default options; null is allowed. */
#define tv_room_mesh_options_init(options) \
  tv_room_mesh_options_init_sized((options), sizeof *(options))

/* Computes the surface: a vertex in each cell of eight voxels through which it passes, and two
   triangles around each edge between two voxels that it crosses. Vertices are not repeated, each is
   of a triangle, and the mesh is closed except where what lies beside was not seen.
   options: null means the defaults.
   vertices, triangles: room for cap_vertices and for cap_triangles; they overlap nothing else.
   *num_vertices, *num_triangles: how many were written. Where that is too little, TV_ERR_CAPACITY
   is returned, the arrays hold nothing of use, and the counts are those that are enough: calling
   with capacities of 0 (and null arrays) asks for them.
   The order is that in which the blocks lie in the room's memory, and the same on every CPU. The
   room is only read, but for scratch in its memory. Takes a step for each voxel of the room, and
   vertices x planes steps.
   Returns TV_ERR_NULL, TV_ERR_STRUCT_SIZE, TV_ERR_ARGUMENT (an option, a capacity below 0),
   TV_ERR_NOT_FINITE (an option or a plane), TV_ERR_CAPACITY, TV_ERR_OVERLAP. */
TV_API tv_status tv_room_mesh(tv_room *room, const tv_room_mesh_options *options,
                              tv_room_vertex *vertices, int32_t cap_vertices, int32_t *num_vertices,
                              tv_room_triangle *triangles, int32_t cap_triangles,
                              int32_t *num_triangles);

/* Options of tv_room_find_planes. Filled by tv_room_plane_options_init. */
typedef struct tv_room_plane_options {
  /* The caller's sizeof, set by tv_room_plane_options_init. */
  uint32_t struct_size;
  /* The fewest maps that have seen the surface that counts as lying behind a plane (share_behind),
     [0, 255], default 1; 0 is 1. With the min_maps of tv_room_mesh_options it is the surface of the
     mesh: what one map alone saw is often noise, and a wall has much of it behind. */
  int32_t min_maps_behind;
  /* The least area of a plane that was measured, in squares of the unit of the poses; 0 (default):
     640 squares of a voxel's side, 0.58 square metres at 3 cm. */
  double min_area;
  /* The direction of gravity in the world, of any length: down. Zeros (default): it is not known.
   */
  double gravity[3];
  /* The standard deviation of that direction in radians, (0, 1], default 0.02. Planes that are
     nearly upright or level are drawn to be so by it. */
  double gravity_sigma_rad;
} tv_room_plane_options;

/* Writes the default options into a struct of struct_size bytes; null is allowed. Programs call
   tv_room_plane_options_init. */
TV_API void tv_room_plane_options_init_sized(tv_room_plane_options *options, size_t struct_size);
/* Writes the default options; null is allowed. */
#define tv_room_plane_options_init(options) \
  tv_room_plane_options_init_sized((options), sizeof *(options))

/* Finds the planes of the measured surface, the largest first: the one of 256 candidates, the
   surfaces of blocks, that most of the surface lies on, within 1.5 voxels and 20 degrees, then
   refined by least squares, on its largest connected part first; and again among what is left.
   options: null means the defaults. planes: room for cap_planes, [0, TV_ROOM_MAX_PLANES].
   *num_planes: how many were written. The room is only read, but for scratch in its memory. Takes
   a step for each voxel of the room, and for each plane some millions.
   Returns TV_ERR_NULL, TV_ERR_STRUCT_SIZE, TV_ERR_ARGUMENT (an option, the capacity),
   TV_ERR_NOT_FINITE (an option), TV_ERR_OVERLAP. */
TV_API tv_status tv_room_find_planes(tv_room *room, const tv_room_plane_options *options,
                                     tv_room_plane *planes, int32_t cap_planes,
                                     int32_t *num_planes);

/* Options of tv_room_infer. Filled by tv_room_infer_options_init. */
typedef struct tv_room_infer_options {
  /* The caller's sizeof, set by tv_room_infer_options_init. */
  uint32_t struct_size;
  /* The largest difference between neighbours, in grey levels of the picture smoothed by 3 x 3
     pixels, that counts as no texture, [0, 255], default 3. */
  int32_t max_step;
  /* num_planes of tv_room_find_planes, which are carried; null (default): none. They are read
     during the call only. */
  const tv_room_plane *planes;
  /* [0, TV_ROOM_MAX_PLANES], default 0. */
  int32_t num_planes;
  /* Must be 0. */
  int32_t reserved;
} tv_room_infer_options;

/* Writes the default options into a struct of struct_size bytes; null is allowed. Programs call
   tv_room_infer_options_init. */
TV_API void tv_room_infer_options_init_sized(tv_room_infer_options *options, size_t struct_size);
/* Writes the default options; null is allowed. */
#define tv_room_infer_options_init(options) \
  tv_room_infer_options_init_sized((options), sizeof *(options))

/* Writes to *size_bytes how much memory tv_room_infer needs for a map of this size: 6 bytes a
   pixel. Returns TV_ERR_NULL, TV_ERR_ARGUMENT (a side outside [1, 16384]). */
TV_API tv_status tv_room_infer_size(int32_t width, int32_t height, size_t *size_bytes);

/* Carries planes across what has no texture: the distances that a map lacks, of pixels in a region
   of its picture without texture, at whose edge or in which enough was measured on a plane, and
   nothing farther away. A region ends where the map's mask is 0, and where the camera has no ray.
   Where several planes qualify, the nearest along the ray is seen. Where the room has a measured
   surface, where a map saw through, and beyond a plane of a share_behind below 0.03, nothing is
   inferred.
   memory: starts at a multiple of TV_CONTEXT_ALIGNMENT and has at least the bytes of
   tv_room_infer_size. Its contents before and after the call do not matter.
   map: as for tv_room_add; it needs `pixels` and was measured (TV_ERR_ARGUMENT).
   options: with the planes; null, and without planes, nothing is inferred.
   distance, sigma: room for width x height each, row by row without gaps; 0 where nothing was
   inferred. *num_pixels: how many pixels were. They are the arrays of another map of the same
   camera and pose, whose `inferred` is 1: add it, and call tv_room_see_through for the measured
   ones, which may contradict it.
   Takes pixels x planes steps at most. The room is only read.
   Returns TV_ERR_NULL, TV_ERR_STRUCT_SIZE, TV_ERR_ARGUMENT (the map, R, an option),
   TV_ERR_NOT_FINITE (R, t or a plane), TV_ERR_CAMERA, TV_ERR_ALIGNMENT, TV_ERR_MEMORY,
   TV_ERR_OVERLAP. */
TV_API tv_status tv_room_infer(const tv_room *room, void *memory, size_t size_bytes,
                               const tv_depth_map *map, const tv_room_infer_options *options,
                               float *distance, float *sigma, int32_t *num_pixels);

TV_END_DECLS

#endif
