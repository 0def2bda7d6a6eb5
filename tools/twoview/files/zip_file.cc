// The ZIP format: PKWARE's APPNOTE.TXT; deflate: RFC 1951.
#include "files/zip_file.h"

#include <algorithm>
#include <array>

#include "base/error.h"

namespace cli {
namespace {

constexpr size_t kEndBytes = 22, kMostComment = 65535, kEntryBytes = 46, kLocalBytes = 30;
constexpr uint32_t kEndMark = 0x06054b50, kEntryMark = 0x02014b50, kLocalMark = 0x04034b50;
constexpr size_t kMostInflated = size_t{1} << 30;  // bytes of a member

uint32_t little_endian(std::string_view bytes, size_t at, size_t count) {
  uint32_t value = 0;
  for (size_t i = count; i-- > 0;) value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
  return value;
}

// Where the record at the archive's end begins; npos where there is none.
size_t end_of_archive(std::string_view archive) {
  if (archive.size() < kEndBytes) return std::string_view::npos;
  const size_t last = archive.size() - kEndBytes;
  const size_t first = last - std::min(last, kMostComment);
  for (size_t at = last + 1; at-- > first;)
    if (little_endian(archive, at, 4) == kEndMark) return at;
  return std::string_view::npos;
}

// The bits of a deflate stream, the lowest of a byte first.
class Bits {
 public:
  explicit Bits(std::string_view bytes) : bytes_(bytes) {}
  // `count` bits, at most 16; zeros behind the end, where is_over() then is true.
  uint32_t take(int count) {
    uint32_t value = 0;
    for (int i = 0; i < count; ++i) value |= take_one() << i;
    return value;
  }
  uint32_t take_one() {
    const size_t byte = at_ / 8;
    const uint32_t bit =
        byte < bytes_.size() ? static_cast<unsigned char>(bytes_[byte]) >> (at_ % 8) & 1u : 0;
    ++at_;
    return bit;
  }
  void skip_to_byte() { at_ = (at_ + 7) / 8 * 8; }
  bool is_over() const { return at_ > 8 * bytes_.size(); }

 private:
  std::string_view bytes_;
  size_t at_ = 0;  // bit
};

// A canonical Huffman code, read bit by bit: the codes of each length are consecutive numbers.
class Code {
 public:
  // Returns false where the lengths give more codes than there are.
  bool make(const uint8_t* lengths, size_t count) {
    counts_.fill(0);
    for (size_t i = 0; i < count; ++i) ++counts_[lengths[i]];
    counts_[0] = 0;
    int left = 1;
    for (size_t length = 1; length < counts_.size(); ++length) {
      left = 2 * left - counts_[length];
      if (left < 0) return false;
    }
    std::array<int, 16> next{};
    for (size_t length = 1; length + 1 < counts_.size(); ++length)
      next[length + 1] = next[length] + counts_[length];
    for (size_t i = 0; i < count; ++i)
      if (lengths[i] != 0) symbols_[static_cast<size_t>(next[lengths[i]]++)] = static_cast<int>(i);
    return true;
  }
  // The next symbol; -1 where the bits are no code.
  int symbol(Bits& bits) const {
    int code = 0, first = 0, index = 0;
    for (size_t length = 1; length < counts_.size(); ++length) {
      code |= static_cast<int>(bits.take_one());
      const int count = counts_[length];
      if (code - first < count) return symbols_[static_cast<size_t>(index + code - first)];
      index += count;
      first = 2 * (first + count);
      code *= 2;
    }
    return -1;
  }

 private:
  std::array<int, 16> counts_{};  // by length in bits
  std::array<int, 288> symbols_{};
};

constexpr std::array<uint16_t, 29> kLengthBase = {3,  4,  5,  6,   7,   8,   9,   10,  11, 13,
                                                  15, 17, 19, 23,  27,  31,  35,  43,  51, 59,
                                                  67, 83, 99, 115, 131, 163, 195, 227, 258};
constexpr std::array<uint8_t, 29> kLengthBits = {0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2,
                                                 2, 3, 3, 3, 3, 4, 4, 4, 4, 5, 5, 5, 5, 0};
constexpr std::array<uint16_t, 30> kDistanceBase = {
    1,   2,   3,   4,   5,   7,    9,    13,   17,   25,   33,   49,   65,    97,    129,
    193, 257, 385, 513, 769, 1025, 1537, 2049, 3073, 4097, 6145, 8193, 12289, 16385, 24577};

bool read_codes(Bits& bits, Code& literals, Code& distances) {
  constexpr size_t kOrder[19] = {16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15};
  const size_t num_literals = 257 + bits.take(5), num_distances = 1 + bits.take(5);
  const size_t num_lengths = 4 + bits.take(4);
  if (num_literals > 286 || num_distances > 30) return false;
  std::array<uint8_t, 19> of_lengths{};
  for (size_t i = 0; i < num_lengths; ++i)
    of_lengths[kOrder[i]] = static_cast<uint8_t>(bits.take(3));
  Code lengths_code;
  if (!lengths_code.make(of_lengths.data(), of_lengths.size())) return false;
  std::array<uint8_t, 286 + 30> lengths{};
  for (size_t i = 0; i < num_literals + num_distances;) {
    const int symbol = lengths_code.symbol(bits);
    if (symbol < 0 || bits.is_over()) return false;
    if (symbol < 16) {
      lengths[i++] = static_cast<uint8_t>(symbol);
      continue;
    }
    if (symbol == 16 && i == 0) return false;
    const uint8_t value = symbol == 16 ? lengths[i - 1] : uint8_t{0};
    const size_t times = symbol == 16   ? 3 + bits.take(2)
                         : symbol == 17 ? 3 + bits.take(3)
                                        : 11 + bits.take(7);
    if (i + times > num_literals + num_distances) return false;
    for (size_t k = 0; k < times; ++k) lengths[i++] = value;
  }
  return literals.make(lengths.data(), num_literals) &&
         distances.make(lengths.data() + num_literals, num_distances);
}

bool fixed_codes(Code& literals, Code& distances) {
  std::array<uint8_t, 288> lengths{};
  for (size_t i = 0; i < lengths.size(); ++i)
    lengths[i] = static_cast<uint8_t>(i < 144 ? 8 : i < 256 ? 9 : i < 280 ? 7 : 8);
  std::array<uint8_t, 30> fives{};
  fives.fill(5);
  return literals.make(lengths.data(), lengths.size()) && distances.make(fives.data(), 30);
}

bool copy_stored(Bits& bits, size_t size, std::string& content) {
  bits.skip_to_byte();
  const uint32_t length = bits.take(16), complement = bits.take(16);
  if ((length ^ complement) != 0xffff || content.size() + length > size) return false;
  for (uint32_t i = 0; i < length && !bits.is_over(); ++i)
    content += static_cast<char>(bits.take(8));
  return !bits.is_over();
}

bool copy_coded(Bits& bits, const Code& literals, const Code& distances, size_t size,
                std::string& content) {
  while (true) {
    const int symbol = literals.symbol(bits);
    if (symbol < 0 || bits.is_over()) return false;
    if (symbol == 256) return true;
    if (symbol < 256) {
      if (content.size() == size) return false;
      content += static_cast<char>(symbol);
      continue;
    }
    const auto of_length = static_cast<size_t>(symbol - 257);
    if (of_length >= kLengthBase.size()) return false;
    const size_t length = kLengthBase[of_length] + bits.take(kLengthBits[of_length]);
    const int of_distance = distances.symbol(bits);
    if (of_distance < 0 || of_distance >= 30) return false;
    const int more_bits = std::max(0, of_distance / 2 - 1);
    const size_t distance = kDistanceBase[static_cast<size_t>(of_distance)] + bits.take(more_bits);
    if (distance > content.size() || content.size() + length > size || bits.is_over()) return false;
    for (size_t i = 0; i < length; ++i) content += content[content.size() - distance];
  }
}

uint32_t crc_of(std::string_view bytes) {
  uint32_t crc = ~0u;
  for (const char byte : bytes) {
    crc ^= static_cast<unsigned char>(byte);
    for (int bit = 0; bit < 8; ++bit) crc = crc >> 1 ^ (crc & 1 ? 0xedb88320u : 0);
  }
  return ~crc;
}

}  // namespace

bool inflate(std::string_view stream, size_t size, std::string& content) {
  content.clear();
  Bits bits(stream);
  for (bool is_last = false; !is_last;) {
    is_last = bits.take_one() == 1;
    const uint32_t kind = bits.take(2);
    if (bits.is_over() || kind == 3) return false;
    if (kind == 0) {
      if (!copy_stored(bits, size, content)) return false;
      continue;
    }
    Code literals, distances;
    const bool is_read =
        kind == 1 ? fixed_codes(literals, distances) : read_codes(bits, literals, distances);
    if (!is_read || !copy_coded(bits, literals, distances, size, content)) return false;
  }
  return content.size() == size;
}

std::vector<ZipMember> zip_members(std::string_view archive, const std::string& name) {
  const BadInput damaged(name + " is damaged: it is no whole ZIP archive");
  const size_t end = end_of_archive(archive);
  if (end == std::string_view::npos) throw damaged;
  const uint32_t count = little_endian(archive, end + 10, 2);
  size_t at = little_endian(archive, end + 16, 4);
  std::vector<ZipMember> members;
  for (uint32_t i = 0; i < count; ++i) {
    if (at > end || end - at < kEntryBytes || little_endian(archive, at, 4) != kEntryMark)
      throw damaged;
    const uint32_t flags = little_endian(archive, at + 8, 2);
    const uint32_t method = little_endian(archive, at + 10, 2);
    const size_t stored = little_endian(archive, at + 20, 4);
    const size_t name_bytes = little_endian(archive, at + 28, 2);
    const size_t local = little_endian(archive, at + 42, 4);
    ZipMember member;
    member.crc = little_endian(archive, at + 16, 4);
    member.size = little_endian(archive, at + 24, 4);
    if (end - at < kEntryBytes + name_bytes) throw damaged;
    member.name = archive.substr(at + kEntryBytes, name_bytes);
    if ((flags & 1) != 0 || (method != 0 && method != 8) || member.size > kMostInflated)
      throw BadInput(name + ": " + member.name +
                     " is encrypted, of 1 GiB, or of a method other than numpy's");
    member.is_deflated = method == 8;
    if (local > end || end - local < kLocalBytes || little_endian(archive, local, 4) != kLocalMark)
      throw damaged;
    const size_t data = local + kLocalBytes + little_endian(archive, local + 26, 2) +
                        little_endian(archive, local + 28, 2);
    if (data > end || end - data < stored) throw damaged;
    member.stored = archive.substr(data, stored);
    members.push_back(member);
    at += kEntryBytes + name_bytes + little_endian(archive, at + 30, 2) +
          little_endian(archive, at + 32, 2);
  }
  return members;
}

std::string content_of(const ZipMember& member, const std::string& name) {
  std::string content;
  if (!member.is_deflated) content = member.stored;
  const bool is_whole = !member.is_deflated || inflate(member.stored, member.size, content);
  if (!is_whole || content.size() != member.size || crc_of(content) != member.crc)
    throw BadInput(name + " is damaged: " + member.name + " cannot be read");
  return content;
}

}  // namespace cli
