// Reads PAIRS.txt, SuperGlue's list of image pairs with ground truth.
#pragma once

#include <array>
#include <string>
#include <vector>

namespace cli {

struct Pair {
  std::string name0, name1;
  int turns0 = 0, turns1 = 0;  // quarter turns of the image and of K, counter-clockwise
  bool has_K = false;
  std::array<double, 9> K0{}, K1{};  // row-major, for the images before they are turned
  bool has_truth = false;
  std::array<double, 9> R{};  // true pose x1 = R x0 + t before the images are turned
  std::array<double, 3> t{};
};

// A line holds name0 name1 [rot0 rot1 [K0(9) K1(9) [T_0to1(16)]]]; blank lines and lines that begin
// with # are skipped. Throws BadInput that names the broken line by its number.
std::vector<Pair> load_pairs(const std::string& path);
std::vector<Pair> parse_pairs(const std::string& text, const std::string& name);

}  // namespace cli
