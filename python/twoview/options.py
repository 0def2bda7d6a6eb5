"""Options of the stages, with the C defaults. A function takes either one of these or its fields as
keywords: twoview.detect(context, image, arc=12)."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Optional, Sequence

from . import _abi
from .enums import Loss, Normalisation, Orientation, Solver


@dataclass(frozen=True)
class FeatureOptions:
    """tv_feature_options."""

    max_keypoints: int = 0  #: bound on descriptors an image; 0: 2048 or the context's, the lesser
    arc: int = 9  #: contiguous circle pixels, 9 to 12
    threshold: int = 10  #: grey levels, [1, 254]
    min_threshold: int = 3  #: the threshold falls as far as this; 0: it is fixed
    levels: int = 1  #: pyramid levels, [1, 8]
    scale_factor: float = 2.0  #: between levels, [1.1, 2]
    cell_px: int = 0  #: grid cell in which corners are budgeted, pixels; 0: the best anywhere
    subpixel: int = 1  #: 1: positions below a pixel
    orientation: int = Orientation.GRADIENT
    descriptor: int = Normalisation.ROOTSIFT
    keypoint_size: float = 4.0  #: diameter, pixels


@dataclass(frozen=True)
class MatchOptions:
    """tv_match_options."""

    ratio: float = 0.92  #: nearest / second nearest distance, both directions below it


@dataclass(frozen=True)
class GuidedOptions:
    """tv_guided_options."""

    max_error_px: float = 4.0  #: half the band's width
    ratio: float = 0.87
    max_distance: float = 180.0  #: L2 distance of descriptors
    neighbourhood_px: float = 4.0


@dataclass(frozen=True)
class EstimateOptions:
    """tv_estimate_options."""

    method: int = Solver.AUTO  #: five-point with cameras, eight-point without
    max_error_px: float = 1.0  #: inlier threshold, pixels of the images as given
    confidence: float = 0.9999
    max_iterations: int = 10000
    fixed_iterations: int = 0  #: 0: adaptive stop
    seed: Optional[int] = None  #: None: the library's constant
    gravity0: Sequence[float] = (0.0, 0.0, 0.0)  #: "down" in camera 0
    gravity1: Sequence[float] = (0.0, 0.0, 0.0)
    gravity_sigma_rad: float = 0.0  #: 0: gravity is not known
    principal_point_sigma: float = 0.01  #: in focal lengths; 0: exactly where the cameras say


@dataclass(frozen=True)
class BundleOptions:
    """tv_bundle_options."""

    loss: int = Loss.CAUCHY
    loss_scale_px: float = 1.0
    max_iterations: int = 50
    hold_pose: int = 0


_STRUCTS = {FeatureOptions: _abi.tv_feature_options, MatchOptions: _abi.tv_match_options,
            GuidedOptions: _abi.tv_guided_options, EstimateOptions: _abi.tv_estimate_options,
            BundleOptions: _abi.tv_bundle_options}


def to_struct(library: _abi.Library, kind: type, options: Any, keywords: dict[str, Any]) -> Any:
    """The C struct of an options object, or of keywords."""
    if options is not None and keywords:
        raise TypeError("options are given as an object or as keywords, not both")
    if options is None:
        options = kind(**keywords)
    if not isinstance(options, kind):
        raise TypeError(f"options: {kind.__name__} is expected, not {type(options).__name__}")
    given = {f.name: getattr(options, f.name) for f in fields(options)}
    return library.make(_STRUCTS[kind], {k: v for k, v in given.items() if v is not None})
