// Makes report.html: one file that needs no other file and no network.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "pair/result.h"
#include "report/html.h"

namespace cli {

struct Figure {
  std::string title, caption;
  cv::Mat picture;
  bool is_photo;  // the page embeds a photo as JPEG, else as PNG
};

std::string report_html(const Outcome& outcome, const std::vector<CloudPoint>& cloud,
                        const std::vector<Figure>& figures);

}  // namespace cli
