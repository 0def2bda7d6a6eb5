// PAIRS.txt: any text gives a list of pairs, or BadInput.
#include <string>

#include "base/error.h"
#include "files/pairs_file.h"
#include "fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  try {
    const auto pairs = cli::parse_pairs({reinterpret_cast<const char*>(data), size}, "f");
    FUZZ_REQUIRE(!pairs.empty());
    for (const cli::Pair& pair : pairs) {
      FUZZ_REQUIRE(!pair.name0.empty() && !pair.name1.empty());
      FUZZ_REQUIRE(fuzz::all_finite(pair.R.data(), 9) && fuzz::all_finite(pair.t.data(), 3));
      FUZZ_REQUIRE(!pair.has_K || (pair.K0[0] > 0 && pair.K1[4] > 0));
    }
  } catch (const cli::BadInput&) {
  }
  return 0;
}
