#include "flights/canvas.h"

#include <algorithm>
#include <cmath>

namespace flights {
namespace {

constexpr double kTurn = 2 * 3.14159265358979323846;

}  // namespace

Noise::Noise(Random& random) : values_(static_cast<size_t>(kSide) * kSide, 0.0f) {
  float amplitude = 0.5f;
  for (int cells = 4; cells <= kSide / 2; cells *= 2, amplitude *= 0.7f) {
    std::vector<float> lattice(static_cast<size_t>(cells * cells));
    for (float& value : lattice) value = amplitude * static_cast<float>(random.uniform(-1, 1));
    const int step = kSide / cells;
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide; ++x) {
        const int i = x / step, j = y / step, i1 = (i + 1) % cells, j1 = (j + 1) % cells;
        float a = static_cast<float>(x % step) / static_cast<float>(step);
        float b = static_cast<float>(y % step) / static_cast<float>(step);
        a = a * a * (3 - 2 * a);
        b = b * b * (3 - 2 * b);
        const auto node = [&](int column, int row) {
          return lattice[static_cast<size_t>(row * cells + column)];
        };
        const float top = node(i, j) * (1 - a) + node(i1, j) * a;
        const float bottom = node(i, j1) * (1 - a) + node(i1, j1) * a;
        values_[static_cast<size_t>(y * kSide + x)] += top * (1 - b) + bottom * b;
      }
    }
  }
}

float Noise::at(float x, float y) const {
  const int i = static_cast<int>(x), j = static_cast<int>(y);
  const float a = x - static_cast<float>(i), b = y - static_cast<float>(j);
  const auto node = [&](int column, int row) {
    return values_[static_cast<size_t>((row & (kSide - 1)) * kSide + (column & (kSide - 1)))];
  };
  return (node(i, j) * (1 - a) + node(i + 1, j) * a) * (1 - b) +
         (node(i, j + 1) * (1 - a) + node(i + 1, j + 1) * a) * b;
}

Canvas::Canvas(double width, double height, double grey)
    : width_(width),
      height_(height),
      columns_(std::max(2, static_cast<int>(std::ceil(width / kTexel)) + 1)),
      rows_(std::max(2, static_cast<int>(std::ceil(height / kTexel)) + 1)),
      values_(static_cast<size_t>(columns_) * static_cast<size_t>(rows_),
              static_cast<float>(grey)) {}

void Canvas::add_noise(const Noise& noise, Random& random, double amplitude, double period,
                       double stretch) {
  // Two layers at other angles and scales; the coarsest lattice of the noise has 4 cells.
  for (int layer = 0; layer < 2; ++layer) {
    const double turn = stretch > 1 ? random.uniform(-0.03, 0.03) : random.uniform(0, kTurn);
    const double scale =
        kTexel * Noise::kSide / (4 * period) * (layer == 0 ? 1 : random.uniform(1.6, 2.3));
    const float ux = static_cast<float>(scale / stretch * std::cos(turn));
    const float uy = static_cast<float>(scale / stretch * std::sin(turn));
    const float vx = static_cast<float>(-scale * std::sin(turn));
    const float vy = static_cast<float>(scale * std::cos(turn));
    // The offset keeps the coordinates positive.
    const float x0 = 65536 + static_cast<float>(random.uniform(0, Noise::kSide));
    const float y0 = 65536 + static_cast<float>(random.uniform(0, Noise::kSide));
    const float share = static_cast<float>(amplitude) * (layer == 0 ? 1.0f : 0.7f);
    for (int row = 0; row < rows_; ++row) {
      for (int column = 0; column < columns_; ++column) {
        const float c = static_cast<float>(column), r = static_cast<float>(row);
        at(column, row) += share * noise.at(x0 + ux * c + vx * r, y0 + uy * c + vy * r);
      }
    }
  }
}

void Canvas::fill(double u, double v, double width, double height, double grey, double cover) {
  // The edges are soft over one texel.
  const double u0 = u / kTexel, u1 = (u + width) / kTexel;
  const double v0 = v / kTexel, v1 = (v + height) / kTexel;
  const int first_row = std::max(0, static_cast<int>(std::floor(v0)));
  const int last_row = std::min(rows_ - 1, static_cast<int>(std::ceil(v1)));
  const int first_column = std::max(0, static_cast<int>(std::floor(u0)));
  const int last_column = std::min(columns_ - 1, static_cast<int>(std::ceil(u1)));
  for (int row = first_row; row <= last_row; ++row) {
    const double in_v = std::clamp(std::min(row + 0.5 - v0, v1 - row + 0.5), 0.0, 1.0);
    for (int column = first_column; column <= last_column; ++column) {
      const double in_u = std::clamp(std::min(column + 0.5 - u0, u1 - column + 0.5), 0.0, 1.0);
      float& value = at(column, row);
      value += static_cast<float>(in_u * in_v * cover * (grey - value));
    }
  }
}

void Canvas::paint_marks(Random& random, double density, double smallest, double largest,
                         double contrast) {
  const int count = static_cast<int>(density * width_ * height_ + random.uniform(0, 1));
  for (int k = 0; k < count; ++k) {
    const double turn = random.uniform(0, kTurn), cosine = std::cos(turn), sine = std::sin(turn);
    const double x = random.uniform(0, columns_), y = random.uniform(0, rows_);
    const double length =
        0.5 * smallest * std::pow(largest / smallest, random.uniform(0, 1)) / kTexel;
    const double breadth = length * random.uniform(0.15, 1);
    const double change = contrast * random.uniform(-1, 1);
    const bool is_round = random.uniform(0, 1) < 0.4;
    const int reach = static_cast<int>(length + breadth) + 2;
    for (int row = std::max(0, static_cast<int>(y) - reach);
         row <= std::min(rows_ - 1, static_cast<int>(y) + reach); ++row) {
      for (int column = std::max(0, static_cast<int>(x) - reach);
           column <= std::min(columns_ - 1, static_cast<int>(x) + reach); ++column) {
        const double dx = column - x, dy = row - y;
        const double a = std::abs(cosine * dx + sine * dy) / length;
        const double b = std::abs(cosine * dy - sine * dx) / breadth;
        const double out = is_round ? std::sqrt(a * a + b * b) : std::max(a, b);
        const double cover = std::clamp((1 - out) * breadth + 0.5, 0.0, 1.0);
        at(column, row) += static_cast<float>(cover * change);
      }
    }
  }
}

void Canvas::print(Random& random, double u, double v, double width, double height, double line,
                   double grey) {
  for (double y = v; y + line <= v + height; y += 1.7 * line) {
    double x = u;
    const double end = u + width * random.uniform(0.6, 1);
    while (x < end) {
      const double word = line * random.uniform(0.8, 4.5);
      if (x + word > u + width) break;
      // A word is a row of letters: narrow strokes of different heights.
      for (double letter = x; letter < x + word; letter += 0.65 * line) {
        const double rise = line * random.uniform(0.55, 1);
        fill(letter, y + line - rise, 0.45 * line, rise, grey, random.uniform(0.6, 1));
      }
      x += word + 0.7 * line;
    }
  }
}

namespace {

// Rows of pieces with seams between them: boards, bricks and tiles. Each piece has a grey of its
// own.
void lay(Canvas& canvas, Random& random, double piece_width, double piece_height, double vary,
         double seam, double seam_grey, double spread, bool is_staggered) {
  for (double v = 0; v < canvas.height(); v += piece_height) {
    double u = is_staggered ? -random.uniform(0, piece_width) : 0;
    while (u < canvas.width()) {
      const double length = piece_width * random.uniform(1 - vary, 1 + vary);
      canvas.fill(u, v, length, piece_height, 128 + random.uniform(-spread, spread), 0.8);
      canvas.fill(u, v, length, seam, seam_grey, 0.8);
      canvas.fill(u, v, seam, piece_height, seam_grey, 0.8);
      u += length;
    }
  }
}

void shelve_books(Canvas& canvas, Random& random) {
  const double board = 0.022;
  double v = 0;
  while (v < canvas.height()) {
    const double shelf = random.uniform(0.27, 0.38);
    const double bottom = std::min(v + shelf, canvas.height());
    double u = 0.02;
    while (u < canvas.width() - 0.02) {
      const double thick = random.uniform(0.012, 0.055);
      if (random.uniform(0, 1) < 0.06) {  // a gap
        u += random.uniform(0.03, 0.15);
        continue;
      }
      const double tall = std::min(random.uniform(0.16, 0.30), bottom - v - 0.01);
      const double grey = random.uniform(35, 225);
      canvas.fill(u, bottom - tall, thick, tall, grey);
      const double ink = grey > 120 ? random.uniform(20, 70) : random.uniform(170, 240);
      const int bands = 1 + static_cast<int>(random.uniform(0, 3));
      for (int k = 0; k < bands; ++k) {
        canvas.fill(u + 0.15 * thick, bottom - tall * random.uniform(0.1, 0.95), 0.7 * thick,
                    tall * random.uniform(0.01, 0.22), ink, 0.85);
      }
      u += thick + 0.0015;
    }
    canvas.fill(0, bottom, canvas.width(), board, 165);
    v = bottom + board;
  }
  canvas.fill(0, 0, 0.02, canvas.height(), 165);
  canvas.fill(canvas.width() - 0.02, 0, 0.02, canvas.height(), 165);
}

void front_of_drawers(Canvas& canvas, Random& random) {
  const double step = random.uniform(0.35, 0.6), tall = random.uniform(0.22, 0.8);
  for (double u = 0; u < canvas.width() - 0.05; u += step) {
    for (double v = 0; v < canvas.height() - 0.05; v += tall) {
      const double width = std::min(step, canvas.width() - u) - 0.008;
      const double height = std::min(tall, canvas.height() - v) - 0.008;
      canvas.fill(u, v, width + 0.008, 0.006, 40, 0.8);
      canvas.fill(u, v, 0.006, height + 0.008, 40, 0.8);
      canvas.fill(u + 0.006, v + 0.006, width, height, 128 + random.uniform(-30, 40), 0.25);
      canvas.fill(u + width * random.uniform(0.4, 0.5), v + 0.25 * height, 0.09, 0.014,
                  random.uniform(0, 1) < 0.5 ? 30 : 235);
    }
  }
}

void draw_poster(Canvas& canvas, const Noise& noise, Random& random) {
  const double w = canvas.width(), h = canvas.height();
  canvas.add_noise(noise, random, random.uniform(50, 95), 0.35 * std::max(w, h));
  canvas.paint_marks(random, random.uniform(15, 60) / (w * h), 0.01, 0.5 * std::min(w, h), 110);
  if (random.uniform(0, 1) < 0.6) {
    const double top = random.uniform(0.05, 0.6) * h;
    canvas.fill(0.08 * w, top, 0.84 * w, 0.33 * h, 225, 0.85);
    canvas.print(random, 0.11 * w, top + 0.02 * h, 0.78 * w, 0.29 * h, random.uniform(0.009, 0.03),
                 35);
  }
  const double frame = random.uniform(0.01, 0.03), grey = random.uniform(0, 1) < 0.5 ? 30 : 215;
  canvas.fill(0, 0, w, frame, grey);
  canvas.fill(0, h - frame, w, frame, grey);
  canvas.fill(0, 0, frame, h, grey);
  canvas.fill(w - frame, 0, frame, h, grey);
}

}  // namespace

Canvas painted(Material material, double width, double height, const Noise& noise, Random& random) {
  Canvas canvas(width, height, random.uniform(110, 170));
  switch (material) {
    case Material::kPaint:
      canvas.add_noise(noise, random, random.uniform(5, 9), 0.8);
      canvas.add_noise(noise, random, 5, 0.05);
      canvas.paint_marks(random, 9, 0.006, 0.12, 28);
      break;
    case Material::kPlaster:
      canvas.add_noise(noise, random, 12, 1.2);
      canvas.add_noise(noise, random, random.uniform(14, 26), 0.10);
      canvas.paint_marks(random, 12, 0.006, 0.3, 25);
      break;
    case Material::kBricks:
      lay(canvas, random, 0.24, 0.075, 0.06, 0.010, 190, 40, true);
      canvas.add_noise(noise, random, 16, 0.25);
      canvas.paint_marks(random, 25, 0.005, 0.1, 35);
      break;
    case Material::kBoards:
      lay(canvas, random, 1.1, 0.12, 0.6, 0.005, 35, 38, true);
      canvas.add_noise(noise, random, 22, 0.06, 9);
      canvas.paint_marks(random, 14, 0.006, 0.06, 45);
      break;
    case Material::kTiles:
      lay(canvas, random, 0.33, 0.33, 0, 0.007, 60, 12, false);
      canvas.add_noise(noise, random, 30, 0.5);
      canvas.paint_marks(random, 12, 0.005, 0.05, 30);
      break;
    case Material::kCarpet:
      canvas.add_noise(noise, random, 18, 1.5);
      canvas.add_noise(noise, random, 26, 0.06);
      canvas.paint_marks(random, 5, 0.08, 0.9, 45);
      break;
    case Material::kWood:
      canvas.add_noise(noise, random, 26, 0.07, 8);
      canvas.paint_marks(random, 10, 0.006, 0.05, 35);
      break;
    case Material::kDrawers:
      canvas.add_noise(noise, random, 20, 0.08, 8);
      front_of_drawers(canvas, random);
      break;
    case Material::kBooks:
      canvas = Canvas(width, height, 45);
      shelve_books(canvas, random);
      canvas.add_noise(noise, random, 9, 0.08);
      break;
    case Material::kPoster: draw_poster(canvas, noise, random); break;
    case Material::kCardboard:
      canvas.add_noise(noise, random, 14, 0.4);
      canvas.paint_marks(random, 30, 0.01, 0.2, 60);
      canvas.print(random, 0.1 * width, 0.15 * height, 0.6 * width, 0.4 * height, 0.022, 40);
      canvas.fill(0.45 * width, 0, 0.05, height, 200, 0.7);
      break;
    case Material::kScreen:
      canvas = Canvas(width, height, 35);
      canvas.fill(0.1 * width, 0.12 * height, 0.5 * width, 0.7 * height, 200);
      canvas.print(random, 0.13 * width, 0.16 * height, 0.44 * width, 0.62 * height, 0.008, 50);
      canvas.paint_marks(random, 80, 0.01, 0.1, 80);
      break;
    case Material::kPanels:
      lay(canvas, random, 0.6, 0.6, 0, 0.012, 70, 6, false);
      canvas.add_noise(noise, random, 10, 0.7);
      canvas.paint_marks(random, 180, 0.005, 0.02, 45);
      break;
  }
  return canvas;
}

}  // namespace flights
