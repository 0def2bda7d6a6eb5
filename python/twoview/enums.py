"""The enums and statuses of the C API. The headers in lib/include/twoview/ describe each value."""

from enum import IntEnum, IntFlag


class Status(IntEnum):
    """tv_status; the names are those of C without TV_."""

    OK = 0
    ERR_NULL = 1
    ERR_ARGUMENT = 2
    ERR_NOT_FINITE = 3
    ERR_STRUCT_SIZE = 4
    ERR_ALIGNMENT = 5
    ERR_MEMORY = 6
    ERR_LIMITS = 7
    ERR_CAPACITY = 8
    ERR_OVERLAP = 9
    ERR_CAMERA = 10
    ERR_OUTSIDE = 11
    ERR_KERNELS = 12
    ERR_MAP = 13
    ERR_TIME = 14
    ERR_STRIDE = 15
    ERR_MASK = 16
    ERR_EFFORT = 17


class Kernels(IntEnum):
    AUTO = 0
    C = 1
    SSE2 = 2
    AVX2 = 3
    AVX512 = 4
    NEON = 5


class Purpose(IntFlag):
    EXTRACT = 1 << 0
    MATCH = 1 << 1
    ESTIMATE = 1 << 2
    RECONSTRUCT = 1 << 3 | 7
    MATCH_GUIDED = 1 << 4
    ADJUST = 1 << 5
    ABSOLUTE_POSE = 1 << 6


class Stage(IntEnum):
    PYRAMID = 0
    DETECT = 1
    DESCRIBE = 2
    MATCH = 3
    ESTIMATE = 4
    REFINE = 5
    TRIANGULATE = 6


class Orientation(IntEnum):
    UPRIGHT = 0
    GRADIENT = 1


class Normalisation(IntEnum):
    SIFT = 0
    ROOTSIFT = 1


class CameraModel(IntEnum):
    PINHOLE = 0
    BROWN_CONRADY = 1
    KANNALA_BRANDT = 2


class Refine(IntFlag):
    """tv_refine: what of a given camera may be refined."""

    NOTHING = 0
    FOCAL_LENGTH = 1 << 0
    PRINCIPAL_POINT = 1 << 1


class Solver(IntEnum):
    AUTO = 0
    FIVE_POINT = 1
    EIGHT_POINT = 2
    SEVEN_POINT = 3
    UPRIGHT = 4


class Kind(IntEnum):
    DEGENERATE = 0
    CALIBRATED = 1
    UNCALIBRATED = 2
    PLANAR = 3
    PANORAMIC = 4
    PLANAR_OR_PANORAMIC = 5
    NO_MOTION = 6


class Verdict(IntEnum):
    REFUSED = 0
    DOUBTFUL = 1
    OK = 2


class Reason(IntFlag):
    TOO_FEW_MATCHES = 1 << 0
    LOW_INLIER_RATIO = 1 << 1
    LOW_PARALLAX = 1 << 2
    TWO_PLANAR_SOLUTIONS = 1 << 3
    PURE_ROTATION = 1 << 4
    NO_MOTION = 1 << 5
    SECOND_MOTION = 1 << 6
    CROWDED_MATCHES = 1 << 7
    REPEATED_STRUCTURE = 1 << 8
    CAMERA_CONTRADICTED = 1 << 9


class Triangulation(IntEnum):
    POLY = 0
    POLY_ABS = 1
    LINEAR_EIGEN = 2
    LINEAR_LS = 3
    ITERATIVE_EIGEN = 4
    ITERATIVE_LS = 5
    MIDPOINT = 6


class PointStatus(IntEnum):
    OK = 0
    INFINITE = 1
    BEHIND = 2
    INVALID = 3


class Loss(IntEnum):
    NONE = 0
    HUBER = 1
    CAUCHY = 2


class OdometryStatus(IntEnum):
    STARTING = 0
    TRACKING = 1
    WEAK = 2
    ROTATION = 3
    LOST = 4


class PathOrigin(IntEnum):
    UNKNOWN = 0
    TRACKED = 1
    TURNED = 2
    LOCATED = 3


class MapReason(IntFlag):
    UNCONFIRMED = 1 << 0
    CONTRADICTED = 1 << 1
    ONE_PLANE = 1 << 2
    JUMPED = 1 << 3
    UNSURE_ATTITUDE = 1 << 4
    VELOCITIES_DISAGREE = 1 << 5


class ScaleSource(IntEnum):
    UNIT = 0
    HEIGHT = 1
    VELOCITY = 2
    HEIGHT_AND_VELOCITY = 3


class RoomPlaneKind(IntEnum):
    OTHER = 0
    UPRIGHT = 1
    LEVEL = 2


# {enum: the prefix of its values' names in C}.
C_PREFIXES = {
    Status: "TV_", Kernels: "TV_KERNELS_", Stage: "TV_STAGE_", Purpose: "TV_PURPOSE_",
    Orientation: "TV_ORIENTATION_", Normalisation: "TV_NORMALISATION_",
    CameraModel: "TV_CAMERA_", Refine: "TV_REFINE_", Solver: "TV_SOLVER_", Kind: "TV_KIND_",
    Verdict: "TV_VERDICT_",
    Reason: "TV_REASON_",
    Triangulation: "TV_TRIANGULATION_", PointStatus: "TV_POINT_", Loss: "TV_LOSS_",
    OdometryStatus: "TV_ODOMETRY_", ScaleSource: "TV_SCALE_",
    MapReason: "TV_MAP_REASON_", PathOrigin: "TV_PATH_",
    RoomPlaneKind: "TV_ROOM_PLANE_",
}
