// Why not OpenCV: 4.6 (Debian 12) turns a film of 90 degrees to the wrong side and names the turn
// 90 where 5.0 says 270, and 5.0.0.93 says 25 pictures a second for every raw H.264 stream
// (measured 2026-11-29). libavformat is what OpenCV itself reads films with.

#include "sources/film_container.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/display.h>
#include <libavutil/spherical.h>
#include <libavutil/stereo3d.h>
}

#include <algorithm>
#include <cmath>
#include <fstream>
#include <memory>

#include "base/error.h"

namespace cli {
namespace {

struct Close {
  void operator()(AVFormatContext* film) const { avformat_close_input(&film); }
};
using Open = std::unique_ptr<AVFormatContext, Close>;

// Data of this type that the container stores with the stream; null where there is none, or less
// than T takes.
template <class T>
const T* side_data(const AVStream& stream, AVPacketSideDataType type, size_t count = 1) {
#if LIBAVFORMAT_VERSION_MAJOR >= 61
  const AVPacketSideData* const found = av_packet_side_data_get(
      stream.codecpar->coded_side_data, stream.codecpar->nb_coded_side_data, type);
  const uint8_t* const data = found != nullptr ? found->data : nullptr;
  const size_t size = found != nullptr ? found->size : 0;
#else
  size_t size = 0;
  const uint8_t* const data = av_stream_get_side_data(&stream, type, &size);
#endif
  return size >= count * sizeof(T) ? reinterpret_cast<const T*>(data) : nullptr;
}

double seconds(int64_t time, AVRational unit) {
  return time == AV_NOPTS_VALUE ? 0 : static_cast<double>(time) * av_q2d(unit);
}

double positive(AVRational ratio) { return ratio.num > 0 && ratio.den > 0 ? av_q2d(ratio) : 0; }

// The turn of a display matrix, which maps (x, y) to (a x + c y, b x + d y), y down. A mirror is
// taken as one of x, before the turn.
void add_turn(const int32_t* matrix, FilmContainer& film) {
  double a = matrix[0], b = matrix[1];
  const double c = matrix[3], d = matrix[4];
  film.is_mirrored = a * d - b * c < 0;
  if (film.is_mirrored) a = -a, b = -b;
  const double degrees = std::atan2(b, a) * 57.29577951308232;
  film.turn_deg = std::fmod(degrees + 360, 360);
}

// Whether the pictures hold those of two eyes, or are one eye's and the other's in turn.
bool is_packed(AVStereo3DType type) {
  switch (type) {
    case AV_STEREO3D_SIDEBYSIDE:
    case AV_STEREO3D_TOPBOTTOM:
    case AV_STEREO3D_FRAMESEQUENCE:
    case AV_STEREO3D_CHECKERBOARD:
    case AV_STEREO3D_SIDEBYSIDE_QUINCUNX:
    case AV_STEREO3D_LINES:
    case AV_STEREO3D_COLUMNS: return true;
    default: return false;
  }
}

const std::string kPdf = "a PDF document";

// The kind of archive or document that the first bytes of a file show; empty for other files.
std::string archive_kind(const std::string& path) {
  constexpr size_t kTarMark = 257;
  std::string head(512, '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(head.data(), static_cast<std::streamsize>(head.size()));
  const auto begins = [&](const char* mark) { return head.rfind(mark, 0) == 0; };
  if (begins("PK\3\4") || begins("PK\5\6")) return "a ZIP archive";
  if (begins("7z\xbc\xaf\x27\x1c")) return "a 7z archive";
  if (begins("Rar!\x1a\x07")) return "a RAR archive";
  if (begins("\x1f\x8b")) return "a gzip archive";
  if (begins("BZh")) return "a bzip2 archive";
  if (begins("\xfd"
             "7zXZ"))
    return "an xz archive";
  if (head.compare(kTarMark, 5, "ustar") == 0) return "a tar archive";
  return begins("%PDF") ? kPdf : "";
}

Open open_film_file(const std::string& path) {
  av_log_set_level(AV_LOG_QUIET);  // the program prints one line of its own
  AVFormatContext* opened = nullptr;
  // The prefix keeps a name such as "a:b.mp4" from being taken for an address.
  if (avformat_open_input(&opened, ("file:" + path).c_str(), nullptr, nullptr) != 0)
    throw BadInput("cannot read " + path +
                   ": it is no film that can be read, or is cut off: record or copy "
                   "it again");
  Open film(opened);
  if (avformat_find_stream_info(film.get(), nullptr) < 0)
    throw BadInput("cannot read " + path + ": its streams cannot be read");
  return film;
}

bool is_pictures(const AVStream& stream) {
  return stream.codecpar->codec_type == AVMEDIA_TYPE_VIDEO &&
         (stream.disposition & AV_DISPOSITION_ATTACHED_PIC) == 0;
}

const AVStream* first_pictures(const AVFormatContext& film) {
  for (unsigned i = 0; i < film.nb_streams; ++i)
    if (is_pictures(*film.streams[i])) return film.streams[i];
  return nullptr;
}

// Gives the packets of the stream one by one until `use` returns false.
template <class Use>
void read_packets(AVFormatContext& film, const AVStream& pictures, const Use& use) {
  AVPacket* packet = av_packet_alloc();
  bool goes_on = packet != nullptr;
  while (goes_on && av_read_frame(&film, packet) >= 0) {
    if (packet->stream_index == pictures.index) goes_on = use(*packet);
    av_packet_unref(packet);
  }
  av_packet_free(&packet);
}

int64_t time_of(const AVPacket& packet) {
  return packet.pts != AV_NOPTS_VALUE ? packet.pts : packet.dts;
}

// Whether the first packet of the stream has a time: those of a raw stream have none, or (MPEG-2)
// only times of decoding that libavformat counts itself.
bool has_times(AVFormatContext& film, const AVStream& pictures) {
  const bool may_count = (film.iformat->flags & AVFMT_GENERIC_INDEX) != 0;
  bool has_time = false;
  read_packets(film, pictures, [&](const AVPacket& packet) {
    has_time = (may_count ? packet.pts : time_of(packet)) != AV_NOPTS_VALUE;
    return false;
  });
  return has_time;
}

}  // namespace

FilmContainer read_film_container(const std::string& path) {
  if (const std::string kind = archive_kind(path); !kind.empty())
    throw BadInput(path + " is " + kind + ", and no film: " +
                   (kind == kPdf ? "take its pictures out (pdfimages -all FILE frames/x), and give "
                                   "their folder with --fps"
                                 : "unpack it, and give the folder of its pictures, or the film"));
  const Open film = open_film_file(path);
  FilmContainer result;
  AVStream* pictures = nullptr;
  for (unsigned i = 0; i < film->nb_streams; ++i) {
    AVStream* const stream = film->streams[i];
    result.has_sound = result.has_sound || stream->codecpar->codec_type == AVMEDIA_TYPE_AUDIO;
    if (!is_pictures(*stream)) continue;
    if (++result.num_picture_streams == 1) pictures = stream;  // the one that OpenCV decodes
  }
  if (pictures == nullptr) return result;
  result.has_pictures = true;
  result.width = pictures->codecpar->width;
  result.height = pictures->codecpar->height;
  result.num_pictures = std::max<int64_t>(0, pictures->nb_frames);
  // For a raw stream, and for JPEG pictures in a zip, which libavformat takes for a raw stream,
  // libavformat may invent times by counting.
  const bool is_raw = (film->iformat->flags & AVFMT_NOTIMESTAMPS) != 0;
  result.has_clock = !is_raw && has_times(*film, *pictures);
  result.rate_hz = positive(pictures->avg_frame_rate);
  if (!(result.rate_hz > 0)) result.rate_hz = positive(pictures->r_frame_rate);
  result.clock_start_s = seconds(pictures->start_time, pictures->time_base);
  result.duration_s = seconds(pictures->duration, pictures->time_base);
  const double aspect = positive(av_guess_sample_aspect_ratio(film.get(), pictures, nullptr));
  if (aspect > 0) result.pixel_aspect = aspect;
  const AVFieldOrder order = pictures->codecpar->field_order;
  result.is_interlaced = order != AV_FIELD_UNKNOWN && order != AV_FIELD_PROGRESSIVE;
  if (const auto* const matrix = side_data<int32_t>(*pictures, AV_PKT_DATA_DISPLAYMATRIX, 9))
    add_turn(matrix, result);
  if (const auto* const sphere = side_data<AVSphericalMapping>(*pictures, AV_PKT_DATA_SPHERICAL))
    result.projection = av_spherical_projection_name(sphere->projection);
  // Newer versions know a rectilinear projection, which is a flat view.
  if (result.projection == "rectilinear") result.projection.clear();
  if (const auto* const stereo = side_data<AVStereo3D>(*pictures, AV_PKT_DATA_STEREO3D))
    if (is_packed(stereo->type)) result.eyes = av_stereo3d_type_name(stereo->type);
  return result;
}

std::vector<double> picture_times(const std::string& path) {
  const Open film = open_film_file(path);
  const AVStream* const pictures = first_pictures(*film);
  std::vector<double> times;
  if (pictures == nullptr) return times;
  const int64_t start = pictures->start_time == AV_NOPTS_VALUE ? 0 : pictures->start_time;
  read_packets(*film, *pictures, [&](const AVPacket& packet) {
    const int64_t time = time_of(packet);
    if (time != AV_NOPTS_VALUE && (packet.flags & AV_PKT_FLAG_DISCARD) == 0)
      times.push_back(seconds(time - start, pictures->time_base));
    return true;
  });
  std::sort(times.begin(), times.end());
  return times;
}

namespace {

struct Free {
  void operator()(AVCodecContext* decoder) const { avcodec_free_context(&decoder); }
  void operator()(AVPacket* packet) const { av_packet_free(&packet); }
  void operator()(AVFrame* frame) const { av_frame_free(&frame); }
};

// What this decoder reports is no error of the film: it is given key frames without what follows.
constexpr int kSilent = 1000;

std::unique_ptr<AVCodecContext, Free> decoder_of(const AVStream& pictures) {
  const AVCodec* const codec = avcodec_find_decoder(pictures.codecpar->codec_id);
  std::unique_ptr<AVCodecContext, Free> decoder(avcodec_alloc_context3(codec));
  if (codec == nullptr || decoder == nullptr ||
      avcodec_parameters_to_context(decoder.get(), pictures.codecpar) < 0)
    return nullptr;
  decoder->log_level_offset = kSilent;
  decoder->thread_count = 1;  // a thread each for pictures that come one at a time is of no use
  return avcodec_open2(decoder.get(), codec, nullptr) == 0 ? std::move(decoder) : nullptr;
}

}  // namespace

struct FilmPackets::State {
  Open film;
  const AVStream* pictures = nullptr;
  std::unique_ptr<AVPacket, Free> packet{av_packet_alloc()};
  std::unique_ptr<AVFrame, Free> frame{av_frame_alloc()};
  std::unique_ptr<AVCodecContext, Free> decoder;
  int64_t num = 0, num_damaged = 0;
  double time_s = 0;
  int width = 0, height = 0;

  void take_packet();
  void measure_key_frame();
};

void FilmPackets::State::take_packet() {
  ++num;
  num_damaged += (packet->flags & AV_PKT_FLAG_CORRUPT) != 0;
  if (const int64_t time = time_of(*packet); time != AV_NOPTS_VALUE) {
    const int64_t start = pictures->start_time == AV_NOPTS_VALUE ? 0 : pictures->start_time;
    time_s = seconds(time - start, pictures->time_base);
  }
  if (decoder != nullptr && (packet->flags & AV_PKT_FLAG_KEY) != 0) measure_key_frame();
}

void FilmPackets::State::measure_key_frame() {
  avcodec_flush_buffers(decoder.get());
  if (avcodec_send_packet(decoder.get(), packet.get()) < 0) return;
  avcodec_send_packet(decoder.get(), nullptr);  // it holds nothing back
  if (avcodec_receive_frame(decoder.get(), frame.get()) < 0) return;
  width = frame->width;
  height = frame->height;
}

FilmPackets::FilmPackets(const std::string& path) : state_(std::make_unique<State>()) {
  state_->film = open_film_file(path);
  state_->pictures = first_pictures(*state_->film);
  if (state_->pictures != nullptr) state_->decoder = decoder_of(*state_->pictures);
}

FilmPackets::~FilmPackets() = default;

bool FilmPackets::next() {
  State& s = *state_;
  if (s.pictures == nullptr) return false;
  while (av_read_frame(s.film.get(), s.packet.get()) >= 0) {
    const bool is_own = s.packet->stream_index == s.pictures->index;
    if (is_own) s.take_packet();
    av_packet_unref(s.packet.get());
    if (is_own) return true;
  }
  return false;
}

int64_t FilmPackets::num() const { return state_->num; }
int64_t FilmPackets::num_damaged() const { return state_->num_damaged; }
double FilmPackets::time_s() const { return state_->time_s; }
int FilmPackets::width() const { return state_->width; }
int FilmPackets::height() const { return state_->height; }

}  // namespace cli
