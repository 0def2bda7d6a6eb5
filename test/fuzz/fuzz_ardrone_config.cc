// Configuration and id texts of any bytes, and keys and values of any bytes: a value becomes
// exactly one command or is refused.
#include <algorithm>
#include <cstdlib>
#include <string>

#include "fuzz.h"
#include "twoview_drivers/ardrone/config.h"

namespace {

void read_text(const char* text, size_t size) {
  ardrone_span key, value;
  size_t offset = 0;
  while (ardrone_config_next(text, size, &offset, &key, &value) == TVS_OK) {
    FUZZ_REQUIRE(key.text >= text && value.text + value.size <= text + size);
  }
  ardrone_id_kind kind = ARDRONE_ID_APPLICATION;
  offset = 0;
  while (ardrone_ids_next(text, size, &offset, &kind, &key, &value) == TVS_OK) {
    FUZZ_REQUIRE(key.size == 8 && value.text + value.size <= text + size);
  }
  char found[32];
  ardrone_config_find(text, size, "general:navdata_demo", found, sizeof found);
}

void write_command(const std::string& key, const std::string& value) {
  static ardrone_at at;
  at.size = 0;
  at.sequence = 0;
  const tvs_status checked = ardrone_config_check(key.c_str(), value.c_str());
  const tvs_status written = ardrone_at_config(&at, key.c_str(), value.c_str());
  FUZZ_REQUIRE((checked != TVS_OK && checked != TVS_NONE) || written == TVS_OK);
  if (written != TVS_OK) return;
  const std::string text(at.text, at.size);
  FUZZ_REQUIRE(text.find('\r') == text.size() - 1);
  FUZZ_REQUIRE(std::count(text.begin(), text.end(), '"') == 4);
}

}  // namespace

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  read_text(text.data(), text.size());
  const size_t middle = text.find('=');
  if (middle != std::string::npos) write_command(text.substr(0, middle), text.substr(middle + 1));
  fuzz::Bytes bytes(data, size);
  char number[40];
  const double value = bytes.wild(-1e9, 1e9);
  if (ardrone_format_number(value, bytes.whole(0, 9), number, sizeof number) == TVS_OK) {
    FUZZ_REQUIRE(std::strtod(number, nullptr) - value < 1 &&
                 value - std::strtod(number, nullptr) < 1);
  }
  return 0;
}
