// The focal length that a photograph's EXIF data hold. libexif parses them.
#pragma once

#include <string_view>

namespace cli {

// The focal length as for 35 mm film, in millimetres, from the EXIF data of a JPEG or PNG file;
// 0 where there is none. It is FocalLengthIn35mmFilm, else FocalLength over the size of the sensor
// that FocalPlaneXResolution and FocalPlaneYResolution give. 0, too, where the picture was cropped:
// where its sides are not in the ratio of PixelXDimension and PixelYDimension, to one per cent.
// It never fails.
double exif_focal_35mm(std::string_view bytes, int width, int height);

}  // namespace cli
