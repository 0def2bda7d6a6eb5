#include "sources/joined_films.h"

#include <cstdint>
#include <fstream>

namespace cli {
namespace {

uint64_t number(const std::string& bytes, size_t at, size_t count, bool big_endian) {
  uint64_t value = 0;
  for (size_t i = 0; i < count; ++i)
    value = value << 8 | static_cast<uint8_t>(bytes[at + (big_endian ? i : count - 1 - i)]);
  return value;
}

// The bytes from there on, fewer than `count` at the end of the file.
std::string bytes_at(std::ifstream& file, uint64_t at, size_t count) {
  std::string bytes(count, '\0');
  file.clear();
  file.seekg(static_cast<std::streamoff>(at));
  file.read(bytes.data(), static_cast<std::streamsize>(count));
  bytes.resize(static_cast<size_t>(file.gcount()));
  return bytes;
}

// Top-level boxes: size (0: to the end, 1: 8 bytes of size behind the name), name.
bool has_second_mp4(std::ifstream& file) {
  int num_heads = 0;
  for (uint64_t at = 0;;) {
    const std::string head = bytes_at(file, at, 16);
    if (head.size() < 8) return false;
    if (head.substr(4, 4) == "ftyp" && ++num_heads == 2) return true;
    uint64_t size = number(head, 0, 4, true);
    if (size == 1 && head.size() == 16) size = number(head, 8, 8, true);
    if (size < 8 || at + size < at) return false;
    at += size;
  }
}

bool has_second_avi(std::ifstream& file) {
  for (uint64_t at = 0;;) {
    const std::string head = bytes_at(file, at, 12);
    if (head.size() < 12 || head.substr(0, 4) != "RIFF") return false;
    if (at > 0 && head.substr(8, 4) == "AVI ") return true;
    const uint64_t size = number(head, 4, 4, false);
    if (size == 0) return false;  // a recorder that was cut off
    at += 8 + size + (size & 1);
  }
}

// Tags behind a head of 9 bytes: kind, 3 bytes of size, 7 more, the data; 4 bytes between them.
bool has_second_flv(std::ifstream& file) {
  constexpr uint64_t kHead = 9, kTag = 11, kBetween = 4;
  for (uint64_t at = kHead + kBetween;;) {
    const std::string head = bytes_at(file, at, 4);
    if (head.size() < 4) return false;
    if (head == std::string("FLV\1", 4)) return true;
    const int kind = head[0] & 31;
    if (kind != 8 && kind != 9 && kind != 18) return false;
    at += kTag + number(head, 1, 3, true) + kBetween;
  }
}

}  // namespace

bool is_joined_film(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  const std::string head = bytes_at(file, 0, 12);
  if (head.size() < 12) return false;
  if (head.substr(4, 4) == "ftyp") return has_second_mp4(file);
  if (head.substr(0, 4) == "RIFF" && head.substr(8, 4) == "AVI ") return has_second_avi(file);
  return head.substr(0, 4) == std::string("FLV\1", 4) && has_second_flv(file);
}

}  // namespace cli
