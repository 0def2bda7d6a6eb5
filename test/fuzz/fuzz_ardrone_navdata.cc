// Navdata: any bytes are decoded as a packet or refused; a decoded packet survives encoding, and
// its SI values are finite. The checksum is corrected for most inputs, else nearly all would be
// refused.
#include <vector>

#include "encode.h"
#include "fuzz.h"

namespace {

void mend_checksum(std::vector<uint8_t>& bytes) {
  if (bytes.size() < 24) return;
  const size_t at = bytes.size() - 8;
  uint32_t sum = 0;
  for (size_t k = 0; k < at; ++k) sum += bytes[k];
  const uint8_t option[8] = {0xff,
                             0xff,
                             8,
                             0,
                             static_cast<uint8_t>(sum),
                             static_cast<uint8_t>(sum >> 8),
                             static_cast<uint8_t>(sum >> 16),
                             0};
  std::memcpy(bytes.data() + at, option, sizeof option);
}

void check_imu(const ardrone_navdata& navdata) {
  tvs_imu imu{};
  imu.struct_size = sizeof imu;
  const tvs_status status = ardrone_navdata_to_imu(&navdata, 0.5, &imu);
  FUZZ_REQUIRE((status == TVS_OK) == (imu.valid != 0));
  FUZZ_REQUIRE(fuzz::all_finite(imu.attitude.world_from_body, 4));
  FUZZ_REQUIRE(fuzz::all_finite(imu.velocity_m_s, 3));
  FUZZ_REQUIRE(fuzz::all_finite(imu.acceleration_m_s2, 3));
  FUZZ_REQUIRE(fuzz::all_finite(imu.rate_rad_s, 3));
}

}  // namespace

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static ardrone_navdata navdata, again;
  static ardrone_sequence sequence;
  if (size == 0) return 0;
  // a copy of exactly this length, so that the sanitizer sees a read beyond it
  std::vector<uint8_t> bytes(data + 1, data + size);
  if (data[0] < 240) mend_checksum(bytes);
  if (ardrone_navdata_decode(bytes.data(), bytes.size(), &navdata) != TVS_OK) return 0;
  ardrone_sequence_check(&sequence, &navdata);
  check_imu(navdata);
  uint8_t encoded[ARDRONE_NAVDATA_MAX_BYTES];
  size_t encoded_size;
  FUZZ_REQUIRE(ardrone_encode_navdata(&navdata, encoded, sizeof encoded, &encoded_size) == TVS_OK);
  FUZZ_REQUIRE(ardrone_navdata_decode(encoded, encoded_size, &again) == TVS_OK);
  again.checksum = navdata.checksum;
  again.num_unknown = navdata.num_unknown;
  again.num_short = navdata.num_short;
  FUZZ_REQUIRE(std::memcmp(&navdata, &again, sizeof navdata) == 0);
  return 0;
}
