#include "flights/interior.h"

#include <algorithm>
#include <cmath>

namespace flights {
namespace {

constexpr double kPi = 3.14159265358979323846;

Box box_between(const Vec3& low, const Vec3& high, Material material) {
  Box box;
  for (size_t k = 0; k < 3; ++k) {
    box.centre[k] = 0.5 * (low[k] + high[k]);
    box.half[k] = 0.5 * (high[k] - low[k]);
  }
  box.materials.fill(material);
  return box;
}

// A box of width x depth x (top - bottom) metres whose base is turned by `yaw` and centred on (x,
// y).
Box standing(double x, double y, double yaw, double width, double depth, double bottom, double top,
             Material material) {
  Box box = box_between({x - width / 2, y - depth / 2, -top},
                        {x + width / 2, y + depth / 2, -bottom}, material);
  box.yaw_rad = yaw;
  return box;
}

class Builder {
 public:
  explicit Builder(uint64_t seed) : random_(seed * 7919 + 17) {}

  Interior build() {
    in_.half_x = random_.uniform(2.9, 4.3);
    in_.half_y = random_.uniform(2.6, 3.5);
    in_.height = random_.uniform(2.5, 3.1);
    Box room = box_between({-in_.half_x, -in_.half_y, -in_.height}, {in_.half_x, in_.half_y, 0},
                           Material::kPaint);
    room.is_room = true;
    const Material walls[] = {Material::kPlaster, Material::kPaint, Material::kBricks,
                              Material::kPlaster};
    for (size_t side = 0; side < 4; ++side) room.materials[side] = walls[one_of(4)];
    const Material ceilings[] = {Material::kPanels, Material::kPlaster};
    const Material floors[] = {Material::kBoards, Material::kTiles, Material::kCarpet};
    room.materials[4] = ceilings[one_of(2)];  // the low z is up
    room.materials[5] = floors[one_of(3)];
    in_.boxes.push_back(room);
    for (int wall = 0; wall < 4; ++wall) furnish(wall);
    lay_table();
    for (const auto& [x, y] : {std::pair{1, 1}, {1, -1}, {-1, 1}, {-1, -1}}) stack_crates(x, y);
    hang_lamps();
    return std::move(in_);
  }

 private:
  size_t one_of(size_t count) { return static_cast<size_t>(random_.next() % count); }

  // Puts a box against a wall: 0 and 1 are the walls at high and low x, 2 and 3 those at high and
  // low y. `along` is the middle of the box on the wall.
  void put(int wall, double along, double width, double depth, double bottom, double top,
           Material material, Material front) {
    const double room = wall < 2 ? in_.half_x : in_.half_y;
    const double centre = (wall % 2 == 0 ? 1 : -1) * (room - depth / 2);
    Box box = wall < 2 ? standing(centre, along, 0, depth, width, bottom, top, material)
                       : standing(along, centre, 0, width, depth, bottom, top, material);
    // The front is the end that faces the room: the low end of an axis at its high wall.
    box.materials[static_cast<size_t>(wall)] = front;
    in_.boxes.push_back(box);
  }

  void furnish(int wall) {
    const double half = wall < 2 ? in_.half_y : in_.half_x;
    double at = -half + random_.uniform(0.45, 0.7);
    while (at < half - 0.9) {
      const size_t kind = one_of(5);
      const double space = half - 0.45 - at;
      const double width = std::min(random_.uniform(0.8, 1.7), space), middle = at + width / 2;
      double top = 0;
      if (kind == 0) {
        top = random_.uniform(1.6, 2.1);
        put(wall, middle, width, random_.uniform(0.35, 0.6), 0, top, Material::kWood,
            Material::kDrawers);
      } else if (kind == 1) {
        top = random_.uniform(1.6, 2.2);
        put(wall, middle, width, random_.uniform(0.26, 0.34), 0, top, Material::kWood,
            Material::kBooks);
      } else if (kind == 2 || kind == 3) {
        top = random_.uniform(0.6, 0.95);
        const double depth = random_.uniform(0.38, 0.55);
        put(wall, middle, width, depth, 0, top, kind == 2 ? Material::kWood : Material::kCarpet,
            kind == 2 ? Material::kDrawers : Material::kCarpet);
        const double end = at + width - 0.2;
        for (double x = at + 0.15; kind == 2 && x < end; x += random_.uniform(0.4, 0.7)) {
          place_thing(wall, x, depth, top);
        }
      }
      if (top < 1.2) hang_picture(wall, at, width, top);
      at += width + random_.uniform(0.1, 0.7);
    }
  }

  void place_thing(int wall, double along, double depth, double bottom) {
    const Material kinds[] = {Material::kCardboard, Material::kPoster, Material::kScreen,
                              Material::kWood};
    const double room = wall < 2 ? in_.half_x : in_.half_y;
    const double centre = (wall % 2 == 0 ? 1 : -1) * (room - depth / 2);
    const double x = wall < 2 ? centre : along, y = wall < 2 ? along : centre;
    in_.boxes.push_back(standing(x, y, random_.uniform(-0.6, 0.6), random_.uniform(0.1, 0.28),
                                 random_.uniform(0.1, 0.25), bottom,
                                 bottom + random_.uniform(0.1, 0.4), kinds[one_of(4)]));
  }

  void hang_picture(int wall, double at, double width, double above) {
    const double picture = width * random_.uniform(0.5, 0.95);
    const double bottom = std::max(above + 0.45, random_.uniform(1.05, 1.4));
    const double top = std::min(bottom + random_.uniform(0.35, 0.95), in_.height - 0.15);
    put(wall, at + width / 2, picture, random_.uniform(0.015, 0.04), bottom, top, Material::kWood,
        one_of(5) == 0 ? Material::kScreen : Material::kPoster);
  }

  void lay_table() {
    const double x = random_.uniform(-0.15, 0.15), y = random_.uniform(-0.15, 0.15);
    const double yaw = random_.uniform(-0.6, 0.6), length = random_.uniform(1.2, 1.6);
    const double breadth = random_.uniform(0.7, 0.9), top = random_.uniform(0.70, 0.76);
    const double c = std::cos(yaw), s = std::sin(yaw);
    const auto on_table = [&](double a, double b) {
      return std::pair{x + c * a - s * b, y + s * a + c * b};
    };
    in_.table = {x, y, -top};
    if (one_of(2) == 0)
      in_.boxes.push_back(standing(x, y, yaw, 2.4, 1.7, 0, 0.012, Material::kCarpet));
    in_.boxes.push_back(standing(x, y, yaw, length, breadth, top - 0.035, top, Material::kWood));
    for (int k = 0; k < 4; ++k) {
      const auto [lx, ly] = on_table((k % 2 == 0 ? 1 : -1) * (length / 2 - 0.06),
                                     (k < 2 ? 1 : -1) * (breadth / 2 - 0.06));
      in_.boxes.push_back(standing(lx, ly, yaw, 0.06, 0.06, 0, top - 0.035, Material::kWood));
    }
    const Material kinds[] = {Material::kCardboard, Material::kPoster, Material::kScreen,
                              Material::kBooks, Material::kWood};
    for (double a = -length / 2 + 0.2; a < length / 2 - 0.15; a += random_.uniform(0.3, 0.5)) {
      const auto [tx, ty] = on_table(a, random_.uniform(-0.22, 0.22));
      in_.boxes.push_back(standing(tx, ty, random_.uniform(-1.5, 1.5), random_.uniform(0.08, 0.3),
                                   random_.uniform(0.08, 0.25), top,
                                   top + random_.uniform(0.05, 0.4), kinds[one_of(5)]));
    }
    const int chairs = 2 + static_cast<int>(one_of(3));
    for (int k = 0; k < chairs; ++k) {
      place_chair(x, y, yaw + 2 * kPi * (k + random_.uniform(-0.15, 0.15)) / chairs + kPi / 2,
                  random_.uniform(0.7, 0.85));
    }
  }

  // A chair that faces the table from the direction `angle`.
  void place_chair(double x, double y, double angle, double away) {
    const double c = std::cos(angle), s = std::sin(angle);
    const double cx = x + away * c, cy = y + away * s;
    in_.boxes.push_back(standing(cx, cy, angle, 0.42, 0.42, 0.43, 0.47, Material::kCarpet));
    in_.boxes.push_back(
        standing(cx + 0.19 * c, cy + 0.19 * s, angle, 0.035, 0.42, 0.5, 0.92, Material::kWood));
    for (int k = 0; k < 4; ++k) {
      const double a = (k % 2 == 0 ? 0.18 : -0.18), b = (k < 2 ? 0.18 : -0.18);
      in_.boxes.push_back(standing(cx + c * a - s * b, cy + s * a + c * b, angle, 0.035, 0.035, 0,
                                   0.43, Material::kWood));
    }
  }

  void stack_crates(int sign_x, int sign_y) {
    if (one_of(2) == 0) return;
    const double size = random_.uniform(0.25, 0.38), top = random_.uniform(0.25, 0.6);
    in_.boxes.push_back(standing(sign_x * (in_.half_x - 0.3), sign_y * (in_.half_y - 0.3),
                                 random_.uniform(-0.5, 0.5), size, size, 0, top,
                                 Material::kCardboard));
    if (one_of(2) == 0) {
      in_.boxes.push_back(standing(sign_x * (in_.half_x - 0.3), sign_y * (in_.half_y - 0.3),
                                   random_.uniform(-0.5, 0.5), 0.8 * size, 0.7 * size, top,
                                   top + random_.uniform(0.15, 0.3), Material::kCardboard));
    }
  }

  void hang_lamps() {
    const int count = 1 + static_cast<int>(one_of(3));
    for (int k = 0; k < count; ++k) {
      in_.lamps.push_back({{random_.uniform(-0.7, 0.7) * in_.half_x,
                            random_.uniform(-0.7, 0.7) * in_.half_y, -in_.height + 0.1},
                           random_.uniform(0.05, 0.5),
                           random_.uniform(2, 7)});
    }
    if (one_of(2) == 0) {  // daylight from one side
      in_.lamps.push_back(
          {{in_.half_x - 0.3, random_.uniform(-0.5, 0.5) * in_.half_y, -1.7}, 0.4, 5});
    }
  }

  Random random_;
  Interior in_;
};

}  // namespace

Interior furnished(uint64_t seed) { return Builder(seed).build(); }

}  // namespace flights
