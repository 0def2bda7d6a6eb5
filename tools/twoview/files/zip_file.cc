// The ZIP format: PKWARE's APPNOTE.TXT.
#include "files/zip_file.h"

#include <zlib.h>

#include <algorithm>

#include "base/error.h"

namespace cli {
namespace {

constexpr size_t kEndBytes = 22, kMostComment = 65535, kEntryBytes = 46, kLocalBytes = 30;
constexpr uint32_t kEndMark = 0x06054b50, kEntryMark = 0x02014b50, kLocalMark = 0x04034b50;
constexpr size_t kMostInflated = size_t{1} << 30;  // bytes of a member
constexpr size_t kMostRatio = 1032;                // deflate packs at most 258 bytes into two bits

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

// Inflates a raw deflate stream of exactly `size` bytes; false where it is damaged.
bool inflate_raw(std::string_view stream, size_t size, std::string& content) {
  if (size / kMostRatio > stream.size()) return false;
  content.resize(size);
  z_stream work{};
  work.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(stream.data()));
  work.avail_in = static_cast<uInt>(stream.size());
  work.next_out = reinterpret_cast<Bytef*>(content.data());
  work.avail_out = static_cast<uInt>(size);
  if (inflateInit2(&work, -MAX_WBITS) != Z_OK) return false;
  const int status = ::inflate(&work, Z_FINISH);
  inflateEnd(&work);
  return status == Z_STREAM_END && work.total_out == size;
}

uint32_t crc_of(std::string_view bytes) {
  return static_cast<uint32_t>(
      crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

}  // namespace

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
  const bool is_whole = !member.is_deflated || inflate_raw(member.stored, member.size, content);
  if (!is_whole || content.size() != member.size || crc_of(content) != member.crc)
    throw BadInput(name + " is damaged: " + member.name + " cannot be read");
  return content;
}

}  // namespace cli
