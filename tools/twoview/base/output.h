// Output files that appear complete or not at all and are removed on a signal; printing to stdout;
// and reading a whole file.
#pragma once

#include <atomic>
#include <cstdio>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace cli {

// A set of output files for one folder. Each file is written under a temporary name beside its
// target, and commit() renames them all. Without commit() these files and the folders that this set
// made are removed. An existing target that is no regular file (a device, a pipe) is written to
// directly. Every failure throws BadInput.
class OutputSet {
 public:
  // Creates the folder if it does not exist, and checks that it is writable.
  explicit OutputSet(const std::filesystem::path& folder);
  ~OutputSet();
  OutputSet(const OutputSet&) = delete;
  OutputSet& operator=(const OutputSet&) = delete;

  // Protects an input file of the run: add() refuses to overwrite it, and remove_others() does not
  // delete it.
  void keep(const std::string& input);

  // Whether this name in the folder is a file that keep() protects.
  bool is_input(const std::string& name) const { return is_kept(folder_ / name); }

  // Refuses a folder that holds something else's results: throws BadInput where one of these names,
  // which the verb may write or delete, is there, but the files that every run of the verb leaves
  // are not, or one is there that none of its runs leaves. So a verb replaces its own earlier
  // results and nothing else. Call it before the work.
  struct Own {
    const char* verb;
    std::vector<std::string> names, always, never;
  };
  void require_own(const Own& own) const;

  void add(const std::string& name, std::string_view bytes);
  void commit();

  // Deletes the files of an earlier run: those of `names` in the folder that this set does not
  // contain.
  void remove_others(const std::vector<std::string>& names) const;

  const std::filesystem::path& folder() const { return folder_; }
  std::vector<std::string> names() const;

 private:
  friend void clean_up_on_signals();
  struct Entry {
    std::string name;
    std::filesystem::path temporary;  // path; empty: the target was written directly
  };
  bool is_kept(const std::filesystem::path& path) const;
  void discard() noexcept;
  void make_folder();

  std::filesystem::path folder_;
  std::vector<std::filesystem::path> made_;  // created folders, outermost first
  std::vector<Entry> entries_;
  std::vector<std::string> kept_;
};

// After this call Ctrl-C, SIGTERM and SIGHUP first remove the files that no OutputSet has
// committed, and then end the program. Call it once, before any other thread starts.
void clean_up_on_signals();

// For work that must end properly on a signal (a recording, a simulation). After this call the
// first such signal only sets the returned flag, and a second one ends the program.
const std::atomic<bool>& stop_flag_for_signals();
// Clears the flag, for the next part of the work, which the next signal shall end properly as well.
void clear_stop_flag();

// Sets what is called when a signal ends the program, such as to give the terminal its mode back;
// null: nothing.
void call_at_last_signal(void (*function)());

// Reads a whole text or image file, or a pipe to its end. Throws BadInput if it is missing, of
// another kind, empty, or larger than max_bytes.
std::string read_file(const std::string& path, size_t max_bytes);

// Writes to stdout at once, without a buffer. A closed pipe is not an error; a full disk is.
void print(std::string_view text);

// Returns a line of a summary, with its name in a column of fixed width.
template <class... T>
std::string summary_line(const char* name, const char* format, T... values) {
  char head[32];
  std::snprintf(head, sizeof head, "%-13s", name);
  const int length = std::snprintf(nullptr, 0, format, values...);  // a note may be long
  std::string text(static_cast<size_t>(length > 0 ? length : 0), '\0');
  std::snprintf(text.data(), text.size() + 1, format, values...);
  return head + text + "\n";
}

}  // namespace cli
