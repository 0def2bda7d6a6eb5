"""Writes the database of COLMAP 4 with pycolmap's own Database class."""

from .errors import BadInput, need_pycolmap

NAME = "4"


def prepare():
    """Raises BadInput if databases cannot be written because pycolmap is missing."""
    need_pycolmap("--schema 4 (not 3.8, that of Debian's colmap)")


def create(path):
    need_pycolmap("--schema 4").Database.open(path).close()


def bring_over(path):
    """Brings a database of an earlier COLMAP 4 over, as COLMAP does itself when it opens one.
    BadInput where COLMAP does not take it."""
    log = need_pycolmap("--schema 4").logging
    level, log.minloglevel = log.minloglevel, log.FATAL.value  # our own line says it
    try:
        create(path)
    except RuntimeError:
        raise BadInput("the database says COLMAP 4, and this COLMAP does not open it") from None
    finally:
        log.minloglevel = level


class Writer:
    """Adds rows to a database; commit() makes them permanent. Each camera has a rig of its own, and
    each image a frame of its own."""

    def __init__(self, path):
        self.colmap = need_pycolmap("--schema 4")
        self.database = self.colmap.Database.open(path)
        self.transaction = self.colmap.DatabaseTransaction(self.database)
        self.transaction.__enter__()
        self.rigs = {rig.ref_sensor_id.id: rig.rig_id for rig in self.database.read_all_rigs()
                     if rig.ref_sensor_id.type == self.colmap.SensorType.CAMERA}
        self._add_missing_frames()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.commit()  # also after an error: pycolmap has no rollback; the caller deletes the file
        self.database.close()

    def commit(self):
        if self.transaction:
            self.transaction.__exit__(None, None, None)
            self.transaction = None

    def add_camera(self, camera):
        made = self.colmap.Camera(model=camera.model, width=camera.width, height=camera.height,
                                  params=list(camera.params))
        made.has_prior_focal_length = True
        made.camera_id = self.database.write_camera(made)
        self._add_rig(made.sensor_id)
        return made.camera_id

    def _add_rig(self, sensor_id):
        rig = self.colmap.Rig()
        rig.add_ref_sensor(sensor_id)
        self.rigs[sensor_id.id] = self.database.write_rig(rig)

    def add_image(self, name, camera_id):
        image = self.colmap.Image(name=name, camera_id=camera_id)
        image.image_id = self.database.write_image(image)
        self._add_frame(image)
        return image.image_id

    def _add_frame(self, image):
        if image.camera_id not in self.rigs:
            self._add_rig(self.database.read_camera(image.camera_id).sensor_id)
        frame = self.colmap.Frame()
        frame.rig_id = self.rigs[image.camera_id]
        frame.add_data_id(image.data_id)
        self.database.write_frame(frame)

    def _add_missing_frames(self):
        """Gives the images that have none a frame. COLMAP, which brings a database of 3.x over,
        makes no frames; its mapper (4.2.1) makes them where no image has one, and refuses a
        database in which only some have."""
        framed = {data.id for frame in self.database.read_all_frames() for data in frame.data_ids
                  if data.sensor_id.type == self.colmap.SensorType.CAMERA}
        for image in self.database.read_all_images():
            if image.image_id not in framed:
                self._add_frame(image)

    def add_features(self, image_id, keypoints, descriptors):
        self.database.write_keypoints(image_id, keypoints)
        self.database.write_descriptors(image_id, self.colmap.FeatureDescriptors(
            type=self.colmap.FeatureExtractorType.SIFT, data=descriptors))

    def add_pair(self, id0, id1, matches, geometry):
        if id0 > id1:
            id0, id1, matches, geometry = id1, id0, matches[:, ::-1], geometry.swapped()
        self.database.write_matches(id0, id1, matches.astype("uint32"))
        row = self.colmap.TwoViewGeometry()
        row.config = geometry.config
        row.inlier_matches = geometry.inlier_matches
        row.F, row.E, row.H = geometry.F, geometry.E, geometry.H
        if geometry.R is not None:
            row.cam2_from_cam1 = self.colmap.Rigid3d(self.colmap.Rotation3d(geometry.R), geometry.t)
        self.database.write_two_view_geometry(id0, id1, row)
