// Reads the members of a ZIP archive, as numpy writes one for .npz.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace cli {

struct ZipMember {
  std::string name;
  std::string_view stored;  // the bytes as they lie in the archive, which must outlive this
  bool is_deflated = false;
  size_t size = 0;  // bytes, when inflated
  uint32_t crc = 0;
};

// The members of an archive in the order of its directory. Throws BadInput, whose text begins with
// `name`, for what is no whole archive and for what numpy never writes: encryption, several disks,
// members of 4 GiB, methods other than stored and deflate.
std::vector<ZipMember> zip_members(std::string_view archive, const std::string& name);

// The member's content. Throws BadInput where it is damaged.
std::string content_of(const ZipMember& member, const std::string& name);

}  // namespace cli
