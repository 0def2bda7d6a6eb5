"""Runs COLMAP's mapper on a database, with pycolmap (4) or Debian's `colmap` (3.8), and makes
COLMAP's own features."""

import os
import pathlib
import shutil
import subprocess

from .conventions import camera_to_colmap
from .errors import BadInput, need_pycolmap

def _run_colmap(verb, *arguments):
    program = shutil.which("colmap")
    if not program:
        raise BadInput("no colmap in the PATH (apt install colmap)")
    done = subprocess.run(
        [program, verb, *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "QT_QPA_PLATFORM": "offscreen"},
    )
    if done.returncode:
        last = (done.stderr or done.stdout).strip().split("\n")[-1]
        raise BadInput(f"colmap {verb}: status {done.returncode}: {last}")


def own_features_38(database, images, camera):
    row = camera_to_colmap(camera)
    _run_colmap("feature_extractor", "--database_path", database, "--image_path", images,
                "--ImageReader.single_camera", 1, "--ImageReader.camera_model", row.model,
                "--ImageReader.camera_params", ",".join(map(repr, row.params)),
                "--SiftExtraction.use_gpu", 0, "--SiftExtraction.num_threads", 1)
    _run_colmap("exhaustive_matcher", "--database_path", database, "--SiftMatching.use_gpu", 0,
                "--SiftMatching.num_threads", 1)


def own_features_4(database, images, camera):
    colmap = need_pycolmap("COLMAP 4's features")
    row = camera_to_colmap(camera)
    reader = colmap.ImageReaderOptions(
        camera_model=row.model, camera_params=",".join(map(repr, row.params))
    )
    extraction, matching = colmap.FeatureExtractionOptions(), colmap.FeatureMatchingOptions()
    extraction.num_threads = matching.num_threads = 1
    extraction.use_gpu = matching.use_gpu = False
    colmap.set_random_seed(1)
    colmap.extract_features(
        database,
        images,
        camera_mode=colmap.CameraMode.SINGLE,
        reader_options=reader,
        extraction_options=extraction,
        device=colmap.Device.cpu,
    )
    colmap.match_exhaustive(database, matching_options=matching, device=colmap.Device.cpu)


def map_38(database, images, folder, fix_intrinsics, seed=1):
    """Runs the mapper of COLMAP 3.8. Returns the folders of the models."""
    os.makedirs(folder, exist_ok=True)
    refine = 0 if fix_intrinsics else 1
    _run_colmap(
        "mapper",
        "--database_path",
        database,
        "--image_path",
        images,
        "--output_path",
        folder,
        "--random_seed",
        seed,
        "--Mapper.num_threads",
        1,
        "--Mapper.ba_refine_focal_length",
        refine,
        "--Mapper.ba_refine_extra_params",
        refine,
        "--Mapper.extract_colors",
        0,
    )
    return sorted(str(path) for path in pathlib.Path(folder).iterdir() if path.is_dir())


def map_4(database, images, folder, fix_intrinsics, seed=1):
    """Runs the mapper of COLMAP 4. Returns the folders of the models."""
    colmap = need_pycolmap("COLMAP 4's mapper")
    os.makedirs(folder, exist_ok=True)
    options = colmap.IncrementalPipelineOptions()
    options.num_threads = options.mapper.num_threads = 1
    options.random_seed = options.mapper.random_seed = options.triangulation.random_seed = seed
    options.ba_refine_focal_length = options.ba_refine_extra_params = not fix_intrinsics
    options.extract_colors = False
    colmap.set_random_seed(seed)
    colmap.incremental_mapping(database, images, folder, options)
    return sorted(str(path) for path in pathlib.Path(folder).iterdir() if path.is_dir())


FEATURES = {"4": own_features_4, "3.8": own_features_38}
MAPPERS = {"4": map_4, "3.8": map_38}
