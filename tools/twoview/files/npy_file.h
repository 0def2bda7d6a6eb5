// Reads numpy's arrays: .npy, and the members of .npz.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace cli {

struct NpyArray {
  std::vector<size_t> shape;
  bool is_integer = false;
  std::vector<double> values;  // row by row

  // Its shape in words, such as "(120, 2)".
  std::string shape_in_words() const;
  // The number of rows, and of values in each.
  size_t rows() const { return shape.empty() ? 1 : shape[0]; }
  size_t columns() const { return rows() == 0 ? 0 : values.size() / rows(); }
};

// Whether the bytes begin as a .npy file does.
bool is_npy(std::string_view bytes);

// An array of numbers: of integers, truth values, or floating point of 16, 32 or 64 bits, in either
// order of bytes and of the axes. `name` begins the text of BadInput, which is thrown for anything
// else: pickled objects, text, records, complex numbers.
NpyArray parse_npy(std::string_view bytes, const std::string& name);

}  // namespace cli
