#include "sources/decoder_errors.h"

extern "C" {
#include <libavutil/log.h>
}

#include <cstdarg>
#include <cstdio>
#include <mutex>

namespace cli {
namespace {

struct Heard {
  std::mutex mutex;  // decoders have threads
  DecoderErrors errors;
};

Heard& heard() {
  static Heard all;
  return all;
}

bool is_decoder(void* speaker) {
  if (speaker == nullptr) return false;
  const AVClass* const kind = *static_cast<AVClass**>(speaker);
  if (kind == nullptr) return false;
  const AVClassCategory category =
      kind->get_category != nullptr ? kind->get_category(speaker) : kind->category;
  return category == AV_CLASS_CATEGORY_DECODER;
}

void listen(void* speaker, int level, const char* format, va_list arguments) {
  if (level > AV_LOG_ERROR || !is_decoder(speaker)) return;
  char text[120];
  std::vsnprintf(text, sizeof text, format, arguments);
  const std::lock_guard<std::mutex> lock(heard().mutex);
  DecoderErrors& errors = heard().errors;
  if (errors.num++ > 0) return;
  errors.first = text;
  while (!errors.first.empty() && (errors.first.back() == '\n' || errors.first.back() == ' '))
    errors.first.pop_back();
}

}  // namespace

void listen_to_decoders() {
  {
    const std::lock_guard<std::mutex> lock(heard().mutex);
    heard().errors = {};
  }
  av_log_set_callback(listen);
}

DecoderErrors decoder_errors() {
  const std::lock_guard<std::mutex> lock(heard().mutex);
  return heard().errors;
}

}  // namespace cli
