#include "room/texture.h"

#include <algorithm>
#include <cmath>

#include "room/random.h"

namespace room {
namespace {

constexpr int kSide = Texture::kSide;

int wrap(int x) { return x & (kSide - 1); }

// Adds smooth, periodic value noise of this amplitude to the tile. The noise has a lattice of
// `cells` cells a side.
void add_noise(Random& random, int cells, double amplitude, std::vector<float>& tile) {
  std::vector<float> lattice(static_cast<size_t>(cells) * cells);
  for (float& value : lattice) value = static_cast<float>(random.uniform(-amplitude, amplitude));
  const auto at = [&](int x, int y) {
    return lattice[static_cast<size_t>((y % cells) * cells + x % cells)];
  };
  const int step = kSide / cells;
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      const int i = x / step, j = y / step;
      float a = static_cast<float>(x % step) / static_cast<float>(step);
      float b = static_cast<float>(y % step) / static_cast<float>(step);
      a = a * a * (3 - 2 * a);
      b = b * b * (3 - 2 * b);
      const float top = at(i, j) * (1 - a) + at(i + 1, j) * a;
      const float bottom = at(i, j + 1) * (1 - a) + at(i + 1, j + 1) * a;
      tile[static_cast<size_t>(y * kSide + x)] += top * (1 - b) + bottom * b;
    }
  }
}

std::vector<float> fractal(Random& random, double grey, double amplitude) {
  std::vector<float> tile(static_cast<size_t>(kSide) * kSide, static_cast<float>(grey));
  for (int cells = 4; cells <= kSide / 2; cells *= 2) {
    add_noise(random, cells, amplitude, tile);
    amplitude *= 0.72;
  }
  return tile;
}

// A shape in a rotated frame: the rectangle |x| <= half_length, |y| <= half_width, or the ellipse
// inscribed in it.
struct Mark {
  double x, y, cosine, sine, half_length, half_width, grey;
  bool round;
};

Mark random_mark(Random& random) {
  Mark mark;
  const double turn = random.uniform(0, 2 * 3.14159265358979);
  mark.x = random.uniform(0, kSide);
  mark.y = random.uniform(0, kSide);
  mark.cosine = std::cos(turn);
  mark.sine = std::sin(turn);
  mark.half_length = 2.5 * std::pow(24.0, random.uniform(0, 1));
  mark.half_width = mark.half_length * random.uniform(0.15, 1);
  mark.grey = random.uniform(15, 240);
  mark.round = random.uniform(0, 1) < 0.4;
  return mark;
}

void paint(const Mark& mark, std::vector<float>& tile) {
  const int reach = static_cast<int>(mark.half_length + mark.half_width) + 2;
  for (int dy = -reach; dy <= reach; ++dy) {
    for (int dx = -reach; dx <= reach; ++dx) {
      const double a = std::abs(mark.cosine * dx + mark.sine * dy) / mark.half_length;
      const double b = std::abs(mark.cosine * dy - mark.sine * dx) / mark.half_width;
      const double out = mark.round ? std::sqrt(a * a + b * b) : std::max(a, b);
      // The edge of the mark is soft over one texel.
      const double cover = std::clamp((1 - out) * mark.half_width + 0.5, 0.0, 1.0);
      if (cover == 0) continue;
      float& texel = tile[static_cast<size_t>(wrap(static_cast<int>(mark.y) + dy) * kSide +
                                              wrap(static_cast<int>(mark.x) + dx))];
      texel += static_cast<float>(cover * 0.85 * (mark.grey - texel));
    }
  }
}

std::vector<uint8_t> to_bytes(const std::vector<float>& tile) {
  std::vector<uint8_t> bytes(tile.size());
  std::transform(tile.begin(), tile.end(), bytes.begin(), [](float value) {
    return static_cast<uint8_t>(std::lround(std::clamp(value, 0.0f, 255.0f)));
  });
  return bytes;
}

std::vector<uint8_t> halved(const std::vector<uint8_t>& fine, int side) {
  const int half = side / 2;
  std::vector<uint8_t> coarse(static_cast<size_t>(half) * half);
  for (int y = 0; y < half; ++y) {
    for (int x = 0; x < half; ++x) {
      const uint8_t* a = &fine[static_cast<size_t>(2 * y * side + 2 * x)];
      coarse[static_cast<size_t>(y * half + x)] =
          static_cast<uint8_t>((a[0] + a[1] + a[side] + a[side + 1] + 2) / 4);
    }
  }
  return coarse;
}

float bilinear(const std::vector<uint8_t>& texels, int side, double u, double v) {
  // u and v must be above -kRepeats: adding kRepeats makes them positive, so that the conversion to
  // an integer rounds down.
  constexpr double kRepeats = 4;
  const double x = (u + kRepeats) * side - 0.5, y = (v + kRepeats) * side - 0.5;
  const int whole_x = static_cast<int>(x), whole_y = static_cast<int>(y);
  const int i = whole_x & (side - 1), i1 = (i + 1) & (side - 1);
  const int j = whole_y & (side - 1), j1 = (j + 1) & (side - 1);
  const float a = static_cast<float>(x - whole_x), b = static_cast<float>(y - whole_y);
  const auto at = [&](int column, int row) {
    return static_cast<float>(texels[static_cast<size_t>(row * side + column)]);
  };
  return (at(i, j) * (1 - a) + at(i1, j) * a) * (1 - b) +
         (at(i, j1) * (1 - a) + at(i1, j1) * a) * b;
}

}  // namespace

Texture::Texture(std::vector<uint8_t> base) {
  levels_.push_back(std::move(base));
  for (int side = kSide; side > 1; side /= 2) levels_.push_back(halved(levels_.back(), side));
}

Texture Texture::pattern(uint64_t seed) {
  Random random(seed);
  std::vector<float> tile = fractal(random, random.uniform(105, 150), 24);
  for (int k = 0; k < 900; ++k) paint(random_mark(random), tile);
  return Texture(to_bytes(tile));
}

Texture Texture::planks(uint64_t seed) {
  constexpr int kBoard = 64;  // width of a wooden board, texels
  Random random(seed);
  std::vector<float> tile = fractal(random, 0, 14);
  for (int row = 0; row < kSide; row += kBoard) {
    int x = 0;
    while (x < kSide) {
      const int length = static_cast<int>(random.uniform(120, 420));
      const float grey = static_cast<float>(random.uniform(70, 190));
      for (int y = row; y < row + kBoard; ++y) {
        for (int k = x; k < std::min(x + length, kSide); ++k) {
          const bool seam = y < row + 3 || k < x + 3;
          tile[static_cast<size_t>(y * kSide + k)] += seam ? 25.0f : grey;
        }
      }
      x += length;
    }
  }
  for (int k = 0; k < 250; ++k) paint(random_mark(random), tile);
  return Texture(to_bytes(tile));
}

float Texture::sample(double u, double v, double footprint) const {
  // The coarsest mip level whose texels are at most as large as the footprint, and the weight of
  // the next coarser level.
  int exponent;
  const double mantissa = std::frexp(std::max(footprint * kSide, 1.0), &exponent);
  const int level = std::min(exponent - 1, static_cast<int>(levels_.size()) - 2);
  const float share = static_cast<float>(2 * mantissa - 1);
  const float fine = bilinear(levels_[static_cast<size_t>(level)], kSide >> level, u, v);
  const float coarse =
      bilinear(levels_[static_cast<size_t>(level) + 1], kSide >> (level + 1), u, v);
  return fine + share * (coarse - fine);
}

}  // namespace room
