#include "base/output.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <mutex>
#include <thread>

#include "base/error.h"

namespace cli {
namespace fs = std::filesystem;
namespace {

// The sets that exist, for the thread that waits for signals. Hold the mutex while creating,
// renaming or deleting a temporary file, so that the thread sees every such file. The list is never
// freed, since the thread outlives main().
struct Living {
  std::mutex mutex;
  std::vector<OutputSet*> sets;
};
Living& living() {
  static Living* const instance = new Living;
  return *instance;
}

std::string reason(int error) { return std::strerror(error); }

// Closes its file descriptor when it is destroyed.
struct Descriptor {
  int fd = -1;
  ~Descriptor() {
    if (fd >= 0) ::close(fd);
  }
};

// Whether the path is a link such as /dev/stdout, which stands for an open file of any kind.
// Renaming a file over such a link would remove the link for every program.
bool stands_for_open_file(const fs::path& path) {
  std::error_code error;
  const std::string link = fs::read_symlink(path, error).string();
  return !error && link.rfind("/proc/", 0) == 0;
}

// Writes all bytes. Returns 0, or the errno of the first failure.
int write_all(int fd, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(fd, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return errno;
    bytes.remove_prefix(static_cast<size_t>(written));
  }
  return 0;
}

// Flushes the data to the disk, so that a full disk is detected before the file receives its final
// name. Returns 0, or an errno. A file system that cannot flush is not an error.
int sync(int fd) {
  if (::fsync(fd) == 0 || errno == EINVAL || errno == ENOTSUP || errno == EROFS) return 0;
  return errno;
}

}  // namespace

OutputSet::OutputSet(const fs::path& folder) : folder_(folder.empty() ? "." : folder) {
  const std::lock_guard<std::mutex> lock(living().mutex);
  try {
    make_folder();
    living().sets.push_back(this);
  } catch (...) {
    discard();
    throw;
  }
}

OutputSet::~OutputSet() {
  const std::lock_guard<std::mutex> lock(living().mutex);
  std::vector<OutputSet*>& sets = living().sets;
  sets.erase(std::remove(sets.begin(), sets.end(), this), sets.end());
  discard();
}

void OutputSet::make_folder() {
  std::error_code error;
  const fs::path whole = fs::absolute(folder_, error);
  if (error) throw BadInput("cannot use folder " + folder_.string() + ": " + error.message());
  fs::path path;
  for (const fs::path& part : whole) {
    path /= part;
    struct stat info;
    if (::stat(path.c_str(), &info) == 0) {
      if (S_ISDIR(info.st_mode)) continue;
      throw BadInput("cannot write to folder " + folder_.string() + ": " + path.string() +
                     " is not a folder");
    }
    if (::mkdir(path.c_str(), 0777) == 0) {
      made_.push_back(path);
    } else if (errno != EEXIST) {
      throw BadInput("cannot make folder " + folder_.string() + ": " + reason(errno));
    }
  }
  if (::access(whole.c_str(), W_OK | X_OK) != 0)
    throw BadInput("cannot write to folder " + folder_.string() + ": " + reason(errno));
}

void OutputSet::keep(const std::string& input) {
  if (!input.empty()) kept_.push_back(input);
}

bool OutputSet::is_kept(const fs::path& path) const {
  return std::any_of(kept_.begin(), kept_.end(), [&](const std::string& input) {
    // Set if one of the two files does not exist; then they are not the same file.
    std::error_code error;
    return fs::is_regular_file(path, error) && fs::equivalent(path, input, error);
  });
}

void OutputSet::require_own(const Own& own) const {
  std::error_code ignored;
  const auto is_there = [&](const std::string& name) {
    return fs::is_regular_file(folder_ / name, ignored);
  };
  const bool is_own = std::all_of(own.always.begin(), own.always.end(), is_there) &&
                      std::none_of(own.never.begin(), own.never.end(), is_there);
  if (is_own) return;
  for (const std::string& name : own.names)
    if (is_there(name) && !is_kept(folder_ / name))
      throw BadInput("folder " + folder_.string() + " holds " + name +
                     ", which is not of an earlier run of twoview " + own.verb +
                     ": give another -o");
}

void OutputSet::add(const std::string& name, std::string_view bytes) {
  const fs::path target = folder_ / name;
  struct stat info;
  const bool exists = ::stat(target.c_str(), &info) == 0;
  if (exists && S_ISDIR(info.st_mode))
    throw BadInput("cannot write " + target.string() + ": it is a folder");
  if (is_kept(target))
    throw BadInput("cannot write " + target.string() + ": it is read by this run; give another -o");

  const bool direct = exists && (!S_ISREG(info.st_mode) || stands_for_open_file(target));
  Entry entry{name, {}};
  if (!direct) entry.temporary = folder_ / ("." + name + "." + std::to_string(::getpid()) + ".tmp");
  const fs::path& path = direct ? target : entry.temporary;

  Descriptor file;
  const int flags = O_WRONLY | O_CLOEXEC | (direct ? O_APPEND : O_CREAT | O_EXCL | O_NOFOLLOW);
  {
    // open() may block on a pipe, and nobody may wait for it meanwhile: a target that is no regular
    // file has no temporary file that could be left behind, and the mutex is locked after open().
    std::unique_lock<std::mutex> lock(living().mutex, std::defer_lock);
    if (!direct) lock.lock();
    file.fd = ::open(path.c_str(), flags, 0666);
    if (file.fd < 0) throw BadInput("cannot write " + target.string() + ": " + reason(errno));
    if (direct) lock.lock();
    entries_.push_back(entry);  // discard() removes the files of entries_
  }
  int error = write_all(file.fd, bytes);
  if (error == 0 && !direct) error = sync(file.fd);
  const int fd = file.fd;
  file.fd = -1;
  if (::close(fd) != 0 && error == 0) error = errno;
  if (error != 0) throw BadInput("cannot write " + target.string() + ": " + reason(error));
}

void OutputSet::commit() {
  const std::lock_guard<std::mutex> lock(living().mutex);
  for (Entry& entry : entries_) {
    if (entry.temporary.empty()) continue;
    const fs::path target = folder_ / entry.name;
    if (::rename(entry.temporary.c_str(), target.c_str()) != 0)
      throw BadInput("cannot write " + target.string() + ": " + reason(errno));
    entry.temporary.clear();
    made_.clear();  // folders with committed files are not removed
  }
  made_.clear();
}

void OutputSet::discard() noexcept {
  for (const Entry& entry : entries_)
    if (!entry.temporary.empty()) ::unlink(entry.temporary.c_str());
  for (auto folder = made_.rbegin(); folder != made_.rend(); ++folder) ::rmdir(folder->c_str());
}

void OutputSet::remove_others(const std::vector<std::string>& names) const {
  for (const std::string& name : names) {
    bool ours = false;
    for (const Entry& entry : entries_) ours = ours || entry.name == name;
    struct stat info;
    const fs::path path = folder_ / name;
    if (!ours && !is_kept(path) && ::lstat(path.c_str(), &info) == 0 && S_ISREG(info.st_mode))
      ::unlink(path.c_str());
  }
}

std::vector<std::string> OutputSet::names() const {
  std::vector<std::string> names;
  for (const Entry& entry : entries_) names.push_back(entry.name);
  return names;
}

// Whether the first signal only sets the flag, before a second one ends the program.
std::atomic<bool>& asks_first() {
  static std::atomic<bool> asks{false};
  return asks;
}

std::atomic<bool>& stop_flag() {
  static std::atomic<bool> stop{false};
  return stop;
}

std::atomic<void (*)()>& last_call() {
  static std::atomic<void (*)()> function{nullptr};
  return function;
}

void call_at_last_signal(void (*function)()) { last_call() = function; }

const std::atomic<bool>& stop_flag_for_signals() {
  asks_first() = true;
  return stop_flag();
}

void clear_stop_flag() { stop_flag() = false; }

void clean_up_on_signals() {
  sigset_t awaited;
  sigemptyset(&awaited);
  // A signal that is ignored when the program starts, as SIGHUP under nohup, stays ignored.
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    struct sigaction action;
    if (::sigaction(signal, nullptr, &action) == 0 && action.sa_handler != SIG_IGN)
      sigaddset(&awaited, signal);
  }
  // The signals are blocked in this thread and in every later one; only the thread below receives
  // them.
  ::pthread_sigmask(SIG_BLOCK, &awaited, nullptr);
  std::thread([awaited] {
    int signal = 0;
    do {
      if (::sigwait(&awaited, &signal) != 0) return;
    } while (asks_first() && !stop_flag().exchange(true));
    living().mutex.lock();  // stays locked: no thread may write another file
    // The newest first: its folder may lie in an older one's.
    std::vector<OutputSet*>& sets = living().sets;
    for (auto set = sets.rbegin(); set != sets.rend(); ++set) (*set)->discard();
    if (void (*const function)() = last_call()) function();
    ::signal(signal, SIG_DFL);
    sigset_t one;
    sigemptyset(&one);
    sigaddset(&one, signal);
    ::pthread_sigmask(SIG_UNBLOCK, &one, nullptr);
    ::raise(signal);
  }).detach();
}

std::string read_file(const std::string& path, size_t max_bytes) {
  Descriptor file;
  file.fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file.fd < 0) throw BadInput("cannot read " + path + ": " + reason(errno));
  struct stat info;
  if (::fstat(file.fd, &info) != 0) throw BadInput("cannot read " + path + ": " + reason(errno));
  if (S_ISDIR(info.st_mode)) throw BadInput("cannot read " + path + ": it is a folder");
  if (!S_ISREG(info.st_mode) && !S_ISFIFO(info.st_mode))
    throw BadInput("cannot read " + path + ": it is not a file");

  std::string bytes;
  if (S_ISREG(info.st_mode) && static_cast<size_t>(info.st_size) <= max_bytes)
    bytes.reserve(static_cast<size_t>(info.st_size));
  char block[1 << 16];
  for (;;) {
    const ssize_t count = ::read(file.fd, block, sizeof block);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) throw BadInput("cannot read " + path + ": " + reason(errno));
    if (count == 0) break;
    bytes.append(block, static_cast<size_t>(count));
    if (bytes.size() > max_bytes)
      throw BadInput("cannot read " + path + ": it is larger than " +
                     std::to_string(max_bytes >> 20) + " MiB");
  }
  if (bytes.empty()) throw BadInput("cannot read " + path + ": it is empty");
  return bytes;
}

void print(std::string_view text) {
  const int error = write_all(STDOUT_FILENO, text);
  if (error != 0 && error != EPIPE) throw BadInput("cannot write to stdout: " + reason(error));
}

}  // namespace cli
