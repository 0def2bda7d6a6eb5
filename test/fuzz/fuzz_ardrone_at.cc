// Commands with any arguments: a command is either written whole, in the protocol's form, or
// refused; after a refusal the datagram and its number are unchanged.
#include <string>

#include "fuzz.h"
#include "twoview_drivers/ardrone/at.h"

namespace {

tvs_status write_one(ardrone_at* at, fuzz::Bytes& bytes) {
  const ardrone_move move = {bytes.raw<float>(), static_cast<float>(bytes.wild(-1.2, 1.2)),
                             bytes.raw<float>(), static_cast<float>(bytes.wild(-1.2, 1.2))};
  const int a = bytes.raw<int32_t>(), b = bytes.raw<int32_t>();
  std::string text[3];
  for (std::string& t : text) {
    for (int k = bytes.raw<uint8_t>() % 12; k > 0; --k)
      t += static_cast<char>(bytes.raw<uint8_t>());
  }
  int32_t numbers[24];
  for (int32_t& number : numbers) number = a ^ b;
  switch (bytes.raw<uint8_t>() % 12) {
    case 0: return ardrone_at_ref(at, a & 1, b & 1);
    case 1: return ardrone_at_pcmd(at, &move, a);
    case 2: return ardrone_at_pcmd_mag(at, &move, a & 7, bytes.raw<float>(), bytes.raw<float>());
    case 3: return ardrone_at_ftrim(at);
    case 4: return ardrone_at_calib(at, a);
    case 5: return ardrone_at_comwdg(at);
    case 6: return ardrone_at_config(at, text[0].c_str(), text[1].c_str());
    case 7: return ardrone_at_config_ids(at, text[0].c_str(), text[1].c_str(), text[2].c_str());
    case 8: return ardrone_at_ctrl(at, static_cast<ardrone_control_mode>(a & 15));
    case 9: return ardrone_at_anim(at, a % 64, b);
    case 10: return ardrone_at_led(at, a % 64, bytes.raw<float>(), b);
    default: return ardrone_at_legacy(at, static_cast<ardrone_legacy>(a & 15), numbers, b % 25);
  }
}

// A command must be one printable line with its own number and closed quotes.
void check_line(const std::string& line, int32_t number) {
  FUZZ_REQUIRE(line.compare(0, 3, "AT*") == 0 && line.back() == '\r');
  const size_t equals = line.find('=');
  FUZZ_REQUIRE(equals != std::string::npos);
  FUZZ_REQUIRE(line.compare(equals + 1, std::to_string(number).size(), std::to_string(number)) ==
               0);
  int quotes = 0;
  for (size_t k = 0; k + 1 < line.size(); ++k) {
    FUZZ_REQUIRE(static_cast<unsigned char>(line[k]) >= 32);
    quotes += line[k] == '"';
  }
  FUZZ_REQUIRE(quotes % 2 == 0);
}

}  // namespace

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static ardrone_at at, before;
  fuzz::Bytes bytes(data, size);
  at.size = 0;
  at.sequence = bytes.raw<uint8_t>() < 200 ? 0 : bytes.raw<int32_t>() & INT32_MAX;
  while (bytes.left() > 0) {
    before = at;
    const tvs_status status = write_one(&at, bytes);
    FUZZ_REQUIRE(at.size <= ARDRONE_AT_MAX_BYTES);
    if (status != TVS_OK) {
      FUZZ_REQUIRE(at.size == before.size && at.sequence == before.sequence);
      if (status == TVS_ERR_CAPACITY) at.size = 0;
      continue;
    }
    FUZZ_REQUIRE(std::memcmp(at.text, before.text, before.size) == 0);
    check_line(std::string(at.text + before.size, at.size - before.size), at.sequence);
  }
  return 0;
}
