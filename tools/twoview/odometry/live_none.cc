// --live in a program without libmicrohttpd.

#include "base/error.h"
#include "odometry/live.h"

namespace cli {

struct LivePage::State {};
LivePage::LivePage(int) { throw BadInput("--live: this program was built without libmicrohttpd"); }
LivePage::~LivePage() = default;
std::string LivePage::address() const { return ""; }
void LivePage::update(const Flight&) {}

}  // namespace cli
