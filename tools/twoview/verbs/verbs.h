// The verbs that work on images and files, one source file each. The drone's verbs are in drone/.
#pragma once

#include "verbs/common.h"

namespace cli {

void add_reconstruct(CLI::App& program, Run& run);
void add_detect(CLI::App& program, Run& run);
void add_match(CLI::App& program, Run& run);
void add_triangulate(CLI::App& program, Run& run);
void add_undistort(CLI::App& program, Run& run);
void add_calibrate(CLI::App& program, Run& run);
void add_evaluate(CLI::App& program, Run& run);

}  // namespace cli
