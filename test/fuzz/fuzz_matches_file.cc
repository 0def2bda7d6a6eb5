// Tables of matches: any text gives a list of matches, or BadInput.
#include <string>

#include "base/error.h"
#include "files/matches_file.h"
#include "fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  try {
    const auto matches = cli::parse_matches({reinterpret_cast<const char*>(data), size}, "f");
    FUZZ_REQUIRE(matches.size() > 0 && matches.pixels[0].size() == matches.pixels[1].size());
  } catch (const cli::BadInput&) {
  }
  return 0;
}
