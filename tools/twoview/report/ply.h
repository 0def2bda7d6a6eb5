// The one writer of PLY files: binary little-endian, with the columns that the field's readers
// take.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace cli {

// The type of a column. There are no integers of 32 bits: COLMAP's reader (pycolmap 4.2.1,
// 2026-11-29) refuses a file with any column that is not float, double or uchar, by this spelling.
// meshio 5.3.5 takes the same files, but reads a uchar of a binary file as signed: its colours
// above 127 come 256 too low, and .view("uint8") brings them back. Counts are floats, which are
// exact up to 16 777 216.
enum class PlyType { kFloat, kUchar };
using PlyColumns = std::vector<std::pair<PlyType, std::vector<const char*>>>;

// The header of a file of points, or of a surface with so many triangles; their bytes follow it:
// the rows of the columns, then of each triangle a byte 3 and the indices of its corners, int32.
// comments: lines without an end.
std::string ply_header(const std::vector<std::string>& comments, size_t num_points,
                       const PlyColumns& columns, std::optional<size_t> num_triangles = {});

// Appends the little-endian bytes of a float.
void append_float(std::string& bytes, float value);

}  // namespace cli
