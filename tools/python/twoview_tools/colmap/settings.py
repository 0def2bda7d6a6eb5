"""The options of the stages as command-line flags, with the names of docs/formats.md."""

import dataclasses

import twoview as tv

_CHOICES = {"orientation": tv.Orientation, "descriptor": tv.Normalisation, "method": tv.Solver}
_KINDS = (tv.FeatureOptions, tv.MatchOptions, tv.EstimateOptions)
# The default for a mapper, which is not time-critical and benefits from long tracks: as many
# keypoints as COLMAP's own extractor (docs/colmap.md).
MAPPING_KEYPOINTS = 8192
# Defaults that are automatic in the library have explicit values here, as in the C++ program.
_EXPLICIT = {"max_keypoints": 2048, "method": tv.Solver.FIVE_POINT}
# The flags of the two calibrations. The principal point of one camera that took both images may be
# moved where its deviation, which then replaces those of both calibrations, is not 0.
_CALIBRATIONS = ("principal_point_sigma", "focal_sigma0", "focal_sigma1", "center_sigma0",
                 "center_sigma1")
# Where the camera says how uncertain it is: the flags have no number of their own as their default.
SIGMAS_OF_THE_CAMERA = dict.fromkeys(_CALIBRATIONS[1:])
_FROM_CAMERA = "that of the camera"
# --effort: the rung to begin with, and the highest one, of tv_reconstruct_options.
EFFORTS = {"fixed": (0, 0), "auto": (0, 3), **{str(rung): (rung, rung) for rung in range(4)}}
_NOT_HERE = ("gravity0", "gravity1", "gravity_sigma_rad", "calibration1")
_EXACT = (tv.Calibration(),) * 2


def _spelt(value):
    return value.name.lower().replace("_", "-")


def _words(enum):
    return [_spelt(value) for value in enum if value is not tv.Solver.AUTO]


def _choice(enum):
    def convert(text):
        for value in enum:
            if _spelt(value) == text and text in _words(enum):
                return value
        raise ValueError
    convert.__name__ = " or ".join(_words(enum))
    return convert


def add_options(parser, kinds=_KINDS, **defaults):
    """Adds a flag for each field of the options, except those of gravity.
    `defaults` are those that differ from the library's."""
    group = parser.add_argument_group("options of the stages (docs/cli.md)")
    for kind in kinds:
        for field in dataclasses.fields(kind):
            if field.name in _NOT_HERE:
                continue
            if field.name == "calibration0":
                for name in _CALIBRATIONS:
                    default = defaults.get(name, 0.0)
                    group.add_argument("--" + name.replace("_", "-"), type=float, default=default,
                                       metavar="X",
                                       help=_FROM_CAMERA if default is None else f"{default:g}")
                continue
            flag = "--" + field.name.replace("_", "-")
            default = defaults.get(field.name, _EXPLICIT.get(field.name, field.default))
            is_flag = isinstance(field.default, bool)  # 0 or 1 on the command line
            default = int(default) if is_flag else default
            if field.name in _CHOICES:
                enum = _CHOICES[field.name]
                group.add_argument(flag, type=_choice(enum), default=enum(default),
                                   metavar="|".join(_words(enum)), help=_spelt(enum(default)))
            else:
                number = int if field.default is None or is_flag else type(field.default)
                group.add_argument(flag, type=number, default=default,
                                   metavar="N" if number is int else "X",
                                   help="the library's" if field.default is None else
                                   _FROM_CAMERA if default is None else f"{default:g}")


def options_of(arguments, kind):
    """Makes an options object of class `kind` from the values of the command line's flags."""
    values = {field.name: getattr(arguments, field.name) for field in dataclasses.fields(kind)
              if getattr(arguments, field.name, None) is not None}
    if kind is tv.EstimateOptions:
        values.update(calibrations_of(arguments))
    return kind(**values)


def calibrations_of(arguments, known=_EXACT):
    """The two calibrations of EstimateOptions, {name: value}: the standard deviations that the
    command line gives, else those of `known`, a Calibration for each camera. Focal lengths may be
    refined where they are uncertain."""
    found, moving = {}, arguments.principal_point_sigma
    for i, calibration in enumerate(known):
        parts = {"refine": tv.Refine.FOCAL_LENGTH}
        for part in ("focal_sigma", "center_sigma"):
            choices = (getattr(arguments, f"{part}{i}"), getattr(arguments, part, None),
                       getattr(calibration, part))
            parts[part] = next(x for x in choices if x is not None)
        if moving != 0:
            parts["refine"] |= tv.Refine.PRINCIPAL_POINT
            parts["center_sigma"] = moving
        found[f"calibration{i}"] = tv.Calibration(**parts)
    return found
