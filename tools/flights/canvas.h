// The surface of one side of a solid, on which a material is painted before the side is lit.
// Lengths are metres, the origin is the top-left corner, and grey levels are 0 to 255. The same
// random numbers give the same picture.
#pragma once

#include <cstddef>
#include <vector>

#include "room/random.h"

namespace flights {

using room::Random;

// Smooth noise of mean 0 whose amplitude falls with the frequency. It repeats after kSide texels;
// canvases sample it at incommensurate scales and angles, so that their sum does not repeat.
class Noise {
 public:
  static constexpr int kSide = 1024;
  explicit Noise(Random& random);
  float at(float x, float y) const;  // in texels, each at least 0

 private:
  std::vector<float> values_;
};

class Canvas {
 public:
  static constexpr double kTexel = 0.0025;  // metres

  Canvas(double width, double height, double grey);
  int columns() const { return columns_; }
  int rows() const { return rows_; }
  double width() const { return width_; }
  double height() const { return height_; }
  float& at(int column, int row) {
    return values_[static_cast<size_t>(row) * static_cast<size_t>(columns_) +
                   static_cast<size_t>(column)];
  }

  // Adds noise whose largest waves are `period` long; along u they are longer by `stretch`.
  void add_noise(const Noise& noise, Random& random, double amplitude, double period,
                 double stretch = 1);
  void fill(double u, double v, double width, double height, double grey, double cover = 1);
  // Paints discs and boxes at random angles: `density` for each square metre, with sizes from
  // `smallest` to `largest`, evenly in their logarithm. `contrast` is the largest change of grey.
  void paint_marks(Random& random, double density, double smallest, double largest,
                   double contrast);
  // Paints lines of words, as on a printed page.
  void print(Random& random, double u, double v, double width, double height, double line,
             double grey);

 private:
  double width_, height_;
  int columns_, rows_;
  std::vector<float> values_;
};

enum class Material {
  kPaint,    // a painted wall: faint noise, few spots
  kPlaster,  // a rough wall
  kBricks,
  kBoards,  // wooden boards with seams
  kTiles,
  kCarpet,
  kWood,       // furniture without seams
  kDrawers,    // a cupboard's front
  kBooks,      // shelves of books
  kPoster,     // a picture with print
  kCardboard,  // a crate with labels
  kScreen,     // a dark screen with windows
  kPanels      // a ceiling
};

// Paints a side of width x height metres with a material.
Canvas painted(Material material, double width, double height, const Noise& noise, Random& random);

}  // namespace flights
