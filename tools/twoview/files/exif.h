// What a photograph's EXIF data hold: its focal length, and how it is to be turned. libexif parses
// them.
#pragma once

#include <string>
#include <string_view>

namespace cli {

// The focal length as for 35 mm film, in millimetres, or 0, and then why there is none.
struct ExifFocal {
  double focal_35mm = 0;
  double sigma = 0;  // relative standard deviation
  // Each continues "The picture ...": why there is none, such as "has no focal length in EXIF
  // data"; why it is less certain than others; what was assumed of the picture's size.
  std::string gap = "", doubt = "", assumed = "";
};

// The focal length from the EXIF data of a JPEG or PNG file. It is FocalLengthIn35mmFilm, else
// FocalLength over the size of the sensor that FocalPlaneXResolution and FocalPlaneYResolution
// give. Where the two differ by more than 10 per cent, or may lack a DigitalZoomRatio, it is the
// middle of all that they may mean, and sigma reaches to the ends. There is none where the ends are
// more than a factor of 2.7 apart, and where the picture was cropped: where its sides are not in
// the ratio of PixelXDimension and PixelYDimension, to one per cent. It never fails.
ExifFocal exif_focal(std::string_view bytes, int width, int height);

// The option that stands in for a camera, with its number where the EXIF data have it:
// "--focal-35mm" or, where they leave no doubt, "--focal-35mm 26 (by EXIF)".
std::string focal_option(const ExifFocal& exif);

// By how many degrees a viewer turns the picture clockwise, as EXIF's Orientation says: 0, 90, 180
// or 270; 0 where it is not said. It never fails.
int exif_turn_deg(std::string_view bytes);

// When the picture was taken: DateTimeOriginal with SubSecTimeOriginal, in seconds of a calendar
// whose zero has no meaning; 0 where it is not said. It never fails.
double exif_time_s(std::string_view bytes);

}  // namespace cli
