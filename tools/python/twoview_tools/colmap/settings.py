"""The stages' options as flags, by the names of docs/formats.md, and the stages run with them."""

import dataclasses

import twoview as tv

_CHOICES = {"orientation": tv.Orientation, "descriptor": tv.Normalisation, "method": tv.Solver}
_KINDS = (tv.FeatureOptions, tv.MatchOptions, tv.EstimateOptions)
# For a mapper, which has time and gains by long tracks: as many as COLMAP's own extractor (docs/colmap.md).
MAPPING_KEYPOINTS = 8192
# For a database, whose pairs share its cameras: a pair's geometry is of those, none is moved for one pair.
PRINCIPAL_POINT_SIGMA_OF_A_DATABASE = 0.0
# What is automatic in the library is a number and a word here, as in the C++ program.
_EXPLICIT = {"max_keypoints": 2048, "method": tv.Solver.FIVE_POINT}
_NOT_HERE = ("gravity0", "gravity1", "gravity_sigma_rad")


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
    """A flag for each field of the options; defaults: those that are not the library's."""
    group = parser.add_argument_group("options of the stages (docs/cli.md)")
    for kind in kinds:
        for field in dataclasses.fields(kind):
            if field.name in _NOT_HERE:
                continue
            flag = "--" + field.name.replace("_", "-")
            default = defaults.get(field.name, _EXPLICIT.get(field.name, field.default))
            if field.name in _CHOICES:
                enum = _CHOICES[field.name]
                group.add_argument(flag, type=_choice(enum), default=enum(default),
                                   metavar="|".join(_words(enum)), help=_spelt(enum(default)))
            else:
                number = int if default is None else type(default)
                group.add_argument(flag, type=number, default=default,
                                   metavar="N" if number is int else "X",
                                   help="the library's" if default is None else f"{default:g}")


def options_of(arguments, kind):
    """The options object that the flags name."""
    return kind(**{field.name: getattr(arguments, field.name) for field in dataclasses.fields(kind)
                   if hasattr(arguments, field.name)})
