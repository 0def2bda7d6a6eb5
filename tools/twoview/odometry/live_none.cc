// --live in a program without libmicrohttpd.

#include "base/error.h"
#include "odometry/live.h"

namespace cli {

struct LivePage::State {};
LivePage::LivePage(int, bool) {
  throw BadInput("--live: this program was built without libmicrohttpd");
}
LivePage::~LivePage() = default;
std::string LivePage::address() const { return ""; }
void LivePage::update(const Flight&) {}
void LivePage::tell(const std::string&) {}
void LivePage::show(std::string, size_t) {}

}  // namespace cli
