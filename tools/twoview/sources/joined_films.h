// Film files that were joined byte by byte (cat a.mp4 b.mp4 > ab.mp4).
#pragma once

#include <string>

namespace cli {

// Whether a second film begins behind the end of the first, in a format of which libavformat reads
// the first one alone: MP4 and QuickTime (a second ftyp at the top level), AVI (a second RIFF of
// AVI; AVIX continues the first), FLV (a second head among the tags). Matroska, transport and raw
// streams may be joined so, and are read to their end. False for what is none of these formats.
bool is_joined_film(const std::string& path);

}  // namespace cli
