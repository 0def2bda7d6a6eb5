"""Bags of ROS 1, ROS 2 and MCAP files: `twoview import` reads them, `twoview export` writes them.

| module | what |
| --- | --- |
| storage | opens a file or folder of any of the formats and gives its raw messages in a stream |
| messages | the types that are read, and their decoding by rosbags |
| pictures | Image and CompressedImage as the bytes of an image file |
| frames | tf_static: how one frame is turned and placed in another |
| importer | a bag to a set folder (docs/formats.md) |
| exporter | what `twoview odometry` wrote to a bag |
| cli | both verbs |

The packages rosbags and mcap are optional: scripts/requirements-bags.txt names them.
"""


class BadInput(Exception):
    """Input that is refused, in one line."""


def counted(number, noun):
    """1 message, 2 messages."""
    return f"{number} {noun}{'' if number == 1 else 's'}"
