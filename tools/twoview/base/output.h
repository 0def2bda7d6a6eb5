// Output files that appear whole or not at all, what happens to them on a signal, what is printed,
// and the reading of a whole file.
#pragma once

#include <atomic>
#include <cstdio>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace cli {

// A set of files for one folder. Each is written to a temporary name beside its target and renamed
// by commit(); without commit() nothing stays, not even the folder if it was made for the set.
// A target that exists and is no regular file (a device, a pipe) is written as it is.
// Every failure throws BadInput.
class OutputSet {
 public:
  // Makes the folder where it is missing and checks that it can be written to.
  explicit OutputSet(const std::filesystem::path& folder);
  ~OutputSet();
  OutputSet(const OutputSet&) = delete;
  OutputSet& operator=(const OutputSet&) = delete;

  // A file that the run reads: add() refuses to write over it, and remove_others() leaves it.
  void keep(const std::string& input);

  void add(const std::string& name, std::string_view bytes);
  void commit();

  // Deletes those of `names` in the folder that this set does not hold: what an earlier run left.
  void remove_others(const std::vector<std::string>& names) const;

  const std::filesystem::path& folder() const { return folder_; }
  std::vector<std::string> names() const;

 private:
  friend void clean_up_on_signals();
  struct Entry {
    std::string name;
    std::filesystem::path temporary;  // empty: written already
  };
  bool is_kept(const std::filesystem::path& path) const;
  void discard() noexcept;
  void make_folder();

  std::filesystem::path folder_;
  std::vector<std::filesystem::path> made_;  // folders made here, outermost first
  std::vector<Entry> entries_;
  std::vector<std::string> kept_;
};

// From now on Ctrl-C, SIGTERM and SIGHUP end the program only after what the OutputSets have not
// committed is gone. Call once, before any other thread starts.
void clean_up_on_signals();

// For work that a signal ends in order (a recording, a simulation): after this call the first such
// signal only sets the flag, and a second one ends the program as before.
const std::atomic<bool>& stop_flag_for_signals();

// The whole of a text or image file; refuses what is missing, no file, empty, or above max_bytes.
std::string read_file(const std::string& path, size_t max_bytes);

// Writes to stdout and flushes. A reader that has gone away is no failure; a full disk is.
void print(std::string_view text);

// A line of a summary, its name in a column of its own.
template <class... T>
std::string summary_line(const char* name, const char* format, T... values) {
  char head[32], text[512];
  std::snprintf(head, sizeof head, "%-13s", name);
  std::snprintf(text, sizeof text, format, values...);
  return head + std::string(text) + "\n";
}

}  // namespace cli
