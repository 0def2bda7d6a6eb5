// What libav's decoders report of damaged films while they conceal it: OpenCV hands the pictures
// over as if nothing had happened.
#pragma once

#include <cstdint>
#include <string>

namespace cli {

struct DecoderErrors {
  int64_t num = 0;    // messages of errors since the last call of listen_to_decoders
  std::string first;  // the first of them
};

// From now on counts what the decoders of this process report as errors, and prints nothing. Call
// it once a film is open: OpenCV takes the messages for itself as it opens its first one.
void listen_to_decoders();
DecoderErrors decoder_errors();

}  // namespace cli
