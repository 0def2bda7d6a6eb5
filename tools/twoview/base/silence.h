// Keeps libraries that print messages off stderr, on which the program prints one clear line only.
#pragma once

namespace cli {

// During the lifetime of this object stderr (file descriptor 2) is discarded.
class StderrSilence {
 public:
  StderrSilence();
  ~StderrSilence();
  StderrSilence(const StderrSilence&) = delete;
  StderrSilence& operator=(const StderrSilence&) = delete;

 private:
  int saved_;
};

}  // namespace cli
