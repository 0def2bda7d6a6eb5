// A room out of views, whose pictures come one after the other.
#pragma once

#include <map>
#include <memory>
#include <vector>

#include "room_model/depth.h"
#include "room_model/partners.h"
#include "room_model/scene.h"

namespace cli {

class RoomBuilder {
 public:
  // Throws BadInput where the memory is too little, or no depth map can be made.
  RoomBuilder(RoomScene scene, const RoomSettings& settings);

  // Whether the picture of view `k` of the scene is needed.
  bool wants(size_t k) const { return uses_[k] > 0; }
  // Gives the picture of the view. The pictures that are needed come in the order of the views; one
  // that does not come counts as missing. Pictures are kept only as long as a keyframe needs them.
  void add_picture(size_t k, const RoomPicture& picture);

  size_t num_keyframes() const { return jobs_.size(); }
  size_t num_done() const { return next_job_; }
  // The scene as it was given, but its camera is that of the pictures after they were scaled down.
  const RoomScene& scene() const { return scene_; }
  // The size of the pictures as they are given.
  cv::Size picture_size() const { return picture_size_; }
  // For what becomes known only while the pictures are read.
  void set_gravity(const Vector3& down) { scene_.gravity = down; }

  // The room of all that was given; to be called once.
  RoomModel finish();

 private:
  struct Job {
    size_t key;                 // view
    std::vector<size_t> views;  // the keyframe first, then its partners
    size_t last;                // the view after which all pictures are there
    DepthRange range;
  };
  struct Map {
    size_t view;
    KnownPixels pixels;
  };
  void run(const Job& job);
  void run_until(size_t view);
  void begin(double voxel);
  bool add(const Map& map);
  bool prune();
  bool fuse(const Map& map);
  void fuse_newest();
  void fill(const Map& map, tv_depth_map& out);
  void find_up(RoomModel& model) const;
  // How many maps must have seen a surface that is kept: two, where there are two maps.
  int32_t fewest_maps() const;
  void find_planes(RoomModel& model) const;
  size_t see_through();
  void infer(RoomModel& model);
  RoomMesh mesh(const RoomModel& model) const;
  void add_page_mesh(RoomModel& model);
  void add_depth_maps(RoomModel& model);
  void count_pixels(RoomModel& model) const;
  void add_free_area(RoomModel& model);

  cv::Size picture_size_;
  RoomScene scene_;
  RoomSettings settings_;
  DepthSweep sweep_;
  std::vector<uint8_t> memory_;
  tv_room* room_ = nullptr;  // in memory_
  double median_depth_ = 0, first_voxel_ = 0, voxel_ = 0;
  std::vector<Job> jobs_;  // in the order in which they can be run
  size_t next_job_ = 0;
  std::vector<int> uses_;                   // by how many jobs that are open a view is needed
  std::map<size_t, RoomPicture> pictures_;  // by view
  std::vector<Map> maps_;
  MapPixels pixels_;                     // of the map that is in work
  std::map<size_t, TileCounts> counts_;  // by view
  int num_without_ = 0, num_missing_ = 0;
  double ms_depth_ = 0, ms_fusion_ = 0;
};

}  // namespace cli
