// twoview drone fly: control by keyboard. A movement ends 0.5 s after the last repeat of its
// key; then the drone hovers. Without --live nothing is sent.

#include <CLI/App.hpp>
#include <cstdlib>
#include <cstring>
#include <memory>

#include "base/error.h"
#include "base/output.h"
#include "drone/drone.h"
#include "drone/keyboard.h"
#include "drone/link.h"

namespace cli {
namespace {

constexpr double kLandingPatienceS = 10;

struct Arguments {
  DroneAddress address;
  double duration = 0, speed = 0.2;
  bool live = false;
};

const char kHelp[] =
    "  t take off   space land   h hover   x EMERGENCY: motors off   r re-arm   f flat trim\n"
    "  w s forward, back   a d left, right   up, down climb, sink   left, right turn   Esc land "
    "and end\n"
    "  a movement ends when its key does\n";

// The command of a key, in words and as a movement.
struct Wish {
  enum Kind { kNone, kTakeOff, kLand, kHover, kMove, kCut, kRearm, kTrim, kEnd } kind = kNone;
  const char* words = "";
  ardrone_move move{0, 0, 0, 0};
};

Wish wish_of(int key, float speed) {
  switch (key) {
    case 't': return {Wish::kTakeOff, "take off", {}};
    case ' ': return {Wish::kLand, "land", {}};
    case 'h': return {Wish::kHover, "hover", {}};
    case 'x': return {Wish::kCut, "EMERGENCY: motors off", {}};
    case 'r': return {Wish::kRearm, "re-arm", {}};
    case 'f': return {Wish::kTrim, "flat trim", {}};
    case 'w': return {Wish::kMove, "forward", {0, -speed, 0, 0}};
    case 's': return {Wish::kMove, "back", {0, speed, 0, 0}};
    case 'a': return {Wish::kMove, "left", {-speed, 0, 0, 0}};
    case 'd': return {Wish::kMove, "right", {speed, 0, 0, 0}};
    case kKeyUp: return {Wish::kMove, "climb", {0, 0, speed, 0}};
    case kKeyDown: return {Wish::kMove, "sink", {0, 0, -speed, 0}};
    case kKeyRight: return {Wish::kMove, "turn right", {0, 0, 0, speed}};
    case kKeyLeft: return {Wish::kMove, "turn left", {0, 0, 0, -speed}};
    case 27: return {Wish::kEnd, "land and end", {}};
    default: return {};
  }
}

tvs_status send(ardrone_session* session, const Wish& wish) {
  switch (wish.kind) {
    case Wish::kTakeOff: return ardrone_session_take_off(session);
    case Wish::kLand:
    case Wish::kEnd: return ardrone_session_land(session);
    case Wish::kHover: return ardrone_session_hover(session);
    case Wish::kMove: return ardrone_session_move(session, &wish.move);
    case Wish::kCut: return ardrone_session_cut_motors(session);
    case Wish::kRearm: return ardrone_session_rearm(session);
    case Wish::kTrim: return ardrone_session_flat_trim(session);
    default: return TVS_OK;
  }
}

std::string status_line(const ardrone_session* session) {
  const ardrone_navdata* n = ardrone_session_navdata(session);
  if (n == nullptr || !ARDRONE_HAS(n, ARDRONE_TAG_DEMO)) return "no link";
  char line[160];
  const bool is_emergency = (n->state & ARDRONE_STATE_EMERGENCY) != 0;
  std::snprintf(line, sizeof line, "%s%s, battery %u %%, height %.2f m, %.2f m/s",
                (n->state & ARDRONE_STATE_FLYING) != 0 ? "in the air" : "on the ground",
                is_emergency ? ", EMERGENCY" : "", n->demo.battery_percent,
                n->demo.altitude_mm * 1e-3, n->demo.velocity_mm_s[0] * 1e-3);
  return line;
}

// A dry run that sends nothing: it prints the command of each key.
int rehearse(const Arguments& a) {
  print(std::string("dry run: nothing is sent (--live flies)\n") + kHelp);
  Keyboard keyboard;
  const std::atomic<bool>& stop = stop_flag_for_signals();
  const int64_t start = ardrone_now_ns();
  while (!stop && !keyboard.has_ended()) {
    if (a.duration > 0 && static_cast<double>(ardrone_now_ns() - start) * 1e-9 >= a.duration) break;
    const std::optional<int> key = keyboard.next();
    if (!key) {
      const timespec pause{0, 10000000};
      ::nanosleep(&pause, nullptr);
      continue;
    }
    const Wish wish = wish_of(*key, static_cast<float>(a.speed));
    if (wish.kind != Wish::kNone) print(std::string("would ask: ") + wish.words + "\n");
    if (wish.kind == Wish::kEnd) break;
  }
  return 0;
}

// Goes back to the start of the terminal's line, and erases it where the terminal can.
std::string line_start() {
  const char* const terminal = std::getenv("TERM");
  return terminal && std::strcmp(terminal, "dumb") == 0 ? "\r" : "\r\033[K";
}

bool is_in_the_air(const ardrone_session* session) {
  const ardrone_navdata* n = ardrone_session_navdata(session);
  return n != nullptr && (n->state & ARDRONE_STATE_FLYING) != 0;
}

int fly(const Arguments& a) {
  if (!a.live) return rehearse(a);
  Keyboard keyboard;
  if (!keyboard.is_terminal()) throw BadInput("--live needs a terminal, with someone at it");
  ardrone_session_options options;
  ardrone_session_options_init(&options);
  options.video = 0;
  const std::atomic<bool>& stop = stop_flag_for_signals();
  Link link(a.address, options, {});
  print(std::string("LIVE: the drone obeys these keys\n") + kHelp);
  if (!link.run([&] { return ardrone_session_is_up(link.session()) != 0; }, stop, 10))
    throw BadInput("no AR.Drone answers at " + a.address.host);
  bool ends = false;
  double next_word = 0;
  const int64_t start = ardrone_now_ns();
  link.run(
      [&] {
        while (const std::optional<int> key = keyboard.next()) {
          const Wish wish = wish_of(*key, static_cast<float>(a.speed));
          if (wish.kind == Wish::kNone) continue;
          const tvs_status status = send(link.session(), wish);
          if (status != TVS_OK)
            print(line_start() + wish.words + ": not now (" + tvs_status_string(status) + ")\n");
          ends = ends || wish.kind == Wish::kEnd;
        }
        const double seconds = static_cast<double>(ardrone_now_ns() - start) * 1e-9;
        if (seconds >= next_word) {
          print(line_start() + status_line(link.session()));
          next_word = seconds + 0.2;
        }
        return ends || keyboard.has_ended();
      },
      stop, a.duration);
  // The drone is landed before the program ends, whatever ended the loop; this waits at most
  // kLandingPatienceS. If a second Ctrl-C interrupts it, the drone's own watchdog takes over.
  ardrone_session_land(link.session());
  static const std::atomic<bool> never{false};
  link.run([&] { return !is_in_the_air(link.session()); }, never, kLandingPatienceS);
  print(line_start() + status_line(link.session()) + "\n");
  return 0;
}

}  // namespace

void add_drone_fly(CLI::App& drone, Run& run) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb = drone.add_subcommand("fly", "by keyboard; a dry run unless --live is given");
  add_address(*verb, a->address, ARDRONE_DEFAULT_HOST);
  add_duration(*verb, a->duration);
  verb->add_option("--speed", a->speed, "share of the drone's limits that a key asks for")
      ->check(number_in(0.05, 1.0))
      ->type_name("[0.05, 1]")
      ->capture_default_str();
  verb->add_flag("--live,!--dry-run", a->live, "really fly; --dry-run, the default, sends nothing");
  verb->final_callback([a, &run] { run = [a] { return fly(*a); }; });
}

}  // namespace cli
